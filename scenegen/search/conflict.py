"""Which parts of a demand clash: a smallest set of conjuncts that no scene meets together.

A demand is taken apart into conjuncts; while contraction, branch and prune still prove what is left empty, conjuncts
are dropped (the deletion filter for minimal unsatisfiable sets, Chinneck and Dravnieks 1991, in halves first).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, Kind
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import Atom, Coord, Core, Junction, atoms_below
from scenegen.lang.formula.interpret import evaluate
from scenegen.search.contract import (
    EVERYTHING,
    Bounds,
    alternatives,
    contract,
    impose,
    intersect,
    push_down,
    size_of,
    start,
)
from scenegen.search.effort import PYTHON_WORK, Effort, scoring_work
from scenegen.search.grid import open_nodes
from scenegen.search.prune import SWEEP_ONLY_NODES, Reachability, find_witness
from scenegen.search.tape import Tape, make_tape, weight

Conjunct = tuple[int, float, float]
"""Formula node of the core, lowest and highest value: one end is infinite."""

PROOF_BOXES = (1, 16, 256)  # boxes that one proof may look at: what is proved with few is minimised with few
PROOF_VISITS = 30_000  # tape nodes that all proofs together may visit: about two seconds
TRIED_SCENES = 64  # scenes tried in every round of a proof: one that meets the demand ends it
BOXES_AT_A_TIME = 32  # boxes that are split at a time
MAX_NAMED_ATOMS = 4  # atoms that a message names


@dataclass(frozen=True, slots=True)
class Conflict:
    """Conjuncts that clash. `proved`: no scene in the box meets them all, and each is needed for that proof (as far as
    the effort went); otherwise a search found no scene that does, and these are the ones that stood in its way."""

    conjuncts: tuple[Conjunct, ...]
    proved: bool

    @property
    def nodes(self) -> tuple[int, ...]:
        """The formula nodes, in the order of the spec."""
        return tuple(dict.fromkeys(node for node, _, _ in self.conjuncts))


def minimal_conflict(
    core: Core,
    lowest: Array,
    highest: Array,
    wanted: Mapping[int, Bounds],
    *,
    search: bool | Reachability = True,
    work: int = PROOF_VISITS,
    effort: Effort | None = None,
) -> Conflict | None:
    """What clashes in a demand over the box lowest..highest (3N,); None where a scene meets it.

    `wanted` maps formula nodes to the ends that their value should lie in. Where nothing can be proved and a short
    search finds no scene either, the result has `proved` False; `search=False` returns None then, and a search that has
    been made already can be given instead. `work` bounds the effort, in visits of nodes (about 60 microseconds each);
    where it does not suffice, less is proved and less dropped. Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    tape = make_tape(core, lowest, highest, effort)
    conjuncts = conjuncts_of(core, wanted)
    proof = _Proof(core, tape, lowest, highest, work, effort)
    for boxes in PROOF_BOXES:
        proof.boxes = boxes
        if proof.refutes(conjuncts):
            return Conflict(tuple(proof.smallest(conjuncts)), True)
    if search is False:
        return None
    found = find_witness(core, lowest, highest, wanted, work=work, effort=effort) if search is True else search
    if found.verdict == "yes" or found.nearest is None:
        return None
    return Conflict(_least_margins(core, found.nearest, conjuncts), False)


def conjuncts_of(core: Core, wanted: Mapping[int, Bounds]) -> list[Conjunct]:
    """The conjuncts of a demand, one end each."""
    found = []
    for node, (low, high) in push_down(core, wanted).items():
        if low > -np.inf:
            found.append((node, low, np.inf))
        if high < np.inf:
            found.append((node, -np.inf, high))
    return found


def conflict_diagnostic(core: Core, found: Conflict, kind: Kind, **facts: Any) -> Diagnostic:
    """The diagnostic of a clash: the caret under the first atom, the others below with their file and line."""
    texts = [_text(core, conjunct) for conjunct in found.conjuncts]
    spans = [next((atom.spans[0] for atom in _atoms(core, node) if atom.spans), None) for node, _, _ in found.conjuncts]
    more = "cannot be met" if len(texts) == 1 else "clashes with what is noted below"
    lines = [
        f"{text}  ({span.place})" if span is not None else text
        for text, span in list(zip(texts, spans, strict=True))[1 : MAX_NAMED_ATOMS + 1]
    ]
    if len(texts) > MAX_NAMED_ATOMS + 1:
        lines.append(f"and {len(texts) - MAX_NAMED_ATOMS - 1} more")
    lines.append("bounds prove it" if found.proved else "no proof: a short search found no scene")
    return kind(spans[0], clash=f"{texts[0]} {more}", others="\n".join(lines), **facts)


def _text(core: Core, conjunct: Conjunct) -> str:
    index, low, high = conjunct
    sign = f">= {low:.4g}" if low > -np.inf else f"<= {high:.4g}"
    atoms = _atoms(core, index)
    names = [f"`{atom.text}`" for atom in atoms[:MAX_NAMED_ATOMS]] + (["..."] if len(atoms) > MAX_NAMED_ATOMS else [])
    if len(atoms) == 1:
        return f"{names[0]} {sign}"
    return f"{' or '.join(names)} {sign}"


def _atoms(core: Core, index: int) -> list[Atom]:
    """The atoms below a formula node, in order, each text once."""
    found: dict[str, Atom] = {}
    for one in atoms_below(core, index):
        atom = core.nodes[one]
        assert isinstance(atom, Atom)
        found.setdefault(atom.text, atom)
    return list(found.values())


def _demand_of(conjuncts: Sequence[Conjunct]) -> dict[int, Bounds]:
    demand: dict[int, Bounds] = {}
    for node, low, high in conjuncts:
        demand[node] = intersect(demand.get(node, EVERYTHING), (low, high))
    return demand


@dataclass(slots=True)
class _Proof:
    """Branch and prune without measure: only whether anything is left. `boxes` bounds one proof, `work` all."""

    core: Core
    tape: Tape
    lowest: Array
    highest: Array
    work: int
    effort: Effort
    boxes: int = 1

    def refutes(self, conjuncts: Sequence[Conjunct]) -> bool:
        """Whether it is proved, within the boxes allowed, that no scene meets the conjuncts."""
        core, tape = self.core, self.tape
        self.effort.spend(PYTHON_WORK * len(conjuncts))
        demand = push_down(core, _demand_of(conjuncts))
        if any(low > high for low, high in demand.values()):
            return True
        rounds, cost = 1 if len(tape.nodes) > SWEEP_ONLY_NODES else 4, weight(tape.nodes)
        demands = [demand]
        lo, hi = start(tape, demands, self.lowest[:, None], self.highest[:, None])
        looked = 1
        while self.work > 0:
            self.work -= rounds * cost
            kept = np.flatnonzero(contract(tape.nodes, lo, hi, rounds, batches=tape.batches, effort=self.effort))
            if not len(kept):
                return True
            lo, hi, demands = lo[:, kept], hi[:, kept], [demands[column] for column in kept]
            if rounds == 1 or looked >= self.boxes or self._meets(conjuncts, lo, hi):
                return False
            next_lo, next_hi, next_demands = (
                [lo[:, BOXES_AT_A_TIME:]],
                [hi[:, BOXES_AT_A_TIME:]],
                demands[BOXES_AT_A_TIME:],
            )
            self.work -= cost * min(BOXES_AT_A_TIME, len(demands)) // 4
            for column in range(min(BOXES_AT_A_TIME, len(demands))):
                split = self._split(demands[column], lo[:, column], hi[:, column])
                if split is None:
                    return False
                for other, part_lo, part_hi in split:
                    next_lo.append(part_lo[:, None])
                    next_hi.append(part_hi[:, None])
                    next_demands.append(other)
                    looked += 1
            lo, hi, demands = np.concatenate(next_lo, axis=1), np.concatenate(next_hi, axis=1), next_demands
        return False

    def smallest(self, conjuncts: list[Conjunct]) -> list[Conjunct]:
        """Drop conjuncts, in halves, quarters and at last one by one, while the rest is still refuted."""
        size = max(1, len(conjuncts) // 2)
        while True:
            position = 0
            while position < len(conjuncts):
                rest = conjuncts[:position] + conjuncts[position + size :]
                if rest and self.refutes(rest):
                    conjuncts = rest
                else:
                    position += size
            if size == 1:
                return conjuncts
            size = max(1, size // 2)

    def _meets(self, conjuncts: Sequence[Conjunct], lo: Array, hi: Array) -> bool:
        """Whether one of a few scenes in the boxes meets the conjuncts: middles first, then random ones."""
        rng = np.random.default_rng(0)
        boxes = np.resize(np.arange(lo.shape[1]), max(TRIED_SCENES, lo.shape[1]))
        where = rng.random((len(self.lowest), len(boxes)))
        where[:, : lo.shape[1]] = 0.5
        rows = self.lowest[:, None] + where * (self.highest - self.lowest)[:, None]
        for row, node in self.tape.rows.items():
            rows[row] = lo[node, boxes] + where[row] * (hi[node, boxes] - lo[node, boxes])
        self.effort.spend(scoring_work(self.core.nodes, len(boxes)))
        values = evaluate(self.core, list(rows), NUMPY, self.effort.check)
        met = np.ones(len(boxes), dtype=bool)
        for node, low, high in conjuncts:
            met &= (values[node] >= low) & (values[node] <= high)
        return bool(met.any())

    def _split(
        self, demand: dict[int, Bounds], lo: Array, hi: Array
    ) -> list[tuple[dict[int, Bounds], Array, Array]] | None:
        """A box in parts: by the alternatives of an open junction, else in halves along the widest coordinate or
        difference that an open atom depends on. None where the whole box meets the demand, or nothing is wide."""
        core, tape = self.core, self.tape
        pending = open_nodes(tape, demand, lo, hi, self.effort)
        if not pending:
            return None
        for one in pending:
            node = core.nodes[one.core]
            if isinstance(node, Junction) and len(node.args) <= BOXES_AT_A_TIME:
                parts = []
                for other, _ in alternatives(core, demand, one.core):
                    part_lo, part_hi = lo.copy(), hi.copy()
                    impose(tape, other, part_lo, part_hi, size_of(self.lowest, self.highest))
                    parts.append((other, part_lo, part_hi))
                return parts
        # only atoms are left open
        leaves = sorted(set().union(*(one.support for one in pending)))
        ends = [index for index, node in enumerate(tape.nodes) if isinstance(node, Coord)]
        if not leaves:
            return None
        scale = max(float((hi[ends] - lo[ends]).max(initial=0.0)), 1e-300)
        width = [float(hi[leaf] - lo[leaf]) for leaf in leaves]
        widest = int(np.argmax(width))
        if not np.isfinite(width[widest]) or width[widest] <= 1e-9 * scale:
            return None
        leaf = leaves[widest]
        middle = 0.5 * (lo[leaf] + hi[leaf])
        below, above = hi.copy(), lo.copy()
        below[leaf] = above[leaf] = middle
        return [(demand, lo, below), (demand, above, hi)]


def _least_margins(core: Core, rows: Array, conjuncts: Sequence[Conjunct]) -> tuple[Conjunct, ...]:
    """The conjuncts with the least margin at the best scene that was found: there they hold each other in balance."""
    values = evaluate(core, list(map(float, rows)))
    margins = [min(values[node] - low, high - values[node]) for node, low, high in conjuncts]
    least = min(margins)
    room = 0.02 * abs(least) + 1e-6
    return tuple(one for one, margin in zip(conjuncts, margins, strict=True) if margin <= least + room)
