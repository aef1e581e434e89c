"""The levels of a request for motions, found by one descent (adaptive multilevel splitting, Cerou and Guyader 2007)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenegen.motions.chains import Chains
from scenegen.motions.problem import GATES, Array, MotionProblem
from scenegen.motions.variables import poses_of
from scenegen.sampling.problem import Budget
from scenegen.sampling.splitting.chains import Region, which_cell

STREAM = 11  # random numbers of motions, separate from those of scenes
KEPT = 0.5
FEWEST, PIECES = 64, 4
AT_LEAST = 16  # chains, of motions so large that more would not fit
LEVELS, STALL = 400, 20
LEFT = 0.1  # correlation of a motion with its chain's earlier one at which they count as independent
LONGEST = 32  # rounds of moves until then, at most
LUCK = 2.5
ROUNDS = 24  # of weights that even out the cells


@dataclass(frozen=True, slots=True)
class Schedule:
    """Regions with the moves made in each; the first `levels` of them are factors of the probability. Then `settling`
    moves make the motions independent; `left` is the correlation that remains. `cells` get motions."""

    regions: tuple[Region, ...]
    levels: int
    moves: int
    settling: int
    left: float
    cells: tuple[int, ...]
    chains: int
    evaluations: int


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of pieces -1 and -2."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, STREAM, piece + 2])))


def statistics(problem: MotionProblem, chains: Chains) -> Array:
    """What is watched to see whether motions are independent: places and headings at a few moments, and scores,
    (S, P)."""
    poses = poses_of(problem, chains.now)[:, :, [0, problem.steps // 2, problem.steps]]
    turned = [np.cos(poses[:, 2]), np.sin(poses[:, 2])]
    parts = [part.reshape(-1, chains.count) for part in (poses[:, :2], *turned)]
    return np.concatenate([*parts, chains.scores[: len(problem.labels)]])


def make_schedule(problem: MotionProblem, budget: Budget) -> Schedule | None:
    """The schedule of a problem; None if its range is not reached. Raises StoppedError when time is up."""
    chains_of_piece = max(FEWEST, 4 * problem.cells.count, -(-problem.request.n // PIECES))
    chains_of_piece = problem.at_once(min(chains_of_piece, 4096), AT_LEAST)
    moves = 10 + problem.steps + len(problem.names)
    many = problem.at_once(max(512, chains_of_piece), AT_LEAST)
    chains = Chains.start(problem, many, generator(problem.request.seed, -1), budget)
    regions: list[Region] = []
    low, high = np.full(len(chains.scores), -np.inf), np.full(len(chains.scores), np.inf)
    held = low.copy()
    for gate in reversed(range(len(problem.labels), len(problem.labels) + len(GATES))):
        low = held.copy()
        low[gate] = 0.0
        if not _descend(chains, low, high, held, moves, regions):
            return None
        held = low
    if not _descend(chains, problem.cells.low, problem.cells.high, held, moves, regions):
        return None
    levels = len(regions)
    reached: tuple[int, ...] = (0,)
    if problem.cells.count > 1:
        reached = _even_out(chains, moves, regions)
    settling, left = _settling(problem, chains, moves)
    return Schedule(tuple(regions), levels, moves, settling, left, reached, chains_of_piece, chains.evaluations)


def _descend(chains: Chains, low: Array, high: Array, held: Array, moves: int, regions: list[Region]) -> bool:
    """Restrict the chains to scores from `low` to `high`, level by level; `held` are lower ends that always hold."""
    scale, history = _scales(chains.scores, low, high), list[float]()
    while len(history) < LEVELS:
        distance = _distance(chains.scores, low, high, scale)
        level = float(np.quantile(distance, KEPT, method="lower"))
        if not np.isfinite(level):
            level = float(distance[np.isfinite(distance)].max(initial=-1.0))
        if level < 0.0:
            return False
        if history and level >= history[-1]:  # most share one value
            below = distance[distance < level]
            level = float(below.max()) if len(below) >= 16 else level
        history.append(level)
        if len(history) > STALL and level > 0.99 * history[-1 - STALL]:
            return False
        slack = level * (1.0 + 1e-9) * scale
        region = Region(np.maximum(low - slack, held) if level else low.copy(), high + slack)
        chains.narrow(region)
        regions.append(region)
        chains.run(moves)
        if level == 0.0:
            return True
    return False


def _scales(scores: Array, low: Array, high: Array) -> Array:
    """The typical distance of each score from its range, which makes metres and radians comparable."""
    out = np.ones(len(scores))
    for row, values in enumerate(scores):
        off = np.maximum(low[row] - values, values - high[row])
        off = off[np.isfinite(off) & (off > 0.0)]
        if len(off):
            out[row] = np.median(off)
    return out


def _distance(scores: Array, low: Array, high: Array, scale: Array) -> Array:
    """How far (P,) motions are from the range, 0 within; infinite if a score is NaN."""
    with np.errstate(invalid="ignore"):
        below = np.where(np.isneginf(low)[:, None], -np.inf, low[:, None] - scores)
        above = np.where(np.isposinf(high)[:, None], -np.inf, scores - high[:, None])
    worst = (np.maximum(below, above) / scale[:, None]).max(axis=0)
    return np.where(np.isnan(scores).any(axis=0), np.inf, np.maximum(worst, 0.0))


def _even_out(chains: Chains, moves: int, regions: list[Region]) -> tuple[int, ...]:
    """Weights under which the chains visit all cells about equally often (Berg and Neuhaus 1992). Returns the cells
    that were visited; the others are closed."""
    cells, base = chains.problem.cells, chains.region
    log_weight, visited = np.zeros(cells.count), np.zeros(cells.count, dtype=bool)
    for done in range(ROUNDS):
        counts = np.zeros(cells.count)
        for _ in range(4):
            chains.run(moves // 2)
            counts += np.bincount(which_cell(list(chains.scores), cells), minlength=cells.count)
        visited |= counts > 0
        if done >= 6 and counts[visited].min() >= 0.4 * counts[visited].mean():
            break
        change = np.log(np.maximum(counts, 0.5) / counts[visited].mean())
        log_weight -= np.clip(change, -3.0, 3.0)
        chains.narrow(replace(base, weights=_weights(log_weight)))
        regions.append(chains.region)
    chains.narrow(replace(base, weights=np.where(visited, _weights(log_weight), 0.0)))
    regions.append(chains.region)
    return tuple(map(int, np.flatnonzero(visited)))


def _weights(log_weight: Array) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight.max(), -600.0, 0.0))
    return out


def _settling(problem: MotionProblem, chains: Chains, moves: int) -> tuple[int, float]:
    """How many moves make motions independent of where their chains were, and the mean correlation then."""
    before, left = statistics(problem, chains), 1.0
    noise = LUCK / np.sqrt(chains.count)  # the largest of some hundred correlations of independent motions
    spread = before.std(axis=1) > 1e-12
    rounds = 0
    while left > LEFT and rounds < LONGEST:
        rounds += 1
        chains.run(moves)
        after = statistics(problem, chains)
        kept = spread & (after.std(axis=1) > 1e-12)
        pairs = zip(before[kept], after[kept], strict=True)
        found = [float(np.corrcoef(one, two)[0, 1]) for one, two in pairs]
        left = max(found, default=0.0) - noise
    return 2 * rounds * moves, float(max(left, 0.0))
