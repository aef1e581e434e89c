"""phi over motions in torch: state formulas by today's robustness, moment by moment, then windows over time."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor
from torch.autograd import forward_ad

from scenegen.lang.formula.timed import Timed, over_time, slide_by_doubling
from scenegen.learn.robustness.compile import Held, Robustness, elsewhere, held_elsewhere, is_transformed, plain
from scenegen.pose import NAMES, SIZE, row_count

STATES_AT_ONCE = 1 << 18  # states at a time, where no gradient is wanted


class TraceRobustness:
    """phi of every label of a spec over time, for any number of motions of N objects at the moments 0 to T.

    A label's phi is its formula's value at moment 0 (Donze and Maler, "Robust satisfaction of temporal logic over
    real-valued signals", FORMATS 2010, in discrete time with closed windows that end with the motion). Values are exact
    minima and maxima, differentiable; time grows with T log T at most, whatever the windows. Works in the dtype and on
    the device of its input.
    """

    def __init__(self, timed: Timed, *, held: Held | None = None) -> None:
        self.timed = timed
        self.held = {} if held is None else dict(held)
        self.labels = tuple(timed.labels)
        self.objects = timed.objects
        self.horizon = timed.horizon
        self._state = Robustness(timed.state)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.timed, self.held)

    def __call__(self, poses: Tensor, *, signals: bool = False) -> Tensor:
        """(B, T + 1, N, 3) poses -> (B, L); with `signals`, the value at every moment: (B, T + 1, L). What looks beyond
        the last moment is infinite there: the least value of no moment is infinity, the largest minus infinity.

        Raises ValueError for another shape or dtype, for NaN or infinite coordinates, and for an object that the spec
        holds elsewhere.
        """
        values = self._values(poses, list(self.timed.labels.values()))
        out = torch.stack(values, dim=-1)
        return out if signals else out[:, 0]

    def required(self, poses: Tensor, *, signals: bool = False) -> Tensor:
        """(B, T + 1, N, 3) poses -> (B,), the least value over time of what the spec requires: it holds where this is
        >= 0. With `signals`, the value at every moment: (B, T + 1). Requirements of steps are infinite at moment 0.
        Without requirements all is infinity. Raises ValueError as calls do."""
        if self.timed.requirement is None:
            self._refuse(poses)
            value = poses.new_full(poses.shape[:2], math.inf)
        else:
            (value,) = self._values(poses, [self.timed.requirement])
        return value if signals else value.amin(-1)

    def _values(self, poses: Tensor, wanted: list[int]) -> list[Tensor]:
        self._refuse(poses)
        batch, moments = poses.shape[:2]
        some = max(1, STATES_AT_ONCE // moments)
        if batch <= some or (poses.requires_grad and torch.is_grad_enabled()):
            return self._batch_values(poses, wanted)
        parts = [self._batch_values(part, wanted) for part in torch.split(poses, some)]
        return [torch.cat(columns) for columns in zip(*parts, strict=True)]

    def _batch_values(self, poses: Tensor, wanted: list[int]) -> list[Tensor]:
        batch, moments = poses.shape[:2]
        if self.timed.steps:
            before = torch.cat([poses[:, :1], poses[:, :-1]], dim=1)
            states = torch.cat([poses, before], dim=2)
        else:
            states = poses
        rows = states.permute(2, 3, 0, 1).reshape(row_count(states.shape[2]), batch * moments)
        signals = self._state.rows(rows, check=False).reshape(len(self._state.labels), batch, moments)

        def everywhere(value: float) -> Tensor:
            return poses.new_full((batch, moments), value)

        values = over_time(_TorchTraces(), self.timed, signals.unbind(0), everywhere)
        return [values[node] for node in wanted]

    def _refuse(self, poses: Tensor) -> None:
        if not isinstance(poses, Tensor):
            raise TypeError(f"poses must be a torch tensor, not {type(poses).__name__}; use torch.from_numpy(poses)")
        want = (self.horizon.moments, len(self.objects), SIZE)
        if poses.ndim != 4 or tuple(poses.shape[1:]) != want:
            shape = f"(B, {want[0]}, {want[1]}, {want[2]})"
            raise ValueError(
                f"poses must have the shape {shape}, one ({', '.join(NAMES)}) per object and moment,"
                f" not {tuple(poses.shape)}"
            )
        if poses.dtype not in (torch.float32, torch.float64):
            raise ValueError(f"coordinates must be float32 or float64, not {str(poses.dtype).removeprefix('torch.')}")
        if not bool(torch.isfinite(plain(poses).detach().sum())):
            bad = (~torch.isfinite(plain(poses))).nonzero()
            if len(bad):
                trace, moment, which, axis = (int(index) for index in bad[0])
                name = self.objects[which]
                raise ValueError(f"{NAMES[axis]} of `{name}` at moment {moment} of motion {trace} is not finite")
        if self.held and not is_transformed(poses):
            found = elsewhere(self.held, poses.detach().reshape(-1, row_count(want[1])).T)
            if found is not None:
                which, at = found
                where = f"at moment {at % want[0]} of motion {at // want[0]}"
                raise ValueError(held_elsewhere(self.objects[which], self.held[which], where))


def _again(timed: Timed, held: Held) -> TraceRobustness:
    return TraceRobustness(timed, held=held)


class _TorchTraces:
    """Arrays of torch, for scenegen.lang.formula.timed."""

    minimum = staticmethod(torch.minimum)
    maximum = staticmethod(torch.maximum)

    @staticmethod
    def shift(a: Tensor, by: int, fill: float) -> Tensor:
        moments = a.shape[-1]
        by = min(by, moments)
        return torch.nn.functional.pad(a[..., by:], (0, by), value=fill)

    @staticmethod
    def first(value: float, everywhere: Any) -> Tensor:
        out: Tensor = everywhere(-math.inf)
        out[..., 0] = value
        return out

    @staticmethod
    def onto(kind: str, a: Tensor, b: Tensor) -> Tensor:
        step = torch.minimum if kind == "min" else torch.maximum
        moments = b.shape[-1]
        if _needs_derivatives(a) or _needs_derivatives(b):
            return torch.cat([step(a[..., :moments], b), a[..., moments:]], dim=-1)
        out: Tensor = torch.empty_like(a)
        step(a[..., :moments], b, out=out[..., :moments])
        out[..., moments:] = a[..., moments:]
        return out

    def slide(self, kind: str, a: Tensor, width: int) -> Tensor:
        """Forwards, a few passes of `doubled` are as fast as anything up to 10,000 moments; backwards each costs much.
        So with gradients it is the algorithm of van Herk, Gil and Werman, linear in T: in blocks of `width` moments
        the extremes from t to the end of its block, and those from the start of the next block on."""
        if not _needs_derivatives(a) or is_transformed(a):
            passed: Tensor = slide_by_doubling(self, kind, a, width)
            return passed
        moments = a.shape[-1]
        blocks = -(-moments // width)
        fill = math.inf if kind == "min" else -math.inf
        a = torch.nn.functional.pad(a, (0, blocks * width - moments), value=fill)
        a = a.reshape(*a.shape[:-1], blocks, width)
        running = torch.cummin if kind == "min" else torch.cummax
        ends = running(a.flip(-1), -1).values.flip(-1).flatten(-2)[..., :moments]
        starts = running(a, -1).values.flatten(-2)[..., width - 1 : moments + width - 1]
        out: Tensor = self.onto(kind, ends, starts)
        return out


def _needs_derivatives(a: Tensor) -> bool:
    """Whether something wants derivatives, or a transform is at work."""
    backward = a.requires_grad and torch.is_grad_enabled()
    return backward or is_transformed(a) or forward_ad.unpack_dual(a).tangent is not None  # type: ignore[no-untyped-call]
