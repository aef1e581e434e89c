"""phi of a core formula by machine code, for the scenes of a torch tensor."""

from __future__ import annotations

import warnings
from functools import cache, lru_cache

import torch
from torch import Tensor

from scenegen.lang.formula.core import Coord, Core, Node
from scenegen.learn.native import MOST_LINES, NativeError, TooLargeError, make_kernel


class Fused:
    """phi of every label by compiled code, without gradients. Make it with `fused`, which keeps the last few cores'.

    Where there is no C compiler, compiling fails for another reason, or the formula is too large to try, a
    RuntimeWarning says so once, and every call from then on returns False. So do calls with coordinates that are NaN
    and with angles of thousands of turns, without a word.
    """

    def __init__(self, core: Core) -> None:
        self._works = any(isinstance(node, Coord) for node in core.nodes)  # constants alone are not worth it
        self._kernel = cache(lambda dtype: make_kernel(core, single=dtype == torch.float32))

    def __call__(self, rows: Tensor, out: Tensor) -> bool:
        """(3N, B) storage on the CPU, float32 or float64, into `out` (L, B), contiguous. Returns whether that was
        done."""
        if not self._works:
            return False
        try:
            kernel = self._kernel(rows.dtype)
        except TooLargeError:
            self._give_up(f"its formula takes more than {MOST_LINES:,} operations, too many to compile in good time")
            return False
        except NativeError as error:
            self._give_up(f"{error}. It takes a C compiler (gcc, clang, or what CC names)")
            return False
        return kernel(rows.detach().numpy(), out.detach().numpy(), torch.get_num_threads())

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
