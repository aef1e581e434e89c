"""How rare each value of phi is under the base distribution: P(phi >= t) and P(phi <= t) for every t at once.

Chains start as uniform scenes and are restricted level by level, up to the highest phi and, in a separate run, down to
the lowest; each level keeps about half (adaptive multilevel splitting, Cerou and Guyader 2007). The share that reaches
t from the level below it, times the shares of all levels before, estimates P(phi >= t). The requirement is satisfied
first, in the same way, so all probabilities are conditional on it.

The chains are divided into islands that never exchange chains (Whiteley, Lee and Heine 2016 discuss such particle
systems). Each island has its own estimate; the scatter of these gives a 95 % interval (see interval.py), which
includes the effect of copies of one ancestor. Effort is counted in node visits, never in seconds. numpy only: torch is
not loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Stop, StoppedError
from scenegen.lang.core import REQUIRE, Apply, Core, gated, part
from scenegen.lang.interpret import phi as evaluate
from scenegen.primitives import NUMPY
from scenegen.primitives.footprint import Circle
from scenegen.sampling.cells import Cells
from scenegen.sampling.interval import Estimate, ratio
from scenegen.sampling.splitting.chain_state import ChainState, Tape, make_frame
from scenegen.sampling.splitting.chains import Chains, Region
from scenegen.sampling.splitting.tuning import Tuner, longest
from scenegen.sampling.tails import (
    COUNTED,
    ISLANDS,
    KEPT,
    ROUNDS,
    OutOfReach,
    Rarity,
    Reach,
    Tail,
    climb,
    constant,
    margins,
    next_level,
    restrict,
)

Array = npt.NDArray[np.float64]

STREAM = 6  # random stream of these runs, apart from those of the samplers
MOST, FEWEST = 8192, 256  # chains of a run
DEPTH = 15  # levels that the effort of a run must cover if every level takes the maximum number of moves
WORK = 5_000_000_000  # node visits of the runs together, and of meeting the requirement: some 8 s each, rarely spent
PER_SHAPE = 60  # cost of a footprint with corners, in plain nodes; two of them in one node cost four times as much
CAREFUL = 4  # the same for the requirement: all runs start from there
SETTLE = 4  # more rounds once the requirement is met, before its chains start the runs


def measure(
    core: Core,
    lowest: Array,
    highest: Array,
    labels: Sequence[str],
    seed: int = 0,
    check: Callable[[], None] | None = None,
    work: int = WORK,
    stop: Stop = NEVER,
) -> Rarity | OutOfReach:
    """P(phi >= t) and P(phi <= t) of each of the labels, for poses uniform over the box lowest..highest (3N,),
    conditional on the core's requirement. The same arguments give the same numbers. `check` is called between levels:
    what it raises ends the run. `work` is the effort, in visits of nodes. Where
    `stop` raises StoppedError, runs end with what they have, and labels that were not begun are left out; it is raised
    again if there are none."""
    with np.errstate(all="ignore"):  # phi may overflow or be undefined somewhere: such scenes count as unreachable
        return _measure(gated(core), lowest, highest, labels, seed, check or _go_on, work, stop)


def _go_on() -> None:
    """The default for `check`: never stops."""


def _measure(
    core: Core,
    lowest: Array,
    highest: Array,
    labels: Sequence[str],
    seed: int,
    check: Callable[[], None],
    effort: int,
    stop: Stop,
) -> Rarity | OutOfReach:
    base: _Base | None = None
    required: Estimate | None = None
    spent = 0
    gate = (REQUIRE,) if REQUIRE in core.labels else ()
    count = _chains([part(core, (label, *gate)) for label in labels], lowest, highest, effort)
    if gate:
        base, best = _require(part(core, gate), lowest, highest, count, seed, check, effort, stop)
        spent = base.evaluations
        if not base.weights.any():
            return OutOfReach(best, spent)
        required = ratio(base.weights, np.ones(ISLANDS))
    reaches: dict[str, Reach] = {}
    for index, label in enumerate(labels):
        alone = part(core, (label,))
        if not make_frame(alone, lowest, highest).dimension:
            reaches[label] = constant(float(evaluate(alone, list(lowest), NUMPY)[label]))
            continue
        one = part(core, (label, *gate))
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, STREAM, 1 + index])))
        try:
            start, weights = _begin(make_frame(one, lowest, highest), base, count, rng, stop)
        except StoppedError:
            if not reaches:
                raise
            break
        work = effort // (2 * len(labels) * cost(one))
        up, down = (_climb(start.some(start.count), weights, sign, work, check, stop) for sign in (1, -1))
        reaches[label] = Reach(up[0], down[0], up[1] + down[1])
        spent += up[1] + down[1]
    return Rarity(reaches, required, spent)


def cost(core: Core) -> int:
    """About the cost of phi of one scene, in visits of plain nodes."""
    shapes = [node.shapes for node in core.nodes if isinstance(node, Apply)]
    cornered = [sum(not isinstance(shape, Circle) for shape in pair) for pair in shapes]
    return len(core.nodes) + PER_SHAPE * sum(many * many for many in cornered)


def _chains(cores: Sequence[Core], lowest: Array, highest: Array, effort: int) -> int:
    """How many chains the effort allows for these cores, a multiple of the islands."""
    fewest = MOST
    for core in cores:
        moves = ROUNDS * longest(max(1, make_frame(core, lowest, highest).dimension)) * DEPTH
        fewest = min(fewest, int(COUNTED * effort) // (2 * len(cores) * cost(core) * moves))
    return max(fewest, FEWEST) // ISLANDS * ISLANDS


@dataclass(frozen=True, slots=True)
class _Base:
    """Chains that satisfy the requirement: `rows` by their index in (3N, B) storage, and the islands' weights."""

    rows: dict[int, Array]
    weights: Array
    evaluations: int


def _require(
    core: Core,
    lowest: Array,
    highest: Array,
    count: int,
    seed: int,
    check: Callable[[], None],
    effort: int,
    stop: Stop,
) -> tuple[_Base, float]:
    """Chains at the base distribution conditioned on the requirement; weights 0 if it could not be satisfied."""
    chain_state = make_frame(core, lowest, highest)
    if not chain_state.dimension:
        least = float(evaluate(core, list(lowest), NUMPY)[REQUIRE])
        return _Base({}, np.full(ISLANDS, float(least >= 0.0)), 1), least
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, STREAM, 0])))
    state, weights = _begin(chain_state, None, count, rng, stop)
    tuner = Tuner(state)
    work = effort // cost(core)
    met = False
    while not met and state.evaluations < work:
        check()
        level = next_level(margins(state, 1), state.region.low[0], KEPT)
        if level is None:
            break
        met = level >= 0.0
        weights = weights * restrict(state, min(level, 0.0), 1)
        for _ in range(CAREFUL):
            tuner.adapt()
    for _ in range(SETTLE if met else 0):
        tuner.adapt()
    best = float(margins(state, 1).max())
    rows = dict(zip(chain_state.rows, state.rows, strict=True))
    return _Base(rows, weights if met else np.zeros(ISLANDS), state.evaluations), best


def _begin(
    chain_state: ChainState, base: _Base | None, count: int, rng: np.random.Generator, stop: Stop
) -> tuple[Chains, Array]:
    """`count` chains of a chain_state at the base distribution, and the weights of their islands."""
    cells = Cells(tuple(chain_state.core.labels), (), (), np.empty(0), np.empty(0))
    state = Chains.start(chain_state, Tape(chain_state, stop=stop), cells, count, rng)
    if base is None:
        return state, np.ones(ISLANDS)
    state.rows = [base.rows.get(row, fresh) for row, fresh in zip(chain_state.rows, state.rows, strict=True)]
    state.pool = list(state.rows)
    state.phi = state.tape(state.rows)
    state.region = Region(np.array([-np.inf, 0.0]), np.full(2, np.inf))
    return state, base.weights


def _climb(
    state: Chains, weights: Array, sign: int, work: int, check: Callable[[], None], stop: Stop
) -> tuple[Tail, int]:
    return climb(state, Tuner(state).adapt, weights, sign, work, check, stop=stop)
