"""The layout of a pose: places in storage, shapes, and that nothing else in the package writes it out."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen import pose
from scenegen.geometry.workspace import Workspace
from scenegen.scenes.data import Pose

SOURCES = Path(scenegen.__file__).parent
# `rows[2::3]`, `row % 3 == 2`, `row // 3`, `3 * thing + axis`, `3 * len(objects)`, `rows.reshape(-1, 3)`
STRIDES = re.compile(
    r"\[\w*::3\]|\brow\w* (%|//) 3\b|\b3 \* (thing|index|which|object|other)\b|\b3 \* (\w+\.)*objects\b"
    r"|\b3 \* len\(|\b(rows|poses)\S*\.reshape\([^()]*, 3\)"
)


def test_a_row_belongs_to_one_object_and_one_axis() -> None:
    rows = [pose.row_of(thing, axis) for thing in range(3) for axis in pose.EVERY]
    assert rows == list(range(pose.row_count(3))) == [row for thing in range(3) for row in pose.rows_of(thing)]
    assert [(pose.owner(row), pose.axis_of(row)) for row in rows] == [
        (k, axis) for k in range(3) for axis in pose.EVERY
    ]
    assert pose.object_count(len(rows)) == 3
    assert [rows[pose.span_of(thing)] for thing in range(3)] == [list(pose.rows_of(thing)) for thing in range(3)]
    for axis in pose.EVERY:
        assert rows[pose.rows_along(axis)] == [row for row in rows if pose.axis_of(row) == axis]


def test_axes_are_lengths_or_angles() -> None:
    assert pose.NAMES[: len(pose.FLAT)] == ("x", "y", "theta")
    assert sorted((*pose.LENGTHS, *pose.ANGLES)) == list(pose.EVERY)
    assert [row for row in range(pose.row_count(2)) if pose.is_angle(row)] == [
        pose.row_of(thing, pose.THETA) for thing in range(2)
    ]
    assert tuple(Pose.model_fields) == pose.NAMES, "scene files have each coordinate by its name"


@pytest.mark.parametrize("scenes", [0, 1, 5])
def test_storage_and_poses_are_one_another(scenes: int) -> None:
    rows = np.arange(pose.row_count(2) * scenes, dtype=float).reshape(pose.row_count(2), scenes)
    poses = pose.as_poses(rows)
    assert poses.shape == (scenes, 2, pose.SIZE)
    assert np.shares_memory(poses, rows) or not scenes
    for thing in range(2):
        for axis in pose.EVERY:
            assert (poses[:, thing, axis] == rows[pose.row_of(thing, axis)]).all()
    assert (pose.as_rows(poses) == rows).all()
    assert pose.flat(poses).shape == (scenes, 2, 3)
    assert pose.places(poses).shape == (scenes, 2, 2)
    if scenes:
        assert (pose.as_poses(rows[:, 0]) == poses[0]).all()
        assert (pose.as_rows(poses[0]) == rows[:, 0]).all()


def test_the_workspace_has_a_range_for_each_axis() -> None:
    space = Workspace((0.0, 2.0), (-1.0, 1.0))
    assert len(space.ranges) == len(space.scales) == pose.SIZE
    lowest, highest = space.box(2)
    assert lowest[pose.rows_along(pose.Y)].tolist() == [-1.0, -1.0]
    assert highest[pose.rows_along(pose.THETA)].tolist() == [pose.TWO_PI] * 2
    assert space.contains(np.stack([lowest, highest], axis=1)).tolist() == [True, False], "theta ends below 2 pi"
    highest[pose.rows_along(pose.THETA)] = pose.BELOW_TURN
    assert space.contains(highest[:, None]).all()


@pytest.mark.long
def test_nothing_else_writes_the_layout_out() -> None:
    found = [
        f"{path.relative_to(SOURCES)}:{number}: {line.strip()}"
        for path in sorted(SOURCES.rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if STRIDES.search(line)
    ]
    assert not found, f"write these with scenegen.pose: {found}"
    assert STRIDES.search("x, y = rows[0::3], rows[1::3]")
    assert STRIDES.search("poses = np.ascontiguousarray(rows.T).reshape(count, -1, 3)")


def test_it_loads_without_numpy() -> None:
    code = "import sys, scenegen.pose; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
