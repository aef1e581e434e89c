"""What scenes show of cameras and robots beside phi: the numbers are those of formulas, and follow what is drawn."""

import math

import numpy as np
import pytest

from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.lang.sights import Seen, sights_of
from scenegen.looks.camera import from_place

FRONT = "camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3\n"
THINGS = "object mug = cylinder(4 cm, 9 cm), carton = box(8 cm, 6 cm, 20 cm), bottle = cylinder(3.5 cm, 25 cm)\n"


def scenes(spec, count=200, seed=0):
    lowest, highest = spec.box()
    return np.random.default_rng(seed).uniform(lowest[:, None], highest[:, None], size=(len(lowest), count))


def test_shares_are_those_of_formulas_and_each_object_has_one_where_none_asks():
    asked = check_text(FRONT + THINGS + "a: visibleShare(mug, front) >= 0 %\nb: viewRoom(mug, front) >= 0")
    rows = scenes(asked)
    (mug,) = sights_of(asked).views(rows)
    values = phi(asked.core, list(rows), NUMPY)
    assert (mug.camera, mug.thing) == ("front", 0)
    assert np.array_equal(mug.share, np.clip(values["a"], 0.0, 1.0)) and 0.05 < (mug.share < 1.0).mean() < 0.95
    assert np.array_equal(mug.whole, values["b"] >= 0.0)
    others = sights_of(check_text(FRONT + THINGS + "task: leftOf(mug, carton)")).views(rows)
    assert [one.thing for one in others] == [0, 1, 2] and np.array_equal(others[0].share, mug.share)


def test_whether_things_are_in_the_picture():
    """As the corners of a box fall in it; where all are beyond one side, nothing of it is seen."""
    text = "camera one = at (0.5, -0.2, 0.5) looks at (0.5, 0.5, 0) fov 30 deg, 4:3\n"
    spec = check_text(text + "object box1 = box(10 cm, 6 cm, 8 cm), b\ntask: leftOf(box1, b)")
    rows = scenes(spec, 2000)
    seen = sights_of(spec).views(rows)[0]
    camera = from_place(np.zeros((1, 3)), (400, 300), np.array([0.5, -0.2, 0.5]), np.array([0.5, 0.5, 0.0]), 30.0)
    x, y, theta = rows[:3]
    corners = np.array([(u, v, z) for u in (-0.05, 0.05) for v in (-0.03, 0.03) for z in (0.0, 0.08)])
    cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
    across = x[:, None] + cos * corners[:, 0] - sin * corners[:, 1]
    along = y[:, None] + sin * corners[:, 0] + cos * corners[:, 1]
    points = np.stack([across, along, np.broadcast_to(corners[:, 2], across.shape)], axis=2)
    pixels = camera.project(points.reshape(-1, 3)).reshape(len(x), 8, 2)
    inside = ((pixels >= 0.0) & (pixels <= (400.0, 300.0))).all(axis=2)
    assert np.array_equal(seen.whole, inside.all(axis=1)) and 0.1 < seen.whole.mean() < 0.9
    beyond = ((pixels < 0.0).all(axis=1) | (pixels > (400.0, 300.0)).all(axis=1)).any(axis=1)
    assert np.array_equal(~seen.any, beyond) and 0.05 < beyond.mean() < 0.9


@pytest.mark.parametrize(
    ("share", "whole", "part", "words"),
    [
        (1.0, True, True, "100 %"),
        (0.9999, True, True, "99 %"),
        (0.001, True, True, "1 %"),
        (0.0, True, True, "0 %"),
        (0.434, False, True, "43 %, partly out of view"),
        (1.0, False, False, "out of view"),
    ],
)
def test_shares_in_words(share, whole, part, words):
    assert Seen("front", 0, np.array([share]), np.array([whole]), np.array([part])).words(0) == words


def test_hands_are_at_the_yaw_with_the_most_room():
    text = "robot arm = panda at (0.5, -0.25, NORTH)\n" + THINGS + "require noOverlap()\n"
    graspable = check_text(text + "task: exists yaw in yaws(carton, arm): handRoom(carton, arm, yaw, 2 cm) >= 0")
    rows = scenes(graspable)
    (grip,) = sights_of(graspable).grips(rows)
    assert (graspable.objects[grip.thing], graspable.objects[grip.robot]) == ("carton", "arm")
    assert np.array_equal(grip.room, phi(graspable.core, list(rows), NUMPY)["task"])
    yaws = sorted({round(math.degrees(yaw)) for yaw in grip.yaw})
    assert len(yaws) > 1 and all(yaw % 15 == 0 for yaw in yaws)
    for yaw in yaws:  # the room at this yaw alone
        alone = check_text(text + f"task: handRoom(carton, arm, {yaw} deg, 2 cm) >= 0")
        here = np.isclose(np.degrees(grip.yaw), yaw)
        assert np.allclose(phi(alone.core, list(rows[:, here]), NUMPY)["task"], grip.room[here])


def test_drawn_surfaces_and_numbers():
    text = FRONT + "object tray at (0.5, 0.5), mug[1..2], can on any of [tray, workspace]\ntask: leftOf(can, tray)"
    for member in check_text(text).members:
        sights = sights_of(member)
        assert sights.of_shares.objects == member.core.objects
        assert len(sights.views(scenes(member, 8))) == len(member.objects)


def test_specs_without_cameras_and_robots_have_none():
    assert sights_of(check_text("task: leftOf(a, b)")) is None
    assert sights_of(check_text("time 5 steps\n" + FRONT + "task: always inView(a, front)")) is None
