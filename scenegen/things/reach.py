"""What an arm reaches from above: between which radii about its first axis, at each height, the last axis of a hand
that points straight down can be, and how far the hand can be turned there.

Random postures are brought to point down at the heights of a grid; the innermost and the outermost of each height are
followed along the set of such postures until it ends; from those near them, all points of a grid of radii between are
searched. A posture that is not straight down, at its place and within all limits at last counts for nothing. So every
point of the grid that is called reached is reached, and where the search finds nothing, the ring ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from scenegen.things.chain import ChainError, JointChain
from scenegen.things.outline import Floats
from scenegen.things.postures import Flags, Postures, PostureSearch

Arc = tuple[float, float]  # of bearings, radians

REACH_SEED = 0
RANDOM_POSTURES = 40_000
LEVELS = 60  # heights of the grid
HEIGHT_DIGITS = 4  # decimals of a height in metres: a file has no more
RADII = 200  # points of the grid over the length of the arm
SETTLING, NEARING = 14, 6  # steps from a random posture, and from one that is near
CLIMBERS, CLIMBS = 8, 40  # postures that are followed to either end of a height; steps of each
SEARCH_STARTS = (
    12,
    40,
    400,
)  # postures from which a point of the grid is searched, at first and later
STRIDE = 4  # of the nearest postures every so many counts: the ends, to which many were followed, are crowded
BISECTIONS, BEND = 4, 0.5  # rounds that add heights where the ends of the ring bend by more, in steps of the grid
HALVINGS = 3  # of the distance from the last point that is reached to the first that is not
SLACKS = 0.0, 0.01, 0.02, 0.05, 0.08, 0.1, 0.125, 0.15, 0.2, 0.3  # radians within the limits of the first joint
TESTED_BEARINGS = 73  # of an arc
BEHIND = math.pi / 2.0  # radians off the middle of its bearings from which an arm leans back over its base
NO_OFFSET = 5e-5  # metres of a tip from the last axis that are none
ROUNDING = 1e-9  # radians
BATCH = 10_000  # postures that are moved at once


@dataclass(frozen=True, slots=True)
class MeasuredRing:
    """Radii (m) about the first axis at heights (m) above the base link's origin, ascending; the bearings (rad) from
    the base's x-axis at which all of them are reached, and the directions in which the hand then closes, from that away
    from the first axis. `gaps` are the heights at which more is reached beyond a gap."""

    heights: tuple[float, ...]
    nearest: tuple[float, ...]
    farthest: tuple[float, ...]
    bearing: Arc
    turn: Arc
    gaps: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Reach:
    """Where the last axis can be: `front`, and `behind` where the arm leans back over its base. `offset` (m) is where
    the tip is from that axis, along the direction in which the hand closes and to its left; `rise` and `step` (m) are
    the distances of the grid in height and radius; `axis` is where the first axis stands in the base link's frame."""

    front: MeasuredRing
    behind: MeasuredRing | None
    offset: tuple[float, float]
    rise: float
    step: float
    axis: tuple[float, float]


def measure_reach(chain: JointChain, approach: Floats, beyond: float = 0.0, closing: Floats | None = None) -> Reach:
    """The rings of an arm, with the hand as `PostureSearch` takes it.

    Headings count up to half a turn, as those of two fingers do. Of radii that are not connected the widest ring
    counts; bearings are all, or those within the limits of the first joint: whichever covers more of the table. Where
    the tip is beside the last axis, but how far the hand turns depends on the posture, or in which direction it closes
    is not known, `offset` is 0 and the rings are smaller: they have what is reached at all headings. Raises ChainError
    for an arm of another kind, and for one whose hand cannot point down.
    """
    some = np.cross(approach, np.eye(3)[int(np.abs(approach).argmin())])
    arm = PostureSearch(chain, approach, beyond, some / np.linalg.norm(some) if closing is None else closing)
    beside = math.hypot(*arm.offset) > NO_OFFSET
    if beside and closing is not None:
        found = _measure(arm, 0.0, arm.offset)
        if all(one.turn[1] - one.turn[0] >= math.pi for one in (found.front, found.behind) if one is not None):
            return found
    return _measure(arm, math.hypot(*arm.offset) if beside else 0.0, (0.0, 0.0))


def _measure(arm: PostureSearch, narrowing: float, offset: tuple[float, float]) -> Reach:
    """The rings, `narrowing` metres smaller at both ends. Raises ChainError."""
    grid = _Grid(arm, np.random.default_rng(REACH_SEED), narrowing)
    front, behind = grid.ring(), None
    if front is None:
        raise ChainError(
            "its hand cannot point straight down over a ring about its first joint",
            "name the direction in which the hand points as the approach, and look at the limits of the joints",
        )
    if front.bearing[1] - front.bearing[0] < math.tau:
        behind = _Grid(arm, np.random.default_rng(REACH_SEED), narrowing, behind=True).ring()
    return Reach(front, behind, offset, grid.rise, grid.step, arm.axis)


def _arcs(arm: PostureSearch, turned: float) -> Iterator[Arc]:
    """The arcs of bearings that a ring may hold for, those within limits `turned` (rad)."""
    if not turned:
        yield -math.pi, math.pi
    low, high = arm.bearing
    if high - low < math.tau:
        yield from ((low + slack + turned, high - slack + turned) for slack in SLACKS if low + slack < high - slack)


def _share_of_arc(arc: Arc, spans: Floats) -> float:
    return (arc[1] - arc[0]) * float((spans[:, 1] ** 2 - spans[:, 0] ** 2).sum())


def _longest(flags: Flags) -> tuple[int, int]:
    """Where the longest run of True begins and ends; (0, 0) where there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))).reshape(-1, 2)
    if not len(edges):
        return 0, 0
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])].tolist()
    return first, last


@dataclass(slots=True, eq=False)
class _Level:
    """What is known of one height: postures there by their radii, ascending, and the radii that were searched, with the
    bearings and turns (n, 2) that postures found there have, the first joint at 0."""

    height: float
    angles: Floats
    radii: Floats
    points: dict[float, Floats] = field(default_factory=dict)

    @classmethod
    def at_height(cls, height: float, now: Postures, holds: Flags) -> _Level:
        level = cls(height, now.angles[:0], now.radii[:0])
        level.add(now, holds)
        return level

    @classmethod
    def union(cls, parts: tuple[_Level, ...]) -> _Level:
        angles, radii = (np.concatenate(each) for each in ([one.angles for one in parts], [one.radii for one in parts]))
        order = np.argsort(radii, kind="stable")
        return cls(parts[0].height, angles[order], radii[order])

    def add(self, now: Postures, holds: Flags) -> None:
        radii = np.concatenate([self.radii, now.radii[holds]])
        order = np.argsort(radii, kind="stable")
        self.angles, self.radii = np.concatenate([self.angles, now.angles[holds]])[order], radii[order]


class _Grid:
    """The search over heights and radii: `arc` is that of the ring, `rise` and `step` the distances of the grid. With
    `behind`, postures count that lean back over the base."""

    def __init__(self, arm: PostureSearch, rng: np.random.Generator, narrowing: float, *, behind: bool = False) -> None:
        self.arm, self.step, self.rise = arm, arm.length / RADII, 0.0
        self.narrowing, self.behind = narrowing, behind
        self.arc = -math.pi, math.pi
        self.levels = self._random_levels(rng)
        self._begin(self.levels)
        arcs = _arcs(arm, math.pi if behind else 0.0)
        self.arc = max(arcs, key=lambda arc: _share_of_arc(arc, self._spans(arc)))
        self._refine(self.levels)
        for _ in range(BISECTIONS):
            more = [self._add_level(*pair) for pair in self._bent()]
            self._begin(more)
            self._refine(more)
            self.levels = sorted([*self.levels, *more], key=lambda level: level.height)

    def ring(self) -> MeasuredRing | None:
        """What was found; None where that is less than two heights."""
        spans = self._spans(self.arc) + np.array([self.narrowing, -self.narrowing])
        first, last = _longest(spans[:, 1] - spans[:, 0] > self.step / 2.0)
        if last - first < 2:
            return None
        levels, spans = self.levels[first:last], spans[first:last]
        flags = [self._reach_flags(level, self.arc) for level in levels]
        gaps = [int(one.sum()) - (end - begin) >= 2 for one in flags for begin, end in [_longest(one)]]
        heights = np.array([level.height for level in levels])
        inner = spans.copy()
        for at in np.flatnonzero(np.diff(heights) < self.rise / 2.0 ** (BISECTIONS - 1)).tolist():
            if np.abs(spans[at + 1] - spans[at]).max() > 2.0 * self.step:  # an edge somewhere between the two
                low, high = max(spans[at : at + 2, 0]), min(spans[at : at + 2, 1])
                for one in (inner[at], inner[at + 1]):
                    one[:] = max(one[0], low), min(one[1], high)
        nearest, farthest, found = inner[:, 0].tolist(), inner[:, 1].tolist(), heights[gaps].tolist()
        turn = self._turn(levels)
        return MeasuredRing(tuple(heights.tolist()), tuple(nearest), tuple(farthest), self.arc, turn, tuple(found))

    def _turn(self, levels: list[_Level]) -> Arc:
        """How far the hand can be turned in every posture of the ring that reaches all of its bearings."""
        low, high = self.arm.turn
        if high - low >= math.tau:
            return -math.pi, math.pi
        parts = [
            np.concatenate([level.points[one] for one in sorted(level.points)])[
                self._covers(level, self.arc).all(axis=1)
            ]
            for level in levels
        ]
        turns = np.concatenate(parts)[:, 1]
        middle = float(np.angle(np.exp(1j * turns).sum())) if len(turns) else 0.0
        off = np.mod(turns - middle + math.pi, math.tau) - math.pi
        return middle + float(off.max(initial=0.0)) + low, middle + float(off.min(initial=0.0)) + high

    def _bent(self) -> list[tuple[_Level, _Level]]:
        """Neighbouring heights between which the ends of the ring may not run straight."""
        spans = self._spans(self.arc)
        first, last = _longest(spans[:, 1] > spans[:, 0])
        heights = np.array([level.height for level in self.levels])
        bends = set()
        for at in range(first + 1, last - 1):
            share = (heights[at] - heights[at - 1]) / (heights[at + 1] - heights[at - 1])
            straight = spans[at - 1] + share * (spans[at + 1] - spans[at - 1])
            if np.abs(straight - spans[at]).max() > BEND * self.step:
                bends |= {at - 1, at}
        least = 4.0 * 10.0**-HEIGHT_DIGITS
        return [(self.levels[at], self.levels[at + 1]) for at in sorted(bends) if heights[at + 1] - heights[at] > least]

    def _add_level(self, low: _Level, high: _Level) -> _Level:
        """The height halfway, with the postures that those of both lead to."""
        angles = np.concatenate([low.angles, high.angles])
        height = round((low.height + high.height) / 2.0, HEIGHT_DIGITS)
        heights = np.full(len(angles), height)
        now = self.arm.settle(angles, NEARING, heights)
        return _Level.at_height(height, now, self._holds(now, heights))

    def _random_levels(self, rng: np.random.Generator) -> list[_Level]:
        """The heights of the grid, with what random postures come to at each."""
        arm = self.arm
        first = arm.settle(self._random(BATCH, rng), SETTLING)
        heights = first.at[arm.holds(first), 2]
        if not len(heights):
            return []
        edge = arm.length / LEVELS
        levels = np.linspace(heights.min() - edge, heights.max() + edge, LEVELS).round(HEIGHT_DIGITS)
        self.rise = float(levels[1] - levels[0])
        found: list[list[_Level]] = []
        for _ in range(RANDOM_POSTURES // BATCH):
            chosen = rng.integers(LEVELS, size=BATCH)
            now = arm.settle(self._random(BATCH, rng), SETTLING, levels[chosen])
            holds = arm.holds(now, levels[chosen])
            found.append(
                [
                    _Level.at_height(height, now, holds & (chosen == number))
                    for number, height in enumerate(levels.tolist())
                ]
            )
        return [_Level.union(parts) for parts in zip(*found, strict=True)]

    def _holds(self, now: Postures, heights: Floats | None = None, radii: Floats | None = None) -> Flags:
        """(N,): which postures count."""
        found = self.arm.holds(now, heights, radii)
        if self.behind:
            off = np.mod(now.bearings - sum(self.arm.bearing) / 2.0 + math.pi, math.tau) - math.pi
            found &= np.abs(off) > BEHIND
        return found

    def _random(self, count: int, rng: np.random.Generator) -> Floats:
        return rng.uniform(self.arm.low, self.arm.high, (count, len(self.arm.low)))

    def _begin(self, levels: list[_Level]) -> None:
        """Search the radii of these heights from the nearest postures."""
        self._follow_ends(levels)
        for level in levels:
            if len(level.radii):
                low, high = float(level.radii[0]), float(level.radii[-1])
                whole = np.arange(math.ceil(low / self.step), math.floor(high / self.step) + 1) * self.step
                level.points = dict.fromkeys([low, *whole.tolist(), high], np.empty((0, 2)))
        self._search([(level, radius) for level in levels for radius in level.points], SEARCH_STARTS[0])

    def _refine(self, levels: list[_Level]) -> None:
        """Search again, from more, where not all of the arc was found; and the ends of the ring more closely."""
        for count in SEARCH_STARTS[1:]:
            self._search([(level, radius) for level in levels for radius in self._missing(level)], count)
        for _ in range(HALVINGS):
            self._search([(level, radius) for level in levels for radius in self._edges(level)], SEARCH_STARTS[1])

    def _missing(self, level: _Level) -> list[float]:
        found = self._reach_flags(level, self.arc)
        return [one for one, is_found in zip(sorted(level.points), found, strict=True) if not is_found]

    def _follow_ends(self, levels: list[_Level]) -> None:
        """The postures of each height go on with those that the innermost and outermost lead to."""
        for goal, ends in ((0.0, slice(None, CLIMBERS)), (self.arm.length * 2.0, slice(-CLIMBERS, None))):
            starts = [level.angles[ends] for level in levels]
            heights = np.repeat([level.height for level in levels], list(map(len, starts)))
            if len(heights):
                now = self.arm.follow(np.concatenate(starts), heights, np.full(len(heights), goal), CLIMBS)
                for level in levels:
                    level.add(now, (heights == level.height) & self._holds(now))

    def _search(self, places: list[tuple[_Level, float]], count: int) -> None:
        """Postures at these heights and radii, from the `count` nearest at the same height."""
        starts, owners = [], []
        for number, (level, radius) in enumerate(places):
            middle = int(np.searchsorted(level.radii, radius))
            first = max(0, min(middle - count * STRIDE // 2, len(level.radii) - count * STRIDE))
            starts.append(level.angles[first : first + count * STRIDE : STRIDE])
            owners.append(np.full(len(starts[-1]), number))
        if not starts:
            return
        angles, owner = np.concatenate(starts), np.concatenate(owners)
        heights, radii = (
            np.array(column)[owner]
            for column in zip(*((level.height, radius) for level, radius in places), strict=True)
        )
        found = np.full((len(angles), 2), np.nan)
        for begin in range(0, len(angles), BATCH):
            part = slice(begin, begin + BATCH)
            now: Postures = self.arm.settle(angles[part], NEARING, heights[part], radii[part])
            good = self._holds(now, heights[part], radii[part])
            found[part] = np.where(good[:, None], np.stack([now.bearings, now.turns], axis=1), np.nan)
        ends = np.searchsorted(owner, np.arange(len(places) + 1))
        for (level, radius), first, last in zip(places, ends, ends[1:], strict=False):
            here = found[first:last][~np.isnan(found[first:last, 0])]
            level.points[radius] = np.concatenate([level.points.get(radius, np.empty((0, 2))), here])

    def _edges(self, level: _Level) -> Iterator[float]:
        """The radii halfway from the ends of the ring to the next points that are not reached."""
        points = sorted(level.points)
        first, last = _longest(self._reach_flags(level, self.arc))
        if first < last and first > 0:
            yield (points[first - 1] + points[first]) / 2.0
        if first < last < len(points):
            yield (points[last - 1] + points[last]) / 2.0

    def _reach_flags(self, level: _Level, arc: Arc) -> Flags:
        """Which of the points of a height, ascending, are reached at all bearings of the arc."""
        counts = np.array([len(level.points[radius]) for radius in sorted(level.points)], dtype=np.intp)
        found = counts > 0
        low, high = self.arm.bearing
        if not found.any() or high - low >= math.tau:
            return found
        begins = (np.cumsum(counts) - counts)[found]
        found[found] = np.logical_or.reduceat(self._covers(level, arc), begins, axis=0).all(axis=1)
        return found

    def _covers(self, level: _Level, arc: Arc) -> Flags:
        """(postures, bearings): which bearings of the arc the first joint takes each posture to, of all points of a
        height, ascending."""
        points = sorted(level.points)
        bearings = np.concatenate([level.points[radius] for radius in points])[:, 0]
        radii = np.repeat(points, [len(level.points[radius]) for radius in points])
        low, high = self.arm.bearing
        aside = np.arcsin(np.minimum(1.0, self.narrowing / np.maximum(radii, 1e-9)))
        tests = np.linspace(*arc, TESTED_BEARINGS)
        off = np.mod(tests - (bearings + low + aside)[:, None] + ROUNDING, math.tau)
        inside: Flags = off <= (high - low - 2.0 * aside)[:, None] + 2.0 * ROUNDING
        return inside | bool(high - low >= math.tau)

    def _spans(self, arc: Arc) -> Floats:
        """(levels, 2): the ends of the widest ring at each height; (0, 0) where there is none."""
        found = np.zeros((len(self.levels), 2))
        for number, level in enumerate(self.levels):
            points = sorted(level.points)
            first, last = _longest(self._reach_flags(level, arc))
            if last > first:
                found[number] = points[first], points[last - 1]
        return found
