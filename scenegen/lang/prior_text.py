"""Priors in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scenegen.lang.formula.builder import describe
from scenegen.lang.formula.core import Const
from scenegen.lang.prior import Normal, Prior, Recorded, UniformHeading, UniformPlace


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
