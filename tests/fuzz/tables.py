"""Random tables: specs of 5 to 30 objects such as people set, with a request for each. `wide` ones have up to 60
objects, heights, choices of surfaces, numbers of things, more disjunctions, or time.

Every text is a valid spec; whether any scene satisfies it is left open.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

FEWEST, MOST, WIDEST = 5, 30, 60
FULL = (0.02, 0.35)  # shares of the workspace that footprints take together
HEADINGS = ("NORTH", "EAST", "SOUTH", "WEST")


@dataclass(frozen=True, slots=True)
class Table:
    """A spec and the options that ask for its scenes; `ranges` is phi by label, None for an open end."""

    text: str
    ranges: dict[str, tuple[float | None, float | None]]

    @property
    def plain(self) -> bool:
        """Whether it asks for scenes of one number of things."""
        return "\ntime " not in f"\n{self.text}" and ".." not in self.text.split("require")[0]

    @property
    def options(self) -> list[str]:
        """The options of `scenegen sample`."""
        out = []
        for name, (low, high) in self.ranges.items():
            ends = ["" if end is None else f"{end:g}" for end in (low, high)]
            out += ["--phi", f"{name}={ends[0]}:{ends[1]}"]
        return out


@dataclass(slots=True)
class Author:
    """Writes one spec. `arrays` are sizes by name; `side` is the length of the workspace."""

    rng: random.Random
    side: float = 1.0
    wide: bool = False
    arrays: dict[str, int] = field(default_factory=dict)
    regions: list[str] = field(default_factory=list)

    # ---- pieces of text

    def cm(self, low: float, high: float) -> str:
        return f"{self.rng.uniform(low, high):.1f} cm"

    def deg(self) -> str:
        return f"{self.rng.choice([5, 10, 20, 45])} deg"

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    def array(self) -> str:
        return self.rng.choice(list(self.arrays))

    def thing(self) -> str:
        name = self.array()
        return f"{name}[{self.rng.randint(1, self.arrays[name])}]"

    def things(self) -> tuple[str, str]:
        first = second = self.thing()
        while second == first:
            second = self.thing()
        return first, second

    def point(self) -> str:
        x, y = (self.rng.uniform(0.1, 0.9) * self.side for _ in "xy")
        return f"({x:.2f}, {y:.2f})"

    # ---- formulas

    def pair(self, a: str, b: str) -> str:
        """A relation of two objects."""
        ways = [
            f"{self.rng.choice(['leftOf', 'rightOf', 'aboveOf', 'belowOf'])}({a}, {b})",
            f"{self.rng.choice(['fullyLeftOf', 'fullyRightOf', 'fullyAboveOf', 'fullyBelowOf'])}({a}, {b})",
            f"{self.rng.choice(['partlyLeftOf', 'partlyAboveOf'])}({a}, {b})",
            f"closeTo({a}, {b}, {self.cm(15, 45)})",
            f"farFrom({a}, {b}, {self.cm(5, 25)})",
            f"{self.rng.choice(['alignedX', 'alignedY'])}({a}, {b}, {self.cm(1, 8)})",
            f"{self.rng.choice(['facing', 'sameHeading'])}({a}, {b}, {self.deg()})",
            f"touching({a}, {b}, {self.cm(0.5, 3)})",
            f"clearOf({a}, {b}, {self.cm(0.5, 5)})",
            f"mirroredPlace({a}, {b}, e = {self.cm(3, 10)})",
            f"!closeTo({a}, {b}, {self.cm(5, 20)})",
            f"gap({a}, {b}) <= {self.cm(3, 20)}",
        ]
        return self.rng.choice(ways)

    def single(self, a: str) -> str:
        """A relation of one object with the table."""
        ways = [
            f"angle({a}, {self.rng.choice(HEADINGS)}, {self.deg()})",
            f"closeTo({a}, {self.point()}, {self.cm(15, 50)})",
            f"farFrom({a}, {self.point()}, {self.cm(5, 25)})",
            f"nearEdge({a}, e = {self.cm(5, 15)})",
            f"{self.rng.choice(['leftOf', 'aboveOf'])}({a}, workspace.center)",
            f"!inCorner({a})",
            f"abs(x({a}) - {0.5 * self.side:g}) <= {self.cm(5, 40)}",
        ]
        if self.regions:
            region = self.rng.choice(self.regions)
            ways += [f"{self.rng.choice(['inside', 'on', 'partlyInside', '!overlaps'])}({a}, {region})"] * 3
        return self.rng.choice(ways)

    def one(self) -> str:
        """A relation of a few named objects."""
        first, second = self.things()
        ways: list[Callable[[], str]] = [
            lambda: self.single(first),
            lambda: self.pair(first, second),
            lambda: self.pair(first, second),
            lambda: f"({self.pair(first, second)} | {self.pair(first, second)})",
            lambda: f"({self.single(first)} | {self.single(first)})",
            lambda: f"({self.single(first)} -> {self.single(second)})",
            lambda: f"between({first}, {second}, {self.point()}, {self.cm(3, 15)})",
        ]
        return self.rng.choice(ways)()

    def many(self) -> str:
        """A relation of a whole array."""
        name = self.array()
        size = self.arrays[name]
        if size < 2:
            return self.single(f"{name}[1]")
        ways: list[Callable[[], str]] = [
            lambda: f"(forall p in {name}: {self.single('p')})",
            lambda: f"(forall p in {name}: {self.single('p')})",
            lambda: f"(forall p in {name}: {self.single('p')} | {self.single('p')})",
            lambda: f"(forall p, q in consecutive({name}): {self.pair('p', 'q')})",
            lambda: f"(exists p in {name}: {self.single('p')})",
            lambda: f"(exists p, q in {name}: {self.pair('p', 'q')})",
            lambda: f"(forall p in {name}: {self.pair('p', self.other(name))})",
            lambda: f"(exists p in {name}: {self.pair('p', self.other(name))})",
            lambda: f"(forall p, q in {name}: farFrom(p, q, {self.cm(4, 12)}))",
            lambda: f"ordered({name}, {self.rng.choice(HEADINGS)})",
        ]
        partners = [other for other, count in self.arrays.items() if other != name and count >= size]
        if partners:
            other = self.rng.choice(partners)
            ways += [lambda: f"(forall i in 1..{size}: {self.pair(f'{name}[i]', f'{other}[i]')})"] * 3
            ways += [lambda: f"(forall p in {name}: exists q in {other}: closeTo(p, q, {self.cm(12, 30)}))"]
        if 3 <= size <= 6:
            ways += [lambda: f"evenlySpaced({name}, {self.cm(2, 6)})"]
        return self.rng.choice(ways)()

    def other(self, name: str) -> str:
        others = [one for one in self.arrays if one != name]
        if not others:
            return self.point()
        name = self.rng.choice(others)
        return f"{name}[{self.rng.randint(1, self.arrays[name])}]"

    def label(self) -> str:
        parts = [self.many() if self.chance(0.4) else self.one() for _ in range(self.rng.choice([1, 1, 2, 2, 3, 4]))]
        text = " & ".join(parts)
        if self.chance(0.4 if self.wide else 0.1):
            text = f"({text}) | ({self.many()})"
        return text

    # ---- the whole

    def shape(self, area: float) -> str:
        """A shape of about the given area."""
        kind, width = self.rng.choice(["box", "box", "cylinder", "prism"]), area**0.5
        if kind == "box":
            ratio = self.rng.choice([1.0, 1.0, self.rng.uniform(0.4, 1.0)])
            return f"box({width / ratio**0.5:.3f}, {width * ratio**0.5:.3f}, 0.05)"
        if kind == "cylinder":
            return f"cylinder({width / 3.1416**0.5:.3f}, 0.05)"
        high = 1.5 * width
        return f"prism([(0, 0), ({high:.3f}, 0), ({0.5 * high:.3f}, {0.9 * high:.3f})], 0.05)"

    def write(self) -> Table:
        rng = self.rng
        lines = []
        if self.chance(0.25):
            self.side = rng.choice([0.6, 0.8, 1.5])
            lines.append(f"workspace [0, {self.side}] x [0, {self.side}]")
        count, full = rng.randint(FEWEST, WIDEST if self.wide else MOST), rng.uniform(*FULL)
        timed, surfaces, counted = False, list[str](), False
        if self.wide:
            timed, counted = self.chance(0.1), self.chance(0.2)
            surfaces = ["workspace"]
            for number in range(0 if timed else rng.choice([0, 1, 2])):
                x, y = (rng.uniform(0.0, 0.5) * self.side for _ in "xy")
                surfaces.append(f"board{number}")
                wide = f"rect({x:.2f}, {y:.2f}, {x + self.side / 2:.2f}, {y + self.side / 2:.2f})"
                lines.append(f"region board{number} = {wide} at {rng.randint(20, 90)} cm")
        if timed:
            lines.append(f"time {rng.randint(2, 6)} steps")
        left = count
        while left:
            size = min(left, rng.randint(1, max(1, count // 2)))
            name = f"{rng.choice(['block', 'can', 'part', 'item', 'coin'])}{len(self.arrays)}"
            self.arrays[name] = size
            area = full * self.side**2 / count * rng.uniform(0.4, 1.6)
            more = f"..{size + rng.randint(1, 3)}" if counted and not timed and len(self.arrays) == 1 else ""
            where = f" on any of [{', '.join(surfaces)}]" if len(surfaces) > 1 and self.chance(0.4) else ""
            lines.append(f"object {name}[{size}{more}] = {self.shape(area)}{where}")
            left -= size
        if self.chance(0.15):
            x, y = (rng.uniform(0.2, 0.8) * self.side for _ in "xy")
            lines.append(f"object base = box(0.15, 0.1, 0.05) at ({x:.2f}, {y:.2f}, 0)")
        for number in range(rng.choice([0, 0, 1, 2])):
            x, y = (rng.uniform(0.0, 0.5) * self.side for _ in "xy")
            wide, deep = (rng.uniform(0.3, 0.5) * self.side for _ in "xy")
            shape = f"rect({x:.2f}, {y:.2f}, {x + wide:.2f}, {y + deep:.2f})"
            if self.chance(0.3):
                shape = f"circle(({x + wide / 2:.2f}, {y + deep / 2:.2f}), {wide / 2:.2f})"
            self.regions.append(f"area{number}")
            lines.append(f"region area{number} = {shape}")
        required = ["noOverlap()"] if self.chance(0.8) else [f"noOverlap({self.array()})"]
        required += ["insideWorkspace()"] if self.chance(0.6) else []
        required += [self.one()] if self.chance(0.2) else []
        required += [f"(forall p in {name}: speed(p) <= {rng.randint(10, 50)} cm/s)" for name in self.arrays if timed]
        lines.append(f"require {' & '.join(required)}")
        names = ["task", "safe", "tidy"][: rng.choice([1, 1, 2, 3])]
        when = rng.choice(["finally", "eventually", "always"]) if timed else ""
        lines += [f"{name}: {when} ({self.label()})" if timed else f"{name}: {self.label()}" for name in names]
        ranges: dict[str, tuple[float | None, float | None]] = dict.fromkeys(names, (0.0, None))
        if self.chance(0.3):
            ranges["task"] = rng.choice([(-0.1, 0.0), (0.0, 0.02), (-0.2, 0.1)])
        return Table("\n".join(lines) + "\n", ranges)


def table(seed: int, number: int, wide: bool = False) -> Table:
    """Table `number` of a seed; the same on any machine."""
    return Author(random.Random(f"{'wide ' * wide}table {seed} {number}"), wide=wide).write()
