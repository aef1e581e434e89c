"""Each change alone keeps the distribution that it is made in: motions drawn by rejection, and changed many times, are
as if drawn by rejection. What chains are told about motions agrees with full scores: whether they stay in a region,
and phi if they do.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ks_2samp

import scenegen
from scenegen.lang.formula.timed import Numpy, over_time
from scenegen.sampling.motions import groups
from scenegen.sampling.motions.moves import RELOCATIONS, changes
from scenegen.sampling.motions.problem import Variables, draw, poses_of
from scenegen.sampling.motions.schedule import MotionChains, statistics
from scenegen.sampling.motions.scores import make_lean_scores, make_motion_problem, moments_needed
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.splitting.levels import Region

from .problems import apart, held, meets, problem

COUNT, TIMES = 4000, 30
LEAST_P = 1e-4  # of some hundred statistics, after Bonferroni


def uneven(poses):
    """Near at first: a label that ends and positions share."""
    return meets(poses[:, :, :2])


PRIOR = """object a, b, c, d
time 4 steps
usually a, d ~ normal((0.3, 0.6), 12 cm)
usually theta(a) ~ normal(NORTH, 40 deg)
usually b ~ normal(a, 15 cm)
usually c ~ [normal((0.8, 0.2), 10 cm): 2, normal((0.3, 0.3), 20 cm): 1]
require forall o in objects: speed(o) <= 30 cm/s & spin(o) <= 30 deg/s
task: (initially closeTo(a, c, 50 cm)) & finally farFrom(b, d, 10 cm)
"""


def problems():
    made = {
        moves: problem(uneven, {"a": (-0.3, 0.05)}, objects=3, steps=4, radius=0.3, moves=moves, required=apart)
        for moves in ("one", "all")
    }
    prior = make_motion_problem(
        scenegen.parse(PRIOR).definition, SampleRequest({"task": Range(-0.3, 0.1)}, n=1, spread="base")
    )
    crowd = problem(uneven, {"a": (-0.5, 0.15)}, objects=5, steps=1, radius=0.05)
    return made | {"held": held(made["one"], 2), "crowd": crowd, "prior": prior}


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
        monkeypatch.setattr(groups, "wrap_inside", always)
        chains.region = replace(chains.region, low=np.where(np.arange(3) == 2, -np.inf, chains.region.low))
    elif wrong == "legal":
        monkeypatch.setattr(groups, "is_legal", lambda unit: always(None, unit))
    else:
        monkeypatch.setattr(groups.ObjectGroup, "stays", always)
    kinds = changes(chains.problem)
    chains.run(30, np.array([float("relocate" in name_of(kind)) / len(RELOCATIONS) for kind in kinds]))
    assert differs(chains, other) <= LEAST_P


HEAD = "object mug, plate, block[3]\ntime 8 steps\n{moves}require forall a in objects: speed(a) <= 20 cm/s\n"

SPECS = {
    "ends": HEAD.format(moves="moves all\n")
    + "task: (initially leftOf(mug, plate)) & (finally closeTo(mug, plate)) & (next farFrom(mug, block[1]))",
    "crowd": HEAD.format(moves="") + "require noOverlap()\ntask: closeTo(mug, plate) until[2, 5] leftOf(mug, block[2])",
    "steps": HEAD.format(moves="")
    + "require noOverlap() & (finally leftOf(mug, plate))\nrequire spin(mug) <= 40 deg/s\n"
    + "task: eventually[3, 6] speed(mug) <= 5 cm/s\nother: always (still(plate) | farFrom(mug, plate))",
    "headings": HEAD.format(moves="")
    + "require spin(mug) <= 40 deg/s\ntask: always[2, 4] (theta(mug) <= 200 deg) & eventually next angle(mug, NORTH)",
    "untils": HEAD.format(moves="moves all\n")
    + "require always[0, 3] farFrom(mug, plate, 5 cm)\n"
    + "task: !(closeTo(mug, plate) until_with[1, 3] next leftOf(mug, plate))",
}  # fmt: skip


def scored(text, count=400):
    spec = scenegen.parse(text)
    problem = make_motion_problem(spec.definition, SampleRequest({spec.labels[0]: Range(-9.0, None)}, n=10))
    poses = poses_of(problem, draw(problem, count, np.random.default_rng(0)))
    with np.errstate(all="ignore"):
        return problem, poses, problem.scores(poses)


@pytest.mark.parametrize("name", SPECS)
def test_judged_motions_have_their_scores(name):
    problem, poses, full = scored(SPECS[name])
    low, high = np.full(len(full), -np.inf), np.full(len(full), np.inf)
    with np.errstate(all="ignore"):
        held, found = problem.judge(poses, low, high)
        broken = full[-2] < 0.0
        assert held.all() and np.array_equal(found[:-2], full[:-2]) and np.array_equal(found[-1], full[-1])
        assert np.array_equal(found[-2] < 0.0, broken) and np.array_equal(found[-2, broken], full[-2, broken])
        low[-2], low[0], high[0] = 0.0, *np.quantile(full[0], (0.2, 0.9))
        low[-1] = np.median(full[-1])
        held, found = problem.judge(poses, low, high)
        wanted = ((full >= low[:, None]) & (full <= high[:, None])).all(axis=0)
        assert np.array_equal(held, wanted) and np.array_equal(found[:-2, held], full[:-2, held])
        assert not problem.judge(poses, low + np.inf, high)[0].any()


@pytest.mark.parametrize("name", SPECS)
def test_other_moments_do_not_matter(name):
    """Whatever a signal is at moments at which it is not needed, labels and requirement are the same."""
    problem, _, _ = scored(SPECS[name], 1)
    timed, rng = problem.score.timed, np.random.default_rng(1)
    needed = np.array(moments_needed(timed, labels=True, requirement=True))
    moments = timed.horizon.moments

    def values(signals):
        nodes = over_time(Numpy(), timed, list(signals), lambda value: np.full(moments, value))
        required = [] if timed.requirement is None else [nodes[timed.requirement].min()]
        return [nodes[node][0] for node in timed.labels.values()] + required

    for _ in range(50):
        one, other = rng.standard_normal((2, *needed.shape))
        assert values(one) == values(np.where(needed, one, other))


def test_ends_are_computed_at_ends_and_bounds_of_steps_not_at_all():
    found = make_lean_scores(scored(SPECS["ends"], 1)[0].score.timed)
    assert sorted(tuple(part.moments) for part in found.labels.parts) == [(0,), (1,), (8,)]
    assert found.requirement is None
