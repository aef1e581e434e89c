"""The light of the sky and the wood, as functions: no picture needed."""

import numpy as np
import pytest

from scenegen.scenes.stage import stage_of
from scenegen.show.looks.textures import wood
from scenegen.show.render.light import SKY_MAP, Ambient, landscape_camera

from .scenefiles import scene_file

STAGE = stage_of(scene_file(["mug"], [[(0.5, 0.5, 0.0)]]))


def looking_down(points):
    """Rays from a metre above each of (P, 2) points, and the depth at which they meet a height."""
    origin = np.column_stack([points, np.ones(len(points))])
    return origin, np.broadcast_to([0.0, 0.0, -1.0], origin.shape)


def landscape(heights):
    """What the software renderer's depth buffer would hold for a (MAP, MAP) landscape of heights."""
    camera = landscape_camera(STAGE)
    near, far = camera._planes()
    depth = -camera.view[2, 3] - heights
    return ((near - 1.0 / depth) / (near - far)).astype(np.float32)


def hidden(heights, points, z=0.0):
    ambient = Ambient(STAGE, *looking_down(np.asarray(points)))
    depth = np.full(len(points), 1.0 - z, dtype=np.float32)
    return ambient.hidden(ambient.landscape(landscape(heights)), depth, slice(None))


def tower(height):
    """A square tower of 10 cm in the middle of the table, as (MAP, MAP) heights."""
    camera = landscape_camera(STAGE)
    columns, rows = np.meshgrid(np.arange(SKY_MAP) + 0.5, np.arange(SKY_MAP) + 0.5)
    origin, _ = camera.resized((SKY_MAP, SKY_MAP)).rays(columns, rows)
    inside = (np.abs(origin[..., 0] - 0.5) < 0.05) & (np.abs(origin[..., 1] - 0.5) < 0.05)
    return np.where(inside, height, 0.0)


def test_an_empty_table_sees_all_of_the_sky():
    assert (hidden(np.zeros((SKY_MAP, SKY_MAP)), [(0.5, 0.5), (0.0, 1.0)]) == 0.0).all()


def test_less_of_the_sky_is_seen_the_nearer_a_wall_and_the_higher_it_is():
    away = np.array([0.002, 0.01, 0.02, 0.04, 0.08, 0.3])
    points = [(0.55 + one, 0.5) for one in away]
    low, high = hidden(tower(0.01), points), hidden(tower(0.2), points)
    assert (np.diff(high) <= 0.0).all() and high[0] > 0.25 and high[-1] == 0.0
    assert (low <= high).all() and low[0] < high[0]
    left = hidden(tower(0.2), [(0.45 - one, 0.5) for one in away])
    assert left == pytest.approx(high, abs=0.06)  # the same on every side, to a pixel of the landscape


def test_nothing_hides_the_sky_from_the_top_of_what_is_highest():
    assert hidden(tower(0.2), [(0.5, 0.5), (0.53, 0.47)], z=0.2).max() == 0.0


def test_wood_is_wood_everywhere_and_fades_where_pixels_are_coarse():
    generator = np.random.default_rng(0)
    x, y = generator.uniform(-50.0, 50.0, (2, 4000))
    fine, coarse = (wood(STAGE, x, y, (np.full(4000, size), np.full(4000, size))) for size in (0.0005, 0.5))
    assert fine.shape == (4000, 3) and np.isfinite(fine).all() and fine.min() > 0.4 and fine.max() < 1.15
    assert fine.std() > 1.5 * coarse.std()
    assert (fine[:, 2] < fine[:, 0]).mean() > 0.5  # dark streaks are warm
    assert np.array_equal(fine, wood(STAGE, x, y, (np.full(4000, 0.0005), np.full(4000, 0.0005))))
