"""Motions of specs over time: what bounds a step, and motions against plain rejection written apart. Monitors: bounds
that hold whatever comes, narrow, and end at phi.
"""

import numpy as np
import pytest
import torch

import scenegen
from experiments.metrics import energy_test, ks_screen
from scenegen.errors import RequestError
from scenegen.pose import as_rows
from scenegen.sampling.motions.bounds import step_bounds
from scenegen.sampling.motions.problem import draw, poses_of, within_a_turn
from scenegen.sampling.motions.scores import make_motion_problem
from scenegen.sampling.request import SampleRequest

HEAD = "object mug, plate\ntime {steps} steps\n{moves}require forall a in objects: speed(a) <= 20 cm/s\n"

SPECS = {
    "meet": HEAD.format(steps=4, moves="") + "task: eventually closeTo(mug, plate, 15 cm)",
    "all move": HEAD.format(steps=3, moves="moves all\n")
    + "task: finally leftOf(mug, plate) & initially rightOf(mug, plate)",
    "apart": HEAD.format(steps=5, moves="") + "require noOverlap()\ntask: always[2, 4] farFrom(mug, plate, 40 cm)",
    "turn": HEAD.format(steps=3, moves="")
    + "require spin(mug) <= 60 deg/s\ntask: eventually angle(mug, NORTH, 20 deg)",
    "until": HEAD.format(steps=6, moves="") + "task: leftOf(mug, plate) until closeTo(mug, plate, 12 cm)",
    "half second": "object mug, plate at (0.5, 0.5)\ntime [0, 2 s] every 0.5 s\nrequire speed(mug) <= 30 cm/s\n"
    "task: next farFrom(mug, plate, 20 cm) & finally closeTo(mug, plate, 10 cm)",
}


def base(spec, count, rng):
    """Plain draws of the distribution that docs/motions.md describes, those in the workspace."""
    far, turn = step_bounds(spec.over_time)
    low, high = (ends.reshape(-1, 3) for ends in spec.definition.box())
    free = [k for k in range(len(spec.objects)) if (low[k, :2] < high[k, :2]).any()]
    poses = [low + (high - low) * rng.random((count, *low.shape))]
    for _ in range(spec.horizon.steps):
        now, mover = poses[-1].copy(), rng.integers(len(free), size=count)
        for place, k in enumerate(free):
            goes = (mover == place) | (spec.moves == "all")
            angle, way = 2 * np.pi * rng.random(count), far[k] * np.sqrt(rng.random(count))
            now[:, k, 0] += goes * way * np.cos(angle)
            now[:, k, 1] += goes * way * np.sin(angle)
            if np.isfinite(turn[k]):
                now[:, k, 2] += goes * turn[k] * rng.uniform(-1, 1, count)
        poses.append(now)
    made = np.stack(poses, axis=1)
    inside = ((made[..., :2] >= low[:, :2]) & (made[..., :2] <= high[:, :2])).all(axis=(1, 2, 3))
    made[..., 2] %= 2 * np.pi
    return made[inside]


def by_rejection(spec, low, high, count, rng):
    score, found = spec.trace_robustness(), []
    while sum(map(len, found)) < count:
        made = torch.from_numpy(base(spec, 50_000, rng))
        phi, met = score(made)[:, 0], score.required(made) >= 0.0
        found.append(made[met & (phi >= low) & (phi <= high)].numpy())
    return np.concatenate(found)[:count]


def flat_rows(poses):
    return as_rows(poses.reshape(len(poses), -1, 3))


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECS)
@pytest.mark.parametrize("method", ["splitting", "rejection"])
def test_motions_follow_plain_rejection(name, method):
    spec, count = scenegen.parse(SPECS[name]), 1500
    made = scenegen.sample_motions(
        spec, (-0.05, None), n=count, seed=2, spread="base", method=method, timeout=400.0
    ).poses
    truth = by_rejection(spec, -0.05, np.inf, count, np.random.default_rng(3))
    first, second = flat_rows(truth), flat_rows(made)
    energy = energy_test(first, second, np.random.default_rng(0), permutations=999, most=count)
    least = 0.01 / (2 * len(SPECS))
    assert energy.p > least and ks_screen(first, second).corrected > least


@pytest.mark.parametrize("name", SPECS)
def test_motions_are_in_range_and_keep_their_bounds(name):
    spec = scenegen.parse(SPECS[name])
    made = scenegen.sample_motions(spec, (-0.1, None), n=30, seed=1)
    poses = torch.from_numpy(made.poses)
    score = spec.trace_robustness()
    assert np.allclose(score(poses)[:, 0], made.phi["task"]) and made.phi["task"].min() >= -0.1
    assert score.required(poses).min() >= 0.0
    assert ((made.poses[..., :2] >= 0.0) & (made.poses[..., :2] <= 1.0)).all()
    way = np.hypot(*np.moveaxis(np.diff(made.poses[..., :2], axis=1), -1, 0))
    assert np.allclose(made.facts["way"], way.sum(axis=(1, 2)))
    if spec.moves == "one":
        assert ((way > 0.0).sum(axis=2) <= 1).all()


@pytest.mark.parametrize(
    ("required", "far", "turn"),
    [
        ("speed(mug) <= 10 cm/s", 0.05, np.inf),
        ("displacement(mug) <= 10 cm & spin(mug) <= 90 deg/s", 0.1, np.pi / 4),
        ("speed(mug) <= 10 cm/s\nrequire speed(mug) < 4 cm/s", 0.02, np.inf),
        ("still(mug)", 0.001, 0.001),
        ("speed(mug) <= 10 cm/s | speed(mug) <= 20 cm/s", np.inf, np.inf),
        ("speed(mug) >= 10 cm/s", np.inf, np.inf),
        ("always speed(mug) <= 10 cm/s", 0.05, np.inf),
        ("always[1, 2] speed(mug) <= 10 cm/s", 0.05, np.inf),  # the first step leads to moment 1
        ("always[2, 2] speed(mug) <= 10 cm/s", np.inf, np.inf),
        ("eventually speed(mug) <= 10 cm/s", np.inf, np.inf),
        ("!(eventually speed(mug) > 10 cm/s)", 0.05, np.inf),
        ("!(eventually (speed(mug) > 10 cm/s | spin(mug) > 90 deg/s))", 0.05, np.pi / 4),
        ("always (10 cm/s > speed(mug) & x(mug) >= 0.1)", 0.05, np.inf),
        ("(always eventually x(mug) >= 0.1) & always 0 <= speed(mug) <= 0.2 / 2", 0.05, np.inf),
        ("always 2 * displacement(mug) - height(mug) <= 0.5 cm", 0.05, np.inf),
        ("always max(speed(mug), 2 * speed(mug)) <= 0.2", 0.05, np.inf),
        ("always (leftOf(mug, (0.5, 0.5)) -> speed(mug) <= 10 cm/s)", np.inf, np.inf),
    ],
)
def test_bounds_of_steps_are_read_from_requirements(required, far, turn):
    spec = scenegen.parse(
        f"object mug\ntime [0, 1 s] every 0.5 s\nrequire {required}\ntask: eventually leftOf(mug, (0.5, 0.5))"
    )
    found = step_bounds(spec.over_time)
    if np.isfinite(far):  # what is drawn, and left out of what is scored, holds
        made = scenegen.sample_motions(spec, (-1.0, None), n=20)
        assert (spec.trace_robustness().required(torch.from_numpy(made.poses)) >= 0.0).all()
    assert np.allclose(np.concatenate(found), [far, turn])


def test_an_object_without_a_bound_is_an_error():
    spec = scenegen.parse(
        "object mug, plate\ntime 2 steps\nrequire speed(mug) <= 0.1\ntask: eventually leftOf(mug, plate)"
    )
    with pytest.raises(RequestError, match="nothing says how far `plate` moves in a step"):
        scenegen.sample_motions(spec, (0.0, None))
    held = scenegen.sample_motions(spec, (0.0, None), n=5, fix={"plate": (0.5, 0.5)})
    assert (held.poses[:, :, 1, :2] == 0.5).all()


def test_workers_and_seeds():
    spec = scenegen.parse(SPECS["meet"])
    one, two = (scenegen.sample_motions(spec, (0.0, None), n=40, workers=count).poses for count in (1, 2))
    assert one.tobytes() == two.tobytes()
    assert scenegen.sample_motions(spec, (0.0, None), n=40, seed=1).poses.tobytes() != one.tobytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"phi": (5.0, None)}, "no motion|no scene"),
        ({"method": "growth"}, "unknown method"),
        ({"n": 0}, "`n` is 0"),
        ({"phi": (0.1499, None), "method": "rejection", "timeout": 3.0}, "found 0 of 16 motions|found . of 16"),
    ],
)
def test_bad_requests(arguments, said):
    with pytest.raises(RequestError, match=said):
        scenegen.sample_motions(scenegen.parse(SPECS["meet"]), **arguments)


def test_a_spec_without_time_has_no_motions():
    with pytest.raises(RequestError, match="time"):
        scenegen.sample_motions(scenegen.parse("leftOf(mug, plate)"))


HEAD_MONITOR = """object mug, plate at (0.5, 0.5), knife
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
SPEC = scenegen.parse(HEAD_MONITOR + "".join(f"{name}: {text}\n" for name, text in FORMULAS.items()))


def motions(count, seed):
    """(B, T + 1, N, 3) from the base distribution, and the box they come from."""
    problem = make_motion_problem(SPEC.definition, SampleRequest({}, n=1, seed=seed))
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
