"""What worlds and policies of suites have to do, checked: for tests of their authors."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from scenegen.errors import ScenegenError
from scenegen.play.policy_server import decode, encode
from scenegen.play.suites.run import Policy, make_policy
from scenegen.play.suites.suite import GradedStart, SuiteTask
from scenegen.validation import as_success

CHECKED_STEPS = 3  # of each episode


def check_world(make: Callable[[SuiteTask], Any], task: SuiteTask, policy: Policy | None = None) -> None:
    """Check a world: `make(task)` is an environment with the calls of Gymnasium, for all episodes of a task.

    `reset(seed=..., options={"start": start})` begins an episode with the objects at `start.poses`, which it does not
    change, and returns an observation and an info; `step(action)` returns an observation, a reward, whether the episode
    is terminated, whether it is truncated, and an info, whose `success` is the world's own judgement. An episode may
    begin at any time. The same start, seed and actions give the same observations, and another start gives another
    observation. `close()` ends it.

    `task` is one of a suite, such as `Suite.load("tabletop").tasks[0]`. Actions are those of `policy(observation,
    instruction)`, by default samples of the environment's `action_space`. Raises AssertionError, which says what is
    wrong; errors of the world itself come out as they are.
    """
    env = make(task)
    for call in ("reset", "step", "close"):
        _check(callable(getattr(env, call, None)), f"the environment has no {call}()")
    act = _act_at_random(env) if policy is None else policy
    first, other = task.start(0, 0), task.start(len(task.scenes) - 1, len(task.scenes) - 1)
    episode, _, again = (_play(env, start, act) for start in (first, other, first))
    for step, (one, two) in enumerate(zip(episode, again, strict=False)):
        where = "reset" if step == 0 else f"step {step}"
        _check(_equal(one, two), f"{where}: the same start, seed and actions gave another observation")
    _check(len(episode) == len(again), "the same start, seed and actions gave an episode of another length")
    begun = _reset(env, other)
    _check(not _equal(episode[0], begun), 'two starts gave the same observation: is options["start"] used?')
    env.close()


def check_policy(policy: Any, observation: Any, env: Any = None, instruction: str = "put the mug on the plate") -> None:
    """Check a policy: a function of an observation and an instruction that returns an action, or a class, or a function
    of `env` alone, that makes one.

    It takes any instruction, also the empty one of `--instruction empty`, does not change the observation, and returns
    an action that can travel to a server and back: finite numbers, texts, lists, arrays, or these by name. If it has
    `reset(seed)`, that begins an episode, in which the same seed and observation give the same action.

    Raises AssertionError, which says what is wrong; errors of the policy itself come out as they are.
    """
    act = make_policy(policy, env)
    _check(callable(act), f"{act!r} cannot be called")
    resets = hasattr(act, "reset")
    actions = []
    for words, seed in ((instruction, 0), ("", 1), (instruction, 0)):
        if resets:
            act.reset(seed)  # type: ignore[attr-defined]
        given = copy.deepcopy(observation)
        action = act(given, words)
        _check(_equal(given, observation), "the policy changes the observation")
        _check(action is not None, "the policy returned None, and no action")
        try:
            back = decode(encode(action))
        except (TypeError, ValueError) as error:
            raise AssertionError(f"the action cannot travel to a server and back: {error}") from None
        _check(_finite(back), f"the action is not finite: {action!r}")
        actions.append(action)
    _check(not resets or _equal(actions[0], actions[2]), "the same seed and observation gave another action")


def _act_at_random(env: Any) -> Policy:
    space: Any = getattr(env, "action_space", None)
    _check(space is not None, "give check_world a policy: the environment has no action_space to take actions from")
    space.seed(0)
    actions = [space.sample() for _ in range(CHECKED_STEPS)]
    turn = iter(actions * 3)
    return lambda observation, instruction: next(turn)


def _reset(env: Any, start: GradedStart) -> Any:
    """The first observation of an episode."""
    poses = start.poses.copy()
    answer = env.reset(seed=start.seed, options={"start": start})
    _check(isinstance(answer, tuple) and len(answer) == 2, "reset() does not return (observation, info)")
    observation, info = answer
    _check_info({"success": None, **info} if isinstance(info, Mapping) else info, "reset()")
    _check(np.array_equal(poses, start.poses), "reset() changes start.poses: copy them")
    return copy.deepcopy(observation)


def _play(env: Any, start: GradedStart, act: Policy) -> list[Any]:
    """The observations of the first steps of an episode."""
    observations = [_reset(env, start)]
    if hasattr(act, "reset"):
        act.reset(start.seed)
    for _ in range(CHECKED_STEPS):
        answer = env.step(act(observations[-1], start.task.instruction))
        five = "(observation, reward, terminated, truncated, info)"
        _check(isinstance(answer, tuple) and len(answer) == 5, f"step() does not return {five}")
        observation, reward, terminated, truncated, info = answer
        _check(np.isfinite(np.asarray(reward, dtype=np.float64)).all(), f"step(): the reward is {reward!r}")
        for name, value in (("terminated", terminated), ("truncated", truncated)):
            _check(np.asarray(value).dtype == np.bool_, f"step(): {name} is {value!r}, not True or False")
        success = _check_info(info, "step()")
        observations.append(copy.deepcopy(observation))
        if terminated or truncated or success:
            break
    return observations


def _check_info(info: Any, call: str) -> bool:
    """Whether an info says success."""
    _check(isinstance(info, Mapping), f"{call}: the info is {info!r}, not a dict")
    try:
        return as_success("of check_world", info, "success")
    except ScenegenError as error:
        raise AssertionError(f"{call}: {error.diagnostics[0].title}") from None


def _equal(one: Any, other: Any) -> bool:
    """Whether two observations are the same; NaN equals NaN."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_equal(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(_equal, one, other))
    first, second = np.asarray(one), np.asarray(other)
    return np.array_equal(first, second, equal_nan=first.dtype.kind == second.dtype.kind == "f")


def _finite(value: Any) -> bool:
    if isinstance(value, Mapping):
        return all(map(_finite, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_finite, value))
    array = np.asarray(value)
    return array.dtype.kind not in "fc" or bool(np.isfinite(array).all())


def _check(holds: Any, message: str) -> None:
    if not holds:
        raise AssertionError(message)
