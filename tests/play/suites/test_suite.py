"""A suite reads back start by start, keeps its bytes, and refuses what was edited."""

import hashlib
import json
import math

import numpy as np
import pytest

from scenegen.api.reading import read_scenes
from scenegen.errors import DataError
from scenegen.errors.files import PHI_DIFFERS
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.learn.success.files import BLANK_DIGEST
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.suite import SUITE_JSON, Suite, check_suite, overlapping, read_manifest


def test_episode_i_has_start_i(small):
    suite = Suite.load(small)
    assert (len(suite), suite.n, [band.name for _, band in suite.cells]) == (6, 3, ["level1", "level2"])
    scenes = read_scenes(small / "beside.json")
    for start in suite:
        band = start.number % 2
        assert start.row == 3 * band + start.number // 2
        assert np.array_equal(start.poses, scenes.poses7()[start.row])
        low, high = suite.tasks[0].bands[band].phi
        assert low <= start.phi["goal"] <= high < 1e-9 and start.phi["start"] >= 0.0
        assert start.probability == pytest.approx(0.5, abs=0.01) and start.band == f"level{band + 1}"
    assert [suite[4].poses.tolist(), suite[4].seed] == [Suite.load(small)[4].poses.tolist(), suite[4].seed]
    with pytest.raises(IndexError):
        suite[6]


def test_a_reversed_task_starts_at_the_goal(small):
    suite = Suite.load(small, reverse=True)
    assert suite.tasks[0].instruction == "Take a away from b." and suite.tasks[0].success == "start"
    assert all(start.phi["goal"] >= 0.0 > start.phi["start"] for start in suite)


def test_shares_of_starts_at_least_as_hard(small):
    """a is uniform over the square: the share of places farther from b than this one's distance, among all starts."""
    rng = np.random.default_rng(1)
    away = np.hypot(*rng.uniform(-0.15, 0.15, size=(2, 400_000)))
    away = away[away >= 0.1]
    for start in Suite.load(small):
        distance = np.hypot(*start.poses[0, :2])
        assert start.log10p == pytest.approx(np.log10((away >= distance).mean()), abs=0.05)


def test_the_digest_is_that_of_the_bytes(small):
    data, digest = (small / SUITE_JSON).read_bytes(), read_manifest(small).digest
    assert hashlib.sha256(data.replace(digest.encode(), BLANK_DIGEST.encode(), 1)).hexdigest() == digest


def test_checked_as_a_whole(small):
    assert [one.reverse for one in check_suite(small)] == [False, True]


def copied(small, folder, name, change):
    folder.mkdir()
    for path in small.iterdir():
        data = path.read_bytes()
        (folder / path.name).write_bytes(change(data) if path.name == name else data)
    return folder


def forged(folder):
    """The checksums and the digest of a folder made those of its files."""
    data = json.loads((folder / SUITE_JSON).read_bytes())
    for task in data["tasks"] + data["reversed"]:
        task["sha256"] = hashlib.sha256((folder / task["scenes"]).read_bytes()).hexdigest()
    text = json.dumps({**data, "digest": BLANK_DIGEST})
    (folder / SUITE_JSON).write_text(text.replace(BLANK_DIGEST, hashlib.sha256(text.encode()).hexdigest(), 1))
    return folder


@pytest.mark.parametrize(
    "name, old, new",
    [
        (SUITE_JSON, b'"seed": 0', b'"seed": 1'),
        ("beside.json", b'"x": 0.', b'"x": 0.0'),
        (SUITE_JSON, b'"version"', b'"Version"'),
    ],
)
def test_what_was_edited_is_refused(small, tmp_path, name, old, new):
    folder = copied(small, tmp_path / "edited", name, lambda data: data.replace(old, new, 1))
    with pytest.raises(DataError) as caught:
        Suite.load(folder)
    assert caught.value.diagnostics[0].kind == NOT_A_SUITE


def test_a_forged_suite_does_not_pass_the_check(small, tmp_path):
    moved = copied(
        small, tmp_path / "moved", "beside.json", lambda data: data.replace(b'"a": {"x": 0.', b'"a": {"x": 0.0', 1)
    )
    forged(moved)
    Suite.load(moved)
    with pytest.raises(DataError) as caught:
        check_suite(moved)
    assert caught.value.diagnostics[0].kind == PHI_DIFFERS


def changed(small, folder, change):
    """A copy of the suite whose suite.json was changed, and has the digest of what it then is."""
    copied(small, folder, "nothing", lambda data: data)
    data = json.loads((folder / SUITE_JSON).read_bytes())
    change(data)
    (folder / SUITE_JSON).write_text(json.dumps(data))
    return forged(folder)


def widened(data):
    data["tasks"][0]["bands"][1]["phi"][1] += 0.001


def turned(data):
    data["reversed"][0]["bands"][0]["phi"].reverse()


def certain(data):
    data["tasks"][0]["bands"][0]["probability"] = 1.0


@pytest.mark.parametrize(
    "change, reason",
    [
        (widened, "the bands level2 and level1 of beside overlap"),
        (turned, "a band of beside ends below its beginning"),
        (certain, "the bands of beside are more probable than all starts"),
    ],
)
def test_bands_that_would_count_starts_twice_are_refused(small, tmp_path, change, reason):
    with pytest.raises(DataError) as caught:
        Suite.load(changed(small, tmp_path / "changed", change))
    assert caught.value.diagnostics[0].facts["reason"] == reason


def test_ranges_overlap_where_they_have_more_than_an_end_in_common():
    assert overlapping([("a", -1.0, 0.0), ("b", -3.0, -2.0), ("c", -2.0, -1.0)]) is None
    assert overlapping([("a", -1.0, 0.0), ("b", -9.0, -8.0), ("c", -2.0, -0.9)]) == ("c", "a")
    assert overlapping([("all", -math.inf, math.inf), ("near", -0.05, 0.0)]) == ("all", "near")


def test_reversed_starts_are_where_the_task_ends(small, tmp_path):
    """Those of this suite's reversed task are the task's own starts."""

    def change(data):
        data["reversed"] = data["tasks"]

    folder = changed(small, tmp_path / "changed", change)
    Suite.load(folder, reverse=True)
    with pytest.raises(DataError, match="not where the task the other way ends"):
        check_suite(folder)


@pytest.mark.long
def test_the_suite_that_ships(root, tmp_path):
    """It is sound, has ten tasks of five bands with instructions and ways back; and its specs give the same bytes."""
    there, back = check_suite("tabletop")
    assert (len(there), len(there.tasks), there.n, len(back)) == (2500, 10, 50, 2500)
    assert all(len(task.bands) == 5 and task.instruction.endswith(".") for task in (*there.tasks, *back.tasks))
    assert sum(path.stat().st_size for path in (root / "suites" / "tabletop").iterdir()) < 3e6
    new_suite([("sides", root / "suites" / "tabletop" / "sides.spec")], tmp_path / "tabletop", workers=1)
    for name in ("sides.json", "sides.reverse.json"):
        assert (tmp_path / "tabletop" / name).read_bytes() == (root / "suites" / "tabletop" / name).read_bytes()
