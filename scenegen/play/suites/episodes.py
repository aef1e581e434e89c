"""Episodes of a task in a world, one after the other in one environment: what every harness begins its episodes with.

Where an episode begins follows from its start alone. The start goes into each reset, with its own seed; how often the
environment was reset before, and where the last episode stopped, change nothing.
"""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Iterator
from typing import Any

from scenegen.errors import RequestError, ScenegenError
from scenegen.errors.requests import BAD_PLUGIN, NOT_INSTALLED, OUT_OF_RANGE
from scenegen.errors.worlds import WORLD_FAILS
from scenegen.play.suites.loading import load_named
from scenegen.play.suites.outcomes import SceneThatStood
from scenegen.play.suites.suite import GradedStart, Suite, SuiteTask
from scenegen.validation import as_int, as_success

ERROR_LENGTH = 200  # characters of an error that outcomes keep


class TaskEpisodes:
    """The environment `env` of a task in a world, and the episode in it: its `observation`, `reward` and `steps`,
    whether it is a `success`, the `scene` that stood at its beginning where the world measures that, and whether it has
    `ended`, which it does at success, where the environment says so, or after `most` steps. Raises ScenegenError for a
    world that cannot be made."""

    def __init__(self, world: str, task: SuiteTask, most: int, suite: Suite | None = None) -> None:
        self.world, self.task, self.most, self.suite = world, task, most, suite
        self.env: Any = make_world(world, task, suite)
        self.scene: SceneThatStood | None = None
        self.observation: Any = None
        self.reward: Any = 0.0
        self.steps, self.success, self.ended = 0, False, True

    def begin(self, start: GradedStart) -> None:
        """Begin the episode of a start. Raises what the environment raises, and ScenegenError for no judgement."""
        if self.env is None:
            self.env = make_world(self.world, self.task, self.suite)
        self.reward, self.steps, self.success, self.ended, self.scene = 0.0, 0, False, True, None
        with self._close_after_errors():
            self.observation, info = self.env.reset(seed=start.seed, options={"start": start})
            if (stood := info.get("scene")) is not None:
                self.scene = SceneThatStood.model_validate(stood)
            self.success = self.ended = as_success(self.world, {"success": None, **info}, "success")

    def step(self, action: Any) -> None:
        """Act. Nothing happens in an episode that has ended. Raises as `begin` does."""
        if self.ended:
            return
        self.steps += 1
        with self._close_after_errors():
            self.observation, self.reward, terminated, truncated, info = self.env.step(action)
            self.success = as_success(self.world, info, "success")
        self.ended = self.success or bool(terminated or truncated) or self.steps >= self.most

    def close(self) -> None:
        """Close the environment; the next episode makes another one."""
        with contextlib.suppress(Exception):
            self.env.close()
        self.env, self.ended = None, True

    @contextlib.contextmanager
    def _close_after_errors(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self.close()  # nobody knows what state it is in
            raise


def make_world(world: str, task: SuiteTask, suite: Suite | None = None) -> Any:
    """The environment of a task in a world, by its name (loading.py); a world that asks for it gets the suite, too.
    Raises ScenegenError."""
    try:
        make = load_named("world", world)
        return make(task, suite) if "suite" in inspect.signature(make).parameters else make(task)
    except Exception as error:
        raise explain_failure("the world", world, error) from error


def explain_failure(what: str, name: str, error: Exception) -> ScenegenError:
    """The error to raise where a world or a policy cannot be made."""
    if isinstance(error, RequestError) and error.diagnostics[0].kind in (BAD_PLUGIN, NOT_INSTALLED):
        return error
    return ScenegenError(WORLD_FAILS(what=what, name=name, how="cannot be made", reason=error_line(error)))


def check_steps(steps: object) -> int:
    """The most steps of an episode. Raises RequestError."""
    most = as_int("steps", steps)
    if most < 1:
        raise RequestError(OUT_OF_RANGE(argument="steps", value=most, wanted="1 or more"))
    return most


def error_line(error: Exception) -> str:
    """What an error says, on one line."""
    return f"{type(error).__name__}: {error}".splitlines()[0][:ERROR_LENGTH]
