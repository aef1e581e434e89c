"""A suite as a benchmark of vla-eval, by the import string `scenegen.play.suites.harnesses.vla_eval:SuiteBenchmark`.

Non-obvious behaviors:

* Episode i of a task has start `suite.numbers(task)[i]`, in every shard and after every reset, however the episodes
  before it ended. An episode beyond the last start is refused: it would be a start that was played before. With
  `throughput_mode`, vla-eval begins again at the first.
* Each result has `start`, the number of the start in the suite, and `digest`, the suite's, beside `success`:
  `scenegen suite report SUITE results/..._aggregate.json` reads them.
* vla-eval acts once in an episode that has already ended when it begins; the action then changes nothing.
* An action is the array `actions` of the policy's answer, as the world takes it. vla-eval compares no conventions of
  actions and observations, since a suite does not know what the numbers of its world mean.
* Observations have `images`, `state` (hand, fingers, joints), `environment_state` and `task_description`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from vla_eval.benchmarks.base import StepBenchmark, StepResult
from vla_eval.specs import DimSpec
from vla_eval.types import Action, EpisodeResult, Observation, Task

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE
from scenegen.play.suites.episodes import TaskEpisodes, check_steps
from scenegen.play.suites.harnesses.observations import split_observation
from scenegen.play.suites.loading import check_name
from scenegen.play.suites.suite import GradedStart, Suite, SuiteTask


class SuiteBenchmark(StepBenchmark):  # type: ignore[misc]
    """The tasks of a suite, by its folder or name, in a `world`; `steps` are the most of an episode. `tasks` are some
    of them, by name. Raises DataError for what is no suite, and RequestError."""

    render_backends: ClassVar[frozenset[str]] = frozenset({"gpu", "cpu"})

    def __init__(
        self,
        suite: str,
        world: str,
        steps: int = 1000,
        reverse: bool = False,
        tasks: Sequence[str] | None = None,
    ) -> None:
        super().__init__()
        check_name("world", world)
        self.suite, self.world, self.most = Suite.load(suite, reverse=reverse), world, check_steps(steps)
        self._tasks = {task.name: task for task in self.suite.tasks}
        for name in tasks or ():
            if name not in self._tasks:
                raise RequestError(UNKNOWN_CHOICE(what="task", name=name, known=self._tasks))
        self._names = list(tasks or self._tasks)
        self._episodes: TaskEpisodes | None = None
        self._start: GradedStart | None = None

    @classmethod
    def configure_render(cls, mode: str) -> dict[str, str]:
        """Worlds choose how they render, as by MUJOCO_GL."""
        return {}

    def get_tasks(self) -> list[Task]:
        return [{"name": name, "suite": self.suite.name} for name in self._names]

    def get_metadata(self) -> dict[str, Any]:
        count = min(len(self.suite.numbers(self._tasks[name])) for name in self._names)
        return {"max_steps": self.most, "max_episodes_per_task": count, "digest": self.suite.digest}

    def get_action_spec(self) -> dict[str, DimSpec]:
        return {}

    def get_observation_spec(self) -> dict[str, DimSpec]:
        return {}

    def reset(self, task: Task) -> Any:
        """Begin the episode `task["episode_idx"]`. Raises RequestError where the task has no such start, and
        ScenegenError for a world that cannot be made."""
        one: SuiteTask = self._tasks[task["name"]]
        numbers, which = self.suite.numbers(one), int(task["episode_idx"])
        if not 0 <= which < len(numbers):
            wanted = f"fewer than the {len(numbers)} starts of {one.name}"
            raise RequestError(OUT_OF_RANGE(argument="episode", value=which, wanted=wanted))
        if self._episodes is None or self._episodes.task is not one:
            self.cleanup()
            self._episodes = TaskEpisodes(self.world, one, self.most)
        self._start = self.suite[numbers[which]]
        self._episodes.begin(self._start)
        return self._episodes.observation

    def step(self, action: Action) -> StepResult:
        episodes = self._episodes
        assert episodes is not None  # reset() made it
        episodes.step(np.asarray(action["actions"]))
        info = {"success": episodes.success}
        return StepResult(episodes.observation, float(episodes.reward), episodes.ended, info)

    def make_obs(self, raw_obs: Any, task: Task) -> Observation:
        found = split_observation(raw_obs)
        parts: Observation = {"images": found.pictures, "state": found.robot, "environment_state": found.surroundings}
        named = {name: part for name, part in parts.items() if len(part)}
        return {**named, "task_description": self._tasks[task["name"]].instruction}

    def get_step_result(self, step_result: StepResult) -> EpisodeResult:
        assert self._start is not None
        success = bool(step_result.info.get("success", False))
        return {"success": success, "start": self._start.number, "digest": self.suite.digest}

    def cleanup(self) -> None:
        if self._episodes is not None:
            self._episodes.close()
        self._episodes = None

    def render(self) -> Any:
        """(H, W, 3): the first picture that the world observes, or None."""
        if self._episodes is None:
            return None
        return next(iter(split_observation(self._episodes.observation).pictures.values()), None)
