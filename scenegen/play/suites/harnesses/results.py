"""Outcomes of a suite from what other harnesses write: vla-eval's `NAME_aggregate.json`, logs of Inspect Robots, and
LeRobot's `eval_info.json`.

An episode that failed in the harness, such as one that took too long, is a failure with its error, as in a run of ours.
LeRobot lists the successes of a task in the order of its starts, and says neither how many steps an episode took, nor
which policy and world it had: the policy is called by the folder of the results.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from scenegen.errors import DataError
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.learn.success.files import FileModel, OutcomesHeader, load_model
from scenegen.play.suites.harnesses.groups import SHORT_DIGEST, suite_of_group
from scenegen.play.suites.outcomes import EpisodeOutcome, SuiteOutcomes, check_outcomes, read_outcomes
from scenegen.play.suites.suite import Suite
from scenegen.scenes.files import read_bytes

RESULTS = "results of vla-eval or LeRobot, or a log of Inspect Robots"


class VlaParams(FileModel, extra="ignore"):
    """What the benchmark was made with."""

    world: str
    steps: int = 1000
    reverse: bool = False


class VlaConfig(FileModel, extra="ignore"):
    params: VlaParams
    max_steps: int | None = None


class VlaEpisode(FileModel, extra="ignore"):
    """`metrics` of one that failed in the harness have neither `start` nor `digest`."""

    episode_id: int
    metrics: dict[str, Any]
    steps: int = 0
    failure_reason: str | None = None


class VlaTask(FileModel, extra="ignore"):
    task: str
    episodes: list[VlaEpisode]


class VlaResults(FileModel, extra="ignore"):
    """vla-eval's results of one benchmark."""

    harness_version: str
    config: VlaConfig
    tasks: list[VlaTask]
    server_info: dict[str, Any] = Field(default_factory=dict)


class RobotsSpec(FileModel, extra="ignore"):
    policy: str
    environment_id: str
    environment_revision: str
    inspect_robots_version: str
    max_steps: int


class RobotsScene(FileModel, extra="ignore"):
    """Scores of each epoch, empty for one that failed."""

    scene_metadata: dict[str, Any]
    epochs: list[dict[str, float]]
    error: str | None = None


class RobotsLog(FileModel, extra="ignore"):
    """A log of Inspect Robots."""

    eval: RobotsSpec
    samples: list[RobotsScene]


class LerobotMetrics(FileModel, extra="ignore"):
    successes: list[bool]


class LerobotTask(FileModel, extra="ignore"):
    """A task of the suite that has the group; `task_id` is its place there."""

    task_group: str
    task_id: Annotated[int, Field(ge=0)]
    metrics: LerobotMetrics


class LerobotResults(FileModel, extra="ignore"):
    """LeRobot's results of an evaluation."""

    per_task: Annotated[list[LerobotTask], Field(min_length=1)]


@dataclass(frozen=True, slots=True)
class _Episode:
    """An episode of a task, by its name or its place: which start in the suite, if the harness says it, and of which
    suite, by the digest or its beginning; or else which of the task's starts."""

    task: str | int
    start: int | None
    turn: int
    digest: str | None
    success: bool
    steps: int | None
    error: str | None


def read_results(path: Path, suite: Suite) -> SuiteOutcomes:
    """The outcomes in a file, of a suite or of its reversed tasks: ours, or in a file `.json` those of another harness.
    Raises DataError."""
    if path.suffix != ".json":
        return read_outcomes(path, suite)
    data, run, versions = read_bytes(path, RESULTS), dict[str, Any](), dict[str, str]()
    try:
        keys = set(json.loads(data))
    except (ValueError, TypeError):
        raise _wrong(path, RESULTS, "it holds no JSON object") from None
    if "samples" in keys:
        log = load_model(RobotsLog, data, path, RESULTS)
        versions = {"inspect-robots": log.eval.inspect_robots_version}
        run = {"world": log.eval.environment_id, "policy": log.eval.policy, "steps": log.eval.max_steps}
        reverse, episodes = any(one.scene_metadata.get("reverse") for one in log.samples), list(_of_robots(path, log))
    elif "per_task" in keys:
        tasks = load_model(LerobotResults, data, path, RESULTS).per_task
        run = {"world": "unknown (LeRobot)", "policy": path.absolute().parent.name}
        reverse, episodes = suite_of_group(tasks[0].task_group)[1], list(_of_lerobot(path, tasks))
    else:
        found = load_model(VlaResults, data, path, RESULTS)
        params, most = found.config.params, found.config.max_steps
        versions = {"vla-eval": found.harness_version}
        policy = str(found.server_info.get("model_server", "a model server"))
        run = {"world": params.world, "policy": policy, "steps": min(params.steps, most or params.steps)}
        reverse, episodes = params.reverse, list(_of_vla(found))
    suite = suite if suite.reverse == reverse else Suite.load(suite.folder, reverse=reverse)
    digests = {one.digest for one in episodes if one.digest is not None}
    if not digests or any(digest != suite.digest[: max(len(digest), SHORT_DIGEST)] for digest in digests):
        of = ", ".join(digest[:12] for digest in sorted(digests)) or "no suite"
        raise _wrong(path, f"of the suite {suite.name}", f"its episodes are of {of}, not of {suite.digest[:12]}")
    header = OutcomesHeader(
        suite=suite.name, digest=suite.digest, reverse=reverse, episodes=len(suite), versions=versions or None, **run
    )
    outcomes = SuiteOutcomes(
        header, tuple(sorted(_number_episodes(path, suite, episodes), key=lambda one: one.episode))
    )
    check_outcomes(path, outcomes, suite)
    return outcomes


def _of_vla(found: VlaResults) -> Iterator[_Episode]:
    for task in found.tasks:
        for one in task.episodes:
            start, digest, success = (one.metrics.get(name) for name in ("start", "digest", "success"))
            yield _Episode(task.task, start, one.episode_id, digest, bool(success), one.steps, one.failure_reason)


def _of_robots(path: Path, log: RobotsLog) -> Iterator[_Episode]:
    for one in log.samples:
        start, task, digest = (one.scene_metadata.get(name) for name in ("start", "task", "digest"))
        if len(one.epochs) > 1:
            raise _wrong(path, RESULTS, f"start {start} was played {len(one.epochs)} times: run one epoch")
        scores = one.epochs[0] if one.epochs else {}
        success, steps = scores.get("success_at_end", 0.0) == 1.0, int(scores.get("episode_length", 0))
        yield _Episode(str(task), start, 0, digest, success, steps, one.error)


def _of_lerobot(path: Path, tasks: list[LerobotTask]) -> Iterator[_Episode]:
    groups = {task.task_group for task in tasks}
    if len(groups) > 1:
        raise _wrong(path, RESULTS, f"it is of {', '.join(sorted(groups))}: evaluate one suite at a time")
    digest, _ = suite_of_group(tasks[0].task_group)
    for task in tasks:
        for turn, success in enumerate(task.metrics.successes):
            yield _Episode(task.task_id, None, turn, digest, success, None, None)


def _number_episodes(path: Path, suite: Suite, episodes: list[_Episode]) -> Iterator[EpisodeOutcome]:
    """The outcomes with the numbers of their starts."""
    numbers: dict[str | int, list[int]] = {}
    for place, task in enumerate(suite.tasks):
        numbers[task.name] = numbers[place] = suite.numbers(task)
    played: set[int] = set()
    for one in episodes:
        of = numbers.get(one.task, [])
        number = of[one.turn] if one.start is None and 0 <= one.turn < len(of) else one.start
        if number not in of or number in played:
            what = f"start {number} of {one.task}" if number is not None else f"episode {one.turn} of {one.task}"
            reason = f"{what} is there twice, or the suite has no such start"
            raise _wrong(path, f"of the suite {suite.name}", reason)
        played.add(number)
        yield EpisodeOutcome(
            episode=number, task=suite[number].task.name, band=suite[number].band, success=one.success,
            steps=one.steps, error=one.error,
        )  # fmt: skip


def _wrong(path: Path, what: str, reason: str) -> DataError:
    return DataError(NOT_A_SUITE(file=path, what=what, reason=reason))
