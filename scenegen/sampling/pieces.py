"""What a sampler offers to whoever runs it on many processes: a plan, made once, and pieces that follow from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scenegen.sampling.cells import Cells

Array = npt.NDArray[np.float64]


class Pieces(Protocol):
    """A sampler's plan for one request, with all that its pieces need. It pickles, and is sent to every worker once.

    The plan is fixed by spec, request and seed; piece k is a function of the plan, the seed and k, on one thread. So
    who works on which piece, and when, changes nothing about the scenes.
    """

    @property
    def plan_digest(self) -> str:
        """A hash of everything that the pieces depend on; a run is resumed only with the plan that it began with."""

    @property
    def wanted(self) -> int:
        """How many scenes are asked for."""

    @property
    def seed(self) -> int:
        """The request's seed."""

    @property
    def cells(self) -> Cells:
        """The cells of the wanted range."""

    @property
    def reached(self) -> Sequence[int]:
        """The cells that the plan has found reachable: they get equal shares of the scenes."""

    def piece(self, k: int) -> tuple[Array, Array]:
        """Candidates of piece k in a fixed order: rows (3N, m) and phi (L, m) of all labels, the requirement's last.

        Within a cell they follow the target distribution; how many fall into which cell is the sampler's affair, but
        every reached cell must get some in the long run. m may be 0.
        """
