"""Sampled motions follow the base distribution conditioned on limits, requirement and range."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.metrics import energy_test, ks_screen
from scenegen.pose import as_rows
from scenegen.sampling.motions.problem import MotionProblem, Variables, draw, poses_of, unit_steps
from scenegen.sampling.motions.sampler import make_plan, pilot, sample
from scenegen.sampling.motions.schedule import MotionChains
from scenegen.sampling.problem import Budget
from scenegen.sampling.request import Range

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
    found = sample(made, Budget(20.0))
    assert not found.complete and found.count == 0


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
