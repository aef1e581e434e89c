"""The rules of environments over time, of one or many: what was asked for, where episodes begin, what is seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from scenegen.api.monitor import Monitor
from scenegen.api.motions import MotionSet
from scenegen.api.spec import Spec, refuse_choices
from scenegen.curriculum.errors import as_gymnasium, names, one_of, refused
from scenegen.curriculum.motion_moves import MotionMoves
from scenegen.curriculum.motion_starts import MotionStarts, open_motions
from scenegen.curriculum.register import ID
from scenegen.curriculum.request import PhiRanges, check_options, read_ranges
from scenegen.curriculum.rules import load_spec
from scenegen.curriculum.views import Views, make_views
from scenegen.errors.learning import NOT_A_FIRST_SCENE
from scenegen.errors.requests import UNKNOWN_LABEL, WRONG_VALUE
from scenegen.errors.temporal import NOT_OVER_TIME
from scenegen.lang.timed import Signal, Timed
from scenegen.motions.monitor import HIGH, Watch
from scenegen.motions.prepare import make_problem
from scenegen.motions.problem import MotionProblem
from scenegen.pose import LENGTHS
from scenegen.sampling.request import Range, SampleRequest

Array = npt.NDArray[np.float64]

REWARDS = ("gain", "final")
FAR = 1e6  # bounds beyond are seen as this
EDGE = 1e-9  # metres by which a given scene may be over the edge


@dataclass(frozen=True, slots=True)
class StartWanted:
    """What a reset asks for: motions in these ranges, the nearest where there is none, or a `given` scene (N, 3)."""

    ranges: PhiRanges
    nearest: bool
    given: Array | None


@dataclass(frozen=True, slots=True)
class MotionRules:
    """Those of MotionTable. `nodes` are the formulas over time that are seen, `names` the numbers of an observation."""

    scenes: Spec
    timed: Timed
    problem: MotionProblem
    goal: tuple[str, ...]
    moves: MotionMoves
    final: bool
    starts: MotionStarts
    usual: PhiRanges
    views: Views
    nodes: tuple[int, ...]
    names: tuple[str, ...]

    def space(self) -> Any:
        """That of observations, a Box."""
        return spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def read(self, options: object) -> StartWanted:
        """The options of a reset. Raises gymnasium.error.Error."""
        given = dict(check_options(options))
        nearest = bool(given.get("nearest", False))
        if nearest and self.starts.given is None:
            wanted = "False, or give motions as `source`"
            raise refused(WRONG_VALUE(argument="nearest", value="True", wanted=wanted))
        ranges = self.usual if given.get("phi") is None else _ranges(self.scenes, self.goal, given["phi"])
        scene = None if given.get("scene") is None else self._given(given["scene"])
        return StartWanted(ranges, nearest, scene)

    def task(self, wanted: StartWanted) -> Array:
        """The range of phi of each label, (L, 2); infinite where it has none."""
        labels = self.timed.labels
        task: Mapping[str, Range] = {} if wanted.given is not None else wanted.ranges.phi(self.scenes.labels)
        ends = {name: (one.low, one.high) for name, one in task.items()}
        both = [ends.get(name, (None, None)) for name in labels]
        return np.array([(_end(low, -1.0), _end(high, 1.0)) for low, high in both]).reshape(len(labels), 2)

    def seen(self, rows: Array, moments: npt.NDArray[np.intp], bounds: Array) -> npt.NDArray[np.float32]:
        """Observations (B, K) of poses (3N, B), after so many moments (B,), with the bounds of `nodes`, (K, 2, B)."""
        horizon = self.timed.horizon
        left = (horizon.moments - moments) / horizon.steps
        ends = np.clip(bounds.reshape(2 * len(self.nodes), -1), -FAR, FAR)
        ends = ends / (1.0 + np.abs(ends))
        return np.concatenate([self.views(rows), left[:, None], ends.T], axis=1).astype(np.float32)

    def waiting(self, motions: Array) -> npt.NDArray[np.bool_]:
        """Whether the requirement holds in motions (T + 1, 3N, B)."""
        moments, _, count = motions.shape
        poses = motions.reshape(moments, len(self.problem.names), -1, count).transpose(1, 2, 0, 3)
        with np.errstate(all="ignore"):
            return np.asarray(self.problem.score(poses)[-1] >= 0.0)

    def _given(self, scene: object) -> Array:
        """A scene of the caller, (N, 3). Raises gymnasium.error.Error for one with which no motion begins."""
        if not isinstance(scene, Mapping | np.ndarray | list | tuple):
            wanted = "a pose (x, y, theta) for each object by name, or an array (N, 3)"
            raise refused(WRONG_VALUE(argument="scene", value=f"of type {type(scene).__name__}", wanted=wanted))
        with as_gymnasium():
            poses = np.array(Monitor(self.scenes).read(scene))
        if poses.ndim != 2:
            raise refused(WRONG_VALUE(argument="scene", value=f"of shape {poses.shape}", wanted="one scene: (N, 3)"))
        low, high = self.problem.lowest, self.problem.highest
        for thing, axis in np.argwhere((poses < low - EDGE) | (poses > high + EDGE)).tolist():
            if axis in LENGTHS or low[thing, axis] == high[thing, axis]:
                reason = f"`{self.problem.names[thing]}` is outside of its limits"
                raise refused(NOT_A_FIRST_SCENE(reason=reason))
        _, required = Watch(self.timed, *self.scenes.declared.box(), True, 1).add(poses[None])
        if required is not None and not required[HIGH, 0] >= 0.0:
            raise refused(NOT_A_FIRST_SCENE(reason="it violates what the spec requires"))
        return poses


def make_motion_rules(
    spec: Spec | str | Path | None,
    goal: str | Sequence[str] | None,
    moves: str,
    share: float,
    reward: str,
    phi: object,
    source: MotionSet | str | Path | None,
) -> MotionRules:
    """From the arguments of MotionTable. Raises what it does."""
    one_of("reward", reward, REWARDS)
    scenes = load_spec(spec)
    timed = scenes.over_time
    if timed is None:
        raise refused(NOT_OVER_TIME(file=scenes.declared.name), more=f"for scenes make {ID}")
    with as_gymnasium():
        refuse_choices(scenes, "a motion")
        problem, _ = make_problem(scenes.declared, SampleRequest({}, 1))
    wanted = _labels(scenes, goal)
    made = MotionMoves(problem, moves, share)
    starts = open_motions(scenes, source)
    usual = _ranges(scenes, wanted, phi)
    views = make_views(scenes.declared)
    over_time = [k for k, node in enumerate(timed.nodes) if not isinstance(node, Signal)]
    nodes = tuple(sorted({*over_time, *timed.labels.values()}))
    named = {node: name for name, node in timed.labels.items()}
    called = [named.get(node, f"formula {k}") for k, node in enumerate(nodes)]
    ends = tuple(f"{name} {end}" for name in called for end in ("least", "most"))
    seen = (*views.names, "time left", *ends)
    return MotionRules(scenes, timed, problem, wanted, made, reward == "final", starts, usual, views, nodes, seen)


def _labels(scenes: Spec, goal: str | Sequence[str] | None) -> tuple[str, ...]:
    wanted = scenes.labels if goal is None else names("goal", goal, "a label")
    for name in wanted:
        if name not in scenes.labels:
            raise refused(UNKNOWN_LABEL(name=name, known=scenes.labels))
    if not wanted:
        raise refused(WRONG_VALUE(argument="goal", value="empty", wanted="a label, or leave it out"))
    return wanted


def _ranges(scenes: Spec, goal: Sequence[str], phi: object) -> PhiRanges:
    """The ranges of a request: (lo, hi) is for every label of the goal. Raises gymnasium.error.Error."""
    return read_ranges(scenes.labels, [scenes.labels.index(name) for name in goal], phi)


def _end(value: float | None, sign: float) -> float:
    return sign * math.inf if value is None else value
