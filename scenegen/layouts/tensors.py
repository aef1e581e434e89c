"""Batches of verified layouts as torch tensors, drawn ahead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from scenegen.api.request import Phi, read_phi
from scenegen.api.sample import draw_scenes
from scenegen.api.spec import Spec, check_spec
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE
from scenegen.layouts.placing import Origins, placed
from scenegen.needs import need
from scenegen.sampling.request import SampleRequest
from scenegen.validation import as_int, as_seconds

if TYPE_CHECKING:
    import torch

ORDERS = ("wxyz", "xyzw")
STREAM = 13  # the stream of random numbers of layouts; robosuite/starts.py and others have streams of their own


class Taken(NamedTuple):
    """`poses` (B, N, 7): x, y, z in metres, then the quaternion; `phi` (B, L), labels in the spec's order."""

    poses: torch.Tensor
    phi: torch.Tensor


class Layouts:
    """Layouts of a spec with phi in a range, as `scenegen.sample` takes it, each verified and each returned once.

    `quaternion` is the order of its four numbers: "wxyz" for ManiSkill, MuJoCo and Isaac Lab up to 2.x, "xyzw" for
    PyBullet, ROS and Isaac Lab 3. `origin`, in metres, is where the spec's point (0, 0) on the table is in the world,
    and `turn`, in radians, turns the spec's x axis. `origins` says where in an object its pose is: "base", the lowest
    point under the middle; "middle" of its height; or metres above the lowest point by name. At least `ahead` layouts
    are drawn at a time, by `method` as in `scenegen.sample`. Objects are in the order of `objects`. The same arguments
    and takes give the same layouts.

    Raises RequestError for arguments that are none, and where torch is not installed.
    """

    def __init__(
        self,
        spec: Spec,
        phi: Phi | None = None,
        *,
        quaternion: Literal["wxyz", "xyzw"],
        device: torch.device | str = "cpu",
        dtype: torch.dtype | None = None,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        turn: float = 0.0,
        origins: Origins = "base",
        ahead: int = 8192,
        seed: int = 0,
        method: str = "auto",
        timeout: float = 60.0,
        workers: int | None = 1,
    ) -> None:
        check_spec(spec)
        need("torch", "for tensors")
        if quaternion not in ORDERS:
            raise RequestError(UNKNOWN_CHOICE(what="order of a quaternion", name=str(quaternion), known=ORDERS))
        self.spec, self.objects = spec, spec.objects
        self._phi = read_phi(spec, phi)
        self._order = [0, 1, 2, 3, 4, 5, 6] if quaternion == "wxyz" else [0, 1, 2, 4, 5, 6, 3]
        self._device, self._dtype = device, dtype
        self._origin, self._turn, self._origins = origin, turn, origins
        self._ahead, self._seed = _positive("ahead", ahead), as_int("seed", seed)
        self._method, self._timeout, self._workers = method, as_seconds("timeout", timeout), workers
        self._draws = 0
        self._left: Taken | None = None

    def take(self, count: int) -> Taken:
        """The next `count` layouts. A draw ends at the time limit with what it has found; raises RequestError where
        it has found none."""
        count = _positive("count", count)
        left = self._left
        while left is None or len(left.poses) < count:
            have = 0 if left is None else len(left.poses)
            fresh = self._draw(max(self._ahead, count - have))
            left = fresh if left is None else _joined(left, fresh)
        self._left = Taken(left.poses[count:], left.phi[count:])
        return Taken(left.poses[:count], left.phi[:count])

    def _draw(self, count: int) -> Taken:
        import torch

        source = np.random.SeedSequence([self._seed, STREAM, self._draws])
        seed = int(source.generate_state(1)[0])
        request = SampleRequest(
            self._phi,
            count,
            seed=seed,
            method=self._method,
            timeout=self._timeout,
            workers=self._workers,
            keep_partial=True,
        )
        scenes = draw_scenes(self.spec, request)
        self._draws += 1
        order = np.random.default_rng(source).permutation(len(scenes))  # scenes come sorted by cells of phi
        poses = placed(scenes, self._origin, self._turn, self._origins)[order][..., self._order]
        phi = np.stack(list(scenes.phi.values()), axis=1)[order]
        dtype = torch.float32 if self._dtype is None else self._dtype
        return Taken(*(torch.from_numpy(one).to(self._device, dtype) for one in (poses, phi)))


def _joined(first: Taken, second: Taken) -> Taken:
    from torch import cat

    return Taken(*(cat(pair) for pair in zip(first, second, strict=True)))


def _positive(name: str, value: object) -> int:
    number = as_int(name, value)
    if number < 1:
        raise RequestError(OUT_OF_RANGE(argument=name, value=number, wanted="1 or more"))
    return number
