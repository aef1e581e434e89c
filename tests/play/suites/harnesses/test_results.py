"""Results of other harnesses, as their files are: outcomes by the number of the start, and what is refused."""

import copy
import json

import pytest

from scenegen.errors import DataError
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.play.suites.harnesses.groups import group_name
from scenegen.play.suites.harnesses.results import read_results
from scenegen.play.suites.outcomes import dump_outcomes, read_outcomes
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.suite import Suite


@pytest.fixture
def suite(small):
    return Suite.load(small)


@pytest.fixture
def vla(suite):
    """What vla-eval 0.8 writes, episodes as they ended; the third was lost in the harness."""
    episodes = [
        {"sid": "a", "episode_id": which, "metrics": {"success": which == 4, "start": which, "digest": suite.digest}}
        for which in (4, 0, 1)
    ]
    lost = {"episode_id": 2, "metrics": {"success": False}, "failure_reason": "timeout", "failure_detail": "..."}
    return {
        "benchmark": "small",
        "harness_version": "0.8.0",
        "tasks": [{"task": "beside", "episodes": [*({**one, "steps": 9} for one in episodes), lost]}],
        "config": {"max_steps": 12, "params": {"suite": "small", "world": "table", "steps": 20}},
        "server_info": {"model_server": "Mine"},
    }


@pytest.fixture
def robots(suite):
    """What Inspect Robots 0.60 writes; the second trial failed."""
    scenes = [
        {
            "scene_id": f"{which:04d}",
            "scene_metadata": {"start": which, "task": "beside", "digest": suite.digest, "reverse": False},
            "epochs": [{} if which == 1 else {"success_at_end": float(which == 3), "episode_length": 5.0}],
            "error": "PolicyError: no plan" if which == 1 else None,
        }
        for which in (0, 1, 3)
    ]
    spec = {"policy": "mine", "environment_id": "table", "environment_revision": suite.digest, "max_steps": 20}
    return {"version": 1, "eval": {**spec, "inspect_robots_version": "0.60.0"}, "samples": scenes}


@pytest.fixture
def lerobot(suite):
    """What LeRobot 0.4.4 writes: successes of a task in the order of its starts."""
    metrics = {"sum_rewards": [0.0, 1.0, 0.0, 1.0], "max_rewards": [0.0, 1.0, 0.0, 1.0], "video_paths": []}
    task = {
        "task_group": group_name(suite),
        "task_id": 0,
        "metrics": {**metrics, "successes": [False, True, False, True]},
    }
    return {"per_task": [task], "per_group": {}, "overall": {"n_episodes": 4}}


def read(tmp_path, data, suite):
    (tmp_path / "results.json").write_text(data if isinstance(data, str) else json.dumps(data))
    return read_results(tmp_path / "results.json", suite)


def test_results_of_vla_eval(tmp_path, vla, suite):
    found = read(tmp_path, vla, suite)
    assert [(one.episode, one.success, one.steps, one.error) for one in found.episodes] == [
        (0, False, 9, None),
        (1, False, 9, None),
        (2, False, 0, "timeout"),
        (4, True, 9, None),
    ]
    assert [one.band for one in found.episodes] == [suite[number].band for number in (0, 1, 2, 4)]
    header = found.header
    assert (header.suite, header.digest, header.episodes, header.reverse) == ("small", suite.digest, 6, False)
    assert (header.world, header.policy, header.steps, header.versions) == ("table", "Mine", 12, {"vla-eval": "0.8.0"})


def test_logs_of_inspect_robots(tmp_path, robots, suite):
    found = read(tmp_path, robots, suite)
    assert [(one.episode, one.success, one.steps, one.error) for one in found.episodes] == [
        (0, False, 5, None),
        (1, False, 0, "PolicyError: no plan"),
        (3, True, 5, None),
    ]
    assert (found.header.world, found.header.policy, found.header.steps) == ("table", "mine", 20)


def test_results_of_lerobot(tmp_path, lerobot, suite, small):
    """They name the suite by its group; steps, world and policy are not in them."""
    found = read(tmp_path, lerobot, suite)
    assert [(one.episode, one.success, one.steps, one.error) for one in found.episodes] == [
        (0, False, None, None),
        (1, True, None, None),
        (2, False, None, None),
        (3, True, None, None),
    ]
    assert [one.band for one in found.episodes] == [suite[number].band for number in range(4)]
    header = found.header
    assert (header.digest, header.policy, header.steps, header.versions) == (suite.digest, tmp_path.name, None, None)
    back = Suite.load(small, reverse=True)
    lerobot["per_task"][0]["task_group"] = group_name(back)
    assert read(tmp_path, lerobot, suite).header.reverse
    report = report_suite(small, [tmp_path / "results.json"], tmp_path / "report.md").read_text()
    assert "2 of 4" in report and "solved at once" not in report


def test_outcomes_without_steps_come_back(tmp_path, lerobot, suite):
    found = read(tmp_path, lerobot, suite)
    (tmp_path / "o.jsonl").write_bytes(dump_outcomes(found.header, found.episodes))
    assert read_outcomes(tmp_path / "o.jsonl", suite).episodes == found.episodes


@pytest.mark.parametrize(
    "path, to, reason",
    [
        (("task_group",), "small", "no suite"),
        (("task_group",), "small-000000000000", "000000000000"),
        (("task_id",), 1, "no such start"),
        (("task_id",), -1, "task_id"),
        (("metrics", "successes"), [True] * 7, "episode 6"),
        (("metrics", "successes"), [0.5], "successes"),
    ],
)
def test_wrong_results_of_lerobot(tmp_path, lerobot, suite, path, to, reason):
    with pytest.raises(DataError, match=reason) as caught:
        read(tmp_path, changed(lerobot, "per_task", 0, *path, to=to), suite)
    assert [one.kind for one in caught.value.diagnostics] == [NOT_A_SUITE]


def test_results_of_two_suites_at_once(tmp_path, lerobot, suite):
    """Their tasks have the same numbers."""
    lerobot["per_task"].append({**lerobot["per_task"][0], "task_group": "libero_object"})
    with pytest.raises(DataError, match="libero_object"):
        read(tmp_path, lerobot, suite)


def test_results_of_reversed_tasks(tmp_path, vla, suite):
    vla["config"]["params"]["reverse"] = True
    assert read(tmp_path, vla, suite).header.reverse


def changed(data, *path, to):
    made = copy.deepcopy(data)
    place = made
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to
    return made


FIRST = "tasks", 0, "episodes", 0


@pytest.mark.parametrize(
    "path, to, reason",
    [
        ((*FIRST, "metrics", "digest"), "0" * 64, "000000000000"),
        ((*FIRST, "metrics", "start"), 0, "twice"),
        ((*FIRST, "metrics", "start"), 6, "no such start"),
        ((*FIRST, "metrics", "start"), "four", "no such start"),
        (("tasks", 0, "episodes", 3, "episode_id"), 6, "no such start"),
        (("tasks", 0, "task"), "besides", "no such start"),
        (("tasks",), [], "no suite"),
        (("config", "params"), {}, "world"),
    ],
)
def test_wrong_results_of_vla_eval(tmp_path, vla, suite, path, to, reason):
    with pytest.raises(DataError, match=reason) as caught:
        read(tmp_path, changed(vla, *path, to=to), suite)
    assert [one.kind for one in caught.value.diagnostics] == [NOT_A_SUITE]


@pytest.mark.parametrize("path, to, reason", [(("epochs",), [{}, {}], "2 times"), (("scene_metadata",), {}, "start")])
def test_wrong_logs(tmp_path, robots, suite, path, to, reason):
    with pytest.raises(DataError, match=reason):
        read(tmp_path, changed(robots, "samples", 0, *path, to=to), suite)


@pytest.mark.parametrize("text", ["", "[", "3", "[1]", '{"a": 1}', '{"samples": []}'])
def test_what_is_no_file_of_results(tmp_path, suite, text):
    with pytest.raises(DataError):
        read(tmp_path, text, suite)
