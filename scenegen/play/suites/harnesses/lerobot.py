"""A suite as environments of LeRobot's EnvHub: what the `env.py` that `scenegen suite envhub` writes calls.

Non-obvious behaviors:

* Task t of the suite is `envs[group][t]`, with the task's name in `envs[group][t].call("task")`. Start i of a task is
  start `suite.numbers(task)[i]` of the suite; `info["start"]` has that number.
* The group is called by the suite and its digest (`group_name`), since it is all that LeRobot's results keep of an
  environment: `scenegen suite report SUITE eval_info.json` knows by it whose starts they are.
* `reset()` begins the n starts after those that the last `reset()` began, one in each of n environments. Starts that
  the automatic resets in between have begun do not count: LeRobot's loop goes on stepping environments that are done
  until the last one is, and throws away what comes of that, so counting them would skip starts.
* An automatic reset of environment k goes n starts on from its last one. A loop that resets once, and then steps for
  ever, meets every start once, too.
* Seeds draw nothing, since a start has its own. But a seed that is not n above that of the last `reset(seed=...)`
  begins at start 0 again: LeRobot counts seeds up by n within an evaluation, so every evaluation begins alike.
* `reset(options={"start": i})` begins starts i, i + 1, ... of the task. After the last start comes the first one.
* The hub's loader downloads env.py alone: the suite's files are downloaded when env.py is called.
* Videos without pictures in the world's observations are black.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE
from scenegen.play.suites.episodes import TaskEpisodes, check_steps
from scenegen.play.suites.harnesses.groups import group_name
from scenegen.play.suites.harnesses.observations import action_box, split_observation
from scenegen.play.suites.suite import SUITE_JSON, GradedStart, Suite, SuiteTask
from scenegen.validation import as_int

VIDEO_RATE = 10  # frames a second of LeRobot's videos
NO_PICTURE = 64  # pixels of a side of the black frames of worlds without pictures
Observed = dict[str, Any]


def make_suite_envs(
    folder: str | Path,
    world: str,
    n_envs: int = 1,
    use_async_envs: bool = False,
    cfg: Any = None,
    *,
    steps: int = 1000,
    reverse: bool = False,
) -> dict[str, dict[int, VectorEnv[Any, Any, Any]]]:
    """Vector environments of every task of the suite in a folder, or of the task `cfg.task`, by the suite's group
    and the task's place in it. Raises DataError for what is no suite, RequestError and ScenegenError."""
    folder = Path(folder)
    if not (folder / SUITE_JSON).exists():
        _download_beside(folder)
    suite = Suite.load(folder, reverse=reverse)
    names, wanted = [task.name for task in suite.tasks], getattr(cfg, "task", None)
    if wanted is not None and wanted not in names:
        raise RequestError(UNKNOWN_CHOICE(what="task", name=wanted, known=names))
    n_envs, steps = as_int("n_envs", n_envs), check_steps(steps)
    if n_envs < 1:
        raise RequestError(OUT_OF_RANGE(argument="n_envs", value=n_envs, wanted="1 or more"))
    kind = AsyncSuiteEnvs if use_async_envs else SyncSuiteEnvs
    found: dict[int, VectorEnv[Any, Any, Any]] = {}
    try:
        for place, task in enumerate(suite.tasks):
            if wanted in (None, task.name):
                makers = [partial(SuiteEnv, suite, place, world, steps, first, n_envs) for first in range(n_envs)]
                found[place] = kind(makers, autoreset_mode=AutoresetMode.SAME_STEP)
    except BaseException:
        for one in found.values():
            one.close()
        raise
    return {group_name(suite): found}


class SuiteEnv(gymnasium.Env[Observed, npt.NDArray[Any]]):
    """A task of a suite in a world. `reset` begins the start that `options["start"]` names and `first` says how far
    behind, or else the one `stride` after the last; an `info` has the number of the start in its suite."""

    render_mode = "rgb_array"

    def __init__(self, suite: Suite, task: int, world: str, steps: int, first: int = 0, stride: int = 1) -> None:
        self._suite, self._first, self._stride = suite, first, stride
        self._task: SuiteTask = suite.tasks[task]
        self._numbers = suite.numbers(self._task)
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": VIDEO_RATE, "starts": len(self._numbers)}
        self._turn = first - stride
        self.task, self.task_description, self._max_episode_steps = self._task.name, self._task.instruction, steps
        self._episodes = TaskEpisodes(world, self._task, steps)
        try:
            low, high = action_box(world, self._episodes.env)
            self.action_space = Box(low.astype(np.float32), high.astype(np.float32))
            self._episodes.begin(suite[self._numbers[0]])  # what a world observes shows only then
            self.observation_space = _space_of(self._observation())
        except BaseException:
            self.close()
            raise

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observed, Observed]:
        """Begin the next episode. The seed is not used: a start has its own. Raises RequestError for no start."""
        first = (options or {}).get("start")
        self._turn = self._turn + self._stride if first is None else self._check(first) + self._first
        self._episodes.begin(self._start)
        return self._observation(), self._info()

    def step(self, action: npt.NDArray[Any]) -> tuple[Observed, float, bool, bool, Observed]:
        """Act. An episode is terminated at success, and truncated where it ends otherwise."""
        episodes = self._episodes
        episodes.step(action)
        success = episodes.success
        return self._observation(), float(episodes.reward), success, episodes.ended and not success, self._info()

    def render(self) -> Any:
        """(H, W, 3): the first picture that the world observes, or a black one."""
        pictures = split_observation(self._episodes.observation).pictures
        return next(iter(pictures.values()), np.zeros((NO_PICTURE, NO_PICTURE, 3), dtype=np.uint8))

    def close(self) -> None:
        self._episodes.close()

    @property
    def _start(self) -> GradedStart:
        return self._suite[self._numbers[self._turn % len(self._numbers)]]

    def _check(self, start: object) -> int:
        number = as_int("start", start)
        if not 0 <= number < len(self._numbers):
            wanted = f"from 0 to {len(self._numbers) - 1}"
            raise RequestError(OUT_OF_RANGE(argument="start", value=number, wanted=wanted))
        return number

    def _observation(self) -> Observed:
        """By LeRobot's names."""
        found = split_observation(self._episodes.observation)
        parts: Observed = {"pixels": found.pictures, "agent_pos": found.robot, "environment_state": found.surroundings}
        return {name: part for name, part in parts.items() if len(part)}

    def _info(self) -> Observed:
        start = self._start
        return {
            "is_success": self._episodes.success,
            "start": start.number,
            "band": start.band,
            "phi": start.phi[start.task.success],
        }


class _StartsInOrder(VectorEnv[Any, Any, Any]):
    """`reset` of several environments begins the starts after those of the last `reset`."""

    _next = 0
    _next_seed: int | None = None

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, Observed]:
        """See the module's text; environments that a `reset_mask` names go on as after automatic resets."""
        given = dict(options or {})
        if "reset_mask" in given and "start" not in given:
            return super().reset(seed=seed, options=given)
        first = seed if seed is None or np.ndim(seed) == 0 else seed[0]
        if first is not None:
            self._next = self._next if first == self._next_seed else 0
            self._next_seed = first + self.num_envs
        start = given.setdefault("start", self._next)
        found = super().reset(seed=seed, options=given)
        self._next = (start + self.num_envs) % self.metadata["starts"]
        return found


class SyncSuiteEnvs(_StartsInOrder, SyncVectorEnv):
    """Environments of a task in this process."""


class AsyncSuiteEnvs(_StartsInOrder, AsyncVectorEnv):
    """Environments of a task, each in a process of its own."""


def _space_of(observation: Any) -> Any:
    if isinstance(observation, dict):
        return Dict({name: _space_of(part) for name, part in observation.items()})
    low, high = (0.0, 255.0) if observation.dtype == np.uint8 else (-np.inf, np.inf)
    return Box(low, high, observation.shape, dtype=observation.dtype)


def _download_beside(folder: Path) -> None:
    """The other files of a repository on the hub whose env.py lies in a folder of the hub's cache,
    `models--OWNER--NAME/snapshots/COMMIT`. Any other folder stays as it is."""
    kind, _, name = folder.parent.parent.name.partition("--")
    if kind != "models" or folder.parent.name != "snapshots":
        return
    from huggingface_hub import snapshot_download

    snapshot_download(name.replace("--", "/"), revision=folder.name, cache_dir=folder.parents[2])
