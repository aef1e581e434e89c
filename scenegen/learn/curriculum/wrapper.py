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

from scenegen.errors.learning import NOT_A_STRATEGY, NOT_A_TASK, NOT_AN_ENVIRONMENT, STRATEGY_OUT_OF_REACH
from scenegen.learn.curriculum.env import TableTop
from scenegen.learn.curriculum.goal import refused
from scenegen.learn.curriculum.motion_env import MotionTable
from scenegen.learn.curriculum.motion_vector import MotionVector
from scenegen.learn.curriculum.request import check_options
from scenegen.learn.curriculum.tasks import Outcome, PhiBox, Strategy
from scenegen.learn.curriculum.vector import Array, BatchedTableEnv, Mask, TableTopVector

CALLS = ("next_task", "report")  # of a strategy


def _options(task: PhiBox, options: Mapping[str, Any] | None) -> dict[str, Any]:
    """A task as options for `reset`; out of reach, the nearest scenes are used."""
    return {**(options or {}), "phi": task, "nearest": True}


def _check(env: Any, kinds: tuple[type, ...], strategy: object) -> None:
    """Raises gymnasium.error.Error for another environment than ours, and for an object that is not a strategy."""
    unwrapped = getattr(env, "unwrapped", env)
    if not isinstance(unwrapped, kinds):
        raise refused(NOT_AN_ENVIRONMENT(wanted=kinds[0].__name__, found=type(unwrapped).__name__))
    if isinstance(strategy, type) or not all(callable(getattr(strategy, call, None)) for call in CALLS):
        shown = strategy.__name__ if isinstance(strategy, type) else repr(strategy)
        raise refused(NOT_A_STRATEGY(value=shown))


def _check_reach(strategy: Strategy, space: PhiBox) -> None:
    """Raises gymnasium.error.InvalidBound if the strategy's range lies completely outside of the environment's: the
    nearest scenes would always be the same."""
    reach = getattr(strategy, "space", None)
    if not isinstance(reach, PhiBox) or len(reach.low) != len(space.low):
        return
    for label, ends in enumerate(zip(reach.low, reach.high, space.low, space.high, strict=True)):
        low, high, least, most = ends
        if low > most or high < least:
            facts = {"low": low, "high": high, "least": least, "most": most}
            raise refused(STRATEGY_OUT_OF_REACH(label=label, **facts), error.InvalidBound)


def _next_task(strategy: Strategy) -> PhiBox:
    """Raises gymnasium.error.Error for an object that is not a task."""
    task = strategy.next_task()
    if not isinstance(task, PhiBox):
        raise refused(NOT_A_TASK(value=repr(task)))
    return task


def _told(outcome: Outcome) -> dict[str, Any]:
    """The content of `info["outcome"]`: an outcome in plain numbers."""
    return {
        "low": list(outcome.task.low),
        "high": list(outcome.task.high),
        "phi": list(outcome.phi),
        "success": outcome.success,
        "total": outcome.total,
        "steps": outcome.steps,
    }


def _overridden(options: Mapping[str, Any] | None) -> bool:
    return isinstance(options, Mapping) and (options.get("phi") is not None or options.get("scene") is not None)


class Curriculum(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """`env` is a TableTop, or a MotionTable with a `source`, wrapped or not; put the curriculum around its time limit,
    or truncated episodes are not reported. Several environments may share a strategy. Make the strategy for the range
    `env.unwrapped.space`.

    The last `info` of an episode has its `outcome`: the task's `low` and `high`, `phi` of the first scene (of a
    MotionTable: of the motion that it is from), `success`, `total` and `steps`."""

    def __init__(self, env: gymnasium.Env[Any, Any], strategy: Strategy) -> None:
        _check(env, (TableTop, MotionTable), strategy)
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, strategy=strategy)
        gymnasium.Wrapper.__init__(self, env)
        self.strategy = strategy
        self._table: TableTop | MotionTable = env.unwrapped  # type: ignore[assignment]
        self._fits = False
        self._labels = len(self._table.scenes.labels)
        self._about = "start" if isinstance(self._table, MotionTable) else "phi"  # of a motion, or of the scene
        self._task: PhiBox | None = None
        self._phi: tuple[float, ...] = ()
        self._total, self._steps = 0.0, 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of the next task."""
        if options is not None:
            check_options(options)
        task = None if _overridden(options) else self._next()
        merged = options if task is None else _options(task, options)
        seen, info = self.env.reset(seed=seed, options=merged)
        self._task = task  # only now: if the reset fails, the episode goes on
        self._phi = tuple(info[self._about].values())[: self._labels]
        self._total, self._steps = 0.0, 0
        return seen, info

    def _next(self) -> PhiBox:
        if not self._fits:  # only now: an environment that always gets its scenes from the caller never draws any
            _check_reach(self.strategy, self._table.space)
            self._fits = True
        return _next_task(self.strategy)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Do an action; at the end of the episode the outcome is reported to the strategy."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        self._total += float(reward)
        self._steps += 1
        if (terminated or truncated) and self._task is not None:
            outcome = Outcome(self._task, self._phi, bool(info["is_success"]), self._total, self._steps)
            self._task = None
            self.strategy.report(outcome)
            info["outcome"] = _told(outcome)
        return seen, reward, terminated, truncated, info


class VectorCurriculum(VectorWrapper[Any, Any, Any, Any, Any]):
    """The same around a TableTopVector, or a MotionVector with a `source`. Outcomes are reported table by table, in the
    order of the tables; `infos`, or the `final_info` of the autoreset mode "SameStep", has them as `outcome`,
    (num_envs,) of objects, with the mask `_outcome`. For `SyncVectorEnv`, wrap the single environments in
    `Curriculum`."""

    def __init__(self, env: TableTopVector | MotionVector, strategy: Strategy) -> None:
        _check(env, (TableTopVector, MotionVector), strategy)
        super().__init__(env)
        self.strategy = strategy
        self._tables: BatchedTableEnv = env.unwrapped
        self._tables.chooser, self._tables.listener = self._next, self._hear
        self._fits = False
        self._names, self._about = self._tables.names, self._tables.about
        self._tasks: list[PhiBox | None] = [None] * env.num_envs
        self._asked: dict[int, PhiBox] = {}  # tasks of episodes that are about to begin
        self._phi = np.zeros((env.num_envs, len(self._names)))
        self._total, self._steps = np.zeros(env.num_envs), np.zeros(env.num_envs, dtype=np.intp)
        self._over = np.zeros(env.num_envs, dtype=np.bool_)
        self._told = np.full(env.num_envs, None, dtype=object)

    def _next(self, number: int) -> Mapping[str, Any]:
        if not self._fits:
            _check_reach(self.strategy, self._tables.space)
            self._fits = True
        task = _next_task(self.strategy)
        self._asked[number] = task
        return _options(task, None)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin episodes of the next tasks."""
        self._asked = {}
        seen, infos = self.env.reset(seed=seed, options=options)
        self._begin(self._tables.chosen((options or {}).get("reset_mask")), infos)
        return seen, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Do an action on every table; the outcomes of episodes that end are reported to the strategy."""
        again = self._over.copy()
        self._asked = {}
        seen, reward, terminated, truncated, infos = self.env.step(actions)
        over = terminated | truncated
        same = self._tables.autoreset_mode is AutoresetMode.SAME_STEP
        if over.any():
            last = infos["final_info"] if same else infos
            last |= {"outcome": self._told, "_outcome": np.array([one is not None for one in self._told])}
        if self._tables.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._over = over
            self._begin(again, infos)
        elif same:
            self._begin(over, infos)
        return seen, reward, terminated, truncated, infos

    def _hear(self, reward: Array, over: Mask, success: Mask) -> None:
        """Called after a step, before tables are reset: reports outcomes to the strategy."""
        self._total += reward
        self._steps += ~self._over
        self._told = np.full(self.num_envs, None, dtype=object)
        for number in np.flatnonzero(over).tolist():
            task = self._tasks[number]
            if task is not None:
                phi = tuple(self._phi[number].tolist())
                total, steps = float(self._total[number]), int(self._steps[number])
                outcome = Outcome(task, phi, bool(success[number]), total, steps)
                self.strategy.report(outcome)
                self._told[number] = _told(outcome)

    def _begin(self, begun: Mask, infos: dict[str, Any]) -> None:
        """Records the scenes at which episodes begin."""
        if not begun.any():
            return
        for number in np.flatnonzero(begun).tolist():
            self._tasks[number] = self._asked.get(number)
        phi = [infos[self._about][name] for name in self._names]
        self._phi[begun] = np.stack(phi, axis=1)[begun]
        self._total[begun], self._steps[begun] = 0.0, 0
        self._over = self._over & ~begun
