"""A curriculum around an environment: every episode begins with a scene of the strategy's next task.

The task is chosen inside `reset`, because vector environments with autoreset and Stable-Baselines3 pass options to the
first reset only. Options with phi or a scene take precedence; such an episode is not reported to the strategy, nor is
one that is interrupted by `reset`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import error
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorWrapper

from scenegen.arrays import Array
from scenegen.errors.learning import NOT_A_TASK, STRATEGY_OUT_OF_REACH
from scenegen.errors.requests import WRONG_VALUE
from scenegen.play.environments.episodes import Episodes
from scenegen.play.environments.gym_errors import gym_error, no_strategy
from scenegen.play.environments.request import check_options
from scenegen.play.environments.rules import Mask
from scenegen.play.environments.tabletop import TableTop, TableTopVector
from scenegen.play.tasks import Outcome, PhiBox, Strategy, is_strategy


class _Record:
    """The episodes on B tables, as their strategy hears of them: the `task` of each, None for one that the strategy did
    not choose; phi of its first scene, the sum of its rewards and its steps."""

    def __init__(self, episodes: Episodes, strategy: Strategy) -> None:
        self._episodes, self._strategy, self._checked = episodes, strategy, False
        self.tasks: list[PhiBox | None] = [None] * episodes.tables
        self.phi = np.zeros((episodes.tables, len(self._episodes.labels)))
        self.total, self.steps = np.zeros(episodes.tables), np.zeros(episodes.tables, dtype=np.intp)

    def next(self) -> PhiBox:
        """The strategy's next task. Raises gymnasium.error.Error for an object that is not a task, and InvalidBound
        for a strategy that is about other phi than there is."""
        if not self._checked:  # only now: an environment that always gets its scenes from the caller never draws any
            self._check_reach()
            self._checked = True
        task = self._strategy.next_task()
        if not isinstance(task, PhiBox):
            raise gym_error(NOT_A_TASK(value=repr(task)))
        return task

    def begin(self, tables: Mask | int, infos: Mapping[str, Any]) -> None:
        """Episodes have begun on some tables, of which the environment says this."""
        for place, name in enumerate(self._episodes.labels):
            phi = infos["phi"][name]
            self.phi[tables, place] = phi if isinstance(tables, int) else phi[tables]
        self.total[tables], self.steps[tables] = 0.0, 0

    def end(self, table: int, success: bool) -> dict[str, Any] | None:
        """Report the outcome of an episode to the strategy. Returns the content of `info["outcome"]`, in plain
        numbers; None if the task was not the strategy's."""
        task = self.tasks[table]
        if task is None:
            return None
        phi = tuple(self.phi[table].tolist())
        outcome = Outcome(task, phi, success, float(self.total[table]), int(self.steps[table]))
        self._strategy.report(outcome)
        return outcome.info()

    def _check_reach(self) -> None:
        """If the strategy's range lies completely outside of the environment's, the nearest scenes would always be the
        same."""
        reach, space = getattr(self._strategy, "space", None), self._episodes.starts.space
        if not isinstance(reach, PhiBox) or len(reach.low) != len(space.low):
            return
        for label, ends in enumerate(zip(reach.low, reach.high, space.low, space.high, strict=True)):
            low, high, least, most = ends
            if low > most or high < least:
                facts = {"low": low, "high": high, "least": least, "most": most}
                raise gym_error(STRATEGY_OUT_OF_REACH(label=label, **facts), error.InvalidBound)


def _options(task: PhiBox, options: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """A task as options for `reset`; out of reach, the nearest scenes are used."""
    return {**(options or {}), "phi": task, "nearest": True}


def _check(env: Any, kind: type, strategy: object) -> None:
    """Raises gymnasium.error.Error for another environment than ours, and for an object that is not a strategy."""
    unwrapped = getattr(env, "unwrapped", env)
    if not isinstance(unwrapped, kind):
        wanted = f"a {kind.__name__}"
        raise gym_error(WRONG_VALUE(argument="env", value=f"a {type(unwrapped).__name__}", wanted=wanted))
    if isinstance(strategy, type) or not is_strategy(strategy):
        shown = strategy.__name__ if isinstance(strategy, type) else repr(strategy)
        raise gym_error(no_strategy(shown))


class Curriculum(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """`env` is a TableTop, wrapped or not; put the curriculum around its time limit, or truncated episodes are not
    reported. Several environments may share a strategy. Make the strategy for the range `env.unwrapped.space`.

    The last `info` of an episode has its `outcome`: the task's `low` and `high`, `phi` of the first scene, `success`,
    `total` and `steps`."""

    def __init__(self, env: gymnasium.Env[Any, Any], strategy: Strategy) -> None:
        _check(env, TableTop, strategy)
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, strategy=strategy)
        gymnasium.Wrapper.__init__(self, env)
        table: Any = env.unwrapped
        self.strategy, self._record = strategy, _Record(table.episodes, strategy)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of the next task."""
        if options is not None:
            check_options(options)
        chosen = options is not None and (options.get("phi") is not None or options.get("scene") is not None)
        task = None if chosen else self._record.next()
        observation, info = self.env.reset(seed=seed, options=options if task is None else _options(task, options))
        self._record.tasks[0] = task  # only now: if the reset fails, the episode goes on
        self._record.begin(0, info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Do an action; at the end of the episode the outcome is reported to the strategy."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        record = self._record
        record.total[0] += float(reward)
        record.steps[0] += 1
        if terminated or truncated:
            outcome = record.end(0, bool(info["is_success"]))
            record.tasks[0] = None
            if outcome is not None:
                info["outcome"] = outcome
        return observation, reward, terminated, truncated, info


class VectorCurriculum(VectorWrapper[Any, Any, Any, Any, Any]):
    """The same around a TableTopVector. Outcomes are reported table by table, in the order of the tables; `infos`, or
    the `final_info` of the autoreset mode "SameStep", has them as `outcome`, (num_envs,) of objects, with the mask
    `_outcome`. For `SyncVectorEnv`, wrap the single environments in `Curriculum`."""

    def __init__(self, env: TableTopVector, strategy: Strategy) -> None:
        _check(env, TableTopVector, strategy)
        super().__init__(env)
        self.strategy = strategy
        self._tables: TableTopVector = env.unwrapped
        self._record = _Record(self._tables.episodes, strategy)
        self._tables.chooser, self._tables.listener = self._choose, self._record_step
        self._next: dict[int, PhiBox] = {}  # tasks of episodes that are about to begin
        self._ended = np.zeros(env.num_envs, dtype=np.bool_)
        self._outcomes = np.full(env.num_envs, None, dtype=object)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin episodes of the next tasks."""
        self._next = {}
        observations, infos = self.env.reset(seed=seed, options=options)
        self._begin(self._tables.tables_to_reset((options or {}).get("reset_mask")), infos)
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Do an action on every table; the outcomes of episodes that end are reported to the strategy."""
        resets = self._ended.copy()
        self._next = {}
        observations, reward, terminated, truncated, infos = self.env.step(actions)
        ended = terminated | truncated
        same = self._tables.autoreset_mode is AutoresetMode.SAME_STEP
        if ended.any():
            last = infos["final_info"] if same else infos
            last |= {"outcome": self._outcomes, "_outcome": np.array([one is not None for one in self._outcomes])}
        if self._tables.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._ended = ended
            self._begin(resets, infos)
        elif same:
            self._begin(ended, infos)
        return observations, reward, terminated, truncated, infos

    def _choose(self, number: int) -> Mapping[str, Any]:
        self._next[number] = task = self._record.next()
        return _options(task)

    def _record_step(self, reward: Array, ended: Mask, success: Mask) -> None:
        """Called after a step, before tables are reset: reports outcomes to the strategy."""
        self._record.total += reward
        self._record.steps += ~self._ended
        self._outcomes = np.full(self.num_envs, None, dtype=object)
        for number in np.flatnonzero(ended).tolist():
            self._outcomes[number] = self._record.end(number, bool(success[number]))

    def _begin(self, tables: Mask, infos: dict[str, Any]) -> None:
        """Records the scenes at which episodes begin."""
        if not tables.any():
            return
        for number in np.flatnonzero(tables).tolist():
            self._record.tasks[number] = self._next.get(number)
        self._record.begin(tables, infos)
        self._ended = self._ended & ~tables
