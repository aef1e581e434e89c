"""What views from above show of priors: where the things usually are, given where the others stand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry import MATH
from scenegen.geometry.footprint import Point, Rectangle
from scenegen.geometry.quantile import CutNormal
from scenegen.lang.formula.interpret import Numbers, fold
from scenegen.lang.prior import Normal, Prior, Recorded, UniformPlace
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import PLACE, X, Y, row_of

FEW = 6  # usual places up to which all are shown at a time: so many colours there are
INNER, OUTER = 0.5, 0.9  # the shares of a normal distribution within its two circles
GRID_STEPS = 96  # along each axis, with equal shares between them: radii are right to a hundredth
CIRCLE_CORNERS = 64  # of the polygon that stands for a circle
MOST_DOTS = 150  # recorded places that are shown; of more, every second, third, ...


@dataclass(frozen=True, slots=True)
class NormalCircles:
    """Half of a normal distribution lies within `inner` metres of its middle, nine tenths within `outer`, what lies
    outside of the box being cut off. `share` is that of a mixture."""

    middle: Point
    inner: float
    outer: float
    share: float


@dataclass(frozen=True, slots=True)
class UniformArea:
    """A part of the table, all of which is equally likely: its corners, and its share of a mixture."""

    corners: tuple[Point, ...]
    share: float


@dataclass(frozen=True, slots=True)
class UsualPlace:
    """Where `things`, objects by number, usually are: all whose priors say the same. All of it is in the box `within`,
    which cuts discs off; `dots` are recorded places."""

    things: tuple[int, ...]
    within: Rectangle
    discs: tuple[NormalCircles, ...] = ()
    areas: tuple[UniformArea, ...] = ()
    dots: tuple[Point, ...] = ()


def usual_places(spec: CheckedSpec, row: Array) -> list[UsualPlace]:
    """Of all things whose place has a prior, in a scene with the core's rows (3M,): what is relative to others is where
    these stand now."""
    lowest, highest = spec.box()
    boxes = {
        thing: (
            float(lowest[row_of(thing, X)]),
            float(lowest[row_of(thing, Y)]),
            float(highest[row_of(thing, X)]),
            float(highest[row_of(thing, Y)]),
        )
        for one in spec.priors
        for thing in one.things
    }
    found: dict[UsualPlace, tuple[int, ...]] = {}
    for prior in spec.priors:
        for one in _places_of(prior, boxes, row) if prior.part != "heading" else ():
            same = replace(one, things=())
            found[same] = (*found.get(same, ()), *one.things)
    return [replace(one, things=things) for one, things in found.items()]


def _places_of(prior: Prior, boxes: dict[int, Rectangle], row: Array) -> Iterator[UsualPlace]:
    """Of each thing of a prior."""
    values = fold(prior.nodes, Numbers(MATH, row.tolist()))
    for place, thing in enumerate(prior.things):
        box = boxes[thing]
        discs, areas, dots = list[NormalCircles](), list[UniformArea](), list[Point]()
        for option, weight in zip(prior.options, prior.weights, strict=True):
            share = weight / sum(prior.weights)
            match option:
                case Normal((x, y), deviation):
                    discs.append(_disc((float(values[x]), float(values[y])), deviation, box, share))
                case UniformPlace():
                    areas.append(UniformArea(option.corners_within(box, CIRCLE_CORNERS), share))
                case Recorded(rows):
                    some = rows[:: math.ceil(len(rows) / MOST_DOTS)]
                    kept = (one for one in some if option.is_reachable(one, [boxes[each] for each in prior.things]))
                    dots += [one[place][:2] for one in kept]
        yield UsualPlace((thing,), box, tuple(discs), tuple(areas), tuple(dots))


def _disc(middle: Point, deviation: float, box: Rectangle, share: float) -> NormalCircles:
    """The circles round a middle that hold their shares of what is left of a normal distribution in a box."""
    steps = (np.arange(GRID_STEPS) + 0.5) / GRID_STEPS
    x, y = (
        deviation * CutNormal.make((box[axis] - at) / deviation, (box[axis + 2] - at) / deviation).quantile(steps)
        for axis, at in zip(PLACE, middle, strict=True)
    )
    inner, outer = np.quantile(np.hypot(x[:, None], y), (INNER, OUTER))
    return NormalCircles(middle, float(inner), float(outer), share)
