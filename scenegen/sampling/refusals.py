"""Requests that no scene meets, or scenes of probability 0: what the errors say, and ranges that only touch a bound."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import NO_SUCH_SCENE
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, Core
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.sampling.request import Range, empty_range
from scenegen.search.conflict import conflict_diagnostic, minimal_conflict
from scenegen.search.contract import Bounds, label_demand
from scenegen.search.effort import Effort, StoppedError, TooMuchError, scoring_work

BOUND_SCENES = 4096  # scenes that tell whether many have phi at its bound
BOUND_NUMBERS = 1 << 22  # numbers of these at most


def impossible(
    core: Core,
    lowest: Array,
    highest: Array,
    phi: Mapping[str, Range],
    wanted: Mapping[int, Bounds],
    held: Sequence[str],
    effort: Effort,
) -> Diagnostic:
    """The error for a request that is proved to have no scene. It names the atoms that conflict, if there is time to
    find out, of the requirement alone where that suffices: then no other range of phi helps. `held` are the objects
    with a given pose."""
    facts: dict[str, object] = {"wanted": ranges_text(phi)}
    try:
        found = None
        if REQUIRE in core.labels:
            required = {core.labels[REQUIRE]: (0.0, math.inf)}
            found = minimal_conflict(core, lowest, highest, required, search=False, effort=effort)
        if found is not None:
            facts = {"required": True, "held": held}
        else:
            found = minimal_conflict(core, lowest, highest, wanted, search=False, effort=effort)
    except (StoppedError, TooMuchError):
        found = None
    return NO_SUCH_SCENE(**facts) if found is None else conflict_diagnostic(core, found, NO_SUCH_SCENE, **facts)


def ranges_text(phi: Mapping[str, Range]) -> str:
    """Ranges of phi by label, in words."""
    return " and ".join(f"phi of `{name}` in {wanted}" for name, wanted in phi.items())


def refuse_points(
    core: Core, lowest: Array, highest: Array, phi: Mapping[str, Range], held: Sequence[str], effort: Effort
) -> None:
    """A single value has probability 0, so the error suggests a band; if no scene has the value at all, it says so
    instead."""
    if any(name not in core.labels or empty_range(wanted) is not None for name, wanted in phi.items()):
        return
    low, high = np.array([phi.get(name, Range()).ends for name in core.labels]).T.copy()
    if REQUIRE in core.labels:
        low[-1] = 0.0
    wanted = label_demand(core, low, high)
    if any(map(np.isnan, (*low, *high))):
        return
    if minimal_conflict(core, lowest, highest, wanted, search=False, effort=effort) is not None:
        raise RequestError(impossible(core, lowest, highest, phi, wanted, held, effort))


def move_shared_bounds(
    core: Core, lowest: Array, highest: Array, phi: Mapping[str, Range], bounds: dict[str, Bounds], effort: Effort
) -> tuple[Mapping[str, Range], dict[str, Bounds]]:
    """The ranges and the bounds of phi, where a range only touches a bound that many scenes share, as where phi is a
    matter of which surface a thing is on: the bound moves by a hair, for it has not probability 0, and a range of that
    value alone has its other end open."""
    ends = {name: wanted for name, wanted in phi.items() if name in bounds}
    count = max(64, min(BOUND_SCENES, BOUND_NUMBERS // len(core.nodes)))
    effort.spend(scoring_work(core.nodes, count))
    width = (highest - lowest)[:, None]
    rows = lowest[:, None] + width * np.random.default_rng(0).random((len(lowest), count))
    with np.errstate(all="ignore"):
        values = evaluate(core, list(rows), NUMPY)
    phi, bounds = dict(phi), dict(bounds)
    for name, one in ends.items():
        low, high = bounds[name]
        if one.low == high and np.any(values[name] == high):
            bounds[name] = low, float(np.nextafter(high, math.inf))
            phi[name] = dataclasses.replace(one, high=None) if one.high == high else one
        elif one.high == low and np.any(values[name] == low):
            bounds[name] = float(np.nextafter(low, -math.inf)), high
            phi[name] = dataclasses.replace(one, low=None) if one.low == low else one
    return phi, bounds
