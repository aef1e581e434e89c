"""A suite as the task `scenegen` of Inspect Robots, and a world as its embodiment `scenegen`, both by entry points.

Non-obvious behaviors:

* Every start is a Scene, whose id is the number of the start in the suite, as `0007`: ids are what episodes are known
  by. Scenes come task after task, since each task has an environment of its own.
* A scene's metadata has the start's geometry (`objects`, and `poses` in the spec's frame), `phi` by label, `band`,
  `task` and the `digest` of the suite: the embodiment refuses scenes of another suite.
* The embodiment begins the start that the scene names, whatever was reset before, and uses no seed of the run: with
  several epochs each epoch has the same starts, and the same randomness in them.
* Success is the world's own judgement; the scorers are `success_at_end` and `episode_length`, which
  `scenegen suite report SUITE LOG.json` reads.
* An error of the world ends the whole run, as Inspect Robots has it for every embodiment.
* An episode that has already ended when it begins ends with its first action, which changes nothing.
* No control mode is declared, since a suite does not know what the numbers of its world mean: Inspect Robots then says
  that it cannot compare it with the policy's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from inspect_robots.embodiment import PRIVILEGED_SUCCESS, RESETTABLE, EmbodimentBase, EmbodimentInfo
from inspect_robots.scene import Scene, Target
from inspect_robots.spaces import Box, CameraSpec, ObservationSpace
from inspect_robots.task import Task
from inspect_robots.types import Action, Observation, StepResult

from scenegen.errors import DataError
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.play.suites.episodes import TaskEpisodes, check_steps
from scenegen.play.suites.harnesses.observations import action_box, split_observation
from scenegen.play.suites.loading import check_name
from scenegen.play.suites.suite import GradedStart, Suite

TARGET_KIND = "scenegen"


def suite_task(suite: str, steps: int = 1000, reverse: bool = False) -> Task:
    """The task of a suite, by its folder or name. Raises DataError for what is none, and RequestError."""
    loaded = Suite.load(suite, reverse=reverse)
    numbers = [number for task in loaded.tasks for number in loaded.numbers(task)]
    scenes = [scene_of(loaded, loaded[number]) for number in numbers]
    metadata = {"suite": loaded.name, "digest": loaded.digest, "reverse": reverse}
    return Task(loaded.name, scenes, ["success_at_end", "episode_length"], check_steps(steps), metadata=metadata)


def scene_of(suite: Suite, start: GradedStart) -> Scene:
    """A start as a scene; its metadata is what JSON can hold."""
    metadata = {
        "start": start.number,
        "task": start.task.name,
        "band": start.band,
        "phi": start.phi,
        "objects": list(start.objects),
        "poses": start.poses.tolist(),
        "digest": suite.digest,
        "reverse": suite.reverse,
    }
    target = Target(TARGET_KIND, {"label": start.task.success})
    return Scene(f"{start.number:04d}", start.task.instruction, target, start.seed, metadata=metadata)


class WorldEmbodiment(EmbodimentBase):  # type: ignore[misc]
    """The tasks of a suite in a `world`; `steps` are the most of an episode. Raises DataError for what is no suite, and
    ScenegenError for a world that cannot be made."""

    def __init__(self, suite: str, world: str, steps: int = 1000, reverse: bool = False) -> None:
        check_name("world", world)
        self.suite, self.world, self.most = Suite.load(suite, reverse=reverse), world, check_steps(steps)
        first = self.suite[0]
        self._episodes = TaskEpisodes(world, first.task, self.most)
        try:
            low, high = action_box(world, self._episodes.env)
            self._episodes.begin(first)  # what a world observes shows only then
        except BaseException:
            self.close()
            raise
        seen = split_observation(self._episodes.observation)
        cameras = tuple(CameraSpec(name, *picture.shape) for name, picture in seen.pictures.items())
        self.info = EmbodimentInfo(
            name=f"scenegen-{world}",
            action_space=Box(low.shape, low, high),
            observation_space=ObservationSpace(cameras, frozenset(seen.numbers)),
            is_simulated=True,
            capabilities=frozenset({RESETTABLE, PRIVILEGED_SUCCESS}),
            supported_target_kinds=frozenset({TARGET_KIND}),
            environment_id=world,
            environment_revision=self.suite.digest,
        )

    def reset(self, scene: Scene, *, seed: int | None = None) -> Observation:
        """Begin the scene's start. Raises DataError for a scene of another suite, and what the world raises."""
        if (scene.metadata.get("digest"), scene.metadata.get("reverse")) != (self.suite.digest, self.suite.reverse):
            reason = f"the embodiment has the suite {self.suite.name}, or its reversed tasks"
            raise DataError(NOT_A_SUITE(file=f"scene {scene.id}", what="a start of the suite", reason=reason))
        start = self.suite[scene.metadata["start"]]
        if self._episodes.task is not start.task:
            self.close()
            self._episodes = TaskEpisodes(self.world, start.task, self.most)
        self._episodes.begin(start)
        return self._observation()

    def step(self, action: Action) -> StepResult:
        """Act; an episode that ends otherwise than by success or after the most steps has the reason `ended`."""
        episodes = self._episodes
        episodes.step(np.asarray(action.data))
        late = episodes.ended and not episodes.success and episodes.steps >= self.most
        reason = "success" if episodes.success else "ended" if episodes.ended and not late else None
        return StepResult(
            self._observation(),
            reward=float(episodes.reward),
            terminated=reason is not None,
            termination_reason=reason,
            truncated=late,
            info={"success": episodes.success},
        )

    def close(self) -> None:
        self._episodes.close()

    def _observation(self) -> Observation:
        found = split_observation(self._episodes.observation)
        state: dict[str, Any] = found.numbers
        return Observation(images=found.pictures, state=state, instruction=self._episodes.task.instruction)
