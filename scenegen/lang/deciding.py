"""Which atom decides phi, for many scenes at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Core, Junction
from scenegen.lang.interpret import evaluate
from scenegen.primitives import NUMPY


def deciding_atoms(core: Core, rows: npt.NDArray[np.float64], label: str) -> dict[int, int]:
    """How often each atom decides phi of a label over B scenes stored as (3N, B): atom's node -> count, most first.

    An atom decides where its margin is the label's phi: it alone would have to change for phi to change.
    """
    values = [np.broadcast_to(value, rows.shape[1]) for value in evaluate(core, list(rows), NUMPY)]
    waiting = {core.labels[label]: np.arange(rows.shape[1])}
    counts: dict[int, int] = {}
    # Parents come after their children on the tape, so going downwards meets every node after all who point to it.
    for index in range(core.labels[label], -1, -1):
        scenes = waiting.pop(index, None)
        if scenes is None:
            continue
        node = core.nodes[index]
        if not isinstance(node, Junction):
            counts[index] = len(scenes)
            continue
        for arg in node.args:
            mine = values[arg][scenes] == values[index][scenes]
            if mine.any():
                waiting[arg] = np.concatenate([waiting.get(arg, np.empty(0, dtype=np.intp)), scenes[mine]])
                scenes = scenes[~mine]
    return dict(sorted(counts.items(), key=lambda item: -item[1]))
