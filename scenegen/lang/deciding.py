"""Which atom decides phi, for many scenes at once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Core, Junction
from scenegen.lang.interpret import evaluate, is_constant, without_constants
from scenegen.primitives import NUMPY

Index = npt.NDArray[np.intp]


def deciding_atoms(core: Core, rows: npt.NDArray[np.float64], label: str) -> dict[int, int]:
    """How often each atom decides phi of a label over B scenes stored as (3N, B): atom's node -> count, most first.

    An atom decides where its margin is the label's phi: it alone would have to change for phi to change. Where that
    margin is the same in every scene, the atom that decides without it counts, as `deciding_atom` has it.
    """
    root = core.labels[label]
    values = [np.broadcast_to(value, rows.shape[1]) for value in evaluate(core, list(rows), NUMPY)]
    found = _deciders(core, root, dict(enumerate(values)), np.arange(rows.shape[1]))
    constant = [atom for atom in found if is_constant(core, atom)]
    rest = without_constants(core, root, values) if constant else {}
    if root in rest:
        scenes = np.concatenate([found.pop(atom) for atom in constant])
        for atom, more in _deciders(core, root, rest, scenes).items():
            found[atom] = np.concatenate([found.get(atom, np.empty(0, dtype=np.intp)), more])
    counts = {atom: len(scenes) for atom, scenes in found.items()}
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def _deciders(core: Core, root: int, values: Mapping[int, npt.NDArray[np.float64]], scenes: Index) -> dict[int, Index]:
    """For each atom those of the scenes in which it decides the formula `root`."""
    waiting = {root: scenes}
    found: dict[int, Index] = {}
    # Parents come after their children on the tape, so going downwards meets every node after all who point to it.
    for index in range(root, -1, -1):
        here = waiting.pop(index, None)
        if here is None:
            continue
        node = core.nodes[index]
        if not isinstance(node, Junction):
            found[index] = here
            continue
        for arg in node.args:
            if arg not in values:
                continue
            mine = values[arg][here] == values[index][here]
            if mine.any():
                waiting[arg] = np.concatenate([waiting.get(arg, np.empty(0, dtype=np.intp)), here[mine]])
                here = here[~mine]
    return found
