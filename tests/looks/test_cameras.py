"""Cameras of looks: where they are, what they see, and how they are turned."""

import numpy as np
import pytest

from scenegen.looks.camera import at_angles, from_place
from scenegen.looks.configuration import read_looks
from scenegen.looks.look import field_of

POINTS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (-0.04, 0.2)])
SIZE = (640, 480)


def look(folder, text):
    (folder / "looks.toml").write_text(text)
    return read_looks(folder / "looks.toml").draw_look(0, 0)


def test_a_camera_is_where_it_is_said_and_looks_where_it_is_said(tmp_path):
    found = look(tmp_path, "[camera]\nposition = [0.3, -0.9, 0.8]\nlook_at = [0.5, 0.4, 0.1]\n").camera(POINTS, SIZE)
    np.testing.assert_allclose(found.eye, [0.3, -0.9, 0.8], atol=1e-12)
    np.testing.assert_allclose(found.project([[0.5, 0.4, 0.1]]), [[320.0, 240.0]], atol=1e-9)
    above = found.project([[0.5, 0.4, 0.3]])[0]
    assert above[0] == pytest.approx(320.0) and above[1] < 240.0  # up is up


def test_without_a_target_it_looks_at_the_middle_of_the_table(tmp_path):
    found = look(tmp_path, "[camera]\nposition = [2, 3, 1]\n").camera(POINTS, SIZE)
    np.testing.assert_allclose(found.project([[0.5, 0.5, 0.0]]), [[320.0, 240.0]], atol=1e-9)


def test_straight_down_is_as_the_view_from_above(tmp_path):
    found = look(tmp_path, "[camera]\nposition = [0.5, 0.5, 2]\n").camera(POINTS, SIZE)
    left, right = found.project([[0.1, 0.5, 0.0], [0.9, 0.5, 0.0]])
    near, far = found.project([[0.5, 0.1, 0.0], [0.5, 0.9, 0.0]])
    assert left[0] < right[0] and near[1] > far[1]


@pytest.mark.parametrize("roll", [-30.0, 10.0, 90.0])
def test_roll_leans_the_camera_to_the_right(roll):
    """A camera that leans to the right shows an upright line leaning to the left by the same angle."""
    place = np.array([0.5, -1.0, 0.5]), np.array([0.5, 0.5, 0.5])
    line = [[0.5, 0.5, 0.5], [0.5, 0.5, 0.6]]
    for camera in (from_place(POINTS, SIZE, *place, 40.0, roll), at_angles(POINTS, SIZE, 0.0, 5.0, 40.0, 1.0, roll)):
        (u0, v0), (u1, v1) = camera.project(line)
        assert np.degrees(np.arctan2(u1 - u0, v0 - v1)) == pytest.approx(-roll, abs=0.5)


def test_the_focal_length_is_that_of_a_picture_24_mm_high(tmp_path):
    assert field_of(12.0) == pytest.approx(90.0)
    drawn = look(tmp_path, "[camera]\nfocal_length = 35\n")
    assert drawn.camera_fov == pytest.approx(2.0 * np.degrees(np.arctan(12.0 / 35.0)))
    assert drawn.as_json()["camera_focal_length"] == pytest.approx(35.0)
    assert drawn.camera(POINTS, SIZE).intrinsics()["fy"] == pytest.approx(480.0 * 35.0 / 24.0)


def test_a_moved_frame_moves_the_camera_with_it(tmp_path):
    drawn = look(tmp_path, "[camera]\nposition = [2, 3, 1]\nlook_at = [1, 1, 0]\n")
    moved = drawn.shift(1000.0, -5.0).camera(POINTS - (1000.0, -5.0, 0.0), SIZE)
    some = np.array([[0.2, 0.7, 0.1]])
    np.testing.assert_allclose(moved.project(some - (1000.0, -5.0, 0.0)), drawn.camera(POINTS, SIZE).project(some))


@pytest.mark.parametrize("text", ["", "[camera]\nposition = [-4, 9, 3]\n", "[camera]\nposition = [0.5, 0.5, 5]\n"])
def test_the_camera_is_inside_the_room(tmp_path, text):
    drawn = look(tmp_path, f"[walls]\ndistance = 0.3\n{text}")
    eye = drawn.camera(POINTS, SIZE).eye
    x0, y0, x1, y1 = drawn.room((0.0, 0.0, 1.0, 1.0), eye)
    assert x0 < eye[0] < x1 and y0 < eye[1] < y1
    assert x0 <= -0.3 and y0 <= -0.3 and x1 >= 1.3 and y1 >= 1.3
