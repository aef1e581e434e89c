"""phi over motions: against the definition, under the laws of logic, and its gradient."""

import copy
import math
import pickle
import time

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import scenegen
from scenegen.lang.checker import check_text
from scenegen.lang.formula.timed import Numpy, extreme, until
from scenegen.learn.robustness.traces import TraceRobustness, _TorchTraces

from ...laws import examples
from .slow_time import text, value

T, SIGNALS = 7, 3
OBJECTS = "object " + ", ".join(f"o{k}" for k in range(SIGNALS)) + "\n"


@st.composite
def windows(draw):
    a = draw(st.integers(0, T))
    return a, draw(st.integers(a, T))


def over_time(below):
    both = st.tuples(below, below)
    return st.one_of(
        st.tuples(st.just("not"), below),
        st.builds(lambda kind, pair: (kind, *pair), st.sampled_from(["and", "or"]), both),
        st.builds(lambda kind, w, f: (kind, *w, f), st.sampled_from(["always", "eventually"]), windows(), below),
        st.builds(lambda kind, w, p: (kind, *w, *p), st.sampled_from(["until", "until_with"]), windows(), both),
        st.tuples(st.sampled_from(["next", "initially", "finally"]), below),
    )


formulas = st.recursive(st.tuples(st.just("atom"), st.integers(0, SIGNALS - 1)), over_time, max_leaves=5)
seeds = st.integers(0, 2**32 - 1)


def robust(formula):
    """None where phi is infinite in every motion."""
    try:
        return TraceRobustness(check_text(f"time {T} steps\n{OBJECTS}task: {formula}").timed)
    except scenegen.SpecError as refused:
        assert {one.code for one in refused.diagnostics} == {"looks-beyond"}
        return None


def motions(seed, count=3):
    """Poses whose x are small whole numbers: ties are common."""
    rng = np.random.default_rng(seed)
    return torch.from_numpy(rng.integers(-4, 5, (count, T + 1, SIGNALS, 3)).astype(float))


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(formulas, seeds)
def test_phi_is_what_the_definition_says(formula, seed):
    run = robust(text(formula))
    poses = motions(seed)
    expected = [[value(formula, poses[b, :, :, 0].T.tolist(), t) for t in range(T + 1)] for b in range(len(poses))]
    if run is None:
        assert all(math.isinf(row[0]) for row in expected)
        return
    signals = run(poses, signals=True)
    assert signals.shape == (len(poses), T + 1, 1)
    assert signals[..., 0].tolist() == expected
    assert run(poses)[:, 0].tolist() == [row[0] for row in expected]


@pytest.mark.long
@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(formulas, formulas, windows(), seeds)
def test_de_morgan_over_time(f, g, window, seed):
    poses = motions(seed)
    w = f"[{window[0]}, {window[1]}]"
    pairs = [
        (f"!always{w} ({text(f)})", f"eventually{w} !({text(f)})"),
        (f"!({text(f)} & {text(g)})", f"!({text(f)}) | !({text(g)})"),
        (f"true until{w} ({text(f)})", f"eventually{w} ({text(f)})"),
        (f"({text(f)}) until_with{w} ({text(g)})", f"({text(f)}) until{w} (({text(f)}) & ({text(g)}))"),
        (f"!!(({text(f)}) until{w} ({text(g)}))", f"({text(f)}) until{w} ({text(g)})"),
        (f"next ({text(f)})", f"eventually[1, 1] ({text(f)})"),
    ]
    for one, other in pairs:
        left, right = robust(one), robust(other)
        assert (left is None) == (right is None)
        if left is not None and right is not None:
            assert torch.equal(left(poses, signals=True), right(poses, signals=True)), (one, other)


@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(formulas, seeds)
def test_the_gradient_is_the_slope(formula, seed):
    run = robust(text(formula))
    if run is None:
        return
    rng = np.random.default_rng(seed)
    poses = torch.from_numpy(rng.normal(size=(2, T + 1, SIGNALS, 3))).requires_grad_()
    way = torch.from_numpy(rng.normal(size=poses.shape))
    phi = run(poses)
    phi.sum().backward()
    assert torch.isfinite(poses.grad).all()
    step = 1e-6
    with torch.no_grad():
        slope = (run(poses + step * way) - run(poses - step * way)).sum() / (2 * step)
    assert float((poses.grad * way).sum()) == pytest.approx(float(slope), abs=1e-6)


@pytest.mark.long
def test_gradients_of_what_moves():
    spec = scenegen.parse(
        "time [0, 2 s] every 0.5 s object a, b require speed(a) <= 1 m/s "
        "one: always still(a, 9) & carried(a, b) two: spin(a) <= 1 until moved(b)"
    )
    run = spec.trace_robustness()
    poses = torch.rand(3, 5, 2, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1)).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: run(x), (poses,))
    assert torch.autograd.gradcheck(lambda x: run.required(x), (poses,))


def test_what_steps_are_worth():
    spec = scenegen.parse(
        "time [0, 1 s] every 0.5 s object a, b require displacement(a) <= 50 cm require x(a) <= 1 "
        "speed: next (speed(a) <= 1 m/s) spin: next (spin(a) <= 1 rad/s) start: speed(a) <= 1 "
        "still: next still(a) moved: next moved(a) carried: next carried(b, a)"
    )
    run = spec.trace_robustness()
    # a moves by 0.3 and turns by a quarter, the short way over EAST; b turns around with it, then stays behind
    quarter = math.pi / 2
    poses = torch.tensor(
        [
            [[0.0, 0.0, quarter / 2], [1.0, 0.0, 0.0]],
            [[0.3, 0.0, 2 * math.pi - quarter / 2], [0.3, -1.0, 2 * math.pi - quarter]],
            [[0.8, 0.0, 0.0], [0.3, -1.0, 0.0]],
        ],
        dtype=torch.float64,
    )[None]
    phi = dict(zip(run.labels, run(poses)[0].tolist(), strict=True))
    assert phi["speed"] == pytest.approx(1 - 0.6) and phi["start"] == 1.0
    assert phi["spin"] == pytest.approx(1 - quarter / 0.5)
    assert phi["still"] == pytest.approx(0.001 - quarter) and phi["moved"] == -phi["still"]
    assert phi["carried"] == pytest.approx(0.001)
    required = run.required(poses, signals=True)[0].tolist()
    assert required == pytest.approx([1.0, 0.2, 0.0])  # at moment 0 the displacement is not asked for
    assert float(run.required(poses)) == pytest.approx(0.0, abs=1e-12)


def test_each_conjunct_of_a_requirement_by_itself():
    """Only what a step takes part in is left out at the first moment, wherever it stands; supports are kept, too."""
    spec = scenegen.parse(
        "time 2 steps object tray, mug on tray, cup "
        "require (forall p in [tray, cup]: speed(p) <= 1 & x(p) <= 1) & finally (y(cup) <= 1) & noCollision() "
        "task: always leftOf(mug, cup)"
    )
    run = spec.trace_robustness()
    poses = torch.zeros(1, 3, 3, 3, dtype=torch.float64)
    poses[0, :, 2, :2] = 3.0
    assert run.required(poses, signals=True)[0].tolist() == pytest.approx([-2.0] * 3)
    poses[0, :, 2, 0], poses[0, :, 2, 1] = 0.9, torch.tensor([0.0, 0.5, 1.5])
    assert run.required(poses, signals=True)[0].tolist() == pytest.approx([-0.5] * 3)
    poses[0, :, 2, 1] = torch.tensor([0.0, 1.0, 0.7])
    first, second, third = run.required(poses, signals=True)[0].tolist()
    assert second == pytest.approx(0.0) and first == third > 0.0, "a speed of 1 in the first step"


def test_held_objects_stay_and_what_is_not_required_holds():
    spec = scenegen.parse("time 3 steps object a, b at (0.5, 0.5) task: always (speed(a) <= speed(b) + 1)")
    run = spec.trace_robustness()
    poses = torch.zeros(2, 4, 2, 3)
    poses[:, :, 1, :2] = 0.5
    assert run(poses).tolist() == [[1.0], [1.0]] and run.required(poses).tolist() == [math.inf, math.inf]


def test_a_state_formula_is_worth_what_it_is_in_a_scene():
    text_ = "object mug, plate\ntask: leftOf(mug, plate) & !closeTo(mug, plate, 25 cm)"
    poses = torch.rand(5, 4, 2, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    run = scenegen.parse(f"time 3 steps\n{text_}").trace_robustness()
    still = scenegen.parse(text_).robustness()
    assert torch.equal(run(poses), still(poses[:, 0]))
    assert torch.equal(run(poses, signals=True), still(poses.reshape(20, 2, 3)).reshape(5, 4, 1))


@pytest.mark.long
@pytest.mark.parametrize("moments", [1, 2, 7, 64, 65])
def test_windows_of_every_width(moments):
    rng = np.random.default_rng(moments)
    f, g = rng.integers(-9, 9, (2, moments)).astype(float)
    for a in range(min(moments, 9)):
        for b in {*range(a, min(moments + 2, a + 9)), moments + 1}:
            ends = [(t + a, min(t + b, moments - 1)) for t in range(moments)]
            assert extreme(Numpy(), "min", f, a, b).tolist() == [min(f[i : j + 1], default=math.inf) for i, j in ends]
            for closed in (False, True):
                kind = "until_with" if closed else "until"
                expected = [value((kind, a, b, ("atom", 0), ("atom", 1)), [f, g], t) for t in range(moments)]
                assert until(Numpy(), f, g, a, b, closed).tolist() == expected


def test_dtypes_chunks_and_copies(monkeypatch):
    run = scenegen.parse("time 4 steps object a, b l: always[0, 2] (leftOf(a, b)) m: moved(a)").trace_robustness()
    poses = torch.rand(9, 5, 2, 3, generator=torch.Generator().manual_seed(0))
    whole = run(poses)
    assert whole.dtype == torch.float32 and whole.shape == (9, 2)
    assert torch.equal(pickle.loads(pickle.dumps(run))(poses), whole)  # noqa: S301
    assert torch.equal(copy.deepcopy(run)(poses), whole)
    monkeypatch.setattr("scenegen.learn.robustness.traces.STATES_AT_ONCE", 11)
    assert torch.equal(run(poses), whole) and run(poses[:0]).shape == (0, 2)


@pytest.mark.parametrize(
    ("poses", "said"),
    [
        (torch.zeros(2, 4, 2, 3), r"shape \(B, 5, 2, 3\)"),
        (torch.zeros(5, 2, 3), r"shape \(B, 5, 2, 3\)"),
        (torch.zeros(2, 5, 2, 3, dtype=torch.int64), "float32 or float64"),
        (torch.full((2, 5, 2, 3), math.nan), "x of `a` at moment 0 of motion 0 is not finite"),
    ],
)
def test_what_is_no_motion(poses, said):
    run = scenegen.parse("time 4 steps object a, b l: always leftOf(a, b)").trace_robustness()
    with pytest.raises(ValueError, match=said):
        run(poses)
    with pytest.raises(ValueError, match=said):
        run.required(poses)


@pytest.mark.long
def test_windows_of_any_width_take_the_same_time():
    """Processor time of 2,000 steps: windows of 1,000 moments beside windows of 4. Looping over windows would take 250
    times as long."""
    poses = torch.rand(8, 2001, 2, 3, generator=torch.Generator().manual_seed(0))

    def seconds(width):
        run = scenegen.parse(
            f"time 2000 steps object a, b l: always[0, {width}] (leftOf(a, b) until[0, {width}] leftOf(b, a))"
        ).trace_robustness()
        run(poses)
        best = math.inf
        for _ in range(3):
            began = time.process_time()
            run(poses)
            best = min(best, time.process_time() - began)
        return best

    assert seconds(1000) < 50 * seconds(4)


@pytest.mark.parametrize("kind", ["min", "max"])
@pytest.mark.parametrize("moments", [1, 2, 6, 10])
def test_windows_with_gradients(kind, moments):
    """Another way than without: the same values, and slopes that go to extremes alone and add up to one each."""
    numbers = np.random.default_rng(moments).integers(-3, 4, (4, moments)).astype(float)
    for a in range(moments + 1):
        for b in range(a, moments + 2):
            plain = torch.from_numpy(numbers)
            followed = plain.clone().requires_grad_()
            found = extreme(_TorchTraces(), kind, followed, a, b)
            expected = extreme(_TorchTraces(), kind, plain, a, b)
            assert torch.equal(found, expected)
            assert np.array_equal(expected.numpy(), extreme(Numpy(), kind, numbers, a, b))
            for t in range(moments - a):
                (slope,) = torch.autograd.grad(found[:, t].sum(), followed, retain_graph=True)
                inside = torch.zeros(moments, dtype=torch.bool)
                inside[t + a : t + b + 1] = True
                assert ((slope == 0) | (inside & (plain == found[:, t : t + 1]))).all()
                assert slope.sum(-1).tolist() == [1.0] * 4 and (slope >= 0).all()


@pytest.mark.long
def test_transforms_of_torch_func():
    run = scenegen.parse(
        "time 4 steps object a, b l: always[0, 2] (leftOf(a, b) until[0, 2] closeTo(a, b)) m: eventually next moved(a)"
    ).trace_robustness()
    poses = torch.rand(3, 5, 2, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(4))
    assert torch.equal(torch.func.vmap(lambda one: run(one[None])[0])(poses), run(poses))
    wanted = torch.autograd.functional.jacobian(run, poses)
    assert wanted.abs().sum() > 0
    for jacobian in (torch.func.jacrev, torch.func.jacfwd):
        assert torch.allclose(jacobian(run)(poses), wanted, rtol=0.0, atol=1e-12)
