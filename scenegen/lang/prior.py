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
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from scenegen.lang.formula.builder import describe
from scenegen.lang.formula.core import Const
from scenegen.pose import PLACE, THETA, row_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenegen.lang.formula.core import Node
    from scenegen.lang.spec import Pose, Region


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution. `middle` are nodes of the prior's tape: x and y, or a heading in radians; `deviation` is
    the standard deviation, in metres of each coordinate, or in radians."""

    middle: tuple[int, ...]
    deviation: float


@dataclass(frozen=True, slots=True)
class UniformPlace:
    """Uniform over the part of a region that lies in the workspace."""

    region: Region


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


@dataclass(frozen=True, slots=True)
class Prior:
    """What one `usually` statement says of `things`, objects by number: of their places, of their headings or, with
    recorded poses, of both. Each thing draws one of `options` by itself, in proportion to `weights`; recorded poses are
    the only option, and things draw their row together. `nodes` is a tape with the middles of normals: numbers and
    coordinates of other objects."""

    things: tuple[int, ...]
    part: Literal["place", "heading", "pose"]
    options: tuple[Normal | UniformPlace | UniformHeading | Recorded, ...]
    weights: tuple[float, ...]
    nodes: tuple[Node, ...] = ()


def prior_rows(priors: Iterable[Prior]) -> dict[int, Prior]:
    """The rows of (3N, B) storage that have a prior, with theirs."""
    axes = {"place": PLACE, "heading": (THETA,), "pose": (*PLACE, THETA)}
    return {row_of(thing, axis): one for one in priors for thing in one.things for axis in axes[one.part]}


def prior_text(prior: Prior, names: Sequence[str], objects: Sequence[str]) -> str:
    """A prior as a spec says it, with recorded poses counted; `names` are what its things are called, `objects` those
    of the spec."""
    each = [f"theta({name})" for name in names] if prior.part == "heading" else names
    options = [_option_text(prior, one, objects) for one in prior.options]
    mixture = ", ".join(f"{one}: {weight:g}" for one, weight in zip(options, prior.weights, strict=True))
    return f"{', '.join(each)} ~ {options[0] if len(options) == 1 else f'[{mixture}]'}"


def _option_text(prior: Prior, one: Normal | UniformPlace | UniformHeading | Recorded, objects: Sequence[str]) -> str:
    match one:
        case UniformPlace(region):
            return f"uniform({region.name})"
        case UniformHeading(low, high):
            return f"uniform({math.degrees(low):g} deg, {math.degrees(high):g} deg)"
        case Recorded(rows, reach, turn):
            return f"poses({len(rows):,} row{'s' * (len(rows) > 1)}, {100.0 * reach:g} cm, {math.degrees(turn):g} deg)"
        case Normal(middle, deviation):
            numbers = [describe(prior.nodes, objects, node) for node in middle]
            if prior.part == "place":
                return f"normal(({', '.join(numbers)}), {100.0 * deviation:g} cm)"
            (known,) = (prior.nodes[node] for node in middle)
            written = f"{math.degrees(known.value):g} deg" if isinstance(known, Const) else numbers[0]
            return f"normal({written}, {math.degrees(deviation):g} deg)"
