"""Formulas that no scene satisfies, and why."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError, Span
from scenegen.errors.declarations import (
    ALWAYS_SATISFIED,
    CANNOT_BE_SATISFIED,
    HARDLY_SATISFIED,
    REQUIREMENT_CANNOT_BE_MET,
    REQUIREMENT_HARDLY_MET,
)
from scenegen.errors.requests import TABLE_TOO_FULL
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, Atom, Const, Core, atoms_below, gate, part_of
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec, combinations, numbers_text
from scenegen.search import node_bounds, spec_bounds
from scenegen.search.effort import Effort, StoppedError

ENDS = (0.0, math.inf)  # satisfied
SCENES, LIVE = 256, 1 << 22  # scenes of the first look, and numbers that it may hold at a time
MAX_AREA_NODES = 12_000  # nodes of a core up to which areas are looked at: tenths of a second
MAX_IDLE_NODES = 200_000  # nodes of a core from which on nothing is said of parts that decide nothing
LABEL_WORK = 2000  # visits of nodes that one label's search for clashes may take: about half a second
TOTAL_WORK = 2 * LABEL_WORK  # that all labels together may take
MAX_LABELS = 24  # labels that are searched for clashes; of more, bounds alone decide
MAX_NAMED_NUMBERS = 4  # of things, that a message names

SMALLER = {"cm": 0.01, "mm": 0.001}

_NUMERAL = re.compile(r"(?<![\w.\[])(?:\d|[A-Z][A-Z0-9_]+\b)")  # or a constant of one's own, in the text of a part
_BARE = re.compile(r"[,=<>≤≥]\s*(\d+(?:\.\d+)?)\s*\)?$")  # a number without a unit at its end


@dataclass(frozen=True, slots=True)
class UnsatisfiedLabel:
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


def doubts(spec: CheckedSpec, effort: Effort | None = None) -> list[UnsatisfiedLabel]:
    """The labels that no scene was found to satisfy, and the requirement, where none was found to meet it.

    Scenes are looked for first: most labels are done with that. What is left is searched for clashes, for about half a
    second in all. Of a spec over time only bounds are looked at. Where `effort` is stopped, the labels of which nothing
    is known yet have no `problem`.
    """
    effort = effort or Effort()
    if spec.timed is not None:
        return _over_time(spec)
    if spec.members:
        return _of_members(spec, effort)
    found, left = [], list(spec.labels)
    try:
        for one in _search(spec, left, effort):
            found.append(one)
    except StoppedError:
        pass
    return found + [UnsatisfiedLabel(name, False, None) for name in left]


def _search(spec: CheckedSpec, left: list[str], effort: Effort) -> Iterator[UnsatisfiedLabel]:
    """What `doubts` finds. `left` are the labels of which nothing is known yet: it gets shorter. Raises what `effort`
    raises."""
    core, box, bounds = gate(spec.core), spec.box(), spec_bounds(spec)
    required = (REQUIRE,) if REQUIRE in core.labels else ()
    left[:] = _not_at_once(core, box, effort)
    if not left:
        return
    from scenegen.search.conflict import conflict_diagnostic, minimal_conflict
    from scenegen.search.prune import find_witness
    from scenegen.search.tape import weight

    waiting = list(left) if len(left) <= MAX_LABELS else [name for name in left if bounds[name][1] < 0.0][:MAX_LABELS]
    missing = []
    work = min(LABEL_WORK, TOTAL_WORK // max(1, len(waiting)))
    for name in waiting:
        one = part_of(core, (name, *required))
        reach = find_witness(one, *box, dict.fromkeys(one.labels.values(), ENDS), work=work, effort=effort)
        if reach.verdict != "yes":
            highest = bounds[name][1]
            missing.append((name, highest if highest < 0.0 else None, one, reach))
        else:
            left.remove(name)
    if required and len(missing) == len(spec.labels):  # some label's scene would have met the requirement, too
        one = part_of(core, required)
        reach = find_witness(one, *box, {one.labels[REQUIRE]: ENDS}, work=work, effort=effort)
        if reach.verdict != "yes":
            if (crowded := _too_full(spec, REQUIRE, effort)) is not None:
                left.clear()
                yield crowded  # without it nothing else matters
                return
            missing.insert(0, (REQUIRE, None, one, reach))
    for name, most, one, reach in missing:
        result = None
        if not reach.short or weight(one.nodes) <= 2 * work:
            # a search that was cut short proves little: its best scene is no reason to warn
            wanted = dict.fromkeys(one.labels.values(), ENDS)
            result = minimal_conflict(one, *box, wanted, search=not reach.short and reach, work=work, effort=effort)
        crowded = None
        if result is None or not result.proved:
            crowded = _too_full(spec, name, effort)
        if name != REQUIRE:
            left.remove(name)
        if crowded is not None or result is None:
            yield crowded or UnsatisfiedLabel(name, False, None)
            continue
        unit: dict[str, str] = {}
        if len(result.nodes) == 1 and isinstance(alone := one.nodes[result.nodes[0]], Atom) and alone.spans:
            unit = _unit(one, alone, alone.spans[0], spec)
        if name == REQUIRE:
            left.clear()
            kind = REQUIREMENT_CANNOT_BE_MET if result.proved else REQUIREMENT_HARDLY_MET
            yield UnsatisfiedLabel(name, result.proved, conflict_diagnostic(one, result, kind, **unit))
            return  # without it nothing else matters
        kind = CANNOT_BE_SATISFIED if result.proved else HARDLY_SATISFIED
        yield UnsatisfiedLabel(
            name, result.proved, conflict_diagnostic(one, result, kind, name=name, most=most, **unit)
        )


def idle(spec: CheckedSpec, effort: Effort | None = None) -> list[Diagnostic]:
    """A warning for each label that every scene satisfies, and for each part of a formula, with a number in it, that
    holds in every scene or in none: the number decides nothing, and mostly its unit is wrong. Bounds prove it. Nothing
    is said where `effort` is stopped."""
    if spec.timed is not None:
        return []
    effort = effort or Effort()
    first, *others = spec.members or (spec,)
    try:
        found = _idle(first, effort)
        for other in others if found else ():
            same = _idle(other, effort)
            found = {key: problem for key, problem in found.items() if key in same}
    except StoppedError:
        return []
    return list(found.values())


def _idle(spec: CheckedSpec, effort: Effort) -> dict[tuple[str, Span], Diagnostic]:
    core = gate(spec.core)
    if len(core.nodes) > MAX_IDLE_NODES:
        return {}
    with np.errstate(over="ignore", invalid="ignore"):
        bounds = node_bounds(core, *spec.box(), effort)
    parts: dict[Span, list[int]] = {}
    for index, node in enumerate(core.nodes):
        if isinstance(node, Atom) and node.spans[0].source.name == spec.name:
            parts.setdefault(node.spans[0], []).append(index)
    found: dict[tuple[str, Span], Diagnostic] = {}
    told = set[int]()
    for name, root in core.labels.items():
        low, high = float(bounds[root].lo), float(bounds[root].hi)
        if high < 0.0 or (low >= 0.0 and name != REQUIRE):
            mine = atoms_below(core, root)
            told.update(mine)  # what can never be, `doubts` tells
            if 0.0 <= low < high:
                first = core.nodes[min(mine)]
                assert isinstance(first, Atom)
                here = next((span for span in first.spans if span.source.name == spec.name), first.spans[0])
                found[name, here] = ALWAYS_SATISFIED(here, name=name, least=low, **_unit(core, first, here, spec))
    for span, atoms in parts.items():
        low, high = min(float(bounds[one].lo) for one in atoms), max(float(bounds[one].hi) for one in atoms)
        first = core.nodes[atoms[0]]
        if told.issuperset(atoms) or not (low > 0.0 or high < 0.0) or low == high or not _NUMERAL.search(span.text):
            continue
        assert isinstance(first, Atom)
        ends = {"least": low} if low > 0.0 else {"most": high}
        found["", span] = ALWAYS_SATISFIED(span, part=span.text, **ends, **_unit(core, first, span, spec))
    return found


def _unit(core: Core, atom: Atom, here: Span, spec: CheckedSpec) -> dict[str, str]:
    """The bare number at the end of an atom's text, where a smaller unit is likely meant, with both units: the largest
    in which it is no longer than the table. Not of counts, which alone are the same in every scene."""
    if isinstance(core.nodes[atom.margin], Const):
        return {}
    bare = _BARE.search(here.text)
    if bare is None or float(bare[1]) < 1.0:
        return {}
    if "rad" in str(atom.unit):
        return {"number": bare[1], "unit": "radians", "small": "deg", "large": "rad"}
    space = spec.workspace
    most = math.hypot(space.x[1] - space.x[0], space.y[1] - space.y[0])
    small = next((unit for unit, length in SMALLER.items() if float(bare[1]) * length <= most), None)
    return {"number": bare[1], "unit": "metres", "small": small, "large": "m"} if small else {}


def _too_full(spec: CheckedSpec, label: str, effort: Effort) -> UnsatisfiedLabel | None:
    """The proof, from areas alone, that the table cannot hold what must keep apart; None where there is none, or where
    it would take long to find. Raises what `effort` raises."""
    if len(spec.core.nodes) > MAX_AREA_NODES:
        return None
    from scenegen.sampling.growth.graph import make_graph
    from scenegen.sampling.growth.packing import packing_proof
    from scenegen.sampling.problem import make_problem
    from scenegen.sampling.request import Range, SampleRequest

    try:
        with np.errstate(all="ignore"):
            request = SampleRequest({} if label == REQUIRE else {label: Range(0.0)})
            problem = make_problem(spec, request, effort=effort)
            proof = packing_proof(make_graph(problem, effort=effort), spec)
    except RequestError:
        effort.check()
        return None  # there is no such scene for another reason, which the search for clashes names
    if not proof:
        return None
    nodes = problem.core.nodes
    here = next(
        one.spans[0]
        for index in sorted(atoms_below(problem.core, problem.core.labels[label]))
        if isinstance(one := nodes[index], Atom)
    )
    return UnsatisfiedLabel(label, True, replace(TABLE_TOO_FULL(here, **proof), severity="warning"))


def _of_members(spec: CheckedSpec, effort: Effort) -> list[UnsatisfiedLabel]:
    """What is doubtful with some number of things; it is proved only where it is proved of every number."""
    found: dict[str, list[tuple[str, UnsatisfiedLabel]]] = {}
    for numbers, member in zip(combinations(spec.counts), spec.members, strict=True):
        for one in doubts(member, effort):
            found.setdefault(one.label, []).append((numbers_text(numbers), one))
    told = []
    for label, each in found.items():
        with_problem = [(name, one) for name, one in each if one.problem is not None]
        if not with_problem:
            told.append(UnsatisfiedLabel(label, False, None))
            continue
        problem = with_problem[0][1].problem
        assert problem is not None
        everywhere = len(each) == len(spec.members) and all(one.proved for _, one in each)
        names = ", ".join(name for name, _ in with_problem[:MAX_NAMED_NUMBERS])
        if len(with_problem) > MAX_NAMED_NUMBERS:
            names += f" and {len(with_problem) - MAX_NAMED_NUMBERS} more"
        told.append(UnsatisfiedLabel(label, everywhere, problem.but(counted="any number" if everywhere else names)))
    return told


def _over_time(spec: CheckedSpec) -> list[UnsatisfiedLabel]:
    from scenegen.sampling.motions.bounds import phi_bounds

    assert spec.timed is not None
    most = {name: high for name, (_, high) in phi_bounds(spec.timed, *spec.box(), Effort()).items()}
    return [
        UnsatisfiedLabel(name, True, CANNOT_BE_SATISFIED(name=name, most=high))
        for name, high in most.items()
        if high < 0.0
    ]


def _not_at_once(core: Core, box: tuple[Array, Array], effort: Effort) -> list[str]:
    """The labels that none of a few random scenes satisfies together with the requirement."""
    lowest, highest = (end[:, None] for end in box)
    scenes = max(8, min(SCENES, LIVE // len(core.nodes)))
    rows = lowest + (highest - lowest) * np.random.default_rng(0).random((len(lowest), scenes))
    values = phi(core, list(rows), NUMPY, effort.check)
    met = {name: np.broadcast_to(value, scenes) >= 0.0 for name, value in values.items()}
    valid = met.pop(REQUIRE, np.ones(scenes, dtype=bool))
    return [name for name, satisfied in met.items() if not (satisfied & valid).any()]


def refuse_infeasible(spec: CheckedSpec, effort: Effort) -> None:
    """Refuse what cannot be learnt, with the reason that `check` gives: a label that no scene satisfies, a requirement
    that none meets, where bounds prove it before `effort` is stopped, and a label that does not vary. Raises
    RequestError."""
    from scenegen.errors.learning import NOTHING_TO_LEARN

    constant = {name: low for name, (low, high) in spec_bounds(spec).items() if not low < high}
    if constant:
        raise RequestError(*(NOTHING_TO_LEARN(label=name, value=low) for name, low in constant.items()))
    proved = [one.problem for one in doubts(spec, effort) if one.proved and one.problem is not None]
    if proved:
        raise RequestError(*(replace(one, severity="error") for one in proved))
