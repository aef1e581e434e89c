"""Which surfaces things are on: the box of poses, cut where a choice of a surface changes.

A thing that can be on several surfaces has a coordinate that chooses one, and `pick` nodes make heights of it. A box
that holds several choices has every height between them, so phi seems to pass through values that it jumps over.
"""

from __future__ import annotations

import math
from itertools import chain

import numpy as np
import numpy.typing as npt

from scenegen.bounds.tape import RELATIVE, Tape
from scenegen.lang.core import Apply, Const, Coord, Core, Junction
from scenegen.pose import row_of

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

MOST = 64  # boxes
SEAM = 1e-8  # taken off either side of a cut: there both surfaces would do, in scenes that have probability 0


def worlds(core: Core, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Boxes, (3N, W) each, which together hold the box lowest..highest (3N,) but for the seams, with one choice of a
    surface each for as many things as `MOST` boxes allow; the box alone where nothing is chosen."""
    low, high = lowest[:, None], highest[:, None]
    for row, ends in sorted(_switches(core).items()):
        inner = sorted(end for end in ends if lowest[row] < end < highest[row])
        if not inner or low.shape[1] * (len(inner) + 1) > MOST:
            continue
        seam = SEAM * max(1.0, abs(float(lowest[row])), abs(float(highest[row])))
        begins = np.array([lowest[row], *(end + seam for end in inner)])
        stops = np.array([*(end - seam for end in inner), highest[row]])
        if (begins >= stops).any():
            continue
        parts, count = len(begins), low.shape[1]
        low, high = np.repeat(low, parts, axis=1), np.repeat(high, parts, axis=1)
        low[row], high[row] = np.tile(begins, count), np.tile(stops, count)
    return low, high


def chooses(core: Core) -> bool:
    """Whether things choose their surfaces."""
    return bool(_switches(core))


def improbable(tape: Tape, lo: Array, hi: Array, thin: float) -> Bool:
    """Which of K boxes, (K,), hold hardly any scenes: the interval of some number, of lo..hi (T, K), is at most `thin`,
    and each value of that number is one of a surface in the space of scenes. That is no proof: such a box can hold
    single scenes."""
    smooth = _smooth(tape)
    narrow = hi - lo <= thin
    out: Bool = np.asarray(narrow[smooth].any(axis=0))
    for index in np.flatnonzero(narrow.any(axis=1)):
        if isinstance(tape.nodes[index], Junction):  # it is as one of its parts is, if that is in its interval
            each = [smooth[arg] | (hi[arg] < lo[index]) | (lo[arg] > hi[index]) for arg in _parts(tape, int(index))]
            out |= narrow[index] & np.logical_and.reduce(each)
    return out


def _smooth(tape: Tape) -> Bool:
    """Coordinates, differences of two, distances and clearances, and their sums with constants, (T,): no value of such
    a number is that of a set of scenes with a volume."""
    smooth = np.zeros(len(tape.nodes), dtype=bool)
    for index, node in enumerate(tape.nodes):
        match node:
            case Coord():
                smooth[index] = True
            case Apply("neg", (arg,)):
                smooth[index] = smooth[arg]
            case Apply("add" | "sub", (one, other)):
                constant = [isinstance(tape.nodes[arg], Const) for arg in (one, other)]
                smooth[index] = index in tape.differences or (any(constant) and smooth[[one, other]].any())
            case Apply(name, args) if name in RELATIVE:
                smooth[index] = name in ("dist", "gap") and any(smooth[args[at]] for at in chain(*RELATIVE[name]))
    return smooth


def _parts(tape: Tape, top: int) -> set[int]:
    """What a junction is the least or the most of, junctions among that replaced by their own parts."""
    found, seen, stack = set[int](), set[int](), [top]
    while stack:
        index = stack.pop()
        node = tape.nodes[index]
        if not isinstance(node, Junction):
            found.add(index)
        elif index not in seen:
            seen.add(index)
            stack.extend(node.args)
    return found


def _switches(core: Core) -> dict[int, set[float]]:
    """The rows of coordinates that choose, and where their choices change."""
    found: dict[int, set[float]] = {}
    for node in core.nodes:
        if isinstance(node, Apply) and node.primitive == "pick":
            switch, end = (core.nodes[arg] for arg in node.args[:2])
            if isinstance(switch, Coord) and isinstance(end, Const) and math.isfinite(end.value):
                found.setdefault(row_of(switch.object, switch.axis), set()).add(end.value)
    return found
