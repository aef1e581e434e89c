"""Core formula -> one kernel of machine code, by torch.compile.

The tape is recorded as an FX graph, so that Dynamo reads a straight line and not our interpreter. Rows go in and come
out one by one, as tensors of their own: no batch, stride, offset or neighbour is then part of what was compiled, and
one compilation per dtype serves every call (and one more after a change of the number of threads).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, fx

from scenegen.lang.core import Coord, Core, Node, last_uses
from scenegen.lang.headings import bare_rows
from scenegen.primitives import Namespace
from scenegen.robustness.headings import coordinates
from scenegen.robustness.namespace import TORCH
from scenegen.robustness.sincos import DOUBLE, SINGLE, Constants, turn
from scenegen.robustness.tape import run

# One thread compiles: more would be left running, and there is next to nothing for them. A product and a sum may become
# one instruction, which rounds once.
OPTIONS: dict[str, Any] = {"compile_threads": 1, "cpp.enable_floating_point_contract_flag": "fast"}
LARGEST = 4_000  # operations of a graph; these take about half a minute to compile, and the time grows faster


class TooLargeError(Exception):
    """A formula of more operations than are compiled."""


class Fused:
    """phi of every label by compiled code, without gradients. Make it with `fused`, which keeps the last few cores'.

    Where there is no C++ compiler, compiling fails for another reason, or the formula is too large to try, a
    RuntimeWarning says so once, and every call from then on returns False. So do calls with headings of footprints of
    thousands of turns, without a word.
    """

    def __init__(self, core: Core) -> None:
        self._works = any(isinstance(node, Coord) for node in core.nodes)  # constants alone are not worth it
        if not self._works:
            return
        try:
            _, self._rows, self._turns = record(core, torch.float64)
        except TooLargeError:
            self._give_up(f"its formula takes more than {LARGEST:,} operations, too many to compile in good time")
            return
        self._kernel = cache(lambda dtype: _compiled(record(core, dtype)[0]))

    def __call__(self, rows: Tensor, out: Tensor, chunk: int) -> bool:
        """(3N, B) storage on the CPU, float32 or float64, into `out` (L, B), contiguous; `chunk` scenes at a time at
        most. Returns whether that was done."""
        count = rows.shape[1]
        if not self._works:
            return False
        if count == 0:
            return True
        if count == 1:  # torch.compile makes a special case of one
            pair = out.new_empty(len(out), 2)
            done = self(rows.expand(-1, 2), pair, 2)
            out.copy_(pair[:, :1])
            return done
        # By way of numpy, a row becomes a tensor that knows of no base and no offset, on which a kernel could depend.
        storage = rows.detach().numpy()
        taken = [np.ascontiguousarray(storage[row]) for row in self._rows]
        filled = list(out.detach().numpy())
        starts = (
            [0, *range(chunk, count - 1, chunk)] if count else []
        )  # the last chunk must not be a single scene, either
        try:
            kernel = self._kernel(rows.dtype)
            # Whether gradients are on is part of what was compiled, too.
            with torch.inference_mode(False), torch.no_grad():
                for start, stop in zip(starts, [*starts[1:], count], strict=True):
                    kernel(*(torch.from_numpy(row[start:stop]) for row in (*taken, *filled)))
        except (RuntimeError, ImportError, OSError) as error:
            reason = str(error).strip().partition("\n")[0]
            self._give_up(f"{reason}. It takes a C++ compiler (g++, or what CXX names) and the headers of Python")
            return False
        # NaN marks headings too large for the kernel.
        return not self._turns or bool(torch.isfinite(out.sum()))

    def _give_up(self, why: str) -> None:
        self._works = False
        text = f"phi is computed operation by operation, as without compiled=True: {why}"
        warnings.warn(text, RuntimeWarning, stacklevel=4)


def fused(core: Core) -> Fused:
    """The compiled core; equal cores share one."""
    return _fused(core.nodes, tuple(core.labels.items()), core.objects)


@lru_cache(maxsize=32)
def _fused(nodes: tuple[Node, ...], labels: tuple[tuple[str, int], ...], objects: tuple[str, ...]) -> Fused:
    return Fused(Core(nodes, dict(labels), objects))


class _Recorder(fx.proxy.GraphAppendingTracer):
    def create_node(self, *args: Any, **kwargs: Any) -> fx.Node:
        if len(self.graph.nodes) >= LARGEST:
            raise TooLargeError
        return super().create_node(*args, **kwargs)


def record(core: Core, dtype: torch.dtype) -> tuple[fx.Graph, list[int], bool]:
    """The tape as a graph from rows (B,) to rows (B,), which it overwrites: first the rows of the storage that the
    formula reads, given beside it, then one row for each label; and whether it turns footprints. Raises TooLargeError.
    """
    graph = fx.Graph()
    tracer = _Recorder(graph)
    read = sorted({node.row for node in core.nodes if isinstance(node, Coord)})
    rows = {row: fx.Proxy(graph.placeholder(f"row{row}"), tracer) for row in read}
    out = [fx.Proxy(graph.placeholder(f"phi{label}"), tracer) for label in range(len(core.labels))]
    turning = _Turning(SINGLE if dtype == torch.float32 else DOUBLE)

    def constant(value: float) -> Any:
        return out[0].new_full((), value)

    with torch.no_grad():
        coordinate = coordinates(rows.__getitem__, bare_rows(core))
        values = run(core, last_uses(core), coordinate, constant, of=cast(Namespace, turning))
    for label, value in zip(out, values, strict=True):
        label.copy_(value)
    graph.output(None)
    return graph, read, turning.used


class _Root(fx.Proxy):
    """The root of a square, with a sign, that is taken only where it is needed: the least of several roots is the root
    of the least square, bit for bit, because roots are rounded. `square` has the sign of the root."""

    def __init__(self, square: Any) -> None:
        self._square = square  # a proxy
        self._taken: fx.Node | None = None
        self.tracer = square.tracer

    @property
    def node(self) -> fx.Node:  # type: ignore[override]
        """The root itself, once something else than a minimum or maximum asks for it."""
        if self._taken is None:
            square = self._square
            taken: Any = torch.where(square < 0.0, -torch.sqrt(-square), torch.sqrt(square))
            self._taken = taken.node
        return cast(fx.Node, self._taken)

    @classmethod
    def __torch_function__(cls, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if function in (torch.minimum, torch.maximum) and all(isinstance(arg, _Root) for arg in args):
            return _Root(function(*(arg._square for arg in args)))
        return super().__torch_function__(function, types, args, kwargs)


class _Turning:
    """The functions of torch, of which some are faster in compiled code: a maximum with 0 is one instruction, one of
    two numbers takes four, because of NaN."""

    def __init__(self, constants: Constants) -> None:
        self._constants = constants
        self.used = False

    def __getattr__(self, name: str) -> Any:
        return getattr(TORCH, name)

    def sign(self, a: Any) -> Any:
        return torch.where(a < 0.0, -1.0, 1.0)

    def copysign(self, size: Any, sign: Any) -> Any:
        return torch.where(sign < 0.0, -size, size)

    def beyond(self, a: Any, half: float) -> Any:
        return torch.relu(torch.abs(a) - half)

    def signed_root(self, square: Any, signed: Any) -> Any:
        return _Root(torch.where(signed < 0.0, -square, square))

    def turn(self, a: Any) -> tuple[Any, Any]:
        self.used = True
        return turn(a, self._constants)


def _compiled(graph: fx.Graph) -> Callable[..., None]:
    # A module of its own for each dtype: torch.compile allows any one only a few compilations.
    module = fx.GraphModule(torch.nn.Module(), graph)
    kernel: Callable[..., None] = torch.compile(module, dynamic=True, fullgraph=True, options=OPTIONS)
    return kernel
