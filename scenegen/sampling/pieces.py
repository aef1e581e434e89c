"""What an exact sampler offers to whoever runs it, on one process or many: a plan, and pieces that follow from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic
from scenegen.sampling.cells import Cells

if TYPE_CHECKING:
    from scenegen.sampling.problem import Problem

MANY_PIECES = 1 << 30  # more than there are processes

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """What a piece brings, in a fixed order without pattern: rows (3N, m), phi (L, m) of all labels, the requirement's
    last, and the cell of each, (m,), -1 for those out of range. `facts` (F,) are to be added up over all pieces."""

    rows: Array
    phi: Array
    cell: Index
    facts: Array


@dataclass(frozen=True, slots=True)
class Tally:
    """How a run stands. Of `found` scenes, `scenes` have been handed out in whole blocks. `pieces` are used up, they
    gave `candidates` in reached cells; `strays` are cells that were hit although the plan takes them for out of reach;
    `facts` are the sums of the pieces' facts; `scarcest` is the cell that lacks most, None where none does. All of it
    depends on the request alone, never on the workers."""

    scenes: int
    found: int
    pieces: int
    candidates: int
    strays: tuple[int, ...] = ()
    facts: tuple[float, ...] = ()
    scarcest: int | None = None


@dataclass(frozen=True, slots=True)
class Account:
    """What a plan makes of a tally: what goes into the scene file's `sampler`, how much was `tried`, in words, and what
    is to be said about it. No timings: the same seed gives the same bytes."""

    info: Mapping[str, object]
    tried: str
    warnings: tuple[Diagnostic, ...] = ()


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

    @property
    def fewest(self) -> int:
        """Pieces that are run at least, though fewer may bring enough scenes: an error bar may need them."""

    @property
    def patience(self) -> int | None:
        """Pieces in a row that may bring nothing of use before a run ends for good; None where time alone ends it."""

    def piece(self, k: int) -> Candidates:
        """Candidates of piece k.

        Within a cell they follow the target distribution; how many fall into which cell is the sampler's affair, but
        every reached cell must get some in the long run. m may be 0.
        """


class Plan(Pieces, Protocol):
    """A plan together with what is to be said about it."""

    @property
    def name(self) -> str:
        """The method."""

    @property
    def problem(self) -> Problem:
        """What the plan is for."""

    @property
    def ruled_out(self) -> frozenset[int]:
        """Cells that are proved to be empty."""

    @property
    def shared_by(self) -> int:
        """How many processes can share the work at most: pieces that fewer scenes need are not worth starting."""

    @property
    def evaluations(self) -> float:
        """How often phi will be evaluated for the whole request, as far as the plan can tell."""

    def account(self, tally: Tally) -> Account:
        """What is said of a run."""

    def misses(self) -> tuple[Array, Array]:
        """Candidates out of the range, from which a report tells what stands in the way: rows (3N, m), phi (L, m)."""
