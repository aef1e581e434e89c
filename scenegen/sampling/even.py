"""Scenes far from each other (`--spread even`): of many exact scenes those that greedy farthest points choose.

Each choice is the candidate whose nearest choice is farthest (Gonzalez 1985, "Clustering to minimize the maximum
intercluster distance"). In a single cell, no choice of as many has a smallest distance of more than twice as much.
Cells keep their shares: a cell that has had its own is out of the choice. The distance is that of `scenes.coverage`.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.processes.pool import run_pieces
from scenegen.sampling.engine.blocks import Drawing, RunProgress
from scenegen.sampling.engine.run import jobs
from scenegen.sampling.plan import Account, Piece, Plan, Selection, Tally, digest
from scenegen.scenes.blocks import Block, join_blocks
from scenegen.scenes.coverage import features
from scenegen.search.effort import NEVER, Budget, Stop, StoppedError

DRAWN_FACTS = 3  # of the piece: scenes to choose from, pieces and candidates drawn; then the plan's own


def farthest(points: Array, cell: Index, shares: Mapping[int, int], stop: Stop = NEVER) -> Index:
    """Which of the points (M, D) are chosen, in order: the first, then each time the one whose nearest chosen one is
    farthest, among those in cells (M,) that have not had their share. Fewer where a cell has too few points. Time
    O(M D) for each; raises what `stop` raises."""
    cells, mine = np.unique(cell, return_inverse=True)
    room = np.minimum([shares.get(one, 0) for one in cells.tolist()], np.bincount(mine, minlength=len(cells)))
    points = points - points.mean(axis=0)  # distances do not depend on the origin, but their rounding does
    squares = np.einsum("ij,ij->i", points, points)
    least = np.where(room[mine] > 0, np.inf, -np.inf)  # squared distance to the nearest chosen; -inf: out of the choice
    chosen = np.empty(int(room.sum()), dtype=np.intp)
    for turn in range(len(chosen)):
        stop.check()
        best = chosen[turn] = int(least.argmax())
        # einsum, not `@`: the threads of a product this small cost more than they save
        distance = squares - 2.0 * np.einsum("ij,j->i", points, points[best]) + squares[best]
        np.minimum(least, distance, out=least)
        room[mine[best]] -= 1
        least[best if room[mine[best]] else mine == mine[best]] = -np.inf
    return chosen


@dataclass(frozen=True, slots=True, eq=False)
class Even(Selection):
    """The n scenes of `plan`, which draws more of them, that are far from each other. They no longer follow its
    distribution, but cells and numbers of things keep their shares; scenes of other things are not compared.

    There is one piece: all candidates, drawn on the request's workers, and the choice among them. `budget` can end it;
    it does not change the result."""

    budget: Budget

    shared_by: ClassVar[int] = 1
    fewest: ClassVar[int] = 1
    patience: ClassVar[int] = 1  # a second piece has nothing new

    @property
    def plan_digest(self) -> str:
        return digest("even", self.plan.scenes_wanted, self.plan.plan_digest)

    @property
    def fact_count(self) -> int:
        return DRAWN_FACTS + self.plan.fact_count

    @property
    def scenes_per_piece(self) -> float:
        return float(self.scenes_wanted)

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        return tuple(tuple(group) for group in self.plan.groups)

    @property
    def weights(self) -> tuple[int, ...]:
        return tuple(self.plan.weights)

    def shortfall_of(self, tally: Tally) -> tuple[Plan, int | None]:
        return self.plan.shortfall_of(tally)

    def draw(self, k: int) -> Piece:
        """The choice, in its order. Raises StoppedError if time is up before all candidates are there, or chosen
        from."""
        labels, coordinates = len(self.problem.labels), self.problem.rows
        if k:
            return Piece(np.empty((coordinates, 0)), np.empty((labels, 0)), np.empty(0, dtype=np.intp), np.empty(0))
        run = RunProgress(self.plan)
        blocks: list[Block] = []
        with closing(run_pieces(Drawing(self.plan, labels), itertools.count(), jobs(self.plan))) as pieces:
            for piece in run.follow(pieces, lambda: self.budget.is_spent, None):
                # with the cell of each as one more row
                blocks += run.take(replace(piece, phi=np.concatenate([piece.phi, piece.cell[None]])))
        tally = run.tally()
        if not run.is_over:
            raise StoppedError(f"{tally.found:,} of the {self.plan.scenes_wanted:,} to choose from were there")
        rest = run.assembler.rest()
        found = join_blocks(blocks if rest is None else [*blocks, rest], coordinates, labels + 1)
        cell, shares = found.phi[-1].astype(np.intp), RunProgress(self).assembler.shares
        chosen = [np.empty(0, dtype=np.intp)]
        for group in self.groups:  # each has the same things in all its scenes
            mine = np.flatnonzero(np.isin(cell, group))
            if len(mine):
                rows = self.problem.scenes(found.rows[:, mine])
                points = features(rows[~np.isnan(rows[:, 0])])
                chosen.append(mine[farthest(points, cell[mine], shares, self.budget)])
        block = found.take(np.concatenate(chosen))
        own = np.array([tally.found, tally.pieces, tally.candidates, *tally.facts])
        return Piece(block.rows, block.phi[:-1], block.phi[-1].astype(np.intp), own)

    def account(self, tally: Tally) -> Account:
        """The plan's own account, of all candidates."""
        found, pieces, candidates = map(int, tally.facts[:DRAWN_FACTS] or (0,) * DRAWN_FACTS)
        account = self.plan.account(Tally(found, found, pieces, candidates, facts=tally.facts[DRAWN_FACTS:]))
        info = {**account.info, "chosen_from": found}
        return replace(account, info=info, tried=account.tried if pieces else "the time that there was")
