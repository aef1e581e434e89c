"""A plan without the scenes that do not settle.

It filters candidates before they are spread over cells, so settling is part of the target: within a cell, scenes follow
the plan's distribution conditional on settling, and all n requested scenes are found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Stop
from scenegen.export.setting import boards_of
from scenegen.formats.blocks import BLOCK
from scenegen.lang.levels import levels
from scenegen.physics.settle import Refusals, Settler
from scenegen.pose import as_poses, row_count
from scenegen.sampling.digest import digest
from scenegen.sampling.plan import Account, Piece, Plan, Tally

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

MOST = 256  # about how many scenes of a piece are dropped: a few seconds of one core
AT_LEAST = 2  # of each cell


@dataclass(slots=True)
class _Memory:
    """The state of a process: its settler, and the scenes that settled in each cell, by piece."""

    settler: Settler | None = None
    kept: dict[int, Index] = field(default_factory=dict)

    def __reduce__(self) -> tuple[type[_Memory], tuple[()]]:
        return _Memory, ()  # other processes begin with none


@dataclass(frozen=True, slots=True, eq=False)
class Settling(Plan):
    """`plan` without the scenes that do not settle.

    One process draws it and drops the scenes on all `workers` (drawing takes a thousandth of the time of dropping). A
    piece takes the first few candidates of every cell. Cells that earlier pieces have filled are skipped: the runner
    would not use their scenes. `stop` can interrupt a piece; it does not change the result. The facts of a piece are
    the numbers of scenes dropped and refused, then those in which each object moved too far, then the plan's own.
    """

    plan: Plan
    workers: int | None = None
    stop: Stop = NEVER
    _memory: _Memory = field(default_factory=_Memory, repr=False)

    shared_by: ClassVar[int] = 1

    @property
    def method(self) -> str:
        return self.plan.method

    @property
    def plan_digest(self) -> str:
        return digest("settling", self._at_once, self.plan.plan_digest)

    @property
    def reached(self) -> Sequence[int]:
        return self.plan.reached

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
    def fact_count(self) -> int:
        return 2 + len(self.problem.spec.objects) + self.plan.fact_count

    @property
    def scenes_per_piece(self) -> float:
        return min(self.plan.scenes_per_piece, self._at_once * len(self.reached))

    @property
    def _at_once(self) -> int:
        """The number of scenes of a cell that a piece drops: 1.5 times the requested number, since some will not
        settle."""
        cells = len(self.reached)
        return max(AT_LEAST, min(math.ceil(1.5 * self.wanted / cells), MOST // cells))

    def account(self, tally: Tally) -> Account:
        """The plan's own account, of scenes before they are dropped; a warning counts those that did not settle."""
        refusals = self._refusals(tally)
        own = 2 + len(refusals.objects)
        account = self.plan.account(replace(tally, facts=tally.facts[own:]))
        warning = refusals.diagnostic()
        return replace(
            account,
            info={**account.info, "settled": True},
            warnings=account.warnings if warning is None else (*account.warnings, warning),
            note=refusals.summary() if refusals.refused else account.note,
        )

    def _refusals(self, tally: Tally) -> Refusals:
        objects = self.problem.spec.objects
        scenes, refused, *moved = map(int, tally.facts[: 2 + len(objects)] or [0] * (2 + len(objects)))
        return Refusals(objects, scenes, refused, tuple(moved))

    def misses(self) -> tuple[Array, Array]:
        return self.plan.misses()

    def draw(self, k: int) -> Piece:
        """Those of the first candidates of piece k in each cell that settle. Raises what `stop` raises."""
        found = self.plan.draw(k)
        full = self._full(k)
        first = [np.flatnonzero(found.cell == cell)[: self._at_once] for cell in self.reached if cell not in full]
        taken = np.sort(np.concatenate([np.empty(0, dtype=np.intp), *first]))
        spec, rows = self.problem.spec, found.rows[:, taken]
        poses = as_poses(rows[: row_count(len(spec.objects))])
        settled = self._settler().settle(poses, levels(spec, rows), self.stop)
        kept = taken[settled.kept]
        if self.wanted <= BLOCK:
            self._memory.kept[k] = np.bincount(found.cell[kept], minlength=max(self.reached) + 1)
        counts = [len(taken), len(taken) - len(kept), *settled.moved.sum(axis=0)]
        facts = np.concatenate([np.array(counts, dtype=np.float64), found.facts])
        return Piece(found.rows[:, kept], found.phi[:, kept], found.cell[kept], facts)

    def _full(self, k: int) -> set[int]:
        """The cells that have their share from pieces before k, as far as this process drew them. None if not all
        scenes fit into the runner's memory at once: it then discards some, and takes others later."""
        before: Any = sum(kept for piece, kept in self._memory.kept.items() if piece < k)
        return set(np.flatnonzero(np.atleast_1d(before) >= math.ceil(self.wanted / len(self.reached))).tolist())

    def _settler(self) -> Settler:
        memory, spec = self._memory, self.problem.spec
        if memory.settler is None:
            memory.settler = Settler(
                spec.shapes,
                fixed=tuple(spec.fixed),
                declared=spec.declares_heights,
                boards=boards_of(spec.regions),
                workers=self.workers,
            )
        return memory.settler

    def close(self) -> None:
        self.plan.close()
        if self._memory.settler is not None:
            self._memory.settler.close()
            self._memory.settler = None
