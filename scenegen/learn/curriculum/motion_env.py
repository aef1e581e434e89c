"""`scenegen/Motion-v0`: make a motion that satisfies a spec over time, from a start from which there is one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.motions import MotionSet
from scenegen.api.spec import Spec
from scenegen.errors.learning import NO_EPISODE
from scenegen.learn.curriculum.env import SceneRenderer, check_render
from scenegen.learn.curriculum.goal import refused
from scenegen.learn.curriculum.motion_rules import MotionStream, make_motion_rules
from scenegen.learn.curriculum.tasks import PhiBox
from scenegen.sampling.motions.monitor import HIGH, LOW, BatchMonitor

Array = npt.NDArray[np.float64]
Seen = npt.NDArray[np.float32]


class MotionTable(gymnasium.Env[Seen, Any]):
    """Move objects for the T steps of a spec over time; the reward sums up to phi of the motion.

    `spec` is a Spec, the path of a spec file or its text; it has `time`. `goal` names the labels that count, by default
    all; phi of the goal is their minimum.

    `moves="grid"`: action 0 waits, every other moves one object by `share` of what a step of it may be, see
    `env.unwrapped.moves.names`. `moves="continuous"`: one number in [-1, 1] per object and coordinate, in these units;
    longer displacements are shortened to the bound, and where one object moves in each step (`moves one`), it is the
    one with the largest part of its bound. Objects stop at the edges of the workspace. A step after which the
    requirement can no longer hold is not made: the objects wait (`blocked`); if it cannot hold then either, the
    episode ends (`violated`).

    Observations are float32 in [-1, 1]: those of TableTop, the time left, as a share, and for each formula over time in
    the spec the least and the largest value that it can still have (`env.unwrapped.names`), x as x / (1 + |x|).

    `reward="gain"`: the increase of the least phi that the goal can still have (0 before the first step, so the first
    step is paid the whole of it); `reward="final"`: phi, in the last step. Both sum up to phi of the motion, unless it
    was `violated`.

    An episode is over when nothing to come matters for phi and waiting would meet the requirement, at the latest after
    T steps: `terminated`, as the observation has the time left; nothing is truncated.

    `info` has `phi` and `phi_high` (label -> what it can be at least and at most; both are phi at the end),
    `is_success` (over, the requirement holds, and phi of the goal >= 0), `blocked`, `violated`, `moment`, `task`: label
    -> [lowest, highest] requested phi, and `start`: label -> phi of the motion whose first moment this episode begins
    with, NaN for a given scene.

    `reset(options={"phi": (lo, hi)})` begins with the first moment of a motion whose phi of every label of the goal
    lies in that range, {"phi": {label: (lo, hi)}} and a PhiBox give ranges of single labels; None is an open end. `phi`
    of the constructor is used if the options have none, by default (0, None). {"scene": ...} begins with a given scene:
    {object: (x, y, theta)} or an array (N, 3). Motions are drawn as by `sample_motions`, or taken from `source`: a
    MotionSet or its file. With a `source`, {"nearest": True} takes the nearest of its motions if none is in the range,
    and `Curriculum` can choose phi.

    `render_mode="rgb_array"` draws the moment in a process that runs until `close`; `view` and `size` (width, height)
    are those of SceneSet.render, and as many pictures make a second of a film as moments make one of the motion.

    Raises errors of `gymnasium.error`: InvalidBound for phi out of reach, InvalidAction, ResetNeeded, MissingArgument,
    UnsupportedMode for an unknown render mode, and Error for the rest.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 - gymnasium's

    def __init__(
        self,
        spec: Spec | str | Path | None = None,
        *,
        goal: str | Sequence[str] | None = None,
        moves: str = "grid",
        share: float = 1.0,
        reward: str = "gain",
        phi: object = (0.0, None),
        source: MotionSet | str | Path | None = None,
        render_mode: str | None = None,
        view: str = "perspective",
        size: tuple[int, int] = (480, 360),
    ) -> None:
        check_render(render_mode, view, size)
        self.rules = rules = make_motion_rules(spec, goal, moves, share, reward, phi, source)
        self.scenes, self.goal, self.moves, self.names = rules.scenes, rules.goal, rules.moves, rules.names
        self.action_space, self.observation_space = rules.moves.space(), rules.space()
        self.render_mode, self.easel = render_mode, SceneRenderer(self.scenes.declared, view, size)
        self.metadata = {**self.metadata, "render_fps": 1.0 / rules.timed.horizon.dt}
        self._stream: MotionStream | None = None
        self._watch: BatchMonitor | None = None
        self._rows: list[Array] = []  # (3N, 1) each
        self._drawn: dict[str, float] = {}
        self._over = False

    @property
    def space(self) -> PhiBox:
        """The phi of the source's motions, for a curriculum. Raises gymnasium.error.Error without a source."""
        return self.rules.starts.space

    @property
    def motion(self) -> Array:
        """The poses so far, (moments, N, 3), metres and radians."""
        return np.array(self._rows).reshape(len(self._rows), len(self.scenes.objects), -1)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin an episode; see the class for options."""
        wanted = self.rules.read(options)  # before the seed is used: a bad request changes nothing
        super().reset(seed=seed)
        if seed is not None or self._stream is None:
            self._stream = MotionStream(self.rules.starts, self.np_random)
        if wanted.given is None:
            poses, phi = self._stream.take(wanted.ranges, nearest=wanted.nearest)
            self._drawn = dict(zip(self.scenes.labels, phi.tolist(), strict=True))
        else:
            poses, self._drawn = wanted.given, dict.fromkeys(self.scenes.labels, math.nan)
        self._watch = BatchMonitor(self.rules.timed, *self.scenes.declared.box(), True, 1)
        self._rows, self._over, self._paid = [poses.reshape(-1, 1)], False, 0.0
        self._possible(self._watch, self._rows[0])
        self._task = self.rules.task(wanted)
        return self._seen(), self._info(blocked=False, violated=False)

    def step(self, action: Any) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Do an action. Raises gymnasium.error.InvalidAction, and ResetNeeded if the episode is over."""
        if self._watch is None or self._over:
            state = "no episode has begun" if self._watch is None else "the episode is over"
            raise refused(NO_EPISODE(state=state, remedy="call reset()"), error.ResetNeeded)
        watch, before = self._watch, self._rows[-1]
        rows = self.moves.after(before, self.moves.checked(action, 1))
        blocked = violated = False
        if not self._possible(watch, rows):
            blocked = not np.array_equal(rows, before)
            watch.back(before)
            rows = before
            violated = not self._possible(watch, rows)
        self._rows.append(rows)
        low, high = self._ends()
        ended = watch.seen[0] == self.rules.timed.horizon.moments
        self._over = bool(violated or ended or (low >= high and self._can_wait()))
        if self.rules.final:
            reward = low if self._over else 0.0
        else:
            worth = low if math.isfinite(low) else self._paid  # nothing is certain yet
            reward, self._paid = worth - self._paid, worth
        return self._seen(), float(reward), self._over, False, self._info(blocked, violated)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The last moment as (height, width, 3) if `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if not self._rows:
            raise refused(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
        return self.easel.draw(self._rows[-1][:, 0])

    def close(self) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()

    def _possible(self, watch: BatchMonitor, rows: Array) -> bool:
        """Whether the requirement can still hold with these poses (3N, 1) as the next moment."""
        watch.add(rows)
        return bool(watch.possible[0])

    def _can_wait(self) -> bool:
        """Whether the requirement holds if the objects stay where they are until the end."""
        left = self.rules.timed.horizon.moments - len(self._rows)
        return bool(self.rules.waiting(np.array(self._rows + [self._rows[-1]] * left))[0])

    def _ends(self) -> tuple[float, float]:
        """What phi of the goal can be at least and at most."""
        assert self._watch is not None
        bounds = self._watch.bounds([self.rules.timed.labels[name] for name in self.goal])
        low, high = bounds.min(axis=0)[:, 0]
        return float(low), float(high)

    def _seen(self) -> Seen:
        watch = self._watch
        assert watch is not None
        found: Seen = self.rules.seen(self._rows[-1], watch.seen, watch.bounds(self.rules.nodes))[0]
        return found

    def _info(self, blocked: bool, violated: bool) -> dict[str, Any]:
        assert self._watch is not None
        labels = self.rules.timed.labels
        bounds = self._watch.bounds(list(labels.values()))[..., 0]
        low, _ = self._ends()
        return {
            "phi": dict(zip(labels, bounds[:, LOW].tolist(), strict=True)),
            "phi_high": dict(zip(labels, bounds[:, HIGH].tolist(), strict=True)),
            "is_success": self._over and not violated and low >= 0.0,
            "blocked": blocked,
            "violated": violated,
            "start": dict(self._drawn),
            "moment": int(self._watch.seen[0]) - 1,
            "task": {name: ends.copy() for name, ends in zip(labels, self._task, strict=True)},
        }
