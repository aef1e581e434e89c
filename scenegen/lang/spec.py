"""A spec that passed the checker; and its members, where it draws how many things there are."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.errors import Diagnostic
from scenegen.geometry.footprint import Footprint
from scenegen.geometry.workspace import Workspace
from scenegen.lang.prior import Pose as Pose
from scenegen.lang.prior import Prior, prior_rows
from scenegen.pose import X, row_of, rows_of, span_of
from scenegen.things import Shape, shape_of

if TYPE_CHECKING:
    from scenegen.lang.formula.core import Core
    from scenegen.lang.formula.timed import Timed

Space = tuple[float, float, float]  # x, y, z

LEVEL = 1e-9  # of a direction of length 1: less of it along the table counts as none


@dataclass(frozen=True, slots=True)
class Region:
    """A named part of the table: its footprint at a fixed place, (x, y, heading). With a `height` above the table it is
    the top of a board."""

    name: str
    footprint: Footprint
    pose: Pose
    height: float = 0.0


@dataclass(frozen=True, slots=True)
class SpecCamera:
    """A camera of a spec: where it is and the point that it looks at, (x, y, z) in metres above the table; the angle of
    its picture's height, in radians, and the picture's width over its height. Its lower and upper side are level."""

    name: str
    eye: Space
    target: Space
    field: float
    aspect: float

    @property
    def forward(self) -> Space:
        """The direction in which it looks, of length 1."""
        x, y, z = (there - here for here, there in zip(self.eye, self.target, strict=True))
        length = math.sqrt(x * x + y * y + z * z)
        return x / length, y / length, z / length

    @property
    def ahead(self) -> tuple[float, float]:
        """The level direction in which it looks, of length 1; straight up or down, the one that is up in its picture of
        the table: y."""
        x, y, _ = self.forward
        level = math.hypot(x, y)
        return (x / level, y / level) if level > LEVEL else (0.0, 1.0)

    @property
    def slope(self) -> tuple[float, float]:
        """Sine and cosine of the angle by which it looks down."""
        x, y, z = self.forward
        return -z, math.hypot(x, y)

    @property
    def sides(self) -> tuple[Space, ...]:
        """The directions, of length 1, at right angles to the four planes through the eye and a side of the picture,
        towards what is pictured."""
        (ahead_x, ahead_y), (sin, cos) = self.ahead, self.slope
        right = (ahead_y, -ahead_x, 0.0)
        up = (sin * ahead_x, sin * ahead_y, cos)
        tan_y = math.tan(self.field / 2.0)
        found: list[Space] = []
        for axis, tan in ((right, tan_y * self.aspect), (up, tan_y)):
            scale = math.hypot(1.0, tan)
            for sign in (1.0, -1.0):
                x, y, z = ((tan * ahead + sign * one) / scale for ahead, one in zip(self.forward, axis, strict=True))
                found.append((x, y, z))
        return tuple(found)


@dataclass(frozen=True, slots=True)
class Support:
    """What an object stands on by declaration: a surface of the object `carrier`, or a region of the table (None).

    `outline` is in the frame of what carries, which `pose` places for a region; `height` is above the carrier's lowest
    point. On a `walled` surface all of the footprint is inside the outline, elsewhere the centre. `box` is that of a
    region: left, bottom, right, top; `far` how far from the carrier's origin the centre can be, where that is known.
    """

    name: str
    carrier: int | None
    outline: Footprint
    height: float
    walled: bool = False
    pose: Pose = (0.0, 0.0, 0.0)
    box: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    far: float | None = None


@dataclass(frozen=True, slots=True)
class SurfaceChoice:
    """What an object stands on where the declaration names several surfaces: one of `options` in each scene.

    Which one is a number in [0, 1], x of a further entry `switch` of the core's objects, which no file or picture
    shows: option k from `ends[k - 1]` up to `ends[k]`. The other numbers of the switch mean nothing.
    """

    switch: int
    options: tuple[Support, ...]
    ends: tuple[float, ...]

    @property
    def middles(self) -> tuple[float, ...]:
        """A number for each option."""
        return tuple((low + high) / 2.0 for low, high in zip((0.0, *self.ends), self.ends, strict=False))


@dataclass(frozen=True, slots=True)
class Count:
    """An array whose number of elements is drawn: `least` to `most`, both included, or one of those `values`. Or an
    object of a category: the number, from 1, is that of one of `assets`, after which the object that is there is
    called. `weights` are whole numbers, one for each number that there can be; none: all are equally likely."""

    name: str
    least: int
    most: int
    assets: tuple[str, ...] = ()
    values: tuple[int, ...] = ()
    weights: tuple[int, ...] = ()

    @property
    def numbers(self) -> Sequence[int]:
        """Every number of elements that there can be, in their order."""
        return self.values or range(self.least, self.most + 1)

    @property
    def words(self) -> str:
        """The numbers as text: `3 to 8`, or `3, 5 or 8`."""
        if not self.values:
            return f"{self.least} to {self.most}"
        return f"{', '.join(map(str, self.values[:-1]))} or {self.values[-1]}"


@dataclass(frozen=True, slots=True)
class CheckedSpec:
    """What a spec means: the workspace, the objects in storage order, and the core formula with its labels.

    `source` is the canonical text that scene and model files carry; `name` is where it was read from; `title` is the
    sentence of its opening comment, if it has one. `shapes` has one entry per object (left out: by their names);
    `fixed` maps the index of each object that the spec holds in place (`at`) to its pose. `supports` maps the index of
    each object that the spec declares to stand on something (`on`) to its support; `heights` is then how high each
    object's lowest point is above the table, and empty where no object has a support. `choices` maps the index of each
    object that stands on one of several surfaces to these; its height, and that of what it carries, is None.
    `priors` is what the spec says of where things usually are: the base distribution, where it is not uniform.
    `warnings` is what the checker noticed and let pass. `timed` is what a spec over time means; its `core` has formulas
    over time then, which no reader of cores takes. `phi_bounds` is filled in by `search.spec_bounds`: for the
    largest specs that takes seconds.

    A spec with random numbers of things has `counts`. It stands for `members`, an ordinary spec for each combination of
    numbers, in lexicographic order; all else here is that of the last one, which has all the objects.
    """

    name: str
    source: str
    workspace: Workspace
    core: Core
    title: str = ""
    shapes: tuple[Shape, ...] = ()
    fixed: Mapping[int, Pose] = field(default_factory=dict)
    regions: tuple[Region, ...] = ()
    supports: Mapping[int, Support] = field(default_factory=dict)
    heights: tuple[float | None, ...] = ()
    choices: Mapping[int, SurfaceChoice] = field(default_factory=dict)
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False)
    timed: Timed | None = None
    counts: tuple[Count, ...] = ()
    members: tuple[CheckedSpec, ...] = ()
    cameras: tuple[SpecCamera, ...] = ()
    priors: tuple[Prior, ...] = ()
    phi_bounds: dict[str, tuple[float, float]] = field(init=False, default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.shapes:
            object.__setattr__(self, "shapes", tuple(shape_of(name) for name in self.core.objects))

    @property
    def objects(self) -> tuple[str, ...]:
        """The objects, without the switches of choices."""
        if self.timed is not None:
            return self.timed.objects
        return self.core.objects[: len(self.core.objects) - len(self.choices)]

    @property
    def declares_heights(self) -> bool:
        """Whether some object has a declared support: all heights are then declared."""
        return bool(self.supports or self.choices)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.core.labels)

    @property
    def sha256(self) -> str:
        """SHA-256 of the canonical text: two specs that differ in layout and comments alone share it."""
        return hashlib.sha256(self.source.encode()).hexdigest()

    def box(self) -> tuple[Array, Array]:
        """Lowest and highest value of every row of (3N, B) storage, each (3N,); equal for objects held in place."""
        lowest, highest = self.workspace.box(len(self.core.objects if self.timed is None else self.objects))
        for index, pose in self.fixed.items():
            held = span_of(index, len(pose))
            lowest[held] = highest[held] = pose
        return lowest, highest

    def log_excess(self, lowest: Array, highest: Array) -> float:
        """How much more room the box lowest..highest, (3N,) each, leaves objects than the workspace has, as the natural
        logarithm of a share of volumes. A prior is a density over the room of its own thing: its rows do not count."""
        if self.priors:
            rows, lowest = [*prior_rows(self.priors)], lowest.copy()
            lowest[rows] = highest[rows]
        return self.workspace.log_excess(lowest, highest, len(self.objects))


def options_of(
    which: int, supports: Mapping[int, Support], choices: Mapping[int, SurfaceChoice]
) -> tuple[Support, ...]:
    """What an object can stand on; nothing where it stands on the table."""
    if which in choices:
        return choices[which].options
    return (supports[which],) if which in supports else ()


def chosen_options(choice: SurfaceChoice, rows: Array) -> Index:
    """(n,): which option each scene has, counted from 0; `rows` are those of the core, (3M, n)."""
    return np.asarray(np.searchsorted(np.array(choice.ends[:-1]), rows[row_of(choice.switch, X)], side="right"))


def carriers_first(which: Iterable[int], options: Callable[[int], Sequence[Support]]) -> Iterator[int]:
    """Objects, and all that they can stand on, each after what carries it; `options` is what an object can stand on."""
    done = set[int]()
    for start in which:
        path = [start]
        while path:
            one = path[-1]
            waiting = [
                under.carrier for under in options(one) if under.carrier is not None and under.carrier not in done
            ]
            if waiting:
                path.extend(waiting)
                continue
            path.pop()
            if one not in done:
                done.add(one)
                yield one


def levels(spec: CheckedSpec, rows: Array) -> Array | None:
    """(n, N): how high above the table each object's lowest point is, in metres, in scenes with the core's rows
    (3M, n), the switches of choices among them; None where heights follow from the poses."""
    if not spec.declares_heights:
        return None
    found: dict[int, Array] = {}
    for which in carriers_first(range(len(spec.objects)), lambda one: options_of(one, spec.supports, spec.choices)):
        found[which] = _level(spec, which, rows, found)
    return np.stack([found[which] for which in range(len(spec.objects))], axis=1)


def _level(spec: CheckedSpec, which: int, rows: Array, found: dict[int, Array]) -> Array:
    count = rows.shape[1]
    known = spec.heights[which]
    if known is not None:
        return np.full(count, known)
    options, choice = options_of(which, spec.supports, spec.choices), spec.choices.get(which)
    each = np.stack([one.height + (np.zeros(count) if one.carrier is None else found[one.carrier]) for one in options])
    picked = np.zeros(count, dtype=np.intp) if choice is None else chosen_options(choice, rows)
    return np.asarray(each[picked, np.arange(count)])


class Picked(int):
    """The number of an asset, which knows its name."""

    asset: str = ""


def _numbers(one: Count) -> list[int]:
    if not one.assets:
        return list(one.numbers)
    found = [Picked(number) for number in one.numbers]
    for number, asset in zip(found, one.assets, strict=True):
        number.asset = asset
    return list(found)


def combinations(counts: Sequence[Count]) -> Iterator[dict[str, int]]:
    """Every combination of numbers by name, in lexicographic order."""
    names = [one.name for one in counts]
    for numbers in itertools.product(*map(_numbers, counts)):
        yield dict(zip(names, numbers, strict=True))


def member_weights(counts: Sequence[Count]) -> tuple[int, ...]:
    """How often each combination of numbers is drawn, compared with the others: whole numbers without a common
    divisor, in the order of `combinations`."""
    each = [one.weights or (1,) * len(one.numbers) for one in counts]
    weights = [math.prod(some) for some in itertools.product(*each)]
    common = math.gcd(*weights)
    return tuple(one // common for one in weights)


def numbers_text(numbers: Mapping[str, int]) -> str:
    """Numbers of things as a spec has them, assets as objects are called: `block[3] and mug:red`."""
    each = numbers.items()
    return " and ".join(f"{name}:{one.asset}" if isinstance(one, Picked) else f"{name}[{one}]" for name, one in each)


def file_stem(numbers: Mapping[str, int]) -> str:
    """Numbers of things as part of a file's name: `block=3,mug=red`."""
    each = numbers.items()
    named = (f"{name}={one.asset.replace('/', '_') if isinstance(one, Picked) else one}" for name, one in each)
    return ",".join(named)


def rows_among(spec: CheckedSpec, member: CheckedSpec) -> Index:
    """The rows of a member's storage in that of all objects; switches of choices have rows as objects have."""
    place = {name: number for number, name in enumerate(spec.core.objects)}
    return np.array([row for name in member.core.objects for row in rows_of(place[name])], dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """The members of a spec in their order, with the `rows` of each. `spare` are rows of x of the objects that may be
    missing; each that is there adds its `weight` to the number of the member."""

    specs: tuple[CheckedSpec, ...]
    rows: tuple[Index, ...]
    spare: Index
    weight: Index

    def split(self, rows: Array) -> Iterator[tuple[int, Index]]:
        """The members that B scenes, (3N, B) with NaN for what is not there, are of, and which scenes those are."""
        member = self.weight @ ~np.isnan(rows[self.spare])
        if len(member) == 1:
            yield int(member[0]), np.zeros(1, dtype=np.intp)
            return
        for number in np.unique(member).tolist():
            yield number, np.flatnonzero(member == number)


def members_of(spec: CheckedSpec) -> Members:
    """The members of a spec; of one that draws no numbers itself alone."""
    specs = spec.members or (spec,)
    place = {name: number for number, name in enumerate(spec.core.objects)}
    spare: list[int] = []
    weight: list[int] = []
    for which, one in enumerate(spec.counts):
        further = math.prod(len(other.numbers) for other in spec.counts[which + 1 :])
        for number in range(one.least + 1, one.most + 1):
            if one.assets:  # one of them is there: it alone says the number
                spare.append(row_of(place[f"{one.name}:{one.assets[number - 1]}"], X))
                weight.append(further * (number - 1))
                continue
            spare.append(row_of(place[f"{one.name}[{number}]"], X))
            weight.append(further if number in one.numbers else 0)
    each = tuple(rows_among(spec, member) for member in specs)
    return Members(specs, each, np.array(spare, dtype=np.intp), np.array(weight, dtype=np.intp))
