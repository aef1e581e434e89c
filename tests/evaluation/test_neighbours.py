import numpy as np
import pytest
from scipy.spatial import KDTree

from scenegen.scenes import coverage
from scenegen.scenes.coverage import kth_squared, least_squared, nearest


@pytest.fixture(params=[(16, 256, 64), (3, 20, 7), (1, 1, 1)])
def tiles(request, monkeypatch):
    """The same answers whatever the tiles: one, several, single distances."""
    for name, value in zip(("_STACK", "_WIDTH", "_QUERIES"), request.param, strict=True):
        monkeypatch.setattr(coverage, name, value)


@pytest.mark.long
@pytest.mark.usefixtures("tiles")
def test_against_a_tree():
    rng = np.random.default_rng(0)
    points, queries = rng.random((300, 5)), rng.random((40, 5))
    points[17] = queries[3]
    distance, index = KDTree(points).query(queries)
    found, where = nearest(queries, points)
    assert found == pytest.approx(distance, abs=1e-15)
    assert (where == index).all()
    assert found[3] == 0.0
    assert least_squared(queries, points) == pytest.approx(distance**2, abs=1e-14)
    weights = rng.random(300)
    power = ((queries[:, None] - points[None]) ** 2).sum(axis=2) + weights
    assert least_squared(queries, points, weights) == pytest.approx(power.min(axis=1), abs=1e-14)
    few = points[:60]
    tree = KDTree(few)
    for k in (1, 4, 59):
        assert np.sqrt(kth_squared(few, k)) == pytest.approx(tree.query(few, k=k + 1)[0][:, k], abs=1e-7)


def test_classes_find_the_same_as_sorting():
    rng = np.random.default_rng(1)
    points = rng.random((5000, 2))
    points[2000:2010] = points[100]  # the ten nearest of a point may share a class
    for k in (1, 5, 12):
        exact = KDTree(points).query(points, k=k + 1)[0][:, k]
        assert np.sqrt(kth_squared(points, k)) == pytest.approx(exact, abs=1e-7)


def test_weights_make_balls():
    points, radius = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, 0.2])
    queries = np.array([[0.4, 0.0], [0.6, 0.0], [0.9, 0.0], [1.0, 0.3]])
    assert (least_squared(queries, points, -(radius**2)) <= 0.0).tolist() == [True, False, True, False]
