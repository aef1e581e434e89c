"""Sampled motions follow the base distribution conditioned on limits, requirement and range. How rare a phi is among
motions: against the shares of plain draws.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import scenegen
from experiments.metrics import energy_test, ks_screen
from scenegen.errors import RequestError
from scenegen.pose import as_rows
from scenegen.sampling.motions import rarity
from scenegen.sampling.motions.problem import MotionProblem, Variables, draw, poses_of, unit_steps
from scenegen.sampling.motions.sampler import MotionSplitting, make_plan, pilot, sample
from scenegen.sampling.motions.schedule import MotionChains
from scenegen.sampling.motions.scores import make_motion_problem
from scenegen.sampling.plan import Tally
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.splitting.levels import Schedule
from scenegen.search.effort import Budget

from .problems import all_problems, apart, ends_right, held, meets, problem

N = 2000
LEAST_P = 0.01 / 12  # six problems, two tests each


def rows(poses):
    return as_rows(poses.reshape(len(poses), -1, 3))


def alike(truth, made, seed=0):
    """p of the energy test and of the screen, the smaller one."""
    first, second = rows(truth), rows(made)
    energy = energy_test(first, second, np.random.default_rng(seed), permutations=1999, most=N)
    return min(energy.p, ks_screen(first, second).corrected)


def another(made: MotionProblem, seed):
    return replace(made, request=replace(made.request, seed=seed, n=N))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(all_problems(1)))
def test_splitting_agrees_with_rejection(name):
    made = all_problems(N)[name]
    truth = sample(another(made, 1), Budget(300.0), method="rejection")
    found = sample(another(made, 2), Budget(300.0), method="splitting")
    assert truth.complete and found.complete
    assert alike(truth.poses, found.poses) > LEAST_P
    gap = abs(truth.info["log10_probability"] - found.info["log10_probability"])
    assert gap < 2 * np.hypot(truth.info["log10_error"], found.info["log10_error"])


def sequential(made, count, rng):
    """A wrong sampler: each step is drawn until it stays inside, as if the future did not matter."""
    now = draw(made, count, rng)
    for step in range(made.steps):
        while True:
            short = replace(made, steps=step + 1)
            poses = poses_of(short, Variables(now.first, now.mover[: step + 1], now.unit[: step + 1]))
            bad = np.flatnonzero(short.room(poses) < 0.0)
            if not len(bad):
                break
            now.unit[step][..., bad] = unit_steps(rng, now.unit.shape[1], len(bad))
    return poses_of(made, now).transpose(3, 2, 0, 1)


@pytest.mark.slow
def test_a_sequential_sampler_is_found_out():
    made = problem(meets, {"a": (None, 10.0)}, n=N, steps=6, radius=0.5)
    truth = sample(made, method="rejection")
    wrong = sequential(made, N, np.random.default_rng(3))
    assert alike(truth.poses, wrong) <= LEAST_P


@pytest.mark.parametrize("moves", ["one", "all"])
def test_changes_keep_the_base_distribution(moves):
    """Without a region chains follow the base distribution: movers, radii and angles stay uniform."""
    made = problem(meets, {"a": (None, None)}, objects=3, moves=moves)
    chains = MotionChains.start(made, 2000, np.random.default_rng(5))
    chains.run(60)
    far = np.hypot(chains.now.unit[..., 0, :], chains.now.unit[..., 1, :])
    free = chains.problem.room(poses_of(made, chains.now)) > -np.inf
    assert free.all() and far.max() <= 1.0
    assert abs((far**2).mean() - 0.5) < 0.02 and abs(chains.now.unit[..., 2, :].mean()) < 0.02
    assert np.ptp(chains.now.first[:, 0]) <= 0.8
    if moves == "one":
        assert np.abs(np.bincount(chains.now.mover.ravel()) / chains.now.mover.size - 1 / 3).max() < 0.02


def test_motions_meet_the_request_and_take_legal_steps():
    made = problem(ends_right, {"a": (0.0, 0.1)}, required=apart, n=200)
    found = sample(made)
    assert found.complete and found.poses.shape == (200, 5, 2, 3) and found.info["method"] == "rejection"
    assert ((found.phi >= 0.0) & (found.phi <= 0.1)).all() and (apart(found.poses.transpose(2, 3, 1, 0)) >= 0.0).all()
    step = np.hypot(*np.moveaxis(np.diff(found.poses[..., :2], axis=1), -1, 0))
    assert step.max() <= 0.15 + 1e-12 and ((step > 0.0).sum(axis=2) <= 1).all()
    moved = step.argmax(axis=2)
    assert (moved == found.movers).all()


@pytest.mark.long
def test_splitting_gives_equal_bytes_and_a_flat_spread():
    made = problem(ends_right, {"a": (-0.05, 0.05)}, n=256, spread="flat", steps=2)
    one, two = (sample(made, method="splitting") for _ in range(2))
    assert one.poses.tobytes() == two.poses.tobytes() and one.info["method"] == "splitting"
    reached = one.info["cells"]["reached"]
    shares = np.bincount(made.cells.find(made.scores(one.poses.transpose(2, 3, 1, 0))), minlength=32)
    assert one.complete and shares.max() - shares[shares > 0].min() <= 1 and (shares > 0).sum() == reached


def test_held_objects_stay():
    made = held(problem(meets, {"a": (0.0, None)}, n=100, steps=3), 1)
    found = sample(made)
    assert not found.poses[:, :, 1].any() and (found.movers == 0).all()


@pytest.mark.long
def test_a_range_that_no_motion_has_ends_without_motions():
    made = problem(meets, {"a": (0.16, None)}, n=10, steps=1)  # phi is at most 0.15
    with pytest.raises(RequestError, match="found 0 of 10 motions: the search did not reach the range"):
        sample(made, Budget(20.0))


@pytest.mark.long
def test_workers_change_nothing():
    made = problem(ends_right, {"a": (0.0, None)}, n=300, steps=2)
    apart_ = replace(made, request=replace(made.request, workers=2))
    assert sample(made).poses.tobytes() == sample(apart_).poses.tobytes()


@pytest.mark.long
def test_the_pilot_counts_the_same_hits_by_one_process_and_two():
    made = problem(ends_right, {"a": (0.0, None)}, n=300, steps=2)
    both = replace(made, request=replace(made.request, workers=2))
    plan = make_plan(made, Budget(300.0), "rejection")
    assert len(plan.draw(0).facts) == plan.fact_count
    (hits, drawn), (same, also) = (pilot(one, Budget(300.0)) for one in (made, both))
    assert (hits == same).all() and drawn == also and hits.min() >= 4


def test_open_ranges_count_once():
    made = problem(meets, {"a": (0.0, None)}, n=10)
    assert made.cells.count == 1 and Range(0.0, None) == made.request.phi["a"]


SPEC = scenegen.parse("""object mug, plate, bowl at (0.5, 0.5)
time 3 steps
require speed(mug) <= 30 cm/s & speed(plate) <= 20 cm/s
require noOverlap()
task: eventually closeTo(mug, plate, 20 cm)
far: always farFrom(plate, bowl, 30 cm)
""")


@pytest.fixture(scope="module")
def plain():
    """phi of both labels of motions that meet what is required, and the share of those: (2, P) and a number."""
    problem = make_motion_problem(SPEC.definition, SampleRequest({}, n=1))
    scores = problem.scores(poses_of(problem, draw(problem, 60_000, np.random.default_rng(3))))
    good = (scores[2:] >= 0.0).all(axis=0)
    return scores[:2, good], good.mean()


@pytest.fixture(scope="module")
def found():
    work, rarity.MOTION_WORK = rarity.MOTION_WORK, 300_000_000
    try:
        return rarity.measure(SPEC.definition, SPEC.labels, seed=5)
    finally:
        rarity.MOTION_WORK = work


def agree(estimate, share, count):
    """log10 of a share within three standard errors of both: the estimate's error is half of a 95 % interval."""
    own = math.sqrt((1.0 - share) / (share * count)) / math.log(10.0)
    return abs(estimate.log10 - math.log10(share)) < 3.0 * math.hypot(estimate.error / 1.96, own)


@pytest.mark.long
def test_it_agrees_with_plain_draws(plain, found):
    scores, met = plain
    assert agree(found.requirement, met, 60_000)
    for phi, reach in zip(scores, found.reaches.values(), strict=True):
        for share in (0.003, 0.03, 0.3):
            high, low = np.quantile(phi, [1.0 - share, share])
            assert agree(reach.up(high), (phi >= high).mean(), len(phi))
            assert agree(reach.down(low), (phi <= low).mean(), len(phi))


@pytest.mark.long
def test_what_is_reached_and_the_same_again(plain, found):
    for phi, reach in zip(plain[0], found.reaches.values(), strict=True):
        assert reach.down.end <= phi.min() + 0.02 and reach.up.end >= phi.max() - 0.02
    small = [rarity.measure(SPEC.definition, ("task",), seed=seed).reaches["task"].up(0.0) for seed in (1, 1, 2)]
    assert small[0] == small[1] != small[2]


# A cube on a tray, one of which moves in each step, by at most 10 cm.
ON_TRAY = """object tray = box(40 cm, 30 cm, 2 cm)
object cube = box(5 cm, 5 cm, 5 cm) on tray
time 2 steps
require speed(tray) <= 10 cm/s & speed(cube) <= 10 cm/s
task: eventually x(cube) >= 0.5
"""


@pytest.fixture(scope="module")
def on_tray():
    """log10 of the shares of motions that meet what is required, and that satisfy the task as well: by a simulation
    that puts the cube on the tray, which a place in the workspace is with probability 0.4 * 0.3."""
    rng, count = np.random.default_rng(11), 400_000
    tray, cube = rng.random((2, count)), (rng.random((2, count)) - 0.5) * [[0.4], [0.3]]
    turn = 2.0 * math.pi * rng.random(count)
    cosine, sine = np.cos(turn), np.sin(turn)
    cube = tray + np.stack([cosine * cube[0] - sine * cube[1], sine * cube[0] + cosine * cube[1]])
    good, right = np.ones(count, dtype=bool), cube[0] >= 0.5
    for _ in range(2):
        far, angle, which = 0.1 * np.sqrt(rng.random(count)), 2.0 * math.pi * rng.random(count), rng.random(count) < 0.5
        step = far * np.stack([np.cos(angle), np.sin(angle)])
        tray, cube = tray + step * which, cube + step * ~which
        x, y = cube - tray
        good &= (np.abs(cosine * x + sine * y) <= 0.2) & (np.abs(cosine * y - sine * x) <= 0.15)
        good &= ((tray >= 0.0) & (tray <= 1.0)).all(axis=0)
        right |= cube[0] >= 0.5
    return math.log10(0.12 * good.mean()), math.log10(0.12 * (good & right).mean())


@pytest.mark.long
def test_what_stands_counts_over_the_workspace(on_tray, monkeypatch):
    monkeypatch.setattr(rarity, "MOTION_WORK", 300_000_000)
    found = rarity.measure(scenegen.parse(ON_TRAY).definition, ("task",), seed=1)
    met, both = on_tray
    assert abs(found.requirement.log10 - met) < 1.5 * found.requirement.error < 0.15
    given = found.reaches["task"].up(0.0)
    assert abs(given.log10 - (both - met)) < 1.5 * given.error < 0.1


@pytest.mark.parametrize("method", ["rejection", pytest.param("splitting", marks=pytest.mark.long)])
def test_so_it_does_in_the_probability_of_a_request(on_tray, method):
    info = scenegen.sample_motions(scenegen.parse(ON_TRAY), {"task": (0.0, None)}, 200, seed=2, method=method)
    info = info.header.sampler
    assert abs(info["log10_probability"] - on_tray[1]) < 1.5 * info["log10_error"] < 0.6


@pytest.mark.long
@pytest.mark.parametrize(("method", "apart"), [("rejection", 0.05), ("splitting", 0.03)])
def test_the_interval_of_a_request_holds(method, apart):
    """Of 40 intervals of 95 %, 38 hold the truth, but for 2.5 standard errors. Two uniform points of the unit square
    are at most s apart with probability pi s^2 - 8/3 s^3 + s^4/2; steps of 1 mm change nothing of that."""
    text = "object a, b\ntime 1 steps\nrequire speed(a) <= 1 mm/s & speed(b) <= 1 mm/s\n"
    spec = scenegen.parse(text + f"task: closeTo(a, b, {apart})")
    truth = math.log10(math.pi * apart**2 - 8.0 / 3.0 * apart**3 + apart**4 / 2.0)
    held = 0
    for seed in range(40):
        info = scenegen.sample_motions(spec, {"task": (0.0, None)}, 20, seed=seed, method=method).header.sampler
        held += abs(info["log10_probability"] - truth) <= info["log10_error"]
    assert held >= 34


def test_the_interval_follows_the_scatter_of_logarithms():
    """Pieces of splitting are skewed: if all came out low, their own standard deviation is too small."""
    spec = scenegen.parse(
        "object a, b\ntime 1 steps\nrequire speed(a) <= 1 mm/s & speed(b) <= 1 mm/s\ntask: leftOf(a, b)"
    )
    problem = make_motion_problem(spec.definition, SampleRequest({}, n=8))
    motions = MotionSplitting(problem, (0,), Schedule((), 1, (0,), 64, 0.0, 1000))
    shares, logs = np.array([1e-6, 2e-6, 1e-6, 9e-6]), np.log([1e-6, 2e-6, 1e-6, 9e-6])
    alive = [shares.sum(), (shares**2).sum(), 4.0, logs.sum(), (logs**2).sum(), 100.0, 1.0]
    info = motions.account(Tally(8, 8, 4, 8, facts=tuple(alive))).info
    assert info["log10_probability"] == pytest.approx(math.log10(shares.mean()), abs=1e-4)
    scatter = logs.var(ddof=1)
    wanted = 3.18 * math.sqrt((scatter + 0.5 * scatter**2 * 4 / 3) / 4) / math.log(10.0)
    assert info["log10_error"] == pytest.approx(wanted, rel=1e-3)
