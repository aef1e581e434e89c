"""Where things usually are: the base distribution of a spec, as its `usually` statements declare it.

    usually mug ~ normal((0.4, 0.3), 5 cm)                    # x and y: independent normals, cut off at the workspace
    usually cup ~ normal(saucer, 3 cm)                        # given where the saucer is
    usually theta(mug) ~ normal(NORTH, 10 deg)                # a heading, cut off half a turn away from its mean
    usually butter ~ [uniform(fridge): 7, uniform(table): 3]  # a mixture
    usually mug, saucer ~ poses("logs.csv", 1 cm, 5 deg)      # a recorded row for both, each number moved a little

The joint density of all poses is the product over the things of the density of each, given those that its own is
relative to. Each factor is a density over the workspace, of what stands on a surface over the rectangle round that:
what would lie beyond its edge is cut off, and the rest scaled up, at every place of what it is relative to. So a
relative prior says nothing of where the other thing is. What has no prior is uniform, and so is its heading.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenegen.geometry.footprint import Circle, Footprint, Point, Rectangle, clip, corners
from scenegen.pose import PLACE, THETA, row_of

if TYPE_CHECKING:
    from scenegen.lang.formula.core import Node

Pose = tuple[float, float, float]  # x, y, heading


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution. `middle` are nodes of the prior's tape: x and y, or a heading in radians; `deviation` is
    the standard deviation, in metres of each coordinate, or in radians."""

    middle: tuple[int, ...]
    deviation: float


@dataclass(frozen=True, slots=True)
class UniformPlace:
    """Uniform over the part of a region that lies in the workspace: its name, its footprint, and where that is."""

    region: str
    footprint: Footprint
    pose: Pose

    def corners_within(self, box: Rectangle, sides: int) -> tuple[Point, ...]:
        """The corners of the part of the region that lies in a box; a disc is a polygon of so many sides."""
        x, y, theta = self.pose
        cos, sin = math.cos(theta), math.sin(theta)
        outline: Sequence[Point]
        if isinstance(self.footprint, Circle):
            radius, turns = self.footprint.radius, [math.tau * k / sides for k in range(sides)]
            outline = [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        else:
            outline = corners(self.footprint)
        return clip([(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in outline], box)


@dataclass(frozen=True, slots=True)
class UniformHeading:
    """Uniform from one heading counter-clockwise to another, in radians: `low` < `high` <= `low` + 2 pi."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Recorded:
    """One of K rows, all equally likely, which has a pose for each of the prior's things; x and y are then moved by up
    to `reach` metres and the heading by up to `turn` radians, each uniformly and by itself. What would lie beyond the
    edge of the workspace is cut off."""

    rows: tuple[tuple[Pose, ...], ...]
    reach: float
    turn: float

    def is_reachable(self, row: Sequence[Pose], boxes: Sequence[Rectangle]) -> bool:
        """Whether all things of a row can be where they were, or near it, each in its box. Along an axis of no width it
        is held, wherever it was."""
        return all(
            low < pose[axis] + self.reach and pose[axis] - self.reach < high
            for pose, box in zip(row, boxes, strict=True)
            for axis in PLACE
            for low, high in [(box[axis], box[axis + 2])]
            if low < high
        )


Distribution = Normal | UniformPlace | UniformHeading | Recorded


@dataclass(frozen=True, slots=True)
class Prior:
    """What one `usually` statement says of `things`, objects by number: of their places, of their headings or, with
    recorded poses, of both. Each thing draws one of `options` by itself, in proportion to `weights`; recorded poses are
    the only option, and things draw their row together. `nodes` is a tape with the middles of normals: numbers and
    coordinates of other objects."""

    things: tuple[int, ...]
    part: Literal["place", "heading", "pose"]
    options: tuple[Distribution, ...]
    weights: tuple[float, ...]
    nodes: tuple[Node, ...] = ()


def prior_rows(priors: Iterable[Prior]) -> dict[int, Prior]:
    """The rows of (3N, B) storage that have a prior, with theirs."""
    axes = {"place": PLACE, "heading": (THETA,), "pose": (*PLACE, THETA)}
    return {row_of(thing, axis): one for one in priors for thing in one.things for axis in axes[one.part]}
