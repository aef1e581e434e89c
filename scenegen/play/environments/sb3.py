"""For Stable-Baselines3: many tables at once as its VecEnv, and a callback that logs a curriculum. Importing this loads
Stable-Baselines3 and torch."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import error
from gymnasium.vector import AutoresetMode, VectorEnv

from scenegen.errors.learning import ONE_ENVIRONMENT
from scenegen.errors.requests import NOT_INSTALLED, WRONG_VALUE
from scenegen.play.environments.gym_errors import as_count, gym_error, no_strategy
from scenegen.play.tasks import Strategy

try:
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
except ImportError as problem:
    command = 'pip install "scenegen-dsl[experiments]"'
    missing = NOT_INSTALLED(package="stable-baselines3", purpose="for learners of it", command=command)
    raise gym_error(missing, error.DependencyNotInstalled) from problem

WINDOW_EPISODES = 100  # episodes over which means are taken


class CurriculumCallback(BaseCallback):
    """Logs, for the last `window` episodes of environments in `Curriculum`: the success rate, phi of the first scene
    and of the tasks per label, steps and rewards, all under `curriculum/`; and the strategy's `log()`, if a strategy is
    given and has one. Works with SB3Vector around a `VectorCurriculum`, too. Outcomes arrive from environments in other
    processes as well, but there each process has its own strategy, and `strategy` here gets no outcomes from them."""

    def __init__(self, strategy: Strategy | None = None, *, window: int = WINDOW_EPISODES, verbose: int = 0) -> None:
        if strategy is not None and not callable(getattr(strategy, "next_task", None)):
            raise gym_error(no_strategy(repr(strategy)))
        window = as_count("window", window)
        super().__init__(verbose)
        self.outcomes: deque[Mapping[str, Any]] = deque(maxlen=window)
        self.episodes = 0
        self._strategy = strategy

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "outcome" in info:
                self.outcomes.append(info["outcome"])
                self.episodes += 1
        return True

    def _on_rollout_end(self) -> None:
        if not self.outcomes:
            return
        self.logger.record("curriculum/episodes", self.episodes)
        for name, key in (("success_rate", "success"), ("reward", "total"), ("steps", "steps")):
            self.logger.record(f"curriculum/{name}", float(np.mean([one[key] for one in self.outcomes])))
        for name in ("phi", "low", "high"):
            means = np.mean([one[name] for one in self.outcomes], axis=0)
            for label, value in enumerate(means.tolist()):
                self.logger.record(f"curriculum/{name}" + (f"_{label + 1}" if len(means) > 1 else ""), value)
        log = getattr(self._strategy, "log", None)
        if callable(log):
            for name, value in log().items():
                self.logger.record(f"curriculum/{name}", float(value))


class SB3Vector(VecEnv):
    """A vector environment of gymnasium, TableTopVector or a wrapper of it, as a VecEnv: `PPO("MlpPolicy",
    SB3Vector(env))`. SB3 begins a new episode in the step that ends one, so make `env` with
    `autoreset_mode="SameStep"`; raises gymnasium.error.Error otherwise.

    The info of a table whose episode ends has `env`'s info about its last scene, `terminal_observation`, and
    `TimeLimit.truncated`; the infos of the others are empty, to save time. Wrap it in SB3's VecMonitor for lengths and
    sums of rewards. It has no single environments: `env_method`, and `set_attr` for some tables, are refused.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        mode = (env.metadata or {}).get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            wanted = 'an environment with autoreset_mode="SameStep", which Stable-Baselines3 needs'
            raise gym_error(WRONG_VALUE(argument="env", value=f"one with {mode}", wanted=wanted))
        self.env = env
        self._actions: Any = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> VecEnvObs:
        """New episodes on all tables, with the seed that `seed` was given since the last reset."""
        if any(self._options):
            raise gym_error(ONE_ENVIRONMENT(what="options", verb="are given to"))
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        observations, infos = self.env.reset(seed=seeds)  # type: ignore[arg-type]  # gymnasium's own take lists, too
        self.reset_infos = [_table_info(infos, number) for number in range(self.num_envs)]
        self._reset_seeds()
        found: VecEnvObs = observations
        return found

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Do the actions."""
        observations, reward, terminated, truncated, infos = self.env.step(self._actions)
        dones = terminated | truncated
        table_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for number in np.flatnonzero(dones).tolist():
            table_infos[number] = {
                **_table_info(infos["final_info"], number),
                "terminal_observation": infos["final_obs"][number],
                "TimeLimit.truncated": bool(truncated[number] and not terminated[number]),
            }
        return observations, np.asarray(reward, dtype=np.float32), dones, table_infos

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The environment's attribute, once for each table."""
        found = getattr(self.env if hasattr(self.env, attr_name) else self.env.unwrapped, attr_name)
        return [found for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set it for all tables at once. Raises gymnasium.error.Error for some of them."""
        if len(list(self._get_indices(indices))) < self.num_envs:
            raise gym_error(ONE_ENVIRONMENT(what=f"`{attr_name}`", verb="is set for"))
        setattr(self.env.unwrapped, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Not supported: raises gymnasium.error.Error."""
        raise gym_error(ONE_ENVIRONMENT(what=f"`{method_name}`", verb="cannot be called on"))

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """False for every table: there are no single environments."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every table, if the environment draws."""
        pictures: Sequence[Any] | None = self.env.render()
        return [None] * self.num_envs if pictures is None else list(pictures)


def _table_info(infos: dict[str, Any], number: int) -> dict[str, Any]:
    """The info of one table: the entries whose mask is True, without the masks."""
    found: dict[str, Any] = {}
    for name, value in infos.items():
        mask = infos.get(f"_{name}")
        if not name.startswith("_") and (mask is None or mask[number]):
            found[name] = _table_info(value, number) if isinstance(value, dict) else value[number]
    return found
