"""What stands on the table: phi, bands and advice, and tables of poses."""

import math

import numpy as np
import pytest

from scenegen.errors import DataError, RequestError
from scenegen.play.stage.check import band_at, check_poses, margins_at, scene_of
from scenegen.play.stage.measure import check_ruler, check_table, measure_poses, poses_by_corners
from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.suite import Suite


def poses_of(start):
    return start.task.scenes.poses[start.row].copy()


def test_a_start_is_as_it_says(suite):
    for number in range(0, len(suite), 97):
        start = suite[number]
        found = check_poses(start, poses_of(start))
        assert found.ok and found.band == start.band and not found.off.any()
        assert found.phi == pytest.approx(start.phi[start.task.success], abs=1e-9)


@pytest.mark.long
def test_advice_that_is_followed_makes_the_start_right(suite):
    rng, advised, right = np.random.default_rng(0), 0, 0
    for _ in range(150):
        start = suite[int(rng.integers(len(suite)))]
        poses = poses_of(start) + rng.normal(0.0, (0.01, 0.01, 0.15), (len(start.objects), 3))
        found = check_poses(start, poses)
        if found.ok:
            continue
        advised += 1
        which = start.objects.index(found.move.name)
        poses[which] += (found.move.x, found.move.y, found.move.turn)
        after = check_poses(start, poses)
        assert after.phi == pytest.approx(found.move.phi, abs=1e-9)
        right += after.ok
    assert advised > 40 and right >= 0.9 * advised  # where no single move is enough, the farthest goes back


def test_advice_moves_less_than_going_back(suite):
    start = next(one for one in suite if one.task.name == "beside" and one.band == "level1")
    poses = poses_of(start)
    away = poses[1, :2] - poses[0, :2]
    poses[0, :2] -= 0.06 * away / np.linalg.norm(away)
    found = check_poses(start, poses)
    assert not found.ok and math.hypot(found.move.x, found.move.y) < 0.06


def test_a_requirement_that_breaks_is_named(suite, stage):
    start = next(one for one in suite if one.task.name == "beside")
    poses = poses_of(start)
    poses[0, :2] = poses[1, :2] + (0.045, 0.0)
    found = check_poses(start, poses)
    assert "farFrom(red, blue, 0.09) is -" in found.broken and not found.ok
    assert found.lines(stage)[-1].count("move ") == 1


def test_what_is_held_goes_back_to_its_place(root):
    suite = Suite.load(root / "tests" / "golden" / "play" / "suites" / "small")
    start = suite[0]
    poses = poses_of(start)
    poses[1, 0] += 0.02
    found = check_poses(start, poses)
    assert found.band == start.band and found.move.name == "b" and found.move.x == pytest.approx(-0.02)


def test_a_scene_of_what_stands_there(suite, tmp_path):
    start = suite[3]
    poses = poses_of(start)
    poses[:, 0] += 0.001
    one = scene_of(check_poses(start, poses))
    from scenegen.api.reading import read_scenes

    again = read_scenes(one.save(tmp_path / "set.json"))
    assert np.allclose(again.poses[0], poses) and again.phi.keys() == start.phi.keys()


def test_margins_are_those_of_the_stored_scenes(suite):
    start = suite[0]
    phi, required = margins_at(start, start.task.scenes.poses)
    assert np.allclose(phi, start.task.scenes.phi[start.task.success]) and (required >= 0.0).all()
    assert band_at(start.task, 1.0) is None


def write_table(path, start, poses):
    names = [f"{name}.{axis}" for name in start.objects for axis in ("x", "y", "theta")]
    path.write_text(",".join(names) + "\n" + ",".join(map(str, poses.ravel())) + "\n")
    return path


def test_poses_from_a_table(suite, stage, tmp_path):
    start = suite[7]
    path = write_table(tmp_path / "p.csv", start, poses_of(start))
    assert np.allclose(measure_poses(stage, start, poses=path), poses_of(start))


def test_a_pose_off_the_table(suite, stage, tmp_path):
    start = suite[7]
    poses = poses_of(start)
    poses[0, 0] = 0.3
    with pytest.raises(DataError) as caught:
        measure_poses(stage, start, poses=write_table(tmp_path / "p.csv", start, poses))
    (wrong,) = caught.value.diagnostics
    assert wrong.kind.code == "stage-things" and "red" in wrong.text("title") and "off the table" in wrong.text("title")
    poses[0, 0] = 0.19
    check_table(stage, start, poses)


def test_headings_in_degrees_and_clicks_without_names(suite, stage, tmp_path):
    start = suite[7]
    poses = poses_of(start)
    poses[:, 2] = 90.0
    with pytest.raises(DataError) as caught:
        measure_poses(stage, start, poses=write_table(tmp_path / "p.csv", start, poses))
    assert "`red` is turned by 90" in caught.value.diagnostics[0].text("title")
    (tmp_path / "c.csv").write_text("u,v\n1,2\n")
    with pytest.raises(DataError) as caught:
        poses_by_corners(stage, start, tmp_path / "c.csv", None)
    assert caught.value.diagnostics[0].kind.code == "table-column"


def test_a_printer_that_shrinks_by_its_ruler():
    check_ruler("p.jpg", 0.1002)
    with pytest.raises(DataError) as caught:
        check_ruler("p.jpg", 0.097)
    with pytest.raises(RequestError, match="97 m"):  # 97 without a unit
        check_ruler("p.jpg", 97.0)
    assert "printed at 97.0 %" in caught.value.diagnostics[0].text("title")


def test_the_mat_of_a_suite_of_one_task_is_its_own(root):
    small = TableStage.from_suite(Suite.load(root / "tests" / "golden" / "play" / "suites" / "small"))
    assert small.margin == 0.02 and [one.name for one in small.things] == ["a", "b"]
