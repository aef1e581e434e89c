"""What `reset` is asked for, as people write it: a range of phi, or a scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.scene import Scene
from scenegen.api.spec import Spec
from scenegen.curriculum.aim import Aim
from scenegen.curriculum.faults import as_gymnasium
from scenegen.curriculum.tasks import PhiBox
from scenegen.data.arrange import check_scenes
from scenegen.errors import quoted, suggest
from scenegen.sampling.request import BAND
from scenegen.scene.data import Pose, SceneData
from scenegen.scene.workspace import AXES, TWO_PI

Array = npt.NDArray[np.float64]

OPTIONS = ("phi", "scene", "nearest")


@dataclass(frozen=True)
class Wanted:
    """phi that a scene is wanted with, of each of an aim's D labels: closed ranges, infinite where an end is open."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    @cached_property
    def dims(self) -> tuple[int, ...]:
        """The labels that something is wanted of."""
        ends = zip(self.low, self.high, strict=True)
        return tuple(k for k, (low, high) in enumerate(ends) if low > -math.inf or high < math.inf)

    def ranges(self, names: Sequence[str]) -> dict[str, tuple[float | None, float | None]]:
        """As samplers are asked for it."""
        return {
            names[k]: (
                self.low[k] if math.isfinite(self.low[k]) else None,
                self.high[k] if math.isfinite(self.high[k]) else None,
            )
            for k in self.dims
        }

    def describe(self, names: Sequence[str]) -> str:
        """`phi of task in -0.2:-0.1`."""
        parts = []
        for name, (low, high) in self.ranges(names).items():
            parts.append(
                f"phi of `{name}` in {'' if low is None else f'{low:.4g}'}:{'' if high is None else f'{high:.4g}'}"
            )
        return " and ".join(parts) or "any phi"


def everything(aim: Aim) -> Wanted:
    """No wish at all."""
    count = len(aim.names)
    return Wanted((-math.inf,) * count, (math.inf,) * count)


def read_phi(aim: Aim, phi: object, *, points: bool = False) -> Wanted:
    """(lowest, highest) is of the goal, a mapping of the labels it names, and a PhiBox of all labels of the spec. None
    is an open end; single values are let pass with `points`. Raises gymnasium.error.Error for what is none of these and
    for unknown labels, and gymnasium.error.InvalidBound for ends that are no numbers or the wrong way round."""
    if isinstance(phi, Wanted):
        return phi
    given: Mapping[int, object]
    if isinstance(phi, PhiBox):
        if not all(isinstance(ends, tuple | list | np.ndarray) for ends in (phi.low, phi.high)):
            raise error.InvalidBound(f"{phi} is no task; `low` and `high` have one number per label each")
        for side in (phi.low, phi.high):
            if len(side) != aim.labels:
                known = quoted(aim.names[: aim.labels])
                raise error.Error(f"the task has phi of {len(side)} labels; the spec has {known}")
        given = dict(enumerate(zip(phi.low, phi.high, strict=True)))
    elif isinstance(phi, Mapping):
        given = {_label(aim, name): ends for name, ends in phi.items()}
    else:
        given = {aim.goal: phi}
    low, high = ([end] * len(aim.names) for end in (-math.inf, math.inf))
    for k, ends in given.items():
        low[k], high[k] = _ends(aim.names[k], ends, points)
    return Wanted(tuple(low), tuple(high))


def _label(aim: Aim, name: object) -> int:
    if name in aim.names:
        return aim.names.index(str(name))
    known = aim.names[: aim.labels]
    raise error.Error(f"the spec has no label `{name}`; {suggest(str(name), known, f'it has {quoted(known)}')}")


def _ends(name: str, ends: object, points: bool) -> tuple[float, float]:
    pair = list(ends) if isinstance(ends, tuple | list | np.ndarray) else []
    if len(pair) != 2 or not all(type(end) is float or end is None or _is_number(end) for end in pair):
        raise error.InvalidBound(
            f"phi of `{name}` is asked for as {ends!r}; write (lowest, highest), None for an open end"
        )
    try:
        low = -math.inf if pair[0] is None else float(pair[0])
        high = math.inf if pair[1] is None else float(pair[1])
    except OverflowError:
        raise error.InvalidBound(f"phi of `{name}` is asked for with an end too large; None is an open end") from None
    if math.isnan(low) or math.isnan(high):
        raise error.InvalidBound(f"phi of `{name}` is asked for as {ends!r}; NaN is no phi, None is an open end")
    if low > high:
        raise error.InvalidBound(f"phi of `{name}` is asked for from {low:g} to {high:g}, which is reversed")
    if low == high and math.isinf(low):
        raise error.InvalidBound(f"phi of `{name}` is asked for as {ends!r}; it is finite, None is an open end")
    if low == high and not points:
        band = f"({low - BAND:g}, {low + BAND:g})"
        raise error.InvalidBound(f"phi of `{name}` is exactly {low:g} with probability 0; ask for a band, say {band}")
    return low, high


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def read_scene(spec: Spec, scene: object) -> Array:
    """(3N,) storage of a scene: a Scene or its data, a mapping from each object to its pose ((x, y, theta), or x, y and
    theta by name), or an array (N, 3) in metres and radians. Raises gymnasium.error.Error for other objects, and for a
    scene that the spec does not allow."""
    if isinstance(scene, Scene | SceneData):
        poses: Mapping[Any, Any] = scene.poses
    elif isinstance(scene, Mapping):
        poses = scene["poses"] if "poses" in scene and "poses" not in spec.objects else scene
        if not isinstance(poses, Mapping):
            raise error.Error(f"the `poses` of the scene are a {type(poses).__name__}; write {{object: (x, y, theta)}}")
    else:
        array = _array(scene) if isinstance(scene, np.ndarray | list | tuple) else np.empty(0)
        if array.shape != (len(spec.objects), 3):
            what = f"an array of shape {array.shape}" if array.size else f"a {type(scene).__name__}"
            raise error.Error(
                f"a scene is a Scene, a pose for each object, or an array ({len(spec.objects)}, 3), not {what}"
            )
        poses = dict(zip(spec.objects, array, strict=True))
    missing = [name for name in spec.objects if name not in poses]
    extra = [str(name) for name in poses if name not in spec.objects]
    if missing or extra:
        what = f"lacks {quoted(missing)}" if missing else f"has {quoted(extra)}"
        raise error.Error(f"the scene {what}; the spec is about {quoted(spec.objects)}")
    rows = np.array([_pose(name, poses[name]) for name in spec.objects]).ravel()
    rows[2::3] %= TWO_PI
    rows[2::3][rows[2::3] >= TWO_PI] = 0.0
    for index, pose in spec.checked.fixed.items():
        if abs(math.remainder(rows[3 * index + 2] - pose[2], TWO_PI)) < 1e-9:
            rows[3 * index + 2] = pose[2]
    with as_gymnasium():
        check_scenes(spec.checked, rows[:, None])
    return rows


def _array(scene: Any) -> Array:
    try:
        array = np.asarray(scene)
        if array.dtype.kind in "iufO":
            return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise error.Error("the poses of the scene are not all numbers; write a row (x, y, theta) for each object")


def _pose(name: str, pose: object) -> tuple[float, float, float]:
    if isinstance(pose, Pose):
        return pose.x, pose.y, pose.theta
    if isinstance(pose, Mapping):
        extra = [str(key) for key in pose if key not in AXES]
        if extra:
            raise error.Error(f"the pose of `{name}` has {quoted(extra)}; it has {quoted(AXES)}, in metres and radians")
        pose = pose.get("x"), pose.get("y"), pose.get("theta", 0.0)
    if isinstance(pose, str | bytes):  # "123" would do
        raise error.Error(f"the pose of `{name}` is {pose!r}; write (x, y, theta) in metres and radians")
    try:
        x, y, theta = (float(value) for value in pose)  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        raise error.Error(f"the pose of `{name}` is {pose!r}; write (x, y, theta) in metres and radians") from None
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(theta)):
        raise error.Error(f"the pose of `{name}` is ({x:g}, {y:g}, {theta:g}); it has to be finite")
    return x, y, theta


def check_options(options: object) -> Mapping[str, Any]:
    """Options as a mapping, empty for None. Raises gymnasium.error.Error for what is none, for an option that there is
    not, and for phi and a scene at once."""
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise error.Error(f'`options` is {options!r}; write them by name, say {{"phi": (-0.2, -0.1)}}')
    for name in options:
        if name not in OPTIONS:
            raise error.Error(f"unknown option `{name}`; {suggest(str(name), OPTIONS, f'there are {quoted(OPTIONS)}')}")
    if options.get("phi") is not None and options.get("scene") is not None:
        raise error.Error("`phi` and `scene` are both asked for; a given scene has the phi that it has: leave one out")
    if not isinstance(options.get("nearest", False), bool | np.bool_):
        raise error.Error(f"`nearest` is {options['nearest']!r}; it is True or False")
    return options
