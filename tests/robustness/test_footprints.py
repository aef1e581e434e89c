"""Clearances inside a core formula: the compiler, the interpreter and the bounds hand them their shapes and poses."""

import numpy as np
import pytest
import torch

from scenegen.geometry import NUMPY, Box, Circle, Polygon
from scenegen.geometry.units import LENGTH
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.lang.formula.interpret import phi
from scenegen.learn.robustness import Robustness
from scenegen.search import label_bounds

DART = Polygon(((-0.05, -0.05), (0.15, 0.0), (-0.05, 0.05)))


@pytest.fixture(scope="module")
def core():
    """gap(a, b) & room(a, tray) & reach(a, 1), b - a; the tray stands still at (0.5, 0.5), turned by 0.3."""
    coords = tuple(Coord(row // 3, row % 3) for row in range(6))
    nodes = (
        *coords,
        *(Const(0.5), Const(0.5), Const(0.3), Const(1.0)),
        Apply("gap", (0, 1, 2, 3, 4, 5), (Box(0.2, 0.1), DART)),
        Apply("room", (0, 1, 2, 6, 7, 8), (Box(0.2, 0.1), Box(0.8, 0.6))),
        Apply("reach", (0, 1, 2, 9), (Box(0.2, 0.1),)),
        Apply("gap", (3, 4, 5, 6, 7, 8), (DART, Circle(0.1))),
        *(Atom(margin, "", LENGTH, ()) for margin in (10, 11, 12, 13)),
        Junction("min", (14, 15, 16, 17)),
    )
    return Core(nodes, {"all": 18, "gap": 14, "room": 15, "reach": 16, "disc": 17}, ("a", "b"))


@pytest.fixture(scope="module")
def rows():
    return np.random.default_rng(0).uniform(0.0, [[1.0], [1.0], [6.0]] * 2, size=(6, 400))


def test_torch_agrees_with_the_interpreter(core, rows):
    found = Robustness(core).rows(torch.from_numpy(rows)).numpy()
    one_by_one = np.array([list(phi(core, column).values()) for column in rows.T.tolist()]).T
    at_once = np.array([np.broadcast_to(value, 400) for value in phi(core, list(rows), NUMPY).values()])
    assert found == pytest.approx(one_by_one, abs=1e-15) and at_once == pytest.approx(one_by_one, abs=1e-15)
    single = Robustness(core).rows(torch.from_numpy(rows).float()).numpy()
    assert single.dtype == np.float32 and single == pytest.approx(found, abs=1e-6)


def test_the_gradient_reaches_what_decides(core, rows):
    where = torch.from_numpy(rows).requires_grad_()
    Robustness(core).rows(where)[1].sum().backward()
    # A translation of both changes no gap, and a gap changes as fast as its footprint moves along the nearest way.
    a, b = where.grad[:2], where.grad[3:5]
    assert a.numpy() == pytest.approx(-b.numpy(), abs=1e-12)
    assert torch.linalg.norm(a, dim=0).numpy() == pytest.approx(1.0, abs=1e-12)


def test_every_scene_lies_within_the_bounds(core, rows):
    low, high = rows - 0.05, rows + 0.05
    lowest, highest = label_bounds(core, low, high)
    values = Robustness(core).rows(torch.from_numpy(rows)).numpy()
    assert lowest.shape == (5, 400) and (lowest <= values).all() and (values <= highest).all()
    assert label_bounds(core, low[:, 7], high[:, 7])[0] == pytest.approx(lowest[:, 7])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("size", [1.0, 0.05])
def test_the_least_clearance_is_the_same_with_and_without_gradients(dtype, size):
    text = """object a, b = box(0.1, 0.06, 0.05), c = cylinder(0.03, 0.1), d = box(0.2, 0.02, 0.05)
    region tray = polygon([(0.6, 0.1), (0.9, 0.1), (0.9, 0.5), (0.7, 0.5)])
    require clearOf(a, tray)
    task: noOverlap() & clearOf(d, tray) & leftOf(a, b)
    near: closeTo(a, b) | noOverlap([a, b, d])"""
    run = Robustness(check_text(text).core)
    rows = size * torch.rand(12, 500, dtype=dtype, generator=torch.Generator().manual_seed(1))
    plain, column = run.rows(rows), run.rows(rows[:, :1])
    assert torch.equal(plain, run.rows(rows.clone().requires_grad_()).detach())
    assert torch.equal(plain[:, :1], column) and torch.equal(plain, run.rows(rows, beta=10.0))
