"""Who stands where: objects that stand on one of some surfaces, and the patches of these on which each is drawn.

The set of poses that supports allow is thin in a box of poses: a bottle on any of six slots is on one of them in one of
a thousand. But its volume does not depend on where the carriers are, so it can be drawn uniformly: carriers first, then
for each object a surface, as likely as its share of the switch times its area, and a place on it. Headings between
walls are drawn with the place, in slices that leave out where the object does not fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Bool
from scenegen.geometry import PRIMITIVES
from scenegen.geometry.footprint import Box, Circle, Footprint, Polygon, corners, measures
from scenegen.lang.formula.core import Apply, Const, Coord, Core, Junction
from scenegen.lang.prior import prior_rows
from scenegen.lang.spec import CheckedSpec, Support, options_of
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI, X, Y, row_of, rows_of
from scenegen.search.contract import Bounds
from scenegen.search.effort import PYTHON_WORK, Effort
from scenegen.search.tape import Tape

# Patches of surfaces, each in the frame of what carries it: where the centre of an object can be on them, for each
# slice of its headings, and drawing a place on one of many.


HEADING_SLICES = 128  # of the circle of headings


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """How one object is drawn: from K patches, the k-th with the probability `odds[k] - odds[k - 1]`. (K,) each: the
    middle and half the size of a patch in the frame of what carries it (a `radius` above 0: a disc), the interval of
    the switch and that of the heading against the carrier's; `number` says which of `frames` carries the patch: the row
    of its x, or the pose of a region. `turned`: the heading is drawn, too."""

    thing: int
    switch: int | None
    turned: bool
    odds: Array
    middle: Array  # (2, K)
    half: Array  # (2, K)
    radius: Array
    begin: Array
    width: Array
    heading: Array
    slice: float
    number: npt.NDArray[np.intp]
    frames: tuple[int | tuple[float, float, float], ...]
    log_volume: float

    @property
    def rows(self) -> tuple[int, ...]:
        place = tuple(row_of(self.thing, axis) for axis in (FLAT if self.turned else PLACE))
        return place if self.switch is None else (*place, self.switch)

    def draw(self, out: Array, rng: np.random.Generator) -> None:
        """Fill the object's rows of `out` (3N, m), in which what carries it is drawn."""
        for row, value in self.poses(out, (out.shape[1],), rng).items():
            out[row] = value

    def poses(self, scenes: Array, shape: tuple[int, ...], rng: np.random.Generator) -> dict[int, Array]:
        """Values of the object's rows, of a shape (..., P), where what carries it stands as in `scenes` (3N, P)."""
        patch = np.minimum(np.searchsorted(self.odds, rng.random(shape), side="right"), len(self.odds) - 1)
        one, other = rng.random((2, *shape))
        u = self.middle[0].take(patch) + (2.0 * one - 1.0) * self.half[0].take(patch)
        v = self.middle[1].take(patch) + (2.0 * other - 1.0) * self.half[1].take(patch)
        if self.radius.any():
            radius = self.radius.take(patch)
            far, round_ = radius * np.sqrt(one), TWO_PI * other
            u, v = np.where(radius > 0.0, far * np.cos(round_), u), np.where(radius > 0.0, far * np.sin(round_), v)
        x, y, theta = self._frame(scenes, self.number.take(patch))
        cos, sin = np.cos(theta), np.sin(theta)
        found = {row_of(self.thing, X): x + (cos * u - sin * v), row_of(self.thing, Y): y + (sin * u + cos * v)}
        if self.turned:
            turn = theta + self.heading.take(patch) + self.slice * rng.random(shape)
            found[row_of(self.thing, THETA)] = np.mod(turn, TWO_PI)
        if self.switch is not None:
            found[self.switch] = self.begin.take(patch) + self.width.take(patch) * rng.random(shape)
        return found

    def _frame(self, scenes: Array, number: npt.NDArray[np.intp]) -> list[Array]:
        poses = [
            [np.float64(value) for value in frame]
            if isinstance(frame, tuple)
            else [scenes[frame + axis] for axis in FLAT]
            for frame in self.frames
        ]
        found = [np.asarray(value) for value in poses[-1]]
        for which in range(len(poses) - 1):
            here = number == which
            found = [np.where(here, value, rest) for value, rest in zip(poses[which], found, strict=True)]
        return found


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePatches:
    """The patches of one surface, (K,) or (2, K) each as in `Step`: what carries it, the interval of the switch, and
    the headings at which slices begin. With a `radius` above 0 the one patch is a disc."""

    frame: int | tuple[float, float, float]
    begin: float
    width: float
    middle: Array  # (2, K)
    half: Array
    radius: float
    heading: Array  # (K,)

    @property
    def areas(self) -> Array:
        """Of its patches, square metres: (K,)."""
        if self.radius > 0.0:
            return np.full(len(self.heading), math.pi * self.radius**2)
        out: Array = 4.0 * self.half[0] * self.half[1]
        return out


def disc(upper: Footprint, under: Support) -> float:
    """The radius of the disc of centres on a round surface, 0 where it is no disc."""
    if not isinstance(under.outline, Circle):
        return 0.0
    if not under.walled:
        return under.outline.radius
    return max(0.0, under.outline.radius - upper.radius) if isinstance(upper, Circle) else 0.0


@cache
def patches(upper: Footprint | None, outline: Footprint, turned: bool) -> tuple[Array, Array]:
    """The boxes of centres on a surface, for each slice of headings where they are `turned`: middle and half the size,
    (2, K) each. `upper` is what must lie inside, None where only the centre must."""
    points = np.array(_corners(outline))
    low, high = points.min(axis=0)[:, None], points.max(axis=0)[:, None]
    count = HEADING_SLICES if turned else 1
    if upper is None:
        low, high = np.repeat(low, count, axis=1), np.repeat(high, count, axis=1)
    elif isinstance(upper, Circle) or not turned:
        inner = max(0.0, measures(upper).inner)
        low, high = np.repeat(low + inner, count, axis=1), np.repeat(high - inner, count, axis=1)
    else:
        angle = (np.arange(HEADING_SLICES) + 0.5) * (TWO_PI / HEADING_SLICES)
        slack = measures(upper).turn * (TWO_PI / HEADING_SLICES / 2.0)
        x, y = np.array(corners(upper)).T[:, :, None]
        turned_points = np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])
        low = low + np.maximum(-turned_points.min(axis=1) - slack, 0.0)
        high = high - np.maximum(turned_points.max(axis=1) - slack, 0.0)
    return (low + high) / 2.0, (high - low) / 2.0


def _corners(outline: Footprint) -> tuple[tuple[float, float], ...]:
    if isinstance(outline, Circle):
        return ((-outline.radius, -outline.radius), (outline.radius, outline.radius))
    return outline.vertices if isinstance(outline, Polygon) else corners(outline)


def facing(begin: Array, ends: tuple[float, float]) -> npt.NDArray[np.bool_]:
    """Which slices of headings, (K,) begins, meet an interval of headings."""
    low, high = ends
    if high - low >= TWO_PI - 1e-6:
        return np.ones(len(begin), dtype=bool)
    out: npt.NDArray[np.bool_] = np.mod(begin - low, TWO_PI) <= high - low
    out |= np.mod(begin + TWO_PI / HEADING_SLICES - low, TWO_PI) <= high - low
    out |= np.mod(low - begin, TWO_PI) <= TWO_PI / HEADING_SLICES
    return out


def cut(
    middle: Array, half: Array, frame: tuple[float, float, float], ends: list[tuple[float, float]]
) -> tuple[Array, Array]:
    """Patches in a frame that stays where it is, as far as they lie in a box of the table."""
    x, y, theta = frame
    cos, sin = math.cos(theta), math.sin(theta)
    centre = [(low + high) / 2.0 for low, high in ends]
    size = [(high - low) / 2.0 for low, high in ends]
    dx, dy = centre[0] - x, centre[1] - y
    about = np.array([cos * dx + sin * dy, cos * dy - sin * dx])[:, None]
    reach = np.array([abs(cos) * size[0] + abs(sin) * size[1], abs(sin) * size[0] + abs(cos) * size[1]])[:, None]
    low, high = np.maximum(middle - half, about - reach), np.minimum(middle + half, about + reach)
    return (low + high) / 2.0, (high - low) / 2.0


def step_of(thing: int, switch: int | None, pieces: list[SurfacePatches], turned: bool) -> Step:
    """How an object is drawn on pieces with some area together; `turned` as in `Step`."""
    frames = tuple(dict.fromkeys(one.frame for one in pieces))
    size = [len(one.heading) for one in pieces]
    weights = np.concatenate([one.width * one.areas for one in pieces])
    slice_ = TWO_PI / HEADING_SLICES
    total = float(weights.sum()) * (slice_ if turned else 1.0)
    odds = np.cumsum(weights)
    return Step(
        thing,
        switch,
        turned,
        odds / odds[-1],
        np.concatenate([one.middle for one in pieces], axis=1),
        np.concatenate([one.half for one in pieces], axis=1),
        np.repeat([one.radius for one in pieces], size),
        np.repeat([one.begin for one in pieces], size),
        np.repeat([one.width for one in pieces], size),
        np.concatenate([one.heading for one in pieces]),
        slice_,
        np.repeat(np.array([frames.index(one.frame) for one in pieces], dtype=np.intp), size),
        frames,
        math.log(total),
    )


BOX_SLACK = 1e-9  # metres and radians by which boxes are larger than contraction says


@dataclass(frozen=True, slots=True)
class Stand:
    """An object that stands on one of some surfaces. `switch` is the row of its choice, None where it has none; `ends`
    are the parts of the choice."""

    thing: int
    upper: Footprint
    options: tuple[Support, ...]
    switch: int | None
    ends: tuple[float, ...]

    @property
    def rows(self) -> tuple[int, ...]:
        place = tuple(row_of(self.thing, axis) for axis in PLACE)
        return place if self.switch is None else (*place, self.switch)


def stands_of(spec: CheckedSpec, lowest: Array, highest: Array) -> tuple[Stand, ...]:
    """What stands on things or on one of several surfaces in a spec with choices, carriers before what they carry. What
    the box lowest..highest (3N,) holds in place is left out, and what has a prior, or stands on what has one: it is
    drawn as that says."""
    if not spec.choices:
        return ()
    waiting = sorted(spec.supports.keys() | spec.choices.keys())
    priors = prior_rows(spec.priors) if spec.priors else {}
    found: list[Stand] = []
    done = set(range(len(spec.objects))).difference(waiting)
    while waiting:
        ready = [one for one in waiting if {*_carriers(spec, one)} <= done]
        for one in ready:
            choice = spec.choices.get(one)
            options = options_of(one, spec.supports, spec.choices)
            switch = None if choice is None else row_of(choice.switch, X)
            stand = Stand(one, spec.shapes[one].footprint, options, switch, (1.0,) if choice is None else choice.ends)
            free = all(lowest[row] < highest[row] for row in stand.rows)
            free &= not any(row in priors for thing in (one, *_carriers(spec, one)) for row in rows_of(thing))
            if free and (choice is not None or options[0].carrier is not None):
                found.append(stand)
        done.update(ready)
        waiting = [one for one in waiting if one not in done]
    return tuple(found)


def _carriers(spec: CheckedSpec, thing: int) -> list[int]:
    return [one.carrier for one in options_of(thing, spec.supports, spec.choices) if one.carrier is not None]


def steps_for(
    stands: Collection[Stand], tape: Tape, lowest: Array, highest: Array, lo: Array, hi: Array, effort: Effort
) -> tuple[Step, ...] | None:
    """How what stands is drawn where the box of poses is contracted to lo, hi (T,). None where no surface is left for
    something: there is no scene. What has no area anywhere is left out, and what a box holds as well as a surface."""

    def ends(row: int) -> Bounds:
        node = tape.rows.get(row)
        if node is None or lowest[row] == highest[row]:
            return float(lowest[row]), float(highest[row])
        return float(lo[node]) - BOX_SLACK, float(hi[node]) + BOX_SLACK

    steps = []
    for stand in stands:
        effort.spend(PYTHON_WORK * 8 * len(stand.options))
        if _box_of(stand, ends):
            continue
        pieces = _pieces(stand, ends)
        if pieces is None:
            return None
        if pieces:
            steps.append(step_of(stand.thing, stand.switch, pieces, _turns(stand, ends)))
    return tuple(steps)


def step_for(stand: Stand, ends: Callable[[int], Bounds]) -> Step | None:
    """How an object that stands is drawn where `ends` tells the interval of each row; None where it has no place."""
    pieces = _pieces(stand, ends)
    return step_of(stand.thing, stand.switch, pieces, _turns(stand, ends)) if pieces else None


def _box_of(stand: Stand, ends: Callable[[int], Bounds]) -> bool:
    """Whether all surfaces have one rectangle of centres, along the axes of a table that none of them leaves, such as
    boards above each other: the contracted box is as good, and can be tied to what else is asked."""
    found = set[tuple[object, ...]]()
    for one in stand.options:
        pose = _carried_boxes(one, ends)
        if pose is None or not isinstance(one.outline, Box) or (one.walled and not isinstance(stand.upper, Circle)):
            return False
        found.add((pose, one.outline, one.walled))
    turn = next(iter(found))[0][2] / (TWO_PI / 4.0)  # type: ignore[index]
    return len(found) == 1 and abs(turn - round(turn)) < BOX_SLACK


def _carried_boxes(under: Support, ends: Callable[[int], Bounds]) -> tuple[float, float, float] | None:
    """The pose of a surface's frame where that is the same in every scene."""
    if under.carrier is None:
        return under.pose
    x, y, theta = (ends(row_of(under.carrier, axis)) for axis in FLAT)
    return (x[0], y[0], theta[0]) if x[0] == x[1] and y[0] == y[1] and theta[0] == theta[1] else None


def _pieces(stand: Stand, ends: Callable[[int], Bounds]) -> list[SurfacePatches] | None:
    """The patches of each surface that is left; None where none is, nothing where all of them have no area."""
    found, left, begin, turned = list[SurfacePatches](), False, 0.0, _turns(stand, ends)
    for under, end in zip(stand.options, stand.ends, strict=True):
        low, high = begin, end
        begin = end
        if stand.switch is not None:
            low, high = max(low, ends(stand.switch)[0]), min(high, ends(stand.switch)[1])
            if low > high:
                continue
        left = True
        low, high = max(low, 0.0), min(high, 1.0)
        frame: int | tuple[float, float, float] = under.pose if under.carrier is None else row_of(under.carrier, X)
        radius = disc(stand.upper, under)
        middle, half = patches(stand.upper if under.walled else None, under.outline, turned)
        heading: Array = np.arange(len(half[0])) * np.float64(TWO_PI / HEADING_SLICES if turned else 0.0)
        held = _carried_boxes(under, ends)
        kept = (half > 0.0).all(axis=0)
        if held is not None:
            if turned:
                kept &= facing(heading + held[2], ends(row_of(stand.thing, THETA)))
            if not radius:
                middle, half = cut(middle, half, held, [ends(row_of(stand.thing, axis)) for axis in PLACE])
                kept &= (half > 0.0).all(axis=0)
        if kept.any() and high > low:
            found.append(SurfacePatches(frame, low, high - low, middle[:, kept], half[:, kept], radius, heading[kept]))
    return found if left else None


def _turns(stand: Stand, ends: Callable[[int], Bounds]) -> bool:
    """Whether the heading is drawn with the place: where walls leave less to some headings than to others."""
    if isinstance(stand.upper, Circle) or not any(one.walled for one in stand.options):
        return False
    low, high = ends(row_of(stand.thing, THETA))
    if low >= high:
        return False
    return high - low >= TWO_PI - 1e-6 or all(_carried_boxes(one, ends) is not None for one in stand.options)


# Which surfaces things are on: the box of poses, cut where a choice of a surface changes.
#
# A thing that can be on several surfaces has a coordinate that chooses one, and `pick` nodes make heights of it. A
# box that holds several choices has every height between them, so phi seems to pass through values that it jumps
# over.


MAX_WORLDS = 64  # boxes
CUT_SEAM = 1e-8  # taken off either side of a cut: there both surfaces would do, in scenes that have probability 0


def worlds(core: Core, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Boxes, (3N, W) each, which together hold the box lowest..highest (3N,) but for the seams, with one choice of a
    surface each for as many things as `MAX_WORLDS` boxes allow; the box alone where nothing is chosen."""
    low, high = lowest[:, None], highest[:, None]
    for row, ends in sorted(_switches(core).items()):
        inner = sorted(end for end in ends if lowest[row] < end < highest[row])
        if not inner or low.shape[1] * (len(inner) + 1) > MAX_WORLDS:
            continue
        seam = CUT_SEAM * max(1.0, abs(float(lowest[row])), abs(float(highest[row])))
        begins = np.array([lowest[row], *(end + seam for end in inner)])
        stops = np.array([*(end - seam for end in inner), highest[row]])
        if (begins >= stops).any():
            continue
        parts, count = len(begins), low.shape[1]
        low, high = np.repeat(low, parts, axis=1), np.repeat(high, parts, axis=1)
        low[row], high[row] = np.tile(begins, count), np.tile(stops, count)
    return low, high


def chooses(core: Core) -> bool:
    """Whether things choose their surfaces."""
    return bool(_switches(core))


def improbable(tape: Tape, lo: Array, hi: Array, thin: float) -> Bool:
    """Which of K boxes, (K,), hold hardly any scenes: the interval of some number, of lo..hi (T, K), is at most `thin`,
    and each value of that number is one of a surface in the space of scenes. That is no proof: such a box can hold
    single scenes."""
    smooth = _smooth(tape)
    narrow = hi - lo <= thin
    out: Bool = np.asarray(narrow[smooth].any(axis=0))
    for index in np.flatnonzero(narrow.any(axis=1)):
        if isinstance(tape.nodes[index], Junction):  # it is as one of its parts is, if that is in its interval
            each = [smooth[arg] | (hi[arg] < lo[index]) | (lo[arg] > hi[index]) for arg in _parts(tape, int(index))]
            out |= narrow[index] & np.logical_and.reduce(each)
    return out


def _smooth(tape: Tape) -> Bool:
    """Coordinates, differences of two, distances and clearances, and their sums with constants, (T,): no value of such
    a number is that of a set of scenes with a volume."""
    smooth = np.zeros(len(tape.nodes), dtype=bool)
    for index, node in enumerate(tape.nodes):
        match node:
            case Coord():
                smooth[index] = True
            case Apply("neg", (arg,)):
                smooth[index] = smooth[arg]
            case Apply("add" | "sub", (one, other)):
                constant = [isinstance(tape.nodes[arg], Const) for arg in (one, other)]
                smooth[index] = index in tape.differences or (any(constant) and smooth[[one, other]].any())
            case Apply(name, args) if PRIMITIVES[name].smooth:
                smooth[index] = any(smooth[args[at]] for at in chain(*PRIMITIVES[name].places))
    return smooth


def _parts(tape: Tape, top: int) -> set[int]:
    """What a junction is the least or the most of, junctions among that replaced by their own parts."""
    found, seen, stack = set[int](), set[int](), [top]
    while stack:
        index = stack.pop()
        node = tape.nodes[index]
        if not isinstance(node, Junction):
            found.add(index)
        elif index not in seen:
            seen.add(index)
            stack.extend(node.args)
    return found


def _switches(core: Core) -> dict[int, set[float]]:
    """The rows of coordinates that choose, and where their choices change."""
    found: dict[int, set[float]] = {}
    for node in core.nodes:
        if isinstance(node, Apply) and node.primitive == "pick":
            switch, end = (core.nodes[arg] for arg in node.args[:2])
            if isinstance(switch, Coord) and isinstance(end, Const) and math.isfinite(end.value):
                found.setdefault(row_of(switch.object, switch.axis), set()).add(end.value)
    return found
