"""The options of `reset` as users write them: a range of phi, or a scene."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from gymnasium import error

from scenegen.api.scenes import Scene
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import quote_names
from scenegen.errors.files import OTHER_OBJECTS, OTHER_SURFACE
from scenegen.errors.learning import NOT_A_TASK, NOT_POSES
from scenegen.errors.requests import (
    CONFLICTING_ARGUMENTS,
    NOT_A_POSE,
    RANGE_NOT_A_PAIR,
    RANGE_REVERSED,
    SINGLE_VALUE,
    UNKNOWN_CHOICE,
    UNKNOWN_LABEL,
    WRONG_VALUE,
)
from scenegen.lang.spec import CheckedSpec, rows_among
from scenegen.play.environments.goal import Goal
from scenegen.play.environments.gym_errors import as_gym_errors, gym_error
from scenegen.play.tasks import PhiBox
from scenegen.pose import NAMES, SIZE, THETA, TWO_PI, X, row_count, row_of, rows_along, wrap_heading
from scenegen.sampling.request import BAND_HALF_WIDTH, Range
from scenegen.scenes.arrange import check_scenes
from scenegen.scenes.data import Pose, RestingPose, SceneData
from scenegen.validation import as_list

RESET_OPTIONS = ("phi", "scene", "nearest")


@dataclass(frozen=True)
class PhiRanges:
    """The requested phi of a scene, for each of a goal's D labels: closed ranges, infinite for an open end."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    @cached_property
    def dims(self) -> tuple[int, ...]:
        """The labels that have a range."""
        ends = zip(self.low, self.high, strict=True)
        return tuple(k for k, (low, high) in enumerate(ends) if low > -math.inf or high < math.inf)

    def phi(self, names: Sequence[str]) -> dict[str, Range]:
        """The ranges of a request to a sampler."""
        low, high = ([end if math.isfinite(end) else None for end in side] for side in (self.low, self.high))
        return {names[k]: Range(low[k], high[k]) for k in self.dims}

    def describe(self, names: Sequence[str]) -> str:
        """`phi of task in -0.2:-0.1`."""
        parts = []
        for name, one in self.phi(names).items():
            low, high = one.low, one.high
            parts.append(
                f"phi of `{name}` in {'' if low is None else f'{low:.4g}'}:{'' if high is None else f'{high:.4g}'}"
            )
        return " and ".join(parts) or "any phi"


class FirstScene(NamedTuple):
    """The first scene of an episode, (3N,); its phi, (D,); and the lowest allowed margin of the requirement: 0, or
    slightly less in a scene that was rounded."""

    row: Array
    phi: Array
    slack: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class StartRequest:
    """Checked options of `reset`: a given scene, or the requested phi; both None if the options have neither."""

    scene: FirstScene | None = None
    ranges: PhiRanges | None = None
    nearest: bool = False


def everything(target: Goal) -> PhiRanges:
    """No range for any label."""
    count = len(target.names)
    return PhiRanges((-math.inf,) * count, (math.inf,) * count)


def read_phi(target: Goal, phi: object, *, points: bool = False) -> PhiRanges:
    """(lowest, highest) is for the goal, a mapping for the labels it names, and a PhiBox for all labels of the spec.
    None is an open end; single values are allowed with `points`. Raises gymnasium.error.Error for anything else and for
    unknown labels, and gymnasium.error.InvalidBound for ends that are not numbers or are reversed."""
    if isinstance(phi, PhiRanges):
        return phi
    names, known = target.names, target.names[: target.labels]
    given: Mapping[int, object]
    if isinstance(phi, PhiBox):
        if not all(isinstance(ends, tuple | list | np.ndarray) for ends in (phi.low, phi.high)):
            raise gym_error(NOT_A_TASK(value=str(phi)), error.InvalidBound)
        for side in (phi.low, phi.high):
            if len(side) != len(known):
                raise gym_error(NOT_A_TASK(count=len(side), labels=known))
        given = dict(enumerate(zip(phi.low, phi.high, strict=True)))
    elif isinstance(phi, Mapping):
        given = {_label(names, known, name): ends for name, ends in phi.items()}
    else:
        given = {target.goal: phi}
    low, high = ([end] * len(names) for end in (-math.inf, math.inf))
    for k, ends in given.items():
        low[k], high[k] = _ends(names[k], ends, points)
    return PhiRanges(tuple(low), tuple(high))


def _label(names: Sequence[str], known: Sequence[str], name: object) -> int:
    if name in names:
        return names.index(str(name))
    raise gym_error(UNKNOWN_LABEL(name=str(name), known=known))


def _ends(name: str, ends: object, points: bool) -> tuple[float, float]:
    pair = as_list(ends)
    if (
        not isinstance(pair, list)
        or len(pair) != 2
        or not all(type(end) is float or end is None or _is_number(end) for end in pair)
    ):
        raise gym_error(RANGE_NOT_A_PAIR(label=name, value=repr(ends)), error.InvalidBound)
    try:
        low = -math.inf if pair[0] is None else float(pair[0])
        high = math.inf if pair[1] is None else float(pair[1])
    except OverflowError:
        raise gym_error(RANGE_NOT_A_PAIR(end="a number that large", label=name), error.InvalidBound) from None
    if math.isnan(low) or math.isnan(high):
        raise gym_error(RANGE_NOT_A_PAIR(end="NaN", label=name), error.InvalidBound)
    if low > high:
        raise gym_error(RANGE_REVERSED(label=name, low=low, high=high), error.InvalidBound)
    if low == high and math.isinf(low):
        raise gym_error(RANGE_NOT_A_PAIR(end=f"{low:g} at both sides", label=name), error.InvalidBound)
    if low == high and not points:
        band = f"{low - BAND_HALF_WIDTH:g}:{low + BAND_HALF_WIDTH:g}"
        raise gym_error(SINGLE_VALUE(label=name, value=low, band=band), error.InvalidBound)
    return low, high


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def read_scene(spec: Spec, scene: object) -> Array:
    """(3N,) storage of a scene: a Scene or its data, a mapping from each object to its pose ((x, y, theta), or x, y and
    theta by name), or an array (N, 3) in metres and radians. Raises gymnasium.error.Error for other objects, and for a
    scene that violates the spec's requirement."""
    if isinstance(scene, Scene | SceneData):
        poses: Mapping[Any, Any] = scene.poses
    elif isinstance(scene, Mapping):
        poses = scene["poses"] if "poses" in scene and "poses" not in spec.objects else scene
        if not isinstance(poses, Mapping):
            raise gym_error(NOT_POSES(found=f"`poses` is a {type(poses).__name__}", objects=len(spec.objects)))
    else:
        array = _array(scene) if isinstance(scene, np.ndarray | list | tuple) else np.empty(0)
        if array.shape != (len(spec.objects), SIZE):
            what = f"an array of shape {array.shape}" if array.size else f"a {type(scene).__name__}"
            raise gym_error(NOT_POSES(found=f"this is {what}", objects=len(spec.objects)))
        here = [
            name for name, pose in zip(spec.objects, array, strict=True) if not (spec.counts and np.isnan(pose).all())
        ]
        poses = {name: array[spec.objects.index(name)] for name in here}
    checked = _member(spec.require_scenes(), poses)
    missing = [name for name in checked.objects if name not in poses]
    extra = [str(name) for name in poses if name not in checked.objects]
    if missing or extra:
        what = f"lacks {quote_names(missing)}" if missing else f"has {quote_names(extra)}"
        raise gym_error(OTHER_OBJECTS(scene=f"a scene that {what}", wanted=checked.objects))
    rows = np.array([_pose(name, poses[name]) for name in checked.objects]).ravel()
    rows[rows_along(THETA)] = wrap_heading(np, rows[rows_along(THETA)])
    for index, pose in checked.fixed.items():
        if abs(math.remainder(rows[row_of(index, THETA)] - pose[THETA], TWO_PI)) < 1e-9:
            rows[row_of(index, THETA)] = pose[THETA]
    rows = np.concatenate([rows, *(_switch(checked, which, poses) for which in checked.choices)])
    with as_gym_errors():
        check_scenes(checked, rows[:, None])
    whole = np.full(row_count(len(spec.require_scenes().core.objects)), np.nan)
    whole[rows_among(spec.require_scenes(), checked)] = rows
    return whole


def _member(spec: CheckedSpec, names: Collection[object]) -> CheckedSpec:
    """The ordinary spec that has most of these objects, and no others if there is one."""
    return max(spec.members or (spec,), key=lambda one: -len(set(one.objects) ^ set(names)))


def _switch(spec: CheckedSpec, which: int, poses: Mapping[Any, Any]) -> Array:
    """The rows of the switch of an object that stands on one of several surfaces."""
    choice, name = spec.choices[which], spec.objects[which]
    pose, known = poses[name], [one.name for one in choice.options]
    on = pose.on if isinstance(pose, RestingPose) else pose.get("on") if isinstance(pose, Mapping) else None
    if on not in known:
        raise gym_error(OTHER_SURFACE(scene="this scene", name=name, surface=on or "", known=known))
    rows = np.zeros(SIZE)
    rows[X] = choice.middles[known.index(on)]
    return rows


def _array(scene: Any) -> Array:
    try:
        array = np.asarray(scene)
        if array.dtype.kind in "iufO":
            return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise gym_error(NOT_POSES(found="these are not all numbers"))


def _pose(name: str, pose: Any) -> tuple[float, float, float]:
    if isinstance(pose, Pose):
        return pose.x, pose.y, pose.theta
    if isinstance(pose, Mapping):
        extra = [str(key) for key in pose if key not in (*NAMES, "on")]
        if extra:
            raise gym_error(NOT_A_POSE(name=name, value=f"one with {quote_names(extra)}"))
        pose = pose.get("x"), pose.get("y"), pose.get("theta", 0.0)
    if isinstance(pose, str | bytes):  # "123" would do
        raise gym_error(NOT_A_POSE(name=name, value=repr(pose)))
    try:
        x, y, theta = (float(value) for value in pose)
    except (TypeError, ValueError, OverflowError):
        raise gym_error(NOT_A_POSE(name=name, value=repr(pose))) from None
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(theta)):
        raise gym_error(NOT_A_POSE(name=name, value=f"({x:g}, {y:g}, {theta:g})"))
    return x, y, theta


def check_options(options: object) -> Mapping[str, Any]:
    """Options as a mapping, empty for None. Raises gymnasium.error.Error for anything else, for an unknown option, and
    for phi and a scene together."""
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        wanted = 'options by name, say {"phi": (-0.2, -0.1)}'
        raise gym_error(WRONG_VALUE(argument="options", value=repr(options), wanted=wanted))
    for name in options:
        if name not in RESET_OPTIONS:
            raise gym_error(UNKNOWN_CHOICE(what="option", name=str(name), known=RESET_OPTIONS))
    if options.get("phi") is not None and options.get("scene") is not None:
        raise gym_error(CONFLICTING_ARGUMENTS(one="phi", other="scene"))
    if not isinstance(options.get("nearest", False), bool | np.bool_):
        raise gym_error(WRONG_VALUE(argument="nearest", value=repr(options["nearest"]), wanted="True or False"))
    return options
