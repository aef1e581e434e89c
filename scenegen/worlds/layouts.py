"""Batches of verified layouts as torch tensors or numpy arrays, drawn ahead."""

from __future__ import annotations

import json
import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from scenegen.api.request import Phi, read_phi
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import poses7
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec, check_spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.files import SAME_NAME
from scenegen.errors.requests import ONLY_AT_BOUND, OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.errors.worlds import TOO_FEW_LAYOUTS
from scenegen.needs import need
from scenegen.sampling.request import SampleRequest
from scenegen.scenes.arrange import refuse_numbers
from scenegen.scenes.files import write_whole
from scenegen.validation import as_int, as_list, as_number, as_path, as_point, as_seconds

if TYPE_CHECKING:
    import torch


# --------------------------------------------------------------------------------------------------------------------
# Poses of scenes in the frame of a simulator.


Origins: TypeAlias = Literal["base", "middle"] | Mapping[str, float]
"""Where the origin of an object is: in its lowest point under the middle, in the middle of its height, or so many
metres above its lowest point, by name; 0 for names that are left out."""
Axis: TypeAlias = Literal["x", "y", "z"]
"""The axis of a body's own frame that points up where it stands."""

# quaternions (w, x, y, z) that turn the axis up: x about y by -90 degrees, y about x by 90 degrees
UPRIGHT = {
    "x": (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0),
    "y": (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0),
    "z": (1.0, 0.0, 0.0, 0.0),
}


def placed(
    scenes: SceneSet, origin: Sequence[float], turn: float, origins: Origins, up: Mapping[str, Axis] | None = None
) -> Array:
    """(n, N, 7): x, y, z in metres and qw, qx, qy, qz, in the world.

    `origin` is where the spec's point (0, 0) at the height of the table is; `turn` turns the spec's x axis
    counter-clockwise, in radians; `up` names the axis of a body's own frame that points up, "z" where it does not say.
    Raises RequestError.
    """
    x, y, z = as_point("origin", origin)
    turn = as_number("turn", turn)
    poses: Array = poses7(scenes.header, scenes.poses, scenes.on, tensor=False, dtype="float64")
    poses[..., 2] += lifts(scenes, origins) + z
    cosine, sine = math.cos(turn), math.sin(turn)
    right, away = poses[..., 0].copy(), poses[..., 1].copy()
    poses[..., 0], poses[..., 1] = cosine * right - sine * away + x, sine * right + cosine * away + y
    # the product of a turn about the vertical and a quaternion (w, 0, 0, z)
    cosine, sine = math.cos(turn / 2.0), math.sin(turn / 2.0)
    w, k = poses[..., 3].copy(), poses[..., 6].copy()
    poses[..., 3], poses[..., 6] = cosine * w - sine * k, sine * w + cosine * k
    for name, axis in ({} if up is None else up).items():
        if name not in scenes.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(name), known=scenes.objects))
        if axis not in UPRIGHT:
            raise RequestError(UNKNOWN_CHOICE(what="axis", plural="axes", name=str(axis), known=tuple(UPRIGHT)))
        a, b, c, d = UPRIGHT[axis]
        which = scenes.objects.index(name)
        w, k = poses[:, which, 3].copy(), poses[:, which, 6].copy()
        # the product of (w, 0, 0, k) and the turn that stands the body up
        poses[:, which, 3:] = np.stack([w * a - k * d, w * b - k * c, w * c + k * b, w * d + k * a], axis=1)
    return poses


def lifts(scenes: SceneSet, origins: Origins) -> Array:
    """(N,): how far the origin of each object is above its lowest point. Raises RequestError."""
    if isinstance(origins, Mapping):
        for name in origins:
            if name not in scenes.objects:
                raise RequestError(UNKNOWN_CHOICE(what="object", name=str(name), known=scenes.objects))
        return np.array([as_number(f"origins[{name!r}]", origins.get(name, 0.0)) for name in scenes.objects])
    if origins not in ("base", "middle"):
        wanted = '"base", "middle" or metres by name'
        raise RequestError(WRONG_VALUE(argument="origins", value=repr(origins), wanted=wanted))
    half = 0.5 if origins == "middle" else 0.0
    return half * np.array([one.shape.height for one in scenes.header.objects])


ORDERS = ("wxyz", "xyzw")
DRAWS = 8  # draws that are kept for `at`
STREAM = 13  # the stream of random numbers of layouts; worlds/robosuite.py and others have streams of their own


class Taken(NamedTuple):
    """`poses` (B, N, 7): x, y, z in metres, then the quaternion; `phi` (B, L), labels in the spec's order. Tensors of
    torch, or arrays of numpy without a device."""

    poses: torch.Tensor | npt.NDArray[Any]
    phi: torch.Tensor | npt.NDArray[Any]


class Layouts:
    """Layouts of a spec with phi in a range, as `scenegen.sample` takes it, each verified and each returned once.

    `quaternion` is the order of its four numbers: "wxyz" for ManiSkill, MuJoCo and Isaac Lab up to 2.x, "xyzw" for
    PyBullet, ROS and Isaac Lab 3. `device` and `dtype` are those of the tensors; without a device (None) layouts are
    numpy arrays, and torch is not needed. `origin`, in metres, is where the spec's point (0, 0) on the table is in the
    world, and `turn`, in radians, turns the spec's x axis. `origins` says where in an object its pose is: "base", the
    lowest point under the middle; "middle" of its height; or metres above the lowest point by name. `up` names the axis
    of a body's own frame that points up where it stands, by object: "x" for SAPIEN's cylinders, "y" for most glTF; the
    others have "z". At least `ahead` layouts are drawn at a time, by `method` as in `scenegen.sample`. Objects are in
    the order of `objects`. The same arguments and takes give the same layouts.

    Raises RequestError for arguments that are none, and where torch is not installed.
    """

    def __init__(
        self,
        spec: Spec,
        phi: Phi | None = None,
        *,
        quaternion: Literal["wxyz", "xyzw"],
        device: torch.device | str | None = "cpu",
        dtype: torch.dtype | npt.DTypeLike | None = None,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        turn: float = 0.0,
        origins: Origins = "base",
        up: Mapping[str, Axis] | None = None,
        ahead: int = 8192,
        seed: int = 0,
        method: str = "auto",
        timeout: float = 60.0,
        workers: int | None = 1,
    ) -> None:
        check_spec(spec)
        if device is not None:
            need("torch", "for tensors")
        if quaternion not in ORDERS:
            raise RequestError(
                UNKNOWN_CHOICE(
                    what="order of a quaternion", plural="orders of a quaternion", name=str(quaternion), known=ORDERS
                )
            )
        self.spec, self.objects = spec, spec.objects
        self._phi = read_phi(spec, phi)
        self._order = [0, 1, 2, 3, 4, 5, 6] if quaternion == "wxyz" else [0, 1, 2, 4, 5, 6, 3]
        self._device, self._dtype = device, dtype
        self._origin, self._turn, self._origins, self._up = origin, turn, origins, {} if up is None else up
        self._ahead, self._seed = _positive("ahead", ahead), as_int("seed", seed)
        self._method, self._timeout, self._workers = method, as_seconds("timeout", timeout), workers
        self._draws = 0
        self._left: Taken | None = None
        self._kept: OrderedDict[int, Taken] = OrderedDict()

    def take(self, count: int, generator: np.random.Generator | torch.Generator | None = None) -> Taken:
        """The next `count` layouts. With a generator, of numpy or torch, they are chosen by it, with repeats, from the
        first `ahead`: the same state of the generator gives the same layouts. A draw ends at the time limit with what
        it has found; raises RequestError where it has found none, and with a generator where it has not found all."""
        count = _positive("count", count)
        if generator is not None:
            return self.at(_chosen(generator, count, self._ahead))
        left = self._left
        while left is None or len(left.poses) < count:
            have = 0 if left is None else len(left.poses)
            fresh = self._draw(max(self._ahead, count - have), self._draws, keep_partial=True)
            self._draws += 1
            left = fresh if left is None else _joined(left, fresh)
        self._left = Taken(left.poses[count:], left.phi[count:])
        return Taken(left.poses[:count], left.phi[:count])

    def at(self, index: int | npt.ArrayLike) -> Taken:
        """Layouts by their numbers, from 0 on, (B,); one number is B = 1. A number stands for the same layout whatever
        was taken before: that of draw `number // ahead`. The latest draws are kept. Raises RequestError where `index`
        is none, and where a draw was not complete at its time limit."""
        numbers = np.atleast_1d(np.asarray(as_list(index)))
        numbers = numbers if numbers.size else numbers.astype(np.intp)
        if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer) or (numbers < 0).any():
            raise RequestError(WRONG_VALUE(argument="index", value=repr(index), wanted="whole numbers from 0 on"))
        draws = np.unique(numbers // self._ahead)
        found = [(draw, self._kept_draw(int(draw))) for draw in draws]
        order = np.argsort(numbers // self._ahead, kind="stable")
        parts = [_only(taken, numbers[numbers // self._ahead == draw] % self._ahead) for draw, taken in found]
        if not parts:
            return _only(self._kept_draw(0), numbers)
        whole = parts[0]
        for part in parts[1:]:
            whole = _joined(whole, part)
        return _only(whole, np.argsort(order, kind="stable"))

    def _kept_draw(self, number: int) -> Taken:
        if number not in self._kept:
            self._kept[number] = self._draw(self._ahead, number, keep_partial=False)
            if len(self._kept) > DRAWS:
                self._kept.popitem(last=False)
        self._kept.move_to_end(number)
        return self._kept[number]

    def _draw(self, count: int, number: int, keep_partial: bool) -> Taken:
        source = np.random.SeedSequence([self._seed, STREAM, number])
        request = SampleRequest(
            self._phi,
            count,
            seed=int(source.generate_state(1)[0]),
            method=self._method,
            timeout=self._timeout,
            workers=self._workers,
            keep_partial=keep_partial,
            strict=True,
        )
        scenes = draw_scenes(self.spec, request)
        order = np.random.default_rng(source).permutation(len(scenes))  # scenes come sorted by cells of phi
        poses = placed(scenes, self._origin, self._turn, self._origins, self._up)[order][..., self._order]
        phi = np.stack(list(scenes.phi.values()), axis=1)[order]
        if self._device is None:
            kind: Any = np.float32 if self._dtype is None else self._dtype
            return Taken(poses.astype(kind), phi.astype(kind))
        import torch

        dtype: Any = torch.float32 if self._dtype is None else self._dtype
        return Taken(*(torch.from_numpy(one).to(self._device, dtype) for one in (poses, phi)))


def _joined(first: Taken, second: Taken) -> Taken:
    if isinstance(first.poses, np.ndarray):
        return Taken(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    from torch import cat

    return Taken(*(cat(pair) for pair in zip(first, second, strict=True)))  # type: ignore[arg-type]


def _only(taken: Taken, which: npt.NDArray[np.intp]) -> Taken:
    return Taken(*(one[which] for one in taken))


def _chosen(generator: np.random.Generator | torch.Generator, count: int, most: int) -> npt.NDArray[np.intp]:
    """(count,) whole numbers below `most`. Raises RequestError for what is no generator."""
    if isinstance(generator, np.random.Generator):
        return generator.integers(most, size=count, dtype=np.intp)
    if type(generator).__module__.partition(".")[0] == "torch":
        import torch

        return torch.randint(most, (count,), generator=generator, device=generator.device).cpu().numpy()
    wanted = "a generator of numpy or torch: numpy.random.default_rng(seed)"
    raise RequestError(WRONG_VALUE(argument="generator", value=repr(generator), wanted=wanted))


def _positive(name: str, value: object) -> int:
    number = as_int(name, value)
    if number < 1:
        raise RequestError(OUT_OF_RANGE(argument=name, value=number, wanted="1 or more"))
    return number


# --------------------------------------------------------------------------------------------------------------------
# Layout pools of Isaac Lab-Arena: the JSON that its `PooledObjectPlacer.load` reads instead of solving.
#
# The form is that of isaaclab_arena/relations/layout_pool_serialization.py (August 2026): by environment a list of
# layouts, each with positions and yaws by object name, checks, a loss and a number of attempts.


def write_arena_pool(
    scenes: SceneSet,
    path: str | Path,
    *,
    num_envs: int = 1,
    names: Mapping[str, str] | None = None,
    anchors: Mapping[str, Sequence[float]] | None = None,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    origins: Origins = "base",
    uses_env_specific_bboxes: bool = False,
    seed: int | None = None,
) -> Path:
    """Write scenes as a layout pool, dealt to the environments in turn; the file appears whole or not at all.

    `names` maps objects to names in Arena. `anchors` are the objects that Arena has and the spec does not, such as the
    table: (x, y, z) or (x, y, z, yaw) by name; the reader wants all objects. Places are in the frame of an
    environment, with `origin`, `turn` and `origins` as `Layouts` has them; the yaw is in radians. `seed` is that of
    Arena's own choices. Raises RequestError, also where there are fewer scenes than environments or the range of phi
    that was asked for is reached with probability 0 alone, DataError for
    scenes that differ in how many things there are, and OutputError.
    """
    path, num_envs = as_path("path", path), as_int("num_envs", num_envs)
    if num_envs < 1:
        raise RequestError(OUT_OF_RANGE(argument="num_envs", value=num_envs, wanted="1 or more"))
    refuse_numbers(scenes.header, "a layout pool")
    for warning in scenes.warnings:
        if (
            warning.kind == ONLY_AT_BOUND
        ):  # these scenes are beside the range that was asked for, and not verified in it
            raise RequestError(replace(warning.but(ask=warning.facts["band"], band=None), severity="error"))
    if len(scenes) < num_envs:
        raise RequestError(TOO_FEW_LAYOUTS(scenes=len(scenes), environments=num_envs))
    called = _names(scenes, names or {})
    still = {name: _anchor(name, pose) for name, pose in (anchors or {}).items()}
    everything = [*called, *still]
    for name in everything:
        if everything.count(name) > 1:
            raise RequestError(SAME_NAME(name=name, objects="objects"))
    poses = placed(scenes, origin, turn, origins)
    pools: list[list[dict[str, object]]] = [[] for _ in range(num_envs)]
    for index, scene in enumerate(poses.tolist()):
        positions = {name: pose[:3] for name, pose in zip(called, scene, strict=True)}
        yaws = {name: 2.0 * math.atan2(pose[6], pose[3]) for name, pose in zip(called, scene, strict=True)}
        layout = {
            "positions": positions | {name: pose[:3] for name, pose in still.items()},
            "orientations": yaws | {name: pose[3] for name, pose in still.items()},
            "validation": {"scenegen_verified": True},
            "final_loss": 0.0,
            "attempts": 1,
        }
        pools[index % num_envs].append(layout)
    document = {
        "placement_seed": None if seed is None else as_int("seed", seed),
        "num_envs": num_envs,
        "uses_env_specific_bboxes": bool(uses_env_specific_bboxes),
        "had_fallbacks": False,
        "env_pools": pools,
    }
    write_whole(path, json.dumps(document, allow_nan=False).encode())
    return path


def _names(scenes: SceneSet, names: Mapping[str, str]) -> list[str]:
    for own in names:
        if own not in scenes.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(own), known=scenes.objects))
    return [names.get(own, own) for own in scenes.objects]


def _anchor(name: str, pose: Sequence[float]) -> list[float]:
    wanted = "(x, y, z) or (x, y, z, yaw)"
    try:
        numbers = [float(one) for one in pose]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
        raise RequestError(WRONG_VALUE(argument=f"anchors[{name!r}]", value=repr(pose), wanted=wanted))
    return numbers if len(numbers) == 4 else [*numbers, 0.0]
