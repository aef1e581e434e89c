"""Formulas that no scene satisfies, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scenegen.bounds import spec_bounds
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.declarations import (
    CANNOT_BE_SATISFIED,
    HARDLY_SATISFIED,
    REQUIREMENT_CANNOT_BE_MET,
    REQUIREMENT_HARDLY_MET,
)
from scenegen.errors.models import NOTHING_TO_LEARN
from scenegen.lang.core import REQUIRE, Core, gated, part
from scenegen.lang.counts import combinations, written
from scenegen.lang.interpret import phi
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]

ENDS = (0.0, math.inf)  # satisfied
SCENES, LIVE = 256, 1 << 22  # scenes of the first look, and numbers that it may hold at a time
WORK = 2000  # visits of nodes that one label's search for clashes may take: about half a second
TOTAL = 2 * WORK  # that all labels together may take
MOST = 24  # labels that are searched for clashes; of more, bounds alone decide


@dataclass(frozen=True, slots=True)
class Doubt:
    """A label that no scene seems to satisfy, or REQUIRE: a requirement that none seems to meet.

    `proved` says that bounds prove it. `problem` is a warning that names the smallest set of conjuncts that clash; None
    where the effort ended before anything could be told.
    """

    label: str
    proved: bool
    problem: Diagnostic | None


def infeasible(spec: CheckedSpec) -> list[Diagnostic]:
    """A warning for each label that no scene seems to satisfy, and for a requirement that no scene meets."""
    return [doubt.problem for doubt in doubts(spec) if doubt.problem is not None]


def doubts(spec: CheckedSpec) -> list[Doubt]:
    """The labels that no scene was found to satisfy, and the requirement, where none was found to meet it.

    Scenes are looked for first: most labels are done with that. What is left is searched for clashes, for about half a
    second in all. Of a spec over time only bounds are looked at.
    """
    if spec.timed is not None:
        return _over_time(spec)
    if spec.members:
        return _of_members(spec)
    core, box, bounds = gated(spec.core), spec.box(), spec_bounds(spec)
    required = (REQUIRE,) if REQUIRE in core.labels else ()
    waiting = _not_at_once(core, box)
    if not waiting:
        return []
    from scenegen.bounds.clash import clash, explain
    from scenegen.bounds.search import find
    from scenegen.bounds.tape import weight

    left_out: list[str] = []
    if len(waiting) > MOST:
        never = [name for name in waiting if bounds[name][1] < 0.0][:MOST]
        waiting, left_out = never, [name for name in waiting if name not in never]
    missing = []
    work = min(WORK, TOTAL // max(1, len(waiting)))
    for name in waiting:
        one = part(core, (name, *required))
        reach = find(one, *box, dict.fromkeys(one.labels.values(), ENDS), work=work)
        if reach.verdict != "yes":
            highest = bounds[name][1]
            missing.append((name, highest if highest < 0.0 else None, one, reach))
    if required and len(missing) == len(spec.labels):  # some label's scene would have met the requirement, too
        one = part(core, required)
        reach = find(one, *box, {one.labels[REQUIRE]: ENDS}, work=work)
        if reach.verdict != "yes":
            missing.insert(0, (REQUIRE, None, one, reach))
    found: list[Doubt] = []
    for name, most, one, reach in missing:
        result = None
        if not reach.short or weight(one.nodes) <= 2 * work:
            # a search that was cut short proves little: its best scene is no reason to warn
            wanted = dict.fromkeys(one.labels.values(), ENDS)
            result = clash(one, *box, wanted, search=not reach.short and reach, work=work)
        if result is None:
            found.append(Doubt(name, False, None))
            continue
        if name == REQUIRE:
            problem = explain(one, result, REQUIREMENT_CANNOT_BE_MET if result.proved else REQUIREMENT_HARDLY_MET)
        else:
            kind = CANNOT_BE_SATISFIED if result.proved else HARDLY_SATISFIED
            problem = explain(one, result, kind, name=name, most=most)
        found.append(Doubt(name, result.proved, problem))
        if name == REQUIRE:
            break  # without it nothing else matters
    return found + [Doubt(name, False, None) for name in left_out]


def _of_members(spec: CheckedSpec) -> list[Doubt]:
    """What is doubtful with some number of things; it is proved only where it is proved of every number."""
    found: dict[str, list[tuple[str, Doubt]]] = {}
    for numbers, member in zip(combinations(spec.counts), spec.members, strict=True):
        for one in doubts(member):
            found.setdefault(one.label, []).append((written(numbers), one))
    told = []
    for label, each in found.items():
        with_problem = [(name, one) for name, one in each if one.problem is not None]
        if not with_problem:
            told.append(Doubt(label, False, None))
            continue
        problem = with_problem[0][1].problem
        assert problem is not None
        everywhere = len(each) == len(spec.members) and all(one.proved for _, one in each)
        names = ", ".join(name for name, _ in with_problem)
        told.append(Doubt(label, everywhere, problem.but(counted="any number" if everywhere else names)))
    return told


def _over_time(spec: CheckedSpec) -> list[Doubt]:
    from scenegen.bounds.effort import Effort
    from scenegen.motions.bounds import phi_bounds

    assert spec.timed is not None
    most = {name: high for name, (_, high) in phi_bounds(spec.timed, *spec.box(), Effort()).items()}
    return [Doubt(name, True, CANNOT_BE_SATISFIED(name=name, most=high)) for name, high in most.items() if high < 0.0]


def _not_at_once(core: Core, box: tuple[Array, Array]) -> list[str]:
    """The labels that none of a few random scenes satisfies together with the requirement."""
    lowest, highest = (end[:, None] for end in box)
    scenes = max(8, min(SCENES, LIVE // len(core.nodes)))
    rows = lowest + (highest - lowest) * np.random.default_rng(0).random((len(lowest), scenes))
    met = {name: np.broadcast_to(value, scenes) >= 0.0 for name, value in phi(core, list(rows), NUMPY).items()}
    valid = met.pop(REQUIRE, np.ones(scenes, dtype=bool))
    return [name for name, satisfied in met.items() if not (satisfied & valid).any()]


def refuse_infeasible(spec: CheckedSpec) -> None:
    """Refuse what cannot be learnt, with the reason that `check` gives: a label that no scene satisfies, a requirement
    that none meets, where bounds prove it, and a label that does not vary. Raises RequestError."""
    constant = [name for name, (low, high) in spec_bounds(spec).items() if not low < high]
    if constant:
        raise RequestError(*(NOTHING_TO_LEARN(label=name, value=spec_bounds(spec)[name][0]) for name in constant))
    proved = [one.problem for one in doubts(spec) if one.proved and one.problem is not None]
    if proved:
        raise RequestError(*(replace(one, severity="error") for one in proved))
