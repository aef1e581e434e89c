"""The interface of all sampling methods: a plan. It is data that can be pickled, with a function that draws piece k and
an account of a run.

A plan is made once, from spec, request and seed. Piece k is a function of the plan and k, on one thread, so it does not
matter which process draws which piece, or when. Workers, streaming, `--resume`, `--settle` and other machines need no
more than this.
"""

from __future__ import annotations

import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.sampling.cells import Cells
from scenegen.sampling.problem import LIVE_NUMBERS, SCENES_IN_CACHE, Problem
from scenegen.scenes.blocks import Block


@dataclass(frozen=True, slots=True)
class Record:
    """Counts in a digest as a dataclass of that name with these values: that of an earlier version, so that digests
    stay equal where a class has changed."""

    name: str
    values: tuple[Any, ...]


def digest(*values: Any) -> str:
    """SHA-256 of nested dataclasses, sequences, mappings, sets, arrays, numbers and texts. Raises TypeError for others.

    Two values have the same digest if all their types, shapes and numbers are the same, bit for bit.
    """
    found = hashlib.sha256()
    waiting: list[Any] = [values]
    while waiting:
        value = waiting.pop()
        found.update(f"{value.name if isinstance(value, Record) else type(value).__name__}:".encode())
        if isinstance(value, Record):
            waiting += value.values
        elif isinstance(value, np.ndarray):
            found.update(f"{value.dtype.str}{value.shape}".encode())
            found.update(np.ascontiguousarray(value).tobytes())
        elif value is None or isinstance(value, bool | int | float | str | np.generic):
            text = repr(value)  # for floats, the shortest text that reads back to the same bits
            found.update(f"{len(text)}:{text}".encode())
        elif is_dataclass(value):
            waiting += [getattr(value, one.name) for one in fields(value)]
        elif isinstance(value, Mapping):
            found.update(str(len(value)).encode())
            waiting += [part for item in value.items() for part in item]
        elif isinstance(value, tuple | list):
            found.update(str(len(value)).encode())
            waiting += value
        elif isinstance(value, set | frozenset):
            waiting.append(tuple(sorted(value)))
        else:
            raise TypeError(f"no digest of a {type(value).__name__}")
    return found.hexdigest()


PHI_TOLERANCE = 1e-9  # maximum difference of two evaluators of phi


def verify(problem: Problem, rows: Array, phi: Array) -> None:
    """Verify scenes, rows (3N, m) with phi (L, m), from scratch: phi of every label by numpy in float64; the ranges,
    the requirement, the workspace, the range of headings, and fixed objects.

    `phi` may lack the requirement's row. Raises AssertionError: a failure is a bug of scenegen, and such scenes are
    never returned.
    """
    size = max(64, min(SCENES_IN_CACHE, LIVE_NUMBERS // len(problem.core.nodes)))
    cells, still = problem.cells, problem.lowest == problem.highest
    for start in range(0, rows.shape[1], size):
        part = slice(start, start + size)
        some = np.ascontiguousarray(rows[:, part])
        again = problem.phi(some)
        if not (np.abs(again[: len(phi)] - phi[:, part]) <= PHI_TOLERANCE).all():
            raise AssertionError("two evaluators of the same spec disagree about phi")
        if not ((again >= cells.low[:, None]) & (again <= cells.high[:, None])).all():
            raise AssertionError("a sampler returned a scene outside the requested range")
        if not problem.spec.workspace.contains(some).all():
            raise AssertionError("a sampler placed an object outside the workspace")
        if (some[still] != problem.lowest[still, None]).any():
            raise AssertionError("a sampler moved an object that is held in place")


MANY_PIECES = 1 << 30  # more than there are processes


@dataclass(frozen=True, slots=True, eq=False)
class Piece(Block):
    """m candidates in a fixed, random order, phi of all labels, the requirement's last; and the cell of each, (m,), -1
    for those out of range. `facts` (F,) are added up over all pieces."""

    cell: npt.NDArray[np.integer[Any]]
    facts: Array


@dataclass(frozen=True, slots=True)
class Tally:
    """The progress of a run. Of `found` scenes, `scenes` are in complete blocks. `pieces` have been used; they gave
    `candidates` in reached cells. `strays` are cells that were hit although the plan considers them unreachable;
    `facts` are the sums of the pieces' facts; `scarcest` is the cell that lacks most scenes, None if none does. All of
    it depends on the request alone, never on the workers; except `cut`, the progress of the piece that the time limit
    interrupted, in words, "" if none was."""

    scenes: int
    found: int
    pieces: int
    candidates: int
    strays: tuple[int, ...] = ()
    facts: tuple[float, ...] = ()
    scarcest: int | None = None
    cut: str = ""


@dataclass(frozen=True, slots=True)
class Account:
    """A plan's account of a tally: the scene file's `sampler`, how much was `tried`, in words, and warnings for the
    user. No timings: the same seed gives the same bytes. `note` is added to a shortfall."""

    info: Mapping[str, object]
    tried: str
    warnings: tuple[Diagnostic, ...] = ()
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Plan(ABC):
    """How the scenes of `problem` are drawn. `why` says in a few words why `auto` chose this plan; None if `auto` did
    not choose it. Subclasses are frozen dataclasses that define `method`; the defaults here fit most of them."""

    problem: Problem
    why: str | None = field(default=None, kw_only=True)

    @property
    @abstractmethod
    def method(self) -> str:
        """The name of the method."""

    @property
    @abstractmethod
    def plan_digest(self) -> str:
        """A hash of everything that the pieces depend on. A run can be resumed only with the plan that it began
        with."""

    @property
    @abstractmethod
    def reached_cells(self) -> Sequence[int]:
        """The cells that the plan has found reachable: they get equal shares of the scenes."""

    @property
    @abstractmethod
    def evaluations(self) -> float:
        """An estimate of how often phi will be evaluated for the whole request."""

    @property
    @abstractmethod
    def scenes_per_piece(self) -> float:
        """About how many scenes in range a piece gives."""

    @property
    @abstractmethod
    def fact_count(self) -> int:
        """How many facts a piece has at most: plans of several parts put them side by side."""

    @abstractmethod
    def draw(self, k: int) -> Piece:
        """Piece k.

        Within a cell its candidates follow the target distribution. The plan is free in how many fall into which cell,
        but every reached cell must get some in the long run. m may be 0. Raises StoppedError if time is up.
        """

    @abstractmethod
    def account(self, tally: Tally) -> Account:
        """The account of a run."""

    @property
    def seconds(self) -> float:
        """What is left to do for the whole request, in seconds of CPU by the constants of search.effort; infinite where
        nothing is chosen by it."""
        return math.inf

    @property
    def scenes_wanted(self) -> int:
        """How many scenes are requested."""
        return self.problem.request.n

    @property
    def seed(self) -> int:
        """The request's seed."""
        return self.problem.request.seed

    @property
    def cells(self) -> Cells:
        """The cells of the requested range."""
        return self.problem.cells

    @property
    def groups(self) -> Sequence[Sequence[int]]:
        """The reached cells in groups, which get shares of the scenes by `weights`; the cells of a group get equal
        shares of its share."""
        return (self.reached_cells,)

    @property
    def weights(self) -> Sequence[int]:
        """How many of sum(weights) scenes belong to each group."""
        return (1,) * len(self.groups)

    @property
    def ruled_out(self) -> frozenset[int]:
        """Cells that are proved to be empty."""
        return frozenset()

    @property
    def fewest(self) -> int:
        """The minimum number of pieces, even if fewer give enough scenes: an error bar may need them."""
        return 1

    @property
    def patience(self) -> int | None:
        """A run ends after this many useless pieces in a row; None if only the time limit ends it."""
        return None

    @property
    def shared_by(self) -> int:
        """The maximum number of processes that can share the work."""
        return MANY_PIECES

    @property
    def is_verified(self) -> bool:
        """Whether each scene is checked against the request before it is returned: all but a model's raw output."""
        return True

    def check(self, rows: Array, phi: Array) -> None:
        """Verify scenes, rows (3N, m) with phi (L, m). Raises AssertionError for one that is not what was requested."""
        verify(self.problem, rows, phi)

    def shortfall_of(self, tally: Tally) -> tuple[Plan, int | None]:
        """The plan that a shortfall is reported of, and the cell of it that lacks most scenes."""
        return self, tally.scarcest

    def misses(self) -> tuple[Array, Array]:
        """Candidates out of the range, from which a report finds the atoms that fail: rows (3N, m), phi (L, m)."""
        return np.empty((len(self.problem.lowest), 0)), np.empty((len(self.problem.core.labels), 0))

    def close(self) -> None:  # noqa: B027 - most plans have nothing to close
        """End the processes that drawing has started: called at the end of a run. Drawing again starts them again."""


PROBED_PIECES = 4  # pieces of a selection that are looked at for its cells, as long as none has a scene


@dataclass(frozen=True, slots=True, eq=False)
class Selection(Plan):
    """`plan` without some of its scenes. Candidates are left out before they are spread over cells, so what they must
    be is part of the target: within a cell, scenes follow the plan's distribution given it, and all n are found.

    `found` are the cells that have such scenes among the first, where what is left out goes by phi: see `probe`. None:
    all that the plan reaches."""

    plan: Plan
    found: tuple[int, ...] | None = field(default=None, kw_only=True)

    def probe(self) -> Self:
        """The selection with the cells that have scenes in its first pieces; with all where there is one cell, or no
        scene in these pieces."""
        if len(self.plan.reached_cells) == 1:
            return self
        cells = (set(self.draw(k).cell.tolist()) & {*self.plan.reached_cells} for k in range(PROBED_PIECES))
        return replace(self, found=tuple(sorted(next(filter(None, cells), self.plan.reached_cells))))

    @property
    def method(self) -> str:
        return self.plan.method

    @property
    def reached_cells(self) -> Sequence[int]:
        return self.plan.reached_cells if self.found is None else self.found

    @property
    def ruled_out(self) -> frozenset[int]:
        return self.plan.ruled_out

    @property
    def fewest(self) -> int:
        return self.plan.fewest

    @property
    def patience(self) -> int | None:
        return self.plan.patience

    @property
    def evaluations(self) -> float:
        return self.plan.evaluations

    @property
    def scenes_per_piece(self) -> float:
        return self.plan.scenes_per_piece

    @property
    def shared_by(self) -> int:
        return self.plan.shared_by

    def misses(self) -> tuple[Array, Array]:
        return self.plan.misses()

    def check(self, rows: Array, phi: Array) -> None:
        self.plan.check(rows, phi)

    def close(self) -> None:
        self.plan.close()


class NoPlan(ABC):
    """Why a method has no plan for a problem, and how many evaluations it took to find that out."""

    evaluations: float

    @property
    @abstractmethod
    def time_is_up(self) -> bool:
        """Whether there was not enough time."""

    @abstractmethod
    def error(self, problem: Problem) -> RequestError:
        """What to say of it. That may take some work."""

    @property
    def final(self) -> bool:
        """Whether no other method is worth a try: time is up, or it is proved that there is no scene."""
        return self.time_is_up

    @property
    def is_crowded(self) -> bool:
        """Whether objects only leave no room for each other."""
        return False

    @property
    def too_dear(self) -> bool:
        """Whether a plan would take longer than was allowed."""
        return False
