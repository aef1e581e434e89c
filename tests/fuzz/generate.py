"""Random specs over every construct of the grammar: mostly meaningful, with slips of the kinds that people make.

The text is written directly, kind by kind, from what has been declared so far. With `slip` > 0 a place now and then
gets something of another kind, a name that nobody declared, an index out of its array, a unit that does not fit, a
number at the edge of what a float holds. The same random.Random gives the same case.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from scenegen.lang import ast
from scenegen.lang.scope import prelude
from scenegen.lang.tokens import KEYWORDS

OBJECTS = "mug plate knife fork cup block box x y theta m cm e gap tray a b objects1 _ NORTHEAST".split()
ASSETS = "mug plate fork crackerbox".split()
EXTREMES = "0 -0 1e308 1e-308 1e400 1e999999999 5e-324 -1e308 00 0.0000001 99999999999999999999 1.5 6.3 1e6 1e3".split()
DEFINED = ["f", "g", "h", "near", "onMat", "tidy"]
STRANGE = ["None", "__class__", "self", "lambda", "nan", "inf", "eval", "min", "leftOf", "sub", "add", "neg", "task"]

Write = Callable[[], str]


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


class Author:
    """Writes one spec; what it declares it can use."""

    def __init__(self, rng: random.Random, slip: float, relations: dict[str, list[str]]) -> None:
        self.rng = rng
        self.slip = slip
        self.relations = relations
        self.objects: list[str] = []
        self.arrays: dict[str, int] = {}
        self.lengths: list[str] = []
        self.angles: list[str] = []
        self.counts: list[str] = []
        self.points: list[str] = []
        self.lists: list[str] = []
        self.regions: dict[str, str] = {}
        self.labels: list[str] = []
        self.definitions: dict[str, tuple[list[str], str]] = {}
        self.things: list[str] = []  # variables and parameters that stand for objects
        self.indices: list[str] = []  # variables that stand for whole numbers
        self.lowest, self.highest = 0.0, 1.0

    # ---- choices

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    def one(self, *ways: Write) -> str:
        return self.rng.choice(ways)()

    def slipped(self) -> str | None:
        """Now and then: something that does not belong here."""
        if not self.chance(self.slip):
            return None
        return self.one(
            lambda: self.formula(1),
            lambda: self.length(1),
            lambda: self.angle(1),
            lambda: self.thing(1),
            lambda: self.list_(1),
            lambda: self.rng.choice(EXTREMES),
            lambda: self.rng.choice(STRANGE),
            lambda: f'"{self.rng.choice(STRANGE)}"',
            lambda: self.area(),
            lambda: "()",
            lambda: "[]",
            lambda: f"{self.count()}..{self.count()}",
            lambda: f"consecutive({self.list_(1)})",
            lambda: f"{self.thing(1)}.{self.rng.choice(['x', 'left', 'count', 'corners', 'foo'])}",
            lambda: f"({self.length(1)}, {self.length(1)}, {self.angle(1)})",
            lambda: f"{self.thing(1)}[{self.count()}]",
        )

    def fresh(self, usual: Sequence[str] = OBJECTS) -> str:
        taken = {*self.objects, *self.arrays, *self.lengths, *self.angles, *self.counts, *self.points, *self.lists}
        taken |= {*self.regions, *self.labels, *self.definitions}
        name = self.rng.choice(usual)
        if self.chance(self.slip):
            return self.rng.choice([name, *STRANGE, *KEYWORDS])
        while name in taken:
            name = f"{name}{self.rng.randrange(10)}"
        return name

    # ---- numbers

    def digits(self) -> str:
        if self.chance(self.slip):
            return self.rng.choice(EXTREMES)
        return self.rng.choice(["0", "1", "2", "0.5", "0.25", "0.1", "3e-1", "0.75", f"{self.rng.random():.3f}"])

    def length(self, depth: int) -> str:
        wrong = self.slipped()
        if wrong is not None:
            return wrong
        if depth <= 0 or self.chance(0.3):
            return self.one(
                self.digits,
                lambda: f"{self.rng.randrange(1, 60)} cm",
                lambda: f"{self.rng.randrange(1, 600)}mm",
                lambda: f"{self.digits()} m",
                lambda: self.rng.choice(self.lengths or ["EPS_CLOSE"]),
                lambda: f"{self.area()}.{self.rng.choice(['width', 'height'])}",
            )
        return self.one(
            lambda: f"x({self.place(depth - 1)})",
            lambda: f"y({self.place(depth - 1)})",
            lambda: f"dist({self.pair('place', depth - 1)})",
            lambda: f"gap({self.pair('thing', depth - 1)})",
            lambda: f"room({self.thing(depth - 1)}, {self.area()})",
            lambda: f"reach({self.thing(depth - 1)}, {self.angle(depth - 1)})",
            lambda: (
                f"{self.rng.choice(['min', 'max', 'sum', 'mean'])}({self.length(depth - 1)}, {self.length(depth - 1)})"
            ),
            lambda: f"{self.rng.choice(['min', 'max', 'sum', 'mean'])}(gaps({self.list_(depth - 1)}))",
            lambda: f"abs({self.length(depth - 1)})",
            lambda: f"({self.length(depth - 1)} {self.rng.choice('+-')} {self.length(depth - 1)})",
            lambda: f"{self.length(depth - 1)} {self.rng.choice('+-')} {self.length(depth - 1)}",
            lambda: f"{self.count()} * {self.length(depth - 1)}",
            lambda: f"({self.length(depth - 1)}) / {self.count()}",
            lambda: f"-{self.length(depth - 1)}",
            lambda: f"sin({self.angle(depth - 1)}) * {self.length(depth - 1)}",
        )

    def angle(self, depth: int) -> str:
        wrong = self.slipped()
        if wrong is not None:
            return wrong
        if depth <= 0 or self.chance(0.4):
            return self.one(
                lambda: f"{self.rng.randrange(0, 400)} deg",
                lambda: f"{self.digits()} turn",
                lambda: f"{self.digits()} rad",
                lambda: self.rng.choice(["NORTH", "EAST", "SOUTH", "WEST", "EPS_ANGLE", *self.angles]),
                self.digits,
            )
        return self.one(
            lambda: f"theta({self.thing(depth - 1)})",
            lambda: f"bearing({self.pair('place', depth - 1)})",
            lambda: f"wrap({self.angle(depth - 1)} - {self.angle(depth - 1)})",
            lambda: f"abs({self.angle(depth - 1)})",
            lambda: f"{self.count()} * {self.angle(depth - 1)}",
        )

    def count(self) -> str:
        if self.chance(self.slip):
            return self.rng.choice(EXTREMES)
        return self.rng.choice(["1", "1", "2", "2", "3", *self.counts, *self.indices])

    # ---- places, things, lists, areas

    def place(self, depth: int) -> str:
        wrong = self.slipped()
        if wrong is not None:
            return wrong
        if depth > 0 and self.chance(0.2):
            return f"({self.length(depth - 1)}, {self.length(depth - 1)})"
        if self.chance(0.15):
            return self.rng.choice([f"{self.area()}.{self.side()}", *self.points])
        return self.thing(depth)

    def side(self) -> str:
        sides = ["left", "right", "top", "bottom", "center", "topLeft", "bottomRight"]
        return self.rng.choice([*sides, "width", "corner", "x"] if self.chance(self.slip) else sides[:5])

    def thing(self, depth: int) -> str:
        if depth > 0:
            wrong = self.slipped()
            if wrong is not None:
                return wrong
        ways: list[Write] = [lambda: self.rng.choice(self.objects)] if self.objects else []
        if self.things:
            ways += [lambda: self.rng.choice(self.things)] * 3
        if self.arrays:
            ways.append(self.element)
        if self.chance(0.05):
            ways.append(lambda: self.rng.choice([*self.regions, "workspace", "objects.first", "objects[1]"]))
        return self.one(*ways) if ways else self.rng.choice(OBJECTS)

    def different(self, kinds: Sequence[str], depth: int) -> list[str]:
        """Arguments; where two are things, hardly ever the same twice: that says the same in every scene."""
        given: list[str] = []
        for kind in kinds:
            text = self.argument(kind, depth)
            for _ in range(8):
                if text not in given or kind not in ("thing", "place") or self.chance(self.slip):
                    break
                text = self.argument(kind, depth)
            given.append(text)
        return given

    def pair(self, kind: str, depth: int) -> str:
        return ", ".join(self.different([kind, kind], depth))

    def element(self) -> str:
        name, size = self.rng.choice(list(self.arrays.items()))
        if self.chance(self.slip):
            return f"{name}[{self.count()}]"
        if self.indices and self.chance(0.5):
            return f"{name}[{self.rng.choice(self.indices)}]"
        return self.rng.choice([f"{name}[{self.rng.randrange(size) + 1}]", f"{name}.first", f"{name}.last"])

    def list_(self, depth: int) -> str:
        if depth > 0:
            wrong = self.slipped()
            if wrong is not None:
                return wrong
        ways: list[Write] = [lambda: "objects"]
        ways += [lambda: self.rng.choice(list(self.arrays))] * 2 if self.arrays else []
        ways += [lambda: self.rng.choice(self.lists)] if self.lists else []
        size = self.rng.choice([2, 2, 3]) if not self.chance(self.slip) else self.rng.randrange(3)
        ways.append(lambda: f"[{', '.join(self.different(['thing'] * size, 0))}]")
        ways.append(
            lambda: f"{self.rng.choice(['workspace', *(n for n, k in self.regions.items() if k != 'circle')])}.corners"
        )
        return self.one(*ways)

    def area(self) -> str:
        return self.rng.choice(["workspace", *self.regions, *self.regions])

    # ---- formulas

    def argument(self, kind: str, depth: int) -> str:
        return {
            "tolerance": lambda: self.length(0),
            "list": lambda: self.list_(depth),
            "heading": lambda: self.angle(min(depth, 1)),
            "area": self.area,
            "place": lambda: self.place(depth),
            "thing": lambda: self.thing(depth),
        }[kind]()

    def formula(self, depth: int) -> str:
        wrong = self.slipped()
        if wrong is not None:
            return wrong
        ways: list[Write] = [self.atom] * 3
        if depth > 0:
            deeper = depth - 1
            ways += [
                lambda: f"{self.formula(deeper)} {self.rng.choice(['&', 'and', '∧'])} {self.formula(deeper)}",
                lambda: f"({self.formula(deeper)} {self.rng.choice(['|', 'or', '∨'])} {self.formula(deeper)})",
                lambda: f"{self.rng.choice(['!', 'not ', '¬'])}({self.formula(deeper)})",
                lambda: f"({self.formula(deeper)}) {self.rng.choice(['->', 'implies', '→'])} {self.formula(deeper)}",
                lambda: f"({self.quantifier(deeper)})",
                lambda: self.quantifier(deeper),
            ]
        if self.chance(0.03):
            ways.append(lambda: self.rng.choice(["true", "false", "⊤", "⊥"]))
        if self.labels:
            ways.append(lambda: self.rng.choice(self.labels))
        return self.one(*ways)

    def atom(self) -> str:
        choice = self.rng.random()
        if choice < 0.35:
            signs = ["<=", ">=", "<", ">", "≤", "≥"]
            sides = [self.length(2), self.length(1)] if self.chance(0.7) else [self.angle(2), self.angle(1)]
            if self.chance(0.15):
                sides.append(self.length(1))
            text = sides[0]
            for side in sides[1:]:
                text += f" {self.rng.choice(signs)} {side}"
            return text
        if choice < 0.5 and self.definitions:
            name = self.rng.choice(list(self.definitions))
            kinds, result = self.definitions[name]
            call = f"{name}({', '.join(self.different(kinds, 1))})"
            return call if result == "formula" else f"{call} <= {self.length(0)}"
        name = self.rng.choice(list(self.relations))
        kinds = self.relations[name]
        if name in ("leftEdge", "rightEdge", "topEdge", "bottomEdge"):
            return f"{name}({self.thing(1)}) <= {self.length(1)}"
        if name == "mirrorImage":
            first, second = self.different(["thing", "thing"], 1)
            return f"closeTo({first}, {name}({second}), {self.length(0)})"
        given = self.different(kinds, 1)
        if kinds and kinds[-1] == "tolerance" and self.chance(0.6):
            given = [*given[:-1], f"e = {given[-1]}"] if self.chance(0.3) else given[:-1]
        return f"{name}({', '.join(given)})"

    def quantifier(self, depth: int) -> str:
        word = self.rng.choice(["forall", "exists", "∀", "∃"])
        before = len(self.things), len(self.indices)
        if self.chance(0.35):
            size = min(self.arrays.values(), default=2)
            names = [f"i{len(self.indices)}"]
            domain = f"1..{self.rng.choice([size, max(1, size - 1)])}" if not self.chance(self.slip) else "0..3"
            if self.chance(0.2):
                names.append(f"j{len(self.indices)}")
                domain = f"1..{max(2, size)}"
            self.indices += names
        else:
            names = [f"p{len(self.things)}", f"q{len(self.things)}"][: self.rng.choice([1, 2])]
            if self.chance(self.slip):
                names = [self.fresh(), *names][: self.rng.choice([1, 2, 3])]
            domain = self.list_(0)
            if len(names) > 1 and self.chance(0.4):
                domain = f"consecutive({domain})"
            self.things += names
        text = f"{word} {', '.join(names)} in {domain}: {self.formula(depth)}"
        del self.things[before[0] :], self.indices[before[1] :]
        return text

    # ---- statements

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
