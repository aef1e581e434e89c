"""At which moments the formulas of a state are looked at."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Everywhere, Junction, Moment, Until, Window
from scenegen.lang.timed import Signal, Timed

Mask = npt.NDArray[np.bool_]


def moments_needed(timed: Timed, *, labels: bool, requirement: bool) -> list[Mask]:
    """Of every signal, the moments (T + 1,) at which its value can matter to the labels' phi at moment 0, or to the
    requirement at any moment."""
    moments, nodes = timed.horizon.moments, timed.nodes
    needed = [np.zeros(moments, dtype=bool) for _ in nodes]
    for root in timed.labels.values() if labels else ():
        needed[root][0] = True
    if requirement and timed.requirement is not None:
        needed[timed.requirement][:] = True
    signals = [np.zeros(moments, dtype=bool) for _ in timed.state.labels]
    for index in range(len(nodes) - 1, -1, -1):  # parents before children
        node, mask = nodes[index], needed[index]
        if not mask.any():
            continue
        match node:
            case Signal(place):
                signals[place] |= mask
            case Junction(_, args):
                for arg in args:
                    needed[arg] |= mask
            case Window(_, arg, lowest, highest):
                needed[arg] |= _later(mask, lowest, highest)
            case Until(_, left, right, lowest, highest, _):
                needed[left] |= _later(mask, 0, highest)
                needed[right] |= _later(mask, lowest, highest)
            case Moment("first", arg):
                needed[arg][0] = True
            case Moment("last", arg):
                needed[arg][-1] = True
            case Moment(_, arg):
                needed[arg][1:] |= mask[1:]
            case Everywhere():
                pass
    return signals


def _later(mask: Mask, lowest: int, highest: int) -> Mask:
    """The moments from `lowest` to `highest` after any that is marked."""
    count = len(mask)
    starts = np.concatenate([[0], np.cumsum(mask)])
    moment = np.arange(count)
    first, last = np.clip(moment - highest, 0, count), np.clip(moment - lowest + 1, 0, count)
    return np.asarray(starts[np.maximum(first, last)] > starts[first])
