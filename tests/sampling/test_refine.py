"""Refinement: onto the target, within the workspace, and hands off what is right already."""

import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.learn.refine import draw, refine
from scenegen.learn.robustness import Robustness

STARTS = 1000


def refined(spec, target, low, high, seed=0, rows=None):
    """Scenes before and after, and phi after."""
    robustness = Robustness(spec.core)
    if rows is None:
        rows = draw(*spec.box(), STARTS, torch.Generator().manual_seed(seed))
    columns = [
        torch.tensor(ends, dtype=torch.float64)[:, None].expand(-1, rows.shape[1]) for ends in (target, low, high)
    ]
    after = refine(robustness, spec.workspace, rows, *columns)
    return rows, after, robustness.rows(after, check=False)


@pytest.mark.parametrize("name, target", [("exp1", [0.19, 0.08]), ("exp2", [0.03])])
@pytest.mark.parametrize("seed", [0, 1])
def test_random_scenes_reach_their_target(name, target, seed, request):
    spec = request.getfixturevalue(name)
    goal = torch.tensor(target, dtype=torch.float64)
    _, after, phi = refined(spec, target, (goal - 1e-6).tolist(), (goal + 1e-6).tolist(), seed)
    hit = ((phi - goal[:, None]).abs() <= 1e-6).all(dim=0)
    assert hit.double().mean() >= 0.95
    assert spec.workspace.contains(after.numpy()).all()
    assert len({scene.numpy().tobytes() for scene in after.T}) == STARTS


def test_scenes_in_range_stay_where_they_are(exp1):
    before, after, phi = refined(exp1, [0.15, 0.0], [0.1, -9.0], [0.2, 9.0])
    old = Robustness(exp1.core).rows(before)
    inside = (old[0] >= 0.1) & (old[0] <= 0.2)
    assert 10 < inside.sum() < STARTS
    assert torch.equal(before[:, inside], after[:, inside])
    assert (before[:, ~inside] != after[:, ~inside]).any(dim=0).all()
    assert ((phi[0] >= 0.1 - 1e-9) & (phi[0] <= 0.2 + 1e-9)).double().mean() > 0.95


def test_a_label_that_is_free_does_not_stand_in_the_way(exp1):
    _, _, phi = refined(exp1, [0.15, 0.0], [0.1, -9.0], [0.2, 9.0])
    assert ((phi[0] >= 0.1) & (phi[0] <= 0.2)).double().mean() > 0.99


def test_a_label_in_its_range_is_not_pushed_out_for_good(exp1):
    _, _, phi = refined(exp1, [0.3, 0.2], [0.29, 0.1], [0.31, 0.3])
    assert (((phi[1] >= 0.1) & (phi[1] <= 0.3) & (phi[0] >= 0.29) & (phi[0] <= 0.31)).double().mean()) > 0.95


def test_what_lies_outside_is_brought_in(exp1):
    rows = torch.tensor([[5.0, -1.0, -1.0, 0.5, 0.5, 9.0]], dtype=torch.float64).T
    _, after, _ = refined(exp1, [0.0, 0.0], [-9.0, -9.0], [9.0, 9.0], rows=rows)
    assert exp1.workspace.contains(after.numpy()).all()
    assert after[:2, 0].tolist() == [1.0, 0.0]


def test_coincident_objects_and_nan_do_no_harm():
    spec = check_text("closeTo(mug, plate, 0.5)")
    rows = torch.full((6, 3), 0.5, dtype=torch.float64)
    rows[:, 1] = torch.nan
    rows[3, 2] = 0.9
    _, after, phi = refined(spec, [0.3], [0.2999], [0.3001], rows=rows)
    assert torch.isfinite(after[:, [0, 2]]).all() and torch.isnan(after[0, 1])
    assert abs(float(phi[0, 2]) - 0.3) < 1e-3
