"""Branch and prune: a disjoint cover of the scenes that meet a demand, each part with a way to draw from it.

The demand is split into alternatives (see contract.py), boxes are contracted, and what is left of each alternative
gets a proposal. A short pilot draw from each shows where volume is wasted; the worst is split or covered more finely,
until half of what is drawn is expected to be kept, or until nothing helps any more.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from scenegen.arrays import Array, Bool
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import Core, Junction
from scenegen.lang.formula.interpret import evaluate
from scenegen.search.contract import SWEEPS, Bounds, alternatives, contract, contract_box, push_down, start
from scenegen.search.effort import PYTHON_WORK, Effort, scoring_work
from scenegen.search.grid import Grids, Open, open_nodes
from scenegen.search.proposal import Proposal, propose
from scenegen.search.tape import Tape, make_tape, weight

if TYPE_CHECKING:
    from scenegen.search.surfaces import Stand

MAX_PARTS = 256  # alternatives of a cover at most
PILOT_SCENES = 1024  # scenes drawn from a part to see what is wasted
PILOT_NUMBERS = 1 << 20  # numbers of one pilot at most: specs of thousands of atoms get smaller ones
GOOD_ACCEPTANCE = 0.5  # share of the drawn scenes that are kept from which on a cover is good enough
STEP_WORK = 1e7  # work that the next step towards a better cover takes, about: 0.1 s
MIN_COVER_WORK = 1.5e7  # work of a cover, a quarter of a second, from which on a worse one may be good enough
SPLIT_FAILURES = 0.25  # an open junction that fails this often is worth a split
# demands that these shares of the scenes meet by themselves are left out of the grids, in turn
LOOSE_SHARES = (0.7, 0.97)
COARSE_BOXES, FINE_BOXES = 128, 2048  # boxes of a grid, first and when it is worth more
SWEEP_ONLY_NODES = 20_000  # nodes of a tape from which on one sweep must do


@dataclass(frozen=True, slots=True)
class GoodEnough:
    """When to stop improving a cover of which less than GOOD_ACCEPTANCE is kept: after the work `most`; or after
    `least`, once drawing the scenes takes no more work than was spent, or than one more step takes, STEP_WORK.
    `drawing` is the work of the scenes if all that is drawn were kept; with 0 any cover will do."""

    drawing: float
    least: float
    most: float = math.inf

    def holds(self, acceptance: float, used: float) -> bool:
        """Whether a cover of which so much is kept, after so much work, will do."""
        return used >= self.most or (used >= self.least and self.drawing <= acceptance * max(used, STEP_WORK))


Apart = tuple[tuple[int, float, float], ...]
"""Formula nodes (of the core) and the ends that tell the scenes of an alternative from the others'."""

Entry = tuple[Mapping[int, Bounds], Apart]
"""An alternative before anything is known of it: its demand, and what sets it apart."""


@dataclass(slots=True)
class Part:
    """One alternative."""

    apart: Apart
    demand: Mapping[int, Bounds]
    lo: Array
    hi: Array
    pending: Sequence[Open] = ()
    proposal: Proposal | None = None
    acceptance: float = 0.0
    fails: Mapping[int, float] = field(default_factory=dict)
    final: bool = False

    def owns(self, values: Sequence[Array], span: slice) -> Bool | None:
        """Which of the scenes whose node values are given belong to this part, (B,) or () where that is the same for
        all; None for all."""
        mine: Bool | None = None
        for node, low, high in self.apart:
            value = values[node]
            value = value[span] if np.ndim(value) else value  # an alternative may be the same for all scenes
            held = (value >= low) & (value <= high)
            mine = held if mine is None else mine & held
        return mine


@dataclass(frozen=True, slots=True)
class Cover:
    """Disjoint parts that hold every scene meeting a demand; none: it is proved that there is no such scene.

    `log_share` is the natural logarithm of their volume over the volume of the whole box, `weights` their shares of it.
    """

    parts: tuple[Part, ...]
    weights: Array
    log_share: float

    @property
    def acceptance(self) -> float:
        """The share of drawn scenes that the pilots kept."""
        return float(sum(weight * part.acceptance for weight, part in zip(self.weights, self.parts, strict=True)))

    def draw(self, out: Array, rng: np.random.Generator) -> tuple[Bool, list[slice]]:
        """Fill `out` (3N, m) with scenes uniform over the proposals; returns which lie in their box, and where the
        scenes of each part are."""
        counts = rng.multinomial(out.shape[1], self.weights)
        usable = np.ones(out.shape[1], dtype=bool)
        spans = []
        begin = 0
        for part, count in zip(self.parts, map(int, counts), strict=True):
            span = slice(begin, begin + count)
            spans.append(span)
            begin += count
            if count and part.proposal is not None:
                inside = part.proposal.draw(out[:, span], rng)
                if inside is not None:
                    usable[span] = inside
        return usable, spans


def prune(
    core: Core,
    lowest: Array,
    highest: Array,
    wanted: Mapping[int, Bounds],
    seed: Sequence[int] = (0,),
    tape: Tape | None = None,
    effort: Effort | None = None,
    enough: GoodEnough | None = None,
    stands: Collection[Stand] = (),
) -> Cover:
    """The cover of the scenes in the box lowest..highest (3N,) at which every wanted formula node lies within its ends.

    `enough` says when one will do of which less than GOOD_ACCEPTANCE is kept. `stands` are drawn on their surfaces;
    that they are on them must be part of what is wanted.

    Deterministic: `seed` starts the pilots' random numbers, which decide about effort, never about what is covered.
    Raises what `effort` raises: half a cover is none.
    """
    effort = Effort() if effort is None else effort
    tape = make_tape(core, lowest, highest, effort) if tape is None else tape
    rng = np.random.default_rng(np.random.SeedSequence(list(seed)))
    search = _Search(core, tape, lowest, highest, wanted, rng, effort, stands, enough)
    begun = effort.used
    parts = search.open_up([(push_down(core, wanted), ())])
    while parts:
        weights = _weights(parts)
        expected = sum(weight * part.acceptance for weight, part in zip(weights, parts, strict=True))
        if expected >= GOOD_ACCEPTANCE or (enough and enough.holds(expected, effort.used - begun)):
            break
        waste = [
            weight * (1.0 - part.acceptance) * (not part.final) for weight, part in zip(weights, parts, strict=True)
        ]
        worst = int(np.argmax(waste))
        if waste[worst] <= 0.01:
            break
        part = parts.pop(worst)
        parts[worst:worst] = search.improve(part, MAX_PARTS - len(parts))
    return _whole(parts, lowest, highest)


def box_cover(
    core: Core,
    lowest: Array,
    highest: Array,
    wanted: Mapping[int, Bounds],
    seed: Sequence[int],
    tape: Tape,
    effort: Effort,
    stands: Collection[Stand] = (),
) -> Cover:
    """A cover as `prune` makes it, of one part: the box that contraction leaves, neither split nor coupled."""
    rng = np.random.default_rng(np.random.SeedSequence(list(seed)))
    search = _Search(core, tape, lowest, highest, wanted, rng, effort, stands)
    parts = search.open_up([(push_down(core, wanted), ())], couple=False)
    return _whole(parts, lowest, highest)


def _whole(parts: Sequence[Part], lowest: Array, highest: Array) -> Cover:
    log_base = float(np.log((highest - lowest)[highest > lowest]).sum())
    if not parts:
        return Cover((), np.empty(0), -math.inf)
    logs = np.array([part.proposal.log_volume for part in parts if part.proposal is not None])
    top = float(logs.max())
    return Cover(tuple(parts), _weights(parts), top + math.log(np.exp(logs - top).sum()) - log_base)


def _weights(parts: Sequence[Part]) -> Array:
    logs = np.array([part.proposal.log_volume for part in parts if part.proposal is not None])
    volumes: Array = np.exp(logs - logs.max())
    volumes /= volumes.sum()
    return volumes


@dataclass(frozen=True, slots=True)
class _Search:
    core: Core
    tape: Tape
    lowest: Array
    highest: Array
    wanted: Mapping[int, Bounds]
    rng: np.random.Generator
    effort: Effort
    stands: Collection[Stand] = ()
    enough: GoodEnough | None = None
    grids: Grids = field(default_factory=Grids)

    def open_up(self, entries: Sequence[Entry], *, couple: bool = True) -> list[Part]:
        """Parts for demands, contracted together; those proved empty are left out."""
        if not entries:
            return []
        found = []
        for (demand, apart), lo, hi in self._contract(entries):
            part = Part(apart, demand, lo, hi)
            part.pending = open_nodes(self.tape, demand, part.lo, part.hi, self.effort)
            if self._equip(part, COARSE_BOXES, couple):
                found.append(part)
        return found

    def _contract(self, entries: Sequence[Entry]) -> list[tuple[Entry, Array, Array]]:
        """Those that are not proved empty, and what is left of the intervals of all nodes, (T,)."""
        rounds = 1 if len(self.tape.nodes) > SWEEP_ONLY_NODES else SWEEPS
        if len(entries) == 1:
            box = contract_box(self.tape, self.lowest, self.highest, entries[0][0], self.effort, rounds)
            return [(entries[0], box.lo.copy(), box.hi.copy())] if box.alive else []
        columns = (len(self.lowest), len(entries))
        boxes = (np.broadcast_to(ends[:, None], columns) for ends in (self.lowest, self.highest))
        low, high = start(self.tape, [demand for demand, _ in entries], *boxes)
        kept = contract(self.tape.nodes, low, high, rounds, batches=self.tape.batches, effort=self.effort)
        return [(entries[at], low[:, at].copy(), high[:, at].copy()) for at in map(int, np.flatnonzero(kept))]

    def improve(self, part: Part, room: int) -> list[Part]:
        """What to put in the place of a part that wastes too much."""
        failing = [
            (share, node)
            for node, share in part.fails.items()
            if share >= SPLIT_FAILURES and len(_args(self.core, node)) <= room and node in part.demand
        ]
        if failing:
            _, node = max(failing)
            split = []
            for demand, apart in alternatives(self.core, part.demand, node):
                self.effort.spend(PYTHON_WORK * (1 + len(demand)))
                split.append((demand, (*part.apart, *((key, *ends) for key, ends in apart.items()))))
            return self.open_up(split)
        part.final = True
        if part.proposal is not None and part.proposal.grids:
            return [part] if self._equip(part, FINE_BOXES) else []
        return [part]

    def _equip(self, part: Part, budget: int, couple: bool = True) -> bool:
        """Give a part the proposal with the least volume; unless `couple`, the box that is left of it. False where a
        cover proves the part empty."""
        atoms = [one for one in part.pending if not isinstance(self.core.nodes[one.core], Junction)]
        # What all things take part in would tie them all, and no grid covers so many.
        atoms = [one for one in atoms if one.node not in self.tape.crowded]
        best = self._proposal(part, (), False, 1)
        if best is None:
            return False
        met = self._pilot(part, best)
        coupling: set[int] = set()
        # A demand that fails often may be tied to others that do not: these come in the second time.
        for loose in LOOSE_SHARES if couple else ():
            more = {one.core for one in atoms if one.node not in self.tape.affine and met[one.core] < loose} - coupling
            if part.acceptance >= GOOD_ACCEPTANCE or (self.enough and self.enough.holds(part.acceptance, 0.0)):
                break  # a part that will do is not coupled further
            if not more:
                continue
            coupling |= more
            tied = any(node in self.tape.differences for one in atoms if one.core in coupling for node in one.support)
            before = best
            for relative in (True, False) if tied else (False,):
                proposal = self._proposal(part, coupling, relative, budget)
                if proposal is None:
                    return False
                if proposal.log_volume < best.log_volume - 0.01:
                    best = proposal
            if best is not before:
                met = self._pilot(part, best)
        return True

    def _proposal(self, part: Part, coupling: Collection[int], relative: bool, budget: int) -> Proposal | None:
        return propose(
            self.tape,
            self.lowest,
            self.highest,
            part.lo,
            part.hi,
            part.pending,
            coupling,
            relative,
            budget,
            self.effort,
            self.grids,
            self.stands,
        )

    def _pilot(self, part: Part, proposal: Proposal) -> dict[int, float]:
        """Draw a few scenes and note which share is kept; returns the share that meets each open demand."""
        count = max(64, min(PILOT_SCENES, PILOT_NUMBERS // len(self.core.nodes)))
        self.effort.spend(scoring_work(self.core.nodes, count))
        rows = np.empty((len(self.lowest), count))
        inside = proposal.draw(rows, self.rng)
        values = [np.broadcast_to(value, count) for value in evaluate(self.core, list(rows), NUMPY, self.effort.check)]
        usable = np.ones(count, dtype=bool) if inside is None else inside
        kept = usable.copy()
        for node, (low, high) in self.wanted.items():
            kept &= (values[node] >= low) & (values[node] <= high)
        mine = part.owns(values, slice(None))
        part.proposal = proposal
        part.acceptance = float((kept if mine is None else kept & mine).mean())
        met = {}
        total = max(1, int(usable.sum()))
        for one in part.pending:
            value = values[one.core]
            met[one.core] = int((usable & (value >= one.low) & (value <= one.high)).sum()) / total
        part.fails = {
            one.core: 1.0 - met[one.core] for one in part.pending if isinstance(self.core.nodes[one.core], Junction)
        }
        return met


def _args(core: Core, index: int) -> tuple[int, ...]:
    node = core.nodes[index]
    return node.args if isinstance(node, Junction) else ()


PRUNE_ROUND_SCENES = 1024  # of one round of the search
KEPT_SCENES = 32
MAX_SEARCH_ROUNDS = 40
FIRST_SCENES = 128  # scenes that are looked at before anything else
# tape nodes that contraction may visit; the search may visit as many, SEARCHES_PER_CONTRACTION times
SEARCH_VISITS = 30_000
SEARCHES_PER_CONTRACTION = 15
STEP_SHRINK = 0.85  # of the step from round to round
MAX_SEARCH_NODES = 20_000  # nodes from which on there is no search


@dataclass(frozen=True, slots=True)
class Reachability:
    """Whether a demand can be met: "yes" with a `witness` (3N,), "no" as bounds prove, or "unknown". `best` is the
    least margin of the best scene that was looked at, and `nearest` (3N,) is that scene. `short`: the effort allowed
    ended the search before its last round."""

    verdict: Literal["yes", "no", "unknown"]
    witness: Array | None = None
    best: float = -np.inf
    nearest: Array | None = None
    short: bool = False


def find_witness(
    core: Core,
    lowest: Array,
    highest: Array,
    wanted: Mapping[int, Bounds],
    *,
    work: int = SEARCH_VISITS,
    effort: Effort | None = None,
) -> Reachability:
    """Whether all wanted formula nodes can lie within their ends at once, in the box lowest..highest (3N,).

    A few uniform scenes first; then contraction; then uniform scenes of the contracted box, the best of which are moved
    by ever smaller steps. The random numbers are always the same. `work` bounds the effort, in visits of nodes.
    Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    rng = np.random.default_rng(0)
    easy, margins = _best(
        core, wanted, effort, lowest[:, None] + (highest - lowest)[:, None] * rng.random((len(lowest), FIRST_SCENES))
    )
    if margins[0] >= 0.0:
        return Reachability("yes", easy[:, 0], float(margins[0]), easy[:, 0])
    if weight(core.nodes) > 2 * work or len(core.nodes) > MAX_SEARCH_NODES:
        return Reachability("unknown", None, float(margins[0]), easy[:, 0], True)
    tape = make_tape(core, lowest, highest, effort)
    lo, hi = start(tape, [push_down(core, wanted)], lowest[:, None], highest[:, None])
    rounds = max(1, min(4, work // weight(tape.nodes)))
    if not contract(tape.nodes, lo, hi, rounds, batches=tape.batches, effort=effort)[0]:
        return Reachability("no", None, float(margins[0]), easy[:, 0])
    low, high = lowest.copy(), highest.copy()
    for row, at in tape.rows.items():
        low[row], high[row] = max(low[row], lo[at, 0]), min(high[row], hi[at, 0])
    free = np.flatnonzero(high > low)
    count = max(KEPT_SCENES, min(PRUNE_ROUND_SCENES, PILOT_NUMBERS // len(core.nodes)))
    rows = low[:, None] + (high - low)[:, None] * rng.random((len(low), count))
    best, margins = _best(core, wanted, effort, rows)
    step = 0.3
    rounds = SEARCHES_PER_CONTRACTION * work // weight(core.nodes)
    for _ in range(min(MAX_SEARCH_ROUNDS, rounds)):
        if margins[0] >= 0.0 or not len(free):
            break
        step *= STEP_SHRINK
        rows = np.repeat(best, max(1, count // best.shape[1]), axis=1)
        moved = rng.random((len(free), rows.shape[1])) < np.maximum(2.0 / len(free), 0.3)
        rows[free] += np.where(moved, step * (high - low)[free, None] * rng.standard_normal(moved.shape), 0.0)
        np.clip(rows, low[:, None], high[:, None], out=rows)
        best, margins = _best(core, wanted, effort, np.concatenate([best, rows], axis=1))
    found = best[:, 0]
    if margins[0] >= 0.0:
        return Reachability("yes", found, float(margins[0]), found)
    return Reachability("unknown", None, float(margins[0]), found, rounds < MAX_SEARCH_ROUNDS)


def _best(core: Core, wanted: Mapping[int, Bounds], effort: Effort, rows: Array) -> tuple[Array, Array]:
    """The scenes with the largest least margin, best first, and their margins."""
    effort.spend(scoring_work(core.nodes, rows.shape[1]))
    values = evaluate(core, list(rows), NUMPY, effort.check)
    margin = np.full(rows.shape[1], np.inf)
    for node, (low, high) in wanted.items():
        np.minimum(margin, np.minimum(values[node] - low, high - values[node]), out=margin)
    margin = np.where(np.isnan(margin), -np.inf, margin)
    order = np.argsort(-margin, kind="stable")[:KEPT_SCENES]
    return rows[:, order], margin[order]
