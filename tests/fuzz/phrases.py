"""Formulas, numbers, places and lists of random specs: what stands inside of statements.

The text is written directly, kind by kind, from what has been declared so far. With `slip` > 0 a place now and then
gets something of another kind, a name that nobody declared, an index out of its array, a unit that does not fit, a
number at the edge of what a float holds.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from scenegen.lang.syntax.tokens import KEYWORDS

OBJECTS = "mug plate knife fork cup block box x y theta m cm e gap tray a b objects1 _ NORTHEAST".split()
EXTREMES = "0 -0 1e308 1e-308 1e400 1e999999999 5e-324 -1e308 00 0.0000001 99999999999999999999 1.5 6.3 1e6 1e3".split()
STRANGE = ["None", "__class__", "self", "lambda", "nan", "inf", "eval", "min", "leftOf", "sub", "add", "neg", "task"]

Write = Callable[[], str]


class Phrases:
    """Writes what stands inside of statements, with the names that have been declared."""

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
