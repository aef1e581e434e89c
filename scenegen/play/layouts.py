"""Batches of verified layouts as torch tensors or numpy arrays, drawn ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.api.request import Phi, read_phi
from scenegen.api.spec import Spec, check_spec
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, WRONG_VALUE
from scenegen.needs import need
from scenegen.play.frame import Axis, Origins, poses_in_world, quaternion_order
from scenegen.play.recent import Recent
from scenegen.play.starts import draw_shuffled
from scenegen.sampling.streams import LAYOUTS_STREAM
from scenegen.validation import as_int, as_list, as_seconds

if TYPE_CHECKING:
    import torch


MAX_DRAWS = 8  # that are kept for `at`


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
        self.spec, self.objects = spec, spec.objects
        self._phi = read_phi(spec, phi)
        self._order = quaternion_order(quaternion)
        self._device, self._dtype = device, dtype
        self._origin, self._turn, self._origins, self._up = origin, turn, origins, {} if up is None else up
        self._ahead, self._seed = _positive("ahead", ahead), as_int("seed", seed)
        self._method, self._timeout, self._workers = method, as_seconds("timeout", timeout), workers
        self._draws = 0
        self._left: Taken | None = None
        self._recent: Recent[int, Taken] = Recent(MAX_DRAWS)

    def take(self, count: int, generator: np.random.Generator | torch.Generator | None = None) -> Taken:
        """The next `count` layouts. With a generator, of numpy or torch, they are chosen by it, with repeats, from the
        first `ahead`: the same state of the generator gives the same layouts. A draw ends at the time limit with what
        it has found; raises RequestError where it has found none, and with a generator where it has not found all."""
        count = _positive("count", count)
        if generator is not None:
            return self.at(_random_numbers(generator, count, self._ahead))
        left = self._left
        while left is None or len(left.poses) < count:
            have = 0 if left is None else len(left.poses)
            fresh = self._draw(max(self._ahead, count - have), self._draws, keep_partial=True)
            self._draws += 1
            left = fresh if left is None else _concatenate([left, fresh])
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
        if not len(numbers):
            return _select(self._recent_draw(0), numbers)
        draw, place = np.divmod(numbers, self._ahead)
        parts = [_select(self._recent_draw(int(each)), place[draw == each]) for each in np.unique(draw)]
        order = np.argsort(draw, kind="stable")
        return _select(_concatenate(parts), np.argsort(order, kind="stable"))

    def _recent_draw(self, number: int) -> Taken:
        return self._recent.get_or_make(number, lambda: self._draw(self._ahead, number, keep_partial=False))

    def _draw(self, count: int, number: int, keep_partial: bool) -> Taken:
        source = np.random.SeedSequence([self._seed, LAYOUTS_STREAM, number])
        scenes = draw_shuffled(
            self.spec, self._phi, count, source,
            timeout=self._timeout, keep_partial=keep_partial, method=self._method, workers=self._workers,
        )  # fmt: skip
        poses = poses_in_world(scenes.header, scenes.poses7(), self._origin, self._turn, self._origins, self._up)[
            ..., self._order
        ]
        phi = np.stack(list(scenes.phi.values()), axis=1)
        if self._device is None:
            kind: Any = np.float32 if self._dtype is None else self._dtype
            return Taken(poses.astype(kind), phi.astype(kind))
        import torch

        dtype: Any = torch.float32 if self._dtype is None else self._dtype
        return Taken(*(torch.from_numpy(one).to(self._device, dtype) for one in (poses, phi)))


def _concatenate(parts: Sequence[Taken]) -> Taken:
    if isinstance(parts[0].poses, np.ndarray):
        return Taken(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    from torch import cat

    return Taken(*(cat(each) for each in zip(*parts, strict=True)))


def _select(taken: Taken, which: npt.NDArray[np.intp]) -> Taken:
    return Taken(*(values[which] for values in taken))


def _random_numbers(generator: np.random.Generator | torch.Generator, count: int, most: int) -> npt.NDArray[np.intp]:
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
