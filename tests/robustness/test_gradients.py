"""Gradients: those of the exact value against finite differences, and the straight-through ones."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.learn.robustness import Robustness

from ..laws import examples
from .formulas import away_from_jumps, magnitude, scenes, seeds, specs

STEP = 1e-6


def gradient(run, rows, beta=None):
    rows = rows.clone().requires_grad_()
    run.rows(rows, beta=beta).sum().backward()
    return rows.grad


checked_points = 0


@pytest.mark.long
@settings(max_examples=examples(80), deadline=None, derandomize=True)
@given(specs(), seeds)
def test_the_gradient_is_the_slope(spec, seed):
    """Along a random direction, wherever the slopes to both sides agree (elsewhere there is a kink)."""
    global checked_points
    core, rng = spec.core, np.random.default_rng(seed)
    rows = scenes(len(spec.objects), 4, seed)[:, :2]  # the uniform half
    way = rng.normal(size=rows.shape[0])
    grads = gradient(Robustness(core), torch.from_numpy(rows)).numpy()
    for column, grad in zip(rows.T, grads.T, strict=True):
        before, here, after = (phi(core, (column + step * way).tolist())["task"] for step in (-STEP, 0.0, STEP))
        slack = 1e-4 * magnitude(core, column)
        left, right = (here - before) / STEP, (after - here) / STEP
        if abs(left - right) > slack or away_from_jumps(core, column) < 1e-4:
            continue
        checked_points += 1
        assert grad @ way == pytest.approx((left + right) / 2.0, abs=slack)


@pytest.mark.long
def test_most_points_were_smooth_enough_to_be_checked():
    assert checked_points > examples(80)


@pytest.mark.long
@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_straight_through_keeps_the_value_and_is_finite_everywhere(spec, seed):
    run, rows = Robustness(spec.core), torch.from_numpy(scenes(len(spec.objects), 8, seed))
    assert torch.equal(run.rows(rows, beta=10.0), run.rows(rows))
    assert torch.isfinite(gradient(run, rows, beta=10.0)).all()
    assert torch.isfinite(gradient(run, rows)).all()


def test_straight_through_reaches_every_object_with_the_weights_of_log_sum_exp():
    run = Robustness(check_text("object a, b, c\ntask: x(a) <= 1 & x(b) <= 1 & x(c) <= 1").core)
    rows = torch.zeros(9, 1, dtype=torch.float64)
    rows[0], rows[3], rows[6] = 0.1, 0.2, 0.4  # margins 0.9, 0.8, 0.6
    exact, smooth = gradient(run, rows), gradient(run, rows, beta=10.0)
    assert exact[:, 0].tolist() == [0, 0, 0, 0, 0, 0, -1, 0, 0]
    weights = np.exp([-9.0, -8.0, -6.0]) / np.exp([-9.0, -8.0, -6.0]).sum()
    assert smooth[[0, 3, 6], 0].numpy() == pytest.approx(-weights, rel=1e-12)
    either = Robustness(check_text("object a, b\ntask: x(a) >= 0 | x(b) >= 0").core)
    rows = torch.tensor([[0.2], [0.0], [0.0], [0.1], [0.0], [0.0]], dtype=torch.float64)
    weights = np.exp([2.0, 1.0]) / np.exp([2.0, 1.0]).sum()
    assert gradient(either, rows, beta=10.0)[[0, 3], 0].numpy() == pytest.approx(weights, rel=1e-12)


@pytest.mark.parametrize("beta", [None, 10.0])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_coincident_objects_have_a_finite_gradient(beta, dtype):
    run = Robustness(check_text("closeTo(a, b) & farFrom(b, c) & dist(a, (0.5, 0.5)) <= 0.1").core)
    rows = torch.full((9, 5), 0.5, dtype=dtype)
    assert torch.isfinite(gradient(run, rows, beta)).all()
    lone = Robustness(check_text("closeTo(a, b)").core)
    assert torch.equal(gradient(lone, rows[:6], beta), torch.zeros(6, 5, dtype=dtype))


@pytest.mark.parametrize("beta", [None, 10.0])
def test_a_batch_larger_than_a_chunk_has_a_gradient(beta):
    run = Robustness(check_text("leftOf(a, b) & !closeTo(a, b, 0.25)").core)
    rows = torch.rand(6, 50, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    whole = gradient(run, rows, beta)
    run._chunk = 7
    assert torch.equal(gradient(run, rows, beta), whole)
    with torch.no_grad():
        assert torch.equal(run.rows(rows.clone().requires_grad_(), beta=beta), run.rows(rows, beta=beta))
    assert whole.abs().sum(0).min() > 0


def test_gradients_flow_through_the_poses_view():
    run = Robustness(check_text("leftOf(a, b)").core)
    poses = torch.zeros(3, 2, 3, dtype=torch.float64, requires_grad=True)
    run(poses).sum().backward()
    assert poses.grad[:, 0, 0].tolist() == [-1.0] * 3 and poses.grad[:, 1, 0].tolist() == [1.0] * 3
    assert poses.grad.abs().sum() == 6.0
