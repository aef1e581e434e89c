"""Rings, frames and shares of the workspace, against the camera of pictures and the numbers of arms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.lang.spec import SpecCamera
from scenegen.looks.camera import from_place
from scenegen.looks.overlay import BEYOND, frame_of, ring_of, share_of_area
from scenegen.things.arms import shipped_arm
from tests.laws import examples

VIEW = (-0.2, -0.1, 1.1, 1.3)
places = st.tuples(st.floats(-1.0, 2.0), st.floats(-1.0, 2.0), st.floats(0.1, 1.5))
cameras = st.builds(
    SpecCamera, st.just("one"), places, places, st.floats(0.2, 2.4), st.sampled_from([4.0 / 3.0, 0.5, 2.0])
).filter(lambda one: math.dist(one.eye, one.target) > 0.1)


def in_picture(camera, points):
    """Whether points of the table are in the picture, by the projection that pictures are drawn with."""
    size = (round(1000 * camera.aspect), 1000)
    lens = from_place(points, size, np.array(camera.eye), np.array(camera.target), math.degrees(camera.field))
    ahead = (points - camera.eye) @ camera.forward
    pixels = lens.project(points)
    return (ahead > 1e-6) & ((pixels >= 0.0) & (pixels <= size)).all(axis=1)


def inside(corners, points):
    """Whether points lie in a convex polygon, counter-clockwise."""
    found = np.full(len(points), len(corners) > 2)
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        found &= (u - x) * (points[:, 1] - y) - (v - y) * (points[:, 0] - x) >= -1e-12
    return found


@settings(max_examples=examples(60))
@given(cameras, st.integers(0, 2**32 - 1))
def test_a_frame_is_what_the_picture_has_of_the_table(camera, seed):
    left, low, right, high = VIEW
    wide, deep = BEYOND * (right - left), BEYOND * (high - low)
    rng = np.random.default_rng(seed)
    points = rng.uniform((left - wide, low - deep, 0.0), (right + wide, high + deep, 0.0), size=(400, 3))
    frame = frame_of(camera, VIEW)
    differ = inside(list(frame.corners), points) != in_picture(camera, points)
    assert differ.sum() <= 2  # of points, which may lie on the border


@settings(max_examples=examples(20))
@given(cameras)
def test_the_share_of_the_workspace(camera):
    grid = np.stack(np.meshgrid(*(np.linspace(0.005, 0.995, 100),) * 2), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))])
    assert share_of_area(camera, (0.0, 0.0, 1.0, 1.0)) == pytest.approx(in_picture(camera, points).mean(), abs=0.02)


def test_eyes_are_shown_where_they_are_or_at_the_border():
    def eye(x, y, target=(0.5, 0.5, 0.0)):
        return frame_of(SpecCamera("one", (x, y, 0.7), target, 1.0, 1.0), VIEW)

    assert eye(0.5, 0.0).eye == (0.5, 0.0, math.pi / 2) and not eye(0.5, 0.0).outside
    assert eye(0.5, -0.6).outside and VIEW[1] < eye(0.5, -0.6).eye[1] < 0.0 and eye(0.5, -0.6).eye[0] == 0.5
    assert eye(0.5, 0.5).eye[2] == math.pi / 2  # straight down: y is up in its picture
    assert frame_of(SpecCamera("one", (0.5, 0.5, 0.7), (0.5, 0.5, 2.0), 1.0, 1.0), VIEW).corners == ()


@pytest.mark.parametrize("name", ["panda", "ur5e", "so101"])
def test_rings_are_those_at_the_table(name):
    arm = shipped_arm(name)
    ring, tip = arm.ring, math.hypot(*arm.offset)
    for foot in (0.0, 0.1):
        found, (near, far) = ring_of(arm, foot), ring.reach_at(-foot)
        assert near - tip - 1e-9 <= found.nearest <= near and far <= found.farthest <= far + tip + 1e-9
    assert ring_of(arm, 5.0) == ring_of(arm, -ring.heights[0])  # the lowest height that it reaches
    assert ring_of(arm).bearing == (None if ring.turns_freely else ring.bearing)
