"""What chains are told about motions agrees with full scores: whether they stay in a region, and phi if they do."""

import numpy as np
import pytest

import scenegen
from scenegen.lang.formula.timed import Numpy, over_time
from scenegen.sampling.motions.problem import draw, poses_of
from scenegen.sampling.motions.scores import lean, make_problem, moments_needed
from scenegen.sampling.request import Range, SampleRequest

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
    problem = make_problem(spec.declared, SampleRequest({spec.labels[0]: Range(-9.0, None)}, n=10))
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
    found = lean(scored(SPECS["ends"], 1)[0].score.timed)
    assert sorted(tuple(part.moments) for part in found.labels.parts) == [(0,), (1,), (8,)]
    assert found.requirement is None
