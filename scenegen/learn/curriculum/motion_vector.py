"""Many motions at once: steps, bounds of phi and observations are computed together, each motion at its own moment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from scenegen.errors.learning import NO_EPISODE
from scenegen.learn.curriculum.goal import refused
from scenegen.learn.curriculum.motion_env import MotionTable
from scenegen.learn.curriculum.motion_rules import MotionStream
from scenegen.learn.curriculum.tasks import PhiBox
from scenegen.learn.curriculum.vector import Array, BatchedTableEnv, Mask, Observations, StepOutcome, masked
from scenegen.sampling.motions.monitor import HIGH, LOW, BatchMonitor


class MotionVector(BatchedTableEnv):
    """`num_envs` tables of `scenegen/Motion-v0`. `autoreset_mode` is gymnasium's: "NextStep", "SameStep" or "Disabled"
    (reset with `options={"reset_mask": mask}`). `max_episode_steps` truncates, before the end of a motion if it is less
    than T; the other arguments are those of MotionTable.

    `reset(seed=s)` seeds the tables with s, s + 1, ..., a list one by one. See TableTopVector for `chooser` and
    `listener`. Raises what MotionTable does; ResetNeeded also if the episode of a table without autoreset is over.
    """

    def __init__(
        self,
        num_envs: int = 1,
        spec: Any = None,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ) -> None:
        super().__init__(num_envs, max_episode_steps, autoreset_mode)
        one = MotionTable(spec, **settings)  # its rules, starts and pictures are used for all tables
        self._one, self.rules = one, one.rules
        self.scenes, self.goal, self.moves = one.scenes, one.goal, one.moves
        self.names, self.about = self.scenes.labels, "start"
        self.metadata = {**one.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = one.render_mode
        self.single_action_space, self.single_observation_space = one.action_space, one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        timed, (low, high) = self.rules.timed, self.scenes.declared.box()
        self._streams: list[MotionStream | None] = [None] * num_envs
        self._watches = BatchMonitor(timed, low, high, True, num_envs)
        self._rows = np.zeros((timed.horizon.moments, len(low), num_envs))  # from the last moment seen on the same
        self._paid = np.zeros(num_envs)
        self._drawn = np.zeros((num_envs, len(timed.labels)))
        self._tasks = np.zeros((num_envs, len(timed.labels), 2))

    @property
    def space(self) -> PhiBox:
        """The phi of the source's motions, for a curriculum. Raises gymnasium.error.Error without a source."""
        return self._one.space

    def motion(self, number: int) -> Array:
        """The poses so far on a table, (moments, N, 3), metres and radians."""
        moments = int(self._watches.seen[number])
        return self._rows[:moments, :, number].reshape(moments, len(self.scenes.objects), -1).copy()

    def render(self) -> tuple[Any, ...] | None:
        """A picture of every table if `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if not self._begun:
            raise refused(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
        return tuple(self._one.easel.draw(row) for row in self._rows[-1].T)

    def close_extras(self, **kwargs: Any) -> None:
        """End the process that draws, if there is one."""
        self._one.close()

    def _checked(self, actions: Any) -> npt.NDArray[Any]:
        return self.moves.checked(actions, self.num_envs)

    def _act(self, actions: npt.NDArray[Any], again: Mask) -> StepOutcome:
        who = np.flatnonzero(~again)
        watches, before = self._watches, self._rows[-1][:, who]
        rows = self.moves.after(before, actions[who])
        watches.add(rows, who)
        blocked, violated = np.zeros_like(again), np.zeros_like(again)
        bad = ~watches.possible[who]
        if bad.any():
            stay = who[bad]
            blocked[stay] = (rows[:, bad] != before[:, bad]).any(axis=0)
            rows[:, bad] = before[:, bad]
            watches.back(before[:, bad], stay)
            watches.add(before[:, bad], stay)
            violated[stay] = ~watches.possible[stay]
        for k, moment in enumerate((watches.seen[who] - 1).tolist()):
            self._rows[moment:, :, who[k]] = rows[:, k]
        low, high = self._goal_ends()
        over = violated | (watches.seen == self.rules.timed.horizon.moments)
        known = np.flatnonzero((low >= high) & ~over & ~again)
        if len(known):
            over[known] = self.rules.waiting(self._rows[..., known])
        if self.rules.final:
            reward = np.where(over, low, 0.0)
        else:
            worth = np.where(np.isfinite(low), low, self._paid)  # nothing is certain yet
            reward, self._paid = worth - self._paid, worth
        return StepOutcome(reward, over & ~violated & (low >= 0.0), over, {"blocked": blocked, "violated": violated})

    def _goal_ends(self) -> Array:
        """What phi of the goal can be at least and at most, (2, num_envs)."""
        found: Array = self._watches.bounds([self.rules.timed.labels[name] for name in self.goal]).min(axis=0)
        return found

    def _seeded(self, number: int) -> None:
        self._streams[number] = None

    def _start(self, chosen: Mask, options: dict[str, Any]) -> Mask:
        given = self.rules.read(options)
        own = given.given is not None or options.get("phi") is not None
        who = np.flatnonzero(chosen)
        begun = []  # all starts first, then the tables: a request that fails leaves the tables unchanged
        for k in who.tolist():
            wanted = given if own or self.chooser is None else self.rules.read(self.chooser(k))
            if wanted.given is None:
                stream, rng = self._streams[k], self._rngs[k]
                if stream is None:
                    assert rng is not None
                    stream = self._streams[k] = MotionStream(self.rules.starts, rng)
                poses, phi = stream.take(wanted.ranges, nearest=wanted.nearest)
            else:
                poses, phi = wanted.given, np.full(len(self.names), math.nan)
            begun.append((k, poses.reshape(-1), phi, self.rules.task(wanted)))
        for k, row, phi, task in begun:
            self._rows[..., k], self._drawn[k], self._tasks[k] = row, phi, task
        self._paid[who] = 0.0
        self._watches.begin(who)
        self._watches.add(self._rows[0][:, who], who)
        return np.zeros_like(chosen)

    def _seen(self) -> Observations:
        watches = self._watches
        return self.rules.seen(self._rows[-1], watches.seen, watches.bounds(self.rules.nodes))

    def _infos(self, told: Mask, success: Mask, flags: Mapping[str, Mask]) -> dict[str, Any]:
        """Combines the infos of single tables like SyncVectorEnv: missing values are zeros."""
        labels, none = self.rules.timed.labels, np.zeros_like(told)
        bounds = self._watches.bounds(list(labels.values()))

        def each(values: Array) -> dict[str, Any]:
            """Values by label, (L, num_envs, ...)."""
            told_ = told.reshape(-1, *[1] * (values.ndim - 2))
            return masked({name: np.where(told_, one, 0.0) for name, one in zip(labels, values, strict=True)}, told)

        values = {
            "phi": each(bounds[:, LOW]),
            "phi_high": each(bounds[:, HIGH]),
            "is_success": success & told,
            "blocked": flags.get("blocked", none) & told,
            "violated": flags.get("violated", none) & told,
            "start": each(self._drawn.T),
            "moment": np.where(told, self._watches.seen - 1, 0),
            "task": each(self._tasks.transpose(1, 0, 2)),
        }
        return masked(values, told)
