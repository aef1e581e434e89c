"""The values of some formula nodes over many columns of poses, computed from what these nodes need alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Coord, Core, Node, children, moved
from scenegen.lang.fold import fold
from scenegen.lang.interpret import Numbers
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """`steps` are the nodes in order, with arguments that count within the steps; `wanted` are the steps of the nodes
    asked for, `rows` the rows of (3N, B) storage that are read."""

    steps: tuple[Node, ...]
    wanted: tuple[int, ...]
    rows: tuple[int, ...]

    def __call__(self, rows: Sequence[Any], check: Callable[[], None] | None = None) -> list[Array]:
        """One value per wanted node. `rows` are 3N arrays that broadcast against each other, or numbers. `check` is
        called before each primitive: what it raises ends the work."""
        values = fold(self.steps, Numbers(NUMPY, rows), before=check)
        return [values[place] for place in self.wanted]


def make_values(core: Core, wanted: Sequence[int]) -> Values:
    """The evaluator of some nodes of a core."""
    needed: set[int] = set()
    waiting = list(wanted)
    while waiting:
        index = waiting.pop()
        if index not in needed:
            needed.add(index)
            waiting.extend(children(core.nodes[index]))
    place = {old: new for new, old in enumerate(sorted(needed))}
    steps = tuple(moved(core.nodes[old], place) for old in place)
    rows = tuple(sorted({node.row for node in steps if isinstance(node, Coord)}))
    return Values(steps, tuple(place[node] for node in wanted), rows)
