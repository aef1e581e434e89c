"""Random specs over every construct of the grammar: mostly meaningful, with slips of the kinds that people make.

phrases.py writes formulas, this the statements around them. The same random.Random gives the same case.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from scenegen.lang.check.scope import prelude
from scenegen.lang.syntax import ast

from .phrases import OBJECTS, Phrases

ASSETS = "mug plate fork crackerbox".split()
DEFINED = ["f", "g", "h", "near", "onMat", "tidy"]


@dataclass(slots=True)
class Case:
    """A spec file's bytes, and the files beside it by name. `sized` says that it attacks by what it expands to."""

    main: bytes
    beside: dict[str, bytes] = field(default_factory=dict)
    sized: bool = False


def relations() -> dict[str, list[str]]:
    """The definitions of the prelude with the kinds of their parameters, told by their names and defaults."""
    kinds = {"e": "tolerance", "items": "list", "heading": "heading", "area": "area", "through": "place"}

    def kind(parameter: ast.Parameter) -> str:
        default = parameter.default
        is_angle = isinstance(default, ast.Name) and default.id == "EPS_ANGLE"
        return "heading" if is_angle else kinds.get(parameter.name.id, "thing")

    return {
        one.name.id: [kind(parameter) for parameter in one.parameters]
        for one in prelude().statements
        if isinstance(one, ast.Definition)
    }


class Author(Phrases):
    """Writes one spec; what it declares it can use."""

    def statements(self) -> str:
        parts = [self.workspace()] if self.chance(0.3) else []
        parts += [self.const() for _ in range(self.rng.choice([0, 0, 1, 2]))]
        if not self.chance(0.15):
            parts += [self.declared() for _ in range(self.rng.randrange(1, 4))]
        else:
            self.objects += self.rng.sample(OBJECTS[:6], 2)
        parts += [self.region() for _ in range(self.rng.choice([0, 0, 1, 2]))]
        parts += [self.const() for _ in range(self.rng.choice([0, 1]))]
        parts += [self.define() for _ in range(self.rng.choice([0, 0, 1, 2]))]
        parts += [f"require {self.formula(1)}" for _ in range(self.rng.choice([0, 0, 0, 1, 2]))]
        parts += [self.label() for _ in range(self.rng.choice([1, 1, 1, 2, 3]))]
        if self.chance(0.1):
            self.rng.shuffle(parts)  # a name may be used before it is declared
        return self.joined(parts)

    def joined(self, parts: list[str]) -> str:
        text = ""
        for part in parts:
            comment = self.rng.choice(["", "", "", " # why", "\n# ein Gerät → ∀\n"])
            text += part + comment + ("\n" if "#" in comment else self.rng.choice(["\n", "\n", "\n\n", " ", "\r\n"]))
        return text

    def workspace(self) -> str:
        if not self.chance(self.slip):
            self.lowest = self.rng.choice([0.0, 0.0, -0.5, -2.0])
            self.highest = self.lowest + self.rng.choice([1.0, 1.0, 0.8, 3.0])
            side = f"[{self.lowest}, {self.highest}]"
            return f"workspace {side} x {side}"
        return f"workspace [{self.length(1)}, {self.length(1)}] x [{self.digits()}, {self.digits()}]"

    def inside(self) -> str:
        return f"{self.lowest + (self.highest - self.lowest) * self.rng.random():.3f}"

    def constant_point(self) -> str:
        if self.chance(self.slip):
            return self.one(lambda: self.place(1), lambda: f"({self.digits()}, {self.digits()})")
        return f"({self.inside()}, {self.inside()})"

    def const(self) -> str:
        name = self.fresh()
        kind = self.rng.randrange(5)
        if kind == 0:
            name = self.rng.choice([name, name, name, "EPS_CLOSE", "EPS_FAR"])
            value = self.one(lambda: f"{self.rng.randrange(1, 60)} cm", lambda: f"2 * {self.digits()} m", self.digits)
            self.lengths.append(name)
        elif kind == 1:
            value = self.angle(0)
            self.angles.append(name)
        elif kind == 2:
            value = self.rng.choice(["1", "2", "1 + 1"])
            self.counts.append(name)
        elif kind == 3:
            value = self.constant_point()
            self.points.append(name)
        else:
            value = self.list_(0)
            self.lists.append(name)
        return f"const {name} = {self.slipped() or value}"

    def shape(self) -> str:
        return self.one(
            lambda: f" = box({self.size()}, {self.size()}, {self.size()})",
            lambda: f" = cylinder({self.size()}, {self.size()})",
            lambda: f" = cylinder(height = {self.size()}, radius = {self.size()})",
            lambda: f" = prism({self.outline()}, {self.size()})",
            lambda: f" = {self.rng.choice(ASSETS)}",
            lambda: f' = urdf("tray.urdf", box({self.size()}, {self.size()}, {self.size()}))',
            lambda: f' = urdf("{self.rng.choice(["tray.urdf", "../x.urdf", "/dev/zero", ""])}")' if self.slip else "",
        )

    def size(self) -> str:
        return self.slipped() or self.rng.choice(["0.05", "6 cm", "80 mm", "0.1 m", *self.lengths])

    def outline(self) -> str:
        if self.chance(self.slip):
            return self.list_(1)
        return self.rng.choice(["[(0, 0), (0.1, 0), (0, 0.1)]", "[(0,0), (8 cm,0), (0.1,0.1), (0,0.1)]"])

    def declared(self) -> str:
        out = []
        for _ in range(self.rng.choice([1, 1, 2, 3])):
            name = self.fresh()
            shape = self.shape() if self.chance(0.4) else ""
            if self.chance(0.3):
                size = self.rng.choice([1, 2, 3, 3, 5])
                self.arrays[name] = size
                pose = f" at [{', '.join(self.constant_point() for _ in range(size))}]" if self.chance(0.15) else ""
                out.append(f"{name}[{self.count() if self.chance(self.slip) else size}]{shape}{pose}")
                continue
            self.objects.append(name)
            pose = ""
            if self.chance(0.15):
                pose = f" at {self.constant_point()}"
                pose = pose if self.chance(0.5) else f"{pose[:-1]}, {self.angle(0)})"
            out.append(f"{name}{shape}{pose}")
        return f"object {', '.join(out)}"

    def region(self) -> str:
        name, kind = self.fresh(), self.rng.choice(["rect", "circle", "polygon"])
        side = self.lowest, self.highest
        if kind == "rect":
            shape = f"rect({side[0]}, {side[0]}, {side[0] + 0.4}, {side[1]})"
            if self.chance(self.slip):
                shape = f"rect({self.length(1)}, {self.digits()}, {self.digits()}, {self.length(0)})"
        elif kind == "circle":
            shape = f"circle({self.constant_point()}, {self.size()})"
        else:
            shape = f"polygon({self.outline()})"
        self.regions[name] = kind
        return f"region {name} = {self.slipped() or shape}"

    def define(self) -> str:
        name = self.fresh(DEFINED)
        kinds = [self.rng.choice(["thing", "thing", "list", "tolerance"]) for _ in range(self.rng.randrange(4))]
        parameters, before = [], (len(self.things), len(self.lengths), len(self.lists))
        default = False
        for number, kind in enumerate(kinds):
            written = parameter = f"{kind[0]}{number}"
            default = default or kind == "tolerance"
            if default and not self.chance(self.slip):
                value = {"thing": "workspace", "list": "objects", "tolerance": self.length(0)}[kind]
                written = f"{parameter} = {value}"
            parameters.append(written)
            {"thing": self.things, "list": self.lists, "tolerance": self.lengths}[kind].append(parameter)
        result = self.rng.choice(["formula", "formula", "number"])
        body = self.formula(2) if result == "formula" else self.length(2)
        del self.things[before[0] :], self.lengths[before[1] :], self.lists[before[2] :]
        self.definitions[name] = (kinds, result)
        return f"def {name}({', '.join(parameters)}) = {body}"

    def label(self) -> str:
        name = self.fresh()
        text = f"{name}{self.rng.choice(['', ' '])}: {self.formula(3)}"
        self.labels.append(name)
        return text


def bare_or_statements(author: Author) -> str:
    """One unnamed formula over inferred objects, or a whole spec."""
    if author.chance(0.25):
        author.objects += author.rng.sample(OBJECTS[:8], author.rng.randrange(2, 5))
        return author.formula(3)
    return author.statements()


def generate(rng: random.Random) -> Case:
    """A case: about a third without slips, some with files beside the spec that it imports."""
    known = relations()
    author = Author(rng, rng.choice([0.0, 0.0, 0.01, 0.03, 0.1]), known)
    if rng.random() < 0.85:
        return Case(bare_or_statements(author).encode())
    beside = {}
    names = [f"part{number}.spec" for number in range(rng.randrange(1, 4))]
    imports = []
    for number, name in enumerate(names):
        inner = [f'import "{other}"' for other in names[number + 1 :] if rng.random() < 0.4]
        if author.chance(author.slip):
            inner.append(f'import "{rng.choice([*names, "main.spec", "../a.spec", "no.spec", ".", ""])}"')
        rows = [rng.choice([author.const, author.define, author.region, author.declared])() for _ in range(2)]
        beside[name] = author.joined([*inner, *rows]).encode()
        if rng.random() < 0.7:
            imports.append(f'import "{name}"')
    return Case(author.joined([*imports, author.statements()]).encode(), beside)
