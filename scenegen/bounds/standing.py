"""Who stands where: objects that stand on one of some surfaces, and the patches of these on which each is drawn.

The set of poses that supports allow is thin in a box of poses: a bottle on any of six slots is on one of them in one of
a thousand. But its volume does not depend on where the carriers are, so it can be drawn uniformly: carriers first, then
for each object a surface, as likely as its share of the switch times its area, and a place on it. Headings between
walls are drawn with the place, in slices that leave out where the object does not fit.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import PYTHON, Effort
from scenegen.bounds.patches import SLICES, Piece, Step, cut, disc, facing, patches, step_of
from scenegen.bounds.requirements import Ends
from scenegen.bounds.tape import Tape
from scenegen.lang.choices import options_of
from scenegen.lang.spec import CheckedSpec, Support
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI, X, row_of
from scenegen.primitives.footprint import Box, Circle, Footprint

Array = npt.NDArray[np.float64]

HAIR = 1e-9  # metres and radians by which boxes are larger than contraction says


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
    the box lowest..highest (3N,) holds in place is left out."""
    if not spec.choices:
        return ()
    waiting = sorted(spec.supports.keys() | spec.choices.keys())
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

    def ends(row: int) -> Ends:
        node = tape.rows.get(row)
        if node is None or lowest[row] == highest[row]:
            return float(lowest[row]), float(highest[row])
        return float(lo[node]) - HAIR, float(hi[node]) + HAIR

    steps = []
    for stand in stands:
        effort.spend(PYTHON * 8 * len(stand.options))
        if _boxed(stand, ends):
            continue
        pieces = _pieces(stand, ends)
        if pieces is None:
            return None
        if pieces:
            steps.append(step_of(stand.thing, stand.switch, pieces, _turns(stand, ends)))
    return tuple(steps)


def step_for(stand: Stand, ends: Callable[[int], Ends]) -> Step | None:
    """How an object that stands is drawn where `ends` tells the interval of each row; None where it has no place."""
    pieces = _pieces(stand, ends)
    return step_of(stand.thing, stand.switch, pieces, _turns(stand, ends)) if pieces else None


def _boxed(stand: Stand, ends: Callable[[int], Ends]) -> bool:
    """Whether all surfaces have one rectangle of centres, along the axes of a table that none of them leaves, such as
    boards above each other: the contracted box is as good, and can be tied to what else is asked."""
    found = set[tuple[object, ...]]()
    for one in stand.options:
        pose = _carried(one, ends)
        if pose is None or not isinstance(one.outline, Box) or (one.walled and not isinstance(stand.upper, Circle)):
            return False
        found.add((pose, one.outline, one.walled))
    turn = next(iter(found))[0][2] / (TWO_PI / 4.0)  # type: ignore[index]
    return len(found) == 1 and abs(turn - round(turn)) < HAIR


def _carried(under: Support, ends: Callable[[int], Ends]) -> tuple[float, float, float] | None:
    """The pose of a surface's frame where that is the same in every scene."""
    if under.carrier is None:
        return under.pose
    x, y, theta = (ends(row_of(under.carrier, axis)) for axis in FLAT)
    return (x[0], y[0], theta[0]) if x[0] == x[1] and y[0] == y[1] and theta[0] == theta[1] else None


def _pieces(stand: Stand, ends: Callable[[int], Ends]) -> list[Piece] | None:
    """The patches of each surface that is left; None where none is, nothing where all of them have no area."""
    found, left, begin, turned = list[Piece](), False, 0.0, _turns(stand, ends)
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
        heading: Array = np.arange(len(half[0])) * np.float64(TWO_PI / SLICES if turned else 0.0)
        held = _carried(under, ends)
        kept = (half > 0.0).all(axis=0)
        if held is not None:
            if turned:
                kept &= facing(heading + held[2], ends(row_of(stand.thing, THETA)))
            if not radius:
                middle, half = cut(middle, half, held, [ends(row_of(stand.thing, axis)) for axis in PLACE])
                kept &= (half > 0.0).all(axis=0)
        if kept.any() and high > low:
            found.append(Piece(frame, low, high - low, middle[:, kept], half[:, kept], radius, heading[kept]))
    return found if left else None


def _turns(stand: Stand, ends: Callable[[int], Ends]) -> bool:
    """Whether the heading is drawn with the place: where walls leave less to some headings than to others."""
    if isinstance(stand.upper, Circle) or not any(one.walled for one in stand.options):
        return False
    low, high = ends(row_of(stand.thing, THETA))
    if low >= high:
        return False
    return high - low >= TWO_PI - 1e-6 or all(_carried(one, ends) is not None for one in stand.options)
