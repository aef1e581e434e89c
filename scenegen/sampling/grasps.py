"""Grasps of pairs: one of each thing that is moved, in the frame of the thing, that fits at the start and at the goal.

At a yaw, the margin of a grasp is that of `graspable` there, the least of the arm's reach and of the room around its
open hand. A hand turns with what it holds, so of a pair it is the least of both ends at the same yaw in the frame of
the thing, and the best yaw counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenegen.arrays import Array, Bool
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_ROBOT, NOTHING_TO_GRASP
from scenegen.geometry import NUMPY
from scenegen.lang.check.arms import YAWS
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Core, part_of
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import object_count, span_of
from scenegen.sampling.request import LENGTH_UNITS, Range, parse_phi

MARGIN_USAGE = "a margin is a length: write a range such as 0.01:, in metres, or with units: 1cm:"
FITS = Range(0.0)  # the margins of a grasp that is clear of everything, and in reach


@dataclass(frozen=True, slots=True)
class PairGrasp:
    """The grasps by a robot: `cores` has of each thing that can be moved, by its place, the margins at YAWS yaws, as
    labels in their order; the margin of a pair is to be in the range `wanted`."""

    cores: Mapping[int, Core]
    wanted: Range

    def margins(self, thing: int, start: Array, goal: Array) -> Array:
        """Of pairs of scenes (3N, n) the margin of a grasp of a thing at each yaw, at both ends: (YAWS, n), metres."""
        found = np.full((YAWS, start.shape[1]), np.inf)
        for end in (start, goal):
            for at_yaw, margin in zip(found, phi(self.cores[thing], list(end), NUMPY).values(), strict=True):
                np.minimum(at_yaw, margin, out=at_yaw)
        return found

    def grasps(self, start: Array, goal: Array) -> Array:
        """Of pairs of scenes (3N, n) the margin of the grasp in metres, and of each thing its yaw in radians, NaN where
        it is not moved, (1 + N, n). Where several things are moved, the margin is the least of theirs."""
        found = np.full((1 + object_count(len(start)), start.shape[1]), np.nan)
        found[0] = np.inf
        for thing in self.cores:
            rows = span_of(thing)
            moved = np.flatnonzero((start[rows] != goal[rows]).any(axis=0))
            margins = self.margins(thing, start[:, moved], goal[:, moved])
            found[0, moved] = np.minimum(found[0, moved], margins.max(axis=0))
            found[1 + thing, moved] = margins.argmax(axis=0) * math.pi / YAWS
        return found

    def holds(self, grasps: Array) -> Bool:
        """(n,): which of some grasps have a margin in the range."""
        low, high = self.wanted.ends
        good: Bool = (grasps[0] >= low) & (grasps[0] <= high)
        return good


def robots_of(spec: CheckedSpec) -> tuple[str, ...]:
    """The names of the robots of a spec."""
    return tuple(name for name, shape in zip(spec.objects, spec.shapes, strict=True) if shape.arm is not None)


def parse_grasp(text: str) -> dict[str, Range]:
    """`--grasp` as typed: "arm", or "arm=0.01:" with a range of the margin. Raises RequestError with a caret."""
    name, equals, _ = text.partition("=")
    if not equals:
        return {text: FITS}
    return parse_phi([text], [name.strip()], "grasp", LENGTH_UNITS, MARGIN_USAGE)


def movable_things(spec: CheckedSpec, robot: str) -> list[int]:
    """The places of what can be moved, robots apart, in a spec with this robot. Raises RequestError for a name that is
    no robot's, and where nothing can be moved."""
    robots = robots_of(spec)
    if robot not in robots:
        raise RequestError(NO_ROBOT(name=robot or '""', known=robots))
    lowest, highest = spec.box()
    things = [
        which
        for which, name in enumerate(spec.objects)
        if name not in robots and (lowest[span_of(which, 2)] < highest[span_of(which, 2)]).any()
    ]
    if not things:
        raise RequestError(NOTHING_TO_GRASP())
    return things


def pair_grasp(spec: CheckedSpec, robot: str, wanted: Range) -> PairGrasp:
    """The grasps of what can be moved; robots stay where they are. Raises RequestError as `movable_things` does."""
    things = movable_things(spec, robot)
    labels = {which: [f"{_free_name(spec.source)}{which}_{k}" for k in range(YAWS)] for which in things}
    lines = [spec.source]
    for which, names in labels.items():
        thing = spec.objects[which].partition(":")[0]  # of a category, the thing has no asset in its name
        reach = f"armReach({thing}, {robot}, GRASP_DEPTH) >= 0"
        for k, name in enumerate(names):
            lines.append(f"{name}: {reach} & handRoom({thing}, {robot}, {k * 180 // YAWS} deg, GRASP_DEPTH) >= 0\n")
    core = check_text("".join(lines), spec.name).core
    return PairGrasp({which: part_of(core, names) for which, names in labels.items()}, wanted)


def _free_name(text: str) -> str:
    """How a name can begin that no name of a text begins with."""
    name = "grasp"
    while name in text:
        name += "_"
    return name
