"""Monitors: bounds that hold whatever comes, narrow, and end at phi."""

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import RequestError
from scenegen.sampling.motions.problem import draw, poses_of, within_a_turn
from scenegen.sampling.motions.scores import make_problem
from scenegen.sampling.request import SampleRequest

HEAD = """object mug, plate at (0.5, 0.5), knife
time 6 steps
require speed(mug) <= 8 cm/s & speed(knife) <= 4 cm/s & spin(mug) <= 20 deg/s
require farFrom(mug, knife, 3 cm)
"""
FORMULAS = {
    "near": "eventually closeTo(mug, plate, 15 cm)",
    "clear": "always farFrom(mug, knife, 10 cm)",
    "order": "farFrom(mug, plate, 20 cm) until[1, 5] leftOf(knife, plate)",
    "turns": "always[0, 3] eventually[0, 2] (leftOf(mug, plate) | facing(mug, plate, 60 deg))",
    "passes": "initially leftOf(mug, plate) & !finally leftOf(mug, plate)",
    "halts": "eventually (moved(mug, 6 cm) & next still(mug)) & always (speed(knife) <= speed(mug) + 5 cm/s)",
}
SPEC = scenegen.parse(HEAD + "".join(f"{name}: {text}\n" for name, text in FORMULAS.items()))


def motions(count, seed):
    """(B, T + 1, N, 3) from the base distribution, and the box they come from."""
    problem = make_problem(SPEC.declared, SampleRequest({}, n=1, seed=seed))
    poses = within_a_turn(poses_of(problem, draw(problem, 40 * count, np.random.default_rng(seed))))
    inside = problem.room(poses) >= 0.0
    return np.ascontiguousarray(poses[..., inside][..., :count].transpose(3, 2, 0, 1))


@pytest.mark.parametrize("reach", [False, True])
def test_bounds_hold_narrow_and_end_at_phi(reach):
    poses = motions(60, 4)
    run = SPEC.trace_robustness()
    phi = dict(zip(SPEC.labels, run(torch.from_numpy(poses)).T.numpy(), strict=True))
    required = run.required(torch.from_numpy(poses)).numpy()
    monitor = scenegen.Monitor(SPEC, reach=reach)
    low, high = ({name: np.full(60, end) for name in SPEC.labels} for end in (-np.inf, np.inf))
    for moment in range(7):
        seen = monitor.add(poses[:, moment])
        assert (seen.moment, seen.t) == (moment, float(moment))
        for name in SPEC.labels:
            assert (seen.low[name] <= phi[name] + 1e-12).all() and (phi[name] <= seen.high[name] + 1e-12).all()
            assert (seen.low[name] >= low[name] - 1e-12).all() and (seen.high[name] <= high[name] + 1e-12).all()
            sure = seen.settled(name)
            assert (((phi[name] >= 0.0) == (seen.low[name] >= 0.0)) | ~sure).all()
        assert (seen.required[0] <= required + 1e-12).all() and (required <= seen.required[1] + 1e-12).all()
        low, high = seen.low, seen.high
    for name in SPEC.labels:
        assert np.allclose(low[name], phi[name], atol=1e-12) and np.allclose(high[name], phi[name], atol=1e-12)
    assert np.allclose(seen.required[0], required, atol=1e-12)


def test_reach_narrows():
    poses = motions(60, 5)
    wide, narrow = scenegen.Monitor(SPEC), scenegen.Monitor(SPEC, reach=True)
    for moment in range(4):
        loose, tight = wide.add(poses[:, moment]), narrow.add(poses[:, moment])
    width = {name: (loose.high[name] - loose.low[name]).mean() for name in SPEC.labels}
    less = {name: (tight.high[name] - tight.low[name]).mean() for name in SPEC.labels}
    assert all(less[name] <= width[name] + 1e-12 for name in SPEC.labels)
    assert all(less[name] < 0.75 * width[name] for name in ("near", "order", "passes")), (less, width)
    settled = [[monitor.settled(name).sum() for name in SPEC.labels] for monitor in (loose, tight)]
    assert sum(settled[1]) > sum(settled[0]) + 20


def test_one_motion_by_name_and_again():
    poses = motions(2, 6)[1]
    monitor, many = scenegen.Monitor(SPEC), scenegen.Monitor(SPEC)
    for _ in range(2):
        for scene in poses:
            named = {name: tuple(place) for name, place in zip(SPEC.objects, scene, strict=True) if name != "plate"}
            one, two = monitor.add(named), many.add(scene[None])
            assert isinstance(one.low["order"], float) and one.low["order"] == two.low["order"][0]
        monitor.reset()
        many.reset()


@pytest.mark.parametrize(
    ("poses", "said"),
    [
        ({"mugg": (0, 0, 0)}, "unknown-object"),
        ({"mug": (0, 0, 0)}, "wrong-value: without `knife`"),
        ({"mug": (0, 0), "knife": (0, 0, 0)}, "wrong-value: not an array"),
        ({"mug": "here", "knife": (0, 0, 0)}, "wrong-value: not an array"),
        ([[0.0, 0.0, 0.0]], "wrong-value: of shape (1, 3)"),
        (np.zeros((0, 3, 3)), "wrong-value: of shape (0, 3, 3)"),
        (np.full((3, 3), np.nan), "wrong-value: not finite"),
        (None, "wrong-value: of shape ()"),
    ],
)
def test_bad_poses(poses, said):
    code, _, reason = said.partition(": ")
    with pytest.raises(RequestError) as refused:
        scenegen.Monitor(SPEC).add(poses)
    (problem,) = refused.value.diagnostics
    assert problem.code == code and reason in str(refused.value)


def test_other_misuse():
    monitor = scenegen.Monitor(SPEC)
    here = np.zeros((4, 3, 3))
    here[:, SPEC.objects.index("plate"), :2] = 0.5  # it is held there
    monitor.add(here)
    with pytest.raises(RequestError, match=r"shape \(5, 3, 3\)"):
        monitor.add(np.zeros((5, 3, 3)))
    for _ in range(6):
        monitor.add(here)
    with pytest.raises(RequestError, match="motion has ended"):
        monitor.add(here)
    with pytest.raises(RequestError, match="not-over-time"):
        scenegen.Monitor(scenegen.parse("leftOf(mug, plate)"))
    with pytest.raises(RequestError):
        scenegen.Monitor("carry.spec")
