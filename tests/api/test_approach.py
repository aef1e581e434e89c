"""Scenes that are moved without torch: the same gradients as torch's, and where they arrive."""

import numpy as np
import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate, phi
from scenegen.learn.robustness import Robustness
from scenegen.pictures.figures.sweep import SOFTMAX_BETA, approach, atom_shares, gradients

SPEC = """object tray, mug, fork
task: (leftOf(mug, tray) | closeTo(mug, fork, 0.2)) & !overlaps(mug, fork) & angle(fork, NORTH, 20 deg)
safe: farFrom(mug, fork, 0.3) | between(fork, mug, tray)
"""


@pytest.mark.parametrize("beta", [None, SOFTMAX_BETA])
def test_gradients_are_torchs(beta):
    core = check_text(SPEC).core
    robustness = Robustness(core)
    drawn = np.random.default_rng(3).uniform(0.0, 1.0, (20, 9))
    for row in drawn:
        rows = torch.from_numpy(row[:, None].copy()).requires_grad_(True)
        out = robustness.rows(rows, beta=beta)
        wanted = [torch.autograd.grad(value.sum(), rows, retain_graph=True)[0][:, 0].numpy() for value in out]
        values = evaluate(core, row.tolist())
        shares = [atom_shares(core, values, node, beta) for node in core.labels.values()]
        assert all(sum(mine.values()) == pytest.approx(1.0) for mine in shares)
        found = gradients(core, row, shares, np.arange(9), np.full(9, 1e-6))
        assert np.abs(found - wanted).max() < 1e-6


def test_many_coordinates_are_shifted_a_few_at_a_time(monkeypatch):
    core = check_text(SPEC).core
    row = np.random.default_rng(4).uniform(0.0, 1.0, 9)
    shares = [atom_shares(core, evaluate(core, row.tolist()), node, None) for node in core.labels.values()]
    whole = gradients(core, row, shares, np.arange(9), np.full(9, 1e-6))
    monkeypatch.setattr("scenegen.pictures.figures.sweep.MAX_COPY_NUMBERS", 4 * len(core.nodes))
    assert np.array_equal(gradients(core, row, shares, np.arange(9), np.full(9, 1e-6)), whole)


def test_a_scene_arrives_and_what_may_not_move_stays():
    spec = check_text(SPEC)
    row = np.array([0.5, 0.5, 0.0, 0.9, 0.9, 0.0, 0.1, 0.9, 0.05])
    free = np.ones(9, dtype=bool)
    free[:3] = False
    low, high = np.array([0.04, -np.inf]), np.array([0.06, np.inf])
    moved = approach(spec.core, spec.workspace, row, np.array([0.05, 0.0]), low, high, free)
    assert 0.04 <= phi(spec.core, moved.tolist())["task"] <= 0.06
    assert np.array_equal(moved[:3], row[:3]) and spec.workspace.contains(moved[:, None]).all()
    assert row[3] == 0.9  # the scene that was given is left alone


def test_a_heading_is_brought_to_its_range():
    spec = check_text("object a\ntask: sin(theta(a)) <= -0.3")
    low = np.array([0.0])
    moved = approach(
        spec.core, spec.workspace, np.array([0.5, 0.5, 0.1]), low + 0.01, low, np.array([np.inf]), np.full(3, True)
    )
    assert np.pi < moved[2] < 2 * np.pi and np.sin(moved[2]) <= -0.3
