"""Running a sampler's pieces to the end: blocks of scenes in memory, or a file of any size at flat memory."""

from __future__ import annotations

import io
import itertools
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.bounds.effort import StoppedError
from scenegen.engine.blocks import Cell, Filler
from scenegen.engine.interrupt import stop_signals
from scenegen.engine.pool import run_pieces
from scenegen.formats.blocks import BLOCK, Block
from scenegen.formats.shards import Shards, folder_of, open_shards
from scenegen.formats.table import format_of
from scenegen.sampling.pieces import Array, Pieces, Tally
from scenegen.scene.data import SceneFile

Progress = Callable[[int, int, int], None]
"""Told after each piece: scenes found, scenes wanted, candidates in the wanted cells."""

CHECKPOINT = 5.0  # seconds of work that kill -9 may cost; when checkpoints are made does not change the file


@dataclass(frozen=True, slots=True)
class _Work:
    """The job of a worker: a piece, and the cell of each candidate, out of range left out. The requirement's margin,
    which is the last row of phi where there is one, has done its work then."""

    pieces: Pieces
    labels: int

    def __call__(self, k: int) -> tuple[Block, Cell, Array]:
        made = self.pieces.piece(k)
        rows, phi, cell = made.rows, made.phi[: self.labels], made.cell
        if len(cell) and cell.min() < 0:
            inside = np.flatnonzero(cell >= 0)
            rows, phi, cell = rows.take(inside, axis=1), phi.take(inside, axis=1), cell[inside]
        return Block(rows, phi), cell, made.facts


@dataclass(slots=True)
class _Standing:
    """How far a run is. `used` pieces have given the sums `facts`; the last `idle` of them brought nothing of use."""

    pieces: Pieces
    filler: Filler
    used: int = 0
    idle: int = 0
    facts: Array = field(default_factory=lambda: np.empty(0))

    @property
    def over(self) -> bool:
        """Whether the run has come to its end by itself."""
        if self.filler.complete:
            return self.used >= self.pieces.fewest
        patience = self.pieces.patience
        return patience is not None and self.idle >= patience

    def take(self, candidates: Block, cell: Cell, facts: Array) -> Generator[Block, None, None]:
        """The blocks that a piece more finishes."""
        found = self.filler.found
        yield from self.filler.offer(candidates, cell)
        if len(facts) > len(self.facts):  # a piece that came to nothing may have fewer than others
            self.facts, facts = facts.copy(), self.facts
        self.facts[: len(facts)] += facts
        self.idle = self.idle + 1 if self.filler.found == found else 0
        self.used += 1

    def tally(self) -> Tally:
        filler = self.filler
        strays, facts = tuple(sorted(filler.strays)), tuple(map(float, self.facts))
        return Tally(filler.done, filler.found, self.used, filler.candidates, strays, facts, filler.scarcest)

    def state(self) -> tuple[dict[str, object], Array]:
        """Everything that is not fixed by the request: JSON, and the scenes that wait for a block."""
        facts, waiting = self.filler.state()
        state = {"pieces": self.used, "idle": self.idle, "found": self.filler.found}
        return {**state, "facts": self.facts.tolist(), "filler": facts}, waiting

    def restore(self, state: Mapping[str, Any], waiting: Array, coordinates: int) -> None:
        self.used, self.idle = int(state["pieces"]), int(state["idle"])
        self.facts = np.array(state["facts"], dtype=np.float64)
        self.filler.restore(state["filler"], waiting, coordinates)


def run_blocks(
    pieces: Pieces,
    labels: int,
    *,
    workers: int = 1,
    spent: Callable[[], bool] = lambda: False,
    progress: Progress | None = None,
    size: int = BLOCK,
) -> Generator[Block, None, Tally]:
    """The scenes of a request in blocks of `size`; the generator's return value is the tally.

    `labels` is the number of the spec's labels. Where `spent` says so, which is asked after each piece, the run ends
    with what there is: fewer scenes than wanted. Raises what `run_pieces` raises.
    """
    run = _Standing(pieces, Filler(pieces.reached, pieces.wanted, pieces.seed, size))
    with closing(run_pieces(_Work(pieces, labels), itertools.count(), workers)) as results:
        while not run.over:
            try:
                made = next(results)
            except StoppedError:  # time was up in the midst of the piece
                break
            yield from run.take(*made)
            if progress is not None:
                progress(run.filler.found, pieces.wanted, run.filler.candidates)
            if spent():
                break
    scarcest = run.filler.scarcest
    rest = run.filler.rest()
    if rest is not None:
        yield rest
    return replace(run.tally(), scarcest=scarcest)


def stream_scenes(
    path: Path,
    pieces: Pieces,
    labels: Sequence[str],
    header: Callable[[Tally], SceneFile],
    *,
    request: Mapping[str, object],
    workers: int = 1,
    resume: bool = False,
    keep_partial: bool = False,
    spent: Callable[[], bool] = lambda: False,
    inspect: Callable[[Block], None] | None = None,
    joining: Callable[[Block], None] | None = None,
    progress: Progress | None = None,
    checkpoint: float = CHECKPOINT,
    size: int = BLOCK,
) -> Tally:
    """Write the scenes of a request to a file in the format of the path's ending, however many there are.

    They grow in `x.parquet.part/` and are joined at the end, so that the file appears whole or not at all. After an
    interrupt or kill -9 at any moment, the same call with `resume` goes on from the last checkpoint and ends with the
    same bytes as an unbroken run; without `resume`, what is there is refused. With `resume` and nothing there, it just
    begins. The bytes do not depend on `workers`, nor on when the run was broken. SIGINT and SIGTERM end the run after
    the piece that is under way, with a checkpoint; KeyboardInterrupt then says how to go on. A second one does not
    wait.

    `labels` are the spec's. `header` makes the scene file without scenes from the tally, once all scenes are there; it
    is tried with an empty tally before the work begins. `request` is JSON that, with the plan, fixes the scenes: put
    the spec's hash, ranges, n, seed, method and the versions of scenegen, numpy and torch there. `inspect` sees every
    block before it is stored, and raises if it finds fault; `joining` sees every block that goes into the file, those
    from before a break too.

    Where `spent` says so, which is asked after each piece, or the pieces' patience is at an end, the run ends early.
    The tally then has fewer scenes than wanted, and nothing is written but the checkpoint, unless `keep_partial`: then
    the scenes that there are become the file. Raises RequestError, DataError (a damaged checkpoint), OutputError, and
    what `run_pieces` raises.
    """
    module = format_of(path)
    trial = header(Tally(0, 0, 0, 0))
    module.write(io.BytesIO(), trial, labels, [])
    coordinates = 3 * len(trial.objects)
    facts = {**request, "plan": pieces.plan_digest, "n": pieces.wanted, "seed": pieces.seed, "block": size}
    with open_shards(path, facts, coordinates, resume=resume) as shards:
        run = _Run(shards, _Standing(pieces, Filler(pieces.reached, pieces.wanted, pieces.seed, size)), inspect)
        standing = run.standing
        if shards.state:
            waiting = np.empty((0, 0)) if shards.joined else shards.pool()
            standing.restore(shards.state, waiting, coordinates)
        if shards.joined:
            shards.discard()
            return standing.tally()
        begun = standing.used
        try:
            with (
                stop_signals() as stop,
                closing(run_pieces(_Work(pieces, len(labels)), itertools.count(begun), workers)) as results,
            ):
                while not standing.over:
                    try:
                        made = next(results)
                    except StoppedError:  # time was up in the midst of the piece
                        break
                    run.take(*made)
                    if progress is not None:
                        progress(standing.filler.found, pieces.wanted, standing.filler.candidates)
                    run.checkpoint(checkpoint)
                    if stop.asked:
                        raise KeyboardInterrupt
                    if spent():
                        break
        except BaseException as error:
            # What comes while a piece is waited for finds everything in order; in the midst of a piece it does not.
            if run.settled and standing.used:
                run.checkpoint()
            if isinstance(error, KeyboardInterrupt) and shards.state:
                kept = f"{folder_of(path)} keeps {shards.state['found']:,} scenes: go on with --resume"
                raise KeyboardInterrupt(f"interrupted; {kept}") from error
            raise
        if standing.used:
            run.checkpoint()
        tally = standing.tally()

        def seen(blocks: Iterable[Block]) -> Iterator[Block]:
            for block in blocks:
                if joining is not None:
                    joining(block)
                yield block

        if standing.filler.complete:
            shards.join(lambda sink, blocks: module.write(sink, header(tally), labels, seen(blocks)))
        elif keep_partial and standing.filler.found:
            # The rest is in no checkpoint: killed in the midst of joining, the run can still be resumed to its end.
            rest = standing.filler.rest()
            assert rest is not None
            if inspect is not None:
                inspect(rest)
            tally = replace(standing.tally(), scarcest=tally.scarcest)
            shards.join(
                lambda sink, blocks: module.write(sink, header(tally), labels, seen(itertools.chain(blocks, [rest]))),
                whole=False,
            )
    return tally


class _Run:
    """A run that stores what it finds. `settled` unless it is in the midst of taking a piece or of a checkpoint."""

    def __init__(self, shards: Shards, standing: _Standing, inspect: Callable[[Block], None] | None) -> None:
        self.settled = True
        self.standing = standing
        self._shards, self._inspect = shards, inspect
        self._last = time.monotonic()

    def take(self, candidates: Block, cell: Cell, facts: Array) -> None:
        self.settled = False
        for block in self.standing.take(candidates, cell, facts):
            if self._inspect is not None:
                self._inspect(block)
            self._shards.append(block)
        self.settled = True

    def checkpoint(self, after: float = 0.0) -> None:
        """A checkpoint, where the last one is that many seconds ago."""
        if time.monotonic() - self._last >= after:
            self.settled = False
            self._shards.checkpoint(*self.standing.state())
            self._last = time.monotonic()
            self.settled = True
