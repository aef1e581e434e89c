"""Each change alone keeps the distribution that it is made in: motions drawn by rejection, and changed many times, are
as if drawn by rejection."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ks_2samp

from scenegen.sampling.motions import groups
from scenegen.sampling.motions.moves import WAYS, changes
from scenegen.sampling.motions.problem import Variables, draw, poses_of
from scenegen.sampling.motions.schedule import MotionChains, statistics
from scenegen.sampling.splitting.levels import Region

from .problems import apart, held, meets, problem

COUNT, TIMES = 4000, 30
LEAST_P = 1e-4  # of some hundred statistics, after Bonferroni


def uneven(poses):
    """Near at first: a label that ends and positions share."""
    return meets(poses[:, :, :2])


def problems():
    made = {
        moves: problem(uneven, {"a": (-0.3, 0.05)}, objects=3, steps=4, radius=0.3, moves=moves, required=apart)
        for moves in ("one", "all")
    }
    crowd = problem(uneven, {"a": (-0.5, 0.15)}, objects=5, steps=1, radius=0.05)
    return made | {"held": held(made["one"], 2), "crowd": crowd}


def inside(made):
    cells = made.cells
    return Region(cells.low, cells.high)


def by_rejection(made, count, seed):
    """Chains in the region, drawn by plain rejection."""
    rng, region = np.random.default_rng(seed), inside(made)
    parts, found = list[Variables](), 0
    while found < count:
        some = draw(made, 50_000, rng)
        good = np.flatnonzero(region.holds(list(made.scores(poses_of(made, some)))))
        parts.append(some.take(good))
        found += len(good)
    chains = MotionChains.start(made, count, rng)
    all_ = (np.concatenate([getattr(one, name) for one in parts], axis=-1) for name in ("first", "mover", "unit"))
    chains.now = Variables(*all_).take(np.arange(count))
    chains.scores, chains.region = made.scores(poses_of(made, chains.now)), region
    return chains


def watched(chains):
    """Statistics, with sums that the changes could shift: the lengths of steps, and who moves first."""
    now = chains.now
    lengths = np.hypot(now.unit[:, :, 0], now.unit[:, :, 1]).reshape(-1, now.count)
    rows = statistics(chains.problem, now, poses_of(chains.problem, now), chains.scores)
    return np.concatenate([rows, lengths, now.mover[:1].astype(float)])


def differs(one, two):
    """The least p of the statistics that vary, corrected for their number."""
    rows = [(a, b) for a, b in zip(watched(one), watched(two), strict=True) if np.ptp(a) > 1e-9]
    return min(ks_2samp(a, b, method="asymp").pvalue for a, b in rows) * len(rows)


def name_of(change):
    return getattr(change, "__name__", None) or f"{change.func.__name__} " + "/".join(change.keywords.values())


CASES = [(name, name_of(change)) for name, made in problems().items() for change in changes(made)]
CASES = [case for case in CASES if case not in (("crowd", "transfer"), ("crowd", "redraw_pairs"))]  # of two steps


@pytest.fixture(scope="module")
def drawn():
    return {name: (by_rejection(made, COUNT, 1), by_rejection(made, COUNT, 2)) for name, made in problems().items()}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "change"), CASES)
def test_each_change_keeps_the_distribution(name, change, drawn):
    start, other = drawn[name]
    chains = start.copy()
    kinds = changes(chains.problem)
    only = np.array([float(name_of(kind) == change) for kind in kinds])
    taken = chains.run(TIMES, only)
    assert taken > 0.001, "the change is never made"
    assert differs(chains, other) > LEAST_P


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["stays", "at_home", "legal"])
def test_a_change_without_its_conditions_is_found_out(wrong, drawn, monkeypatch):
    start, other = drawn["crowd"]
    chains = start.copy()

    def always(of, by):
        return np.ones(by.shape[-1], dtype=bool)

    if wrong == "at_home":
        monkeypatch.setattr(groups, "at_home", always)
        chains.region = replace(chains.region, low=np.where(np.arange(3) == 2, -np.inf, chains.region.low))
    elif wrong == "legal":
        monkeypatch.setattr(groups, "legal", lambda unit: always(None, unit))
    else:
        monkeypatch.setattr(groups.ObjectGroup, "stays", always)
    kinds = changes(chains.problem)
    chains.run(30, np.array([float("relocate" in name_of(kind)) / len(WAYS) for kind in kinds]))
    assert differs(chains, other) <= LEAST_P
