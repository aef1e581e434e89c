"""`scenegen/Motion-v0`: make a motion that satisfies a spec over time, from a start from which there is one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import error, spaces

from scenegen.api.monitor import Monitor
from scenegen.api.motions import MotionSet
from scenegen.api.spec import Spec, refuse_choices
from scenegen.curriculum.errors import as_gymnasium, names, one_of, refused
from scenegen.curriculum.motion_moves import MotionMoves
from scenegen.curriculum.motion_starts import MotionStream, open_motions
from scenegen.curriculum.picture import Easel, check_render
from scenegen.curriculum.register import ID
from scenegen.curriculum.request import PhiRanges, check_options, read_ranges
from scenegen.curriculum.rules import load_spec
from scenegen.curriculum.tasks import PhiBox
from scenegen.curriculum.views import make_views
from scenegen.errors.learning import NO_EPISODE, NOT_A_FIRST_SCENE
from scenegen.errors.requests import UNKNOWN_LABEL, WRONG_VALUE
from scenegen.errors.temporal import NOT_OVER_TIME
from scenegen.lang.timed import Signal
from scenegen.motions.monitor import HIGH, LOW, Watch
from scenegen.motions.prepare import make_problem
from scenegen.pose import LENGTHS
from scenegen.sampling.request import SampleRequest

Array = npt.NDArray[np.float64]
Seen = npt.NDArray[np.float32]

REWARDS = ("gain", "final")
FAR = 1e6  # bounds beyond are seen as this
EDGE = 1e-9  # metres by which a given scene may be over the edge


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
        one_of("reward", reward, REWARDS)
        self.scenes = load_spec(spec)
        timed = self.scenes.over_time
        if timed is None:
            raise refused(NOT_OVER_TIME(file=self.scenes.declared.name), more=f"for scenes make {ID}")
        self._timed, self._final = timed, reward == "final"
        with as_gymnasium():
            refuse_choices(self.scenes, "a motion")
            self._problem, _ = make_problem(self.scenes.declared, SampleRequest({}, 1))
        self.goal = self._labels(goal)
        self.moves = MotionMoves(self._problem, moves, share)
        self._starts = open_motions(self.scenes, source)
        self._usual = self._read(phi)
        self._views = make_views(self.scenes.declared)
        self._nodes = [k for k, node in enumerate(timed.nodes) if not isinstance(node, Signal)]
        self._nodes = sorted({*self._nodes, *timed.labels.values()})
        named = {node: name for name, node in timed.labels.items()}
        called = [named.get(node, f"formula {k}") for k, node in enumerate(self._nodes)]
        ends = tuple(f"{name} {end}" for name in called for end in ("least", "most"))
        self.names = (*self._views.names, "time left", *ends)
        self.action_space = self.moves.space()
        self.observation_space = spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)
        self.render_mode, self.easel = render_mode, Easel(self.scenes.declared, view, size)
        self.metadata = {**self.metadata, "render_fps": 1.0 / timed.horizon.dt}
        self._stream: MotionStream | None = None
        self._watch: Watch | None = None
        self._poses: list[Array] = []
        self._drawn: dict[str, float] = {}
        self._over = False

    @property
    def space(self) -> PhiBox:
        """The phi of the source's motions, for a curriculum. Raises gymnasium.error.Error without a source."""
        return self._starts.space

    @property
    def motion(self) -> Array:
        """The poses so far, (moments, N, 3), metres and radians."""
        return np.array(self._poses)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin an episode; see the class for options."""
        options = dict(check_options(options))  # before the seed is used: a bad request changes nothing
        nearest = bool(options.get("nearest", False))
        if nearest and self._starts.given is None:
            wanted = "False, or give motions as `source`"
            raise refused(WRONG_VALUE(argument="nearest", value="True", wanted=wanted))
        ranges = self._usual if options.get("phi") is None else self._read(options["phi"])
        given = None if options.get("scene") is None else self._given(options["scene"])
        super().reset(seed=seed)
        if seed is not None or self._stream is None:
            self._stream = MotionStream(self._starts, self.np_random)
        if given is None:
            poses, phi = self._stream.take(ranges, nearest=nearest)
            self._drawn = dict(zip(self.scenes.labels, phi.tolist(), strict=True))
        else:
            poses, self._drawn = given, dict.fromkeys(self.scenes.labels, math.nan)
        self._watch, _ = self._begun(poses)
        self._poses, self._over, self._paid = [poses], False, 0.0
        self._task = {} if given is not None else ranges.phi(self.scenes.labels)
        return self._seen(), self._info(blocked=False, violated=False)

    def step(self, action: Any) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Do an action. Raises gymnasium.error.InvalidAction, and ResetNeeded if the episode is over."""
        if self._watch is None or self._over:
            state = "no episode has begun" if self._watch is None else "the episode is over"
            raise refused(NO_EPISODE(state=state, remedy="call reset()"), error.ResetNeeded)
        watch, before = self._watch, self._poses[-1]
        poses, mark = self.moves.after(before, action), watch.mark()
        blocked = violated = False
        if not self._possible(watch, poses):
            blocked = not np.array_equal(poses, before)
            watch.back(mark)
            poses = before
            violated = not self._possible(watch, poses)
        self._poses.append(poses)
        low, high = self._ends()
        self._over = violated or watch.seen == self._timed.horizon.moments or (low >= high and self._can_wait())
        if self._final:
            reward = low if self._over else 0.0
        else:
            worth = low if math.isfinite(low) else self._paid  # nothing is certain yet
            reward, self._paid = worth - self._paid, worth
        return self._seen(), float(reward), self._over, False, self._info(blocked, violated)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The last moment as (height, width, 3) if `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if not self._poses:
            raise refused(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
        return self.easel.draw(self._poses[-1].reshape(-1))

    def close(self) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()

    def _begun(self, poses: Array) -> tuple[Watch, bool]:
        """A monitor of motions that begin so, and whether the requirement can hold in one."""
        watch = Watch(self._timed, *self.scenes.declared.box(), True, 1)
        return watch, self._possible(watch, poses)

    def _possible(self, watch: Watch, poses: Array) -> bool:
        """Whether the requirement can still hold with these poses as the next moment."""
        _, required = watch.add(poses[None])
        return required is None or bool(required[HIGH, 0] >= 0.0)

    def _can_wait(self) -> bool:
        """Whether the requirement holds if the objects stay where they are until the end."""
        left = self._timed.horizon.moments - len(self._poses)
        poses = np.array(self._poses + [self._poses[-1]] * left)
        with np.errstate(all="ignore"):
            return bool(self._problem.score(poses.transpose(1, 2, 0)[..., None])[-1, 0] >= 0.0)

    def _ends(self) -> tuple[float, float]:
        """What phi of the goal can be at least and at most."""
        assert self._watch is not None
        bounds = self._watch.bounds([self._timed.labels[name] for name in self.goal])
        low, high = bounds.min(axis=0)[:, 0]
        return float(low), float(high)

    def _seen(self) -> Seen:
        watch, horizon = self._watch, self._timed.horizon
        assert watch is not None
        bounds = np.clip(watch.bounds(self._nodes).reshape(-1), -FAR, FAR)
        left = (horizon.moments - watch.seen) / horizon.steps
        state = self._views(self._poses[-1].reshape(-1, 1))[0]
        return np.concatenate([state, [left], bounds / (1.0 + np.abs(bounds))]).astype(np.float32)

    def _info(self, blocked: bool, violated: bool) -> dict[str, Any]:
        assert self._watch is not None
        labels = self._timed.labels
        bounds = self._watch.bounds(list(labels.values()))[..., 0]
        low, _ = self._ends()
        ends = {name: (one.low, one.high) for name, one in self._task.items()}
        task = {name: ends.get(name, (None, None)) for name in labels}
        return {
            "phi": dict(zip(labels, bounds[:, LOW].tolist(), strict=True)),
            "phi_high": dict(zip(labels, bounds[:, HIGH].tolist(), strict=True)),
            "is_success": self._over and not violated and low >= 0.0,
            "blocked": blocked,
            "violated": violated,
            "start": dict(self._drawn),
            "moment": self._watch.seen - 1,
            "task": {name: np.array([_end(low, -1.0), _end(high, 1.0)]) for name, (low, high) in task.items()},
        }

    def _given(self, scene: object) -> Array:
        """A scene of the caller, (N, 3). Raises gymnasium.error.Error for one with which no motion begins."""
        if not isinstance(scene, Mapping | np.ndarray | list | tuple):
            wanted = "a pose (x, y, theta) for each object by name, or an array (N, 3)"
            raise refused(WRONG_VALUE(argument="scene", value=f"of type {type(scene).__name__}", wanted=wanted))
        with as_gymnasium():
            poses = np.array(Monitor(self.scenes).read(scene))
        if poses.ndim != 2:
            raise refused(WRONG_VALUE(argument="scene", value=f"of shape {poses.shape}", wanted="one scene: (N, 3)"))
        low, high = self._problem.lowest, self._problem.highest
        for thing, axis in np.argwhere((poses < low - EDGE) | (poses > high + EDGE)).tolist():
            if axis in LENGTHS or low[thing, axis] == high[thing, axis]:
                reason = f"`{self._problem.names[thing]}` is outside of its limits"
                raise refused(NOT_A_FIRST_SCENE(reason=reason))
        if not self._begun(poses)[1]:
            raise refused(NOT_A_FIRST_SCENE(reason="it violates what the spec requires"))
        return poses

    def _labels(self, goal: str | Sequence[str] | None) -> tuple[str, ...]:
        wanted = self.scenes.labels if goal is None else names("goal", goal, "a label")
        for name in wanted:
            if name not in self.scenes.labels:
                raise refused(UNKNOWN_LABEL(name=name, known=self.scenes.labels))
        if not wanted:
            raise refused(WRONG_VALUE(argument="goal", value="empty", wanted="a label, or leave it out"))
        return wanted

    def _read(self, phi: object) -> PhiRanges:
        """The ranges of a request: (lo, hi) is for every label of the goal. Raises gymnasium.error.Error."""
        places = [self.scenes.labels.index(name) for name in self.goal]
        return read_ranges(self.scenes.labels, places, phi)


def _end(value: float | None, sign: float) -> float:
    return sign * math.inf if value is None else value
