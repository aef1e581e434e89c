"""Running a sampler's pieces to the end: blocks of scenes in memory, or a file of any size at flat memory."""

from __future__ import annotations

import io
import itertools
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenegen.engine.blocks import Cell, Filler
from scenegen.engine.pool import run_pieces
from scenegen.formats.blocks import BLOCK, Block
from scenegen.formats.shards import Shards, folder_of, open_shards
from scenegen.formats.table import format_of
from scenegen.sampling.pieces import Pieces
from scenegen.scene.data import SceneFile

Progress = Callable[[int, int, int], None]
"""Told after each piece: scenes found, scenes wanted, candidates in the wanted cells."""

CHECKPOINT = 5.0  # seconds of work that kill -9 may cost; when checkpoints are made does not change the file


@dataclass(frozen=True, slots=True)
class Tally:
    """How a run stands. `pieces` are used up, they gave `candidates` in reached cells; `strays` are cells that were hit
    although the plan takes them for out of reach. All of it depends on the request alone, never on the workers."""

    scenes: int
    pieces: int
    candidates: int
    strays: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class _Work:
    """The job of a worker: a piece, and the cell of each candidate, out of range left out. The requirement's margin,
    which is the last row of phi where there is one, has done its work then."""

    pieces: Pieces
    labels: int

    def __call__(self, k: int) -> tuple[Block, Cell]:
        rows, phi = self.pieces.piece(k)
        cell = self.pieces.cells.find(phi)
        inside = np.flatnonzero(cell >= 0)
        return Block(rows[:, inside], phi[: self.labels, inside]), cell[inside]


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

    `labels` is the number of the spec's labels. Where `spent` says so, which is asked between pieces, the run ends with
    what there is: fewer scenes than wanted. Raises what `run_pieces` raises.
    """
    filler = Filler(pieces.reached, pieces.wanted, pieces.seed, size)
    used = 0
    with closing(run_pieces(_Work(pieces, labels), itertools.count(), workers)) as results:
        while not (filler.complete or spent()):
            yield from filler.offer(*next(results))
            used += 1
            if progress is not None:
                progress(filler.found, pieces.wanted, filler.candidates)
    rest = filler.rest()
    if rest is not None:
        yield rest
    return _tally(filler, used)


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
    progress: Progress | None = None,
    checkpoint: float = CHECKPOINT,
    size: int = BLOCK,
) -> Tally:
    """Write the scenes of a request to a file in the format of the path's ending, however many there are.

    They grow in `x.parquet.part/` and are joined at the end, so that the file appears whole or not at all. After an
    interrupt or kill -9 at any moment, the same call with `resume` goes on from the last checkpoint and ends with the
    same bytes as an unbroken run; without `resume`, what is there is refused. With `resume` and nothing there, it just
    begins. The bytes do not depend on `workers`, nor on when the run was broken.

    `labels` are the spec's. `header` makes the scene file without scenes from the tally, once all scenes are there; it
    is tried with an empty tally before the work begins. `request` is JSON that, with the plan, fixes the scenes: put
    the spec's hash, ranges, n, seed, method and the versions of scenegen, numpy and torch there. `inspect` sees every
    block before it is stored, and raises if it finds fault.

    Where `spent` says so, which is asked between pieces, the run ends early. The tally then has fewer scenes than
    wanted, and nothing is written but the checkpoint, unless `keep_partial`: then the scenes that there are become the
    file. Raises RequestError, DataError (a damaged checkpoint), OutputError, and what `run_pieces` raises.
    """
    module = format_of(path)
    trial = header(Tally(0, 0, 0))
    module.write(io.BytesIO(), trial, labels, [])
    coordinates = 3 * len(trial.objects)
    facts = {**request, "plan": pieces.plan_digest, "n": pieces.wanted, "seed": pieces.seed, "block": size}
    with open_shards(path, facts, coordinates, resume=resume) as shards:
        if shards.joined:
            facts = shards.state["filler"]
            shards.discard()
            return Tally(facts["done"], shards.state["pieces"], facts["candidates"], tuple(facts["strays"]))
        filler = Filler(pieces.reached, pieces.wanted, pieces.seed, size)
        used = 0
        if shards.state:
            used = int(shards.state["pieces"])
            filler.restore(shards.state["filler"], shards.pool(), coordinates)
        run = _Run(shards, filler, used, inspect)
        try:
            with closing(run_pieces(_Work(pieces, len(labels)), itertools.count(used), workers)) as results:
                while not (filler.complete or spent()):
                    run.take(*next(results))
                    if progress is not None:
                        progress(filler.found, pieces.wanted, filler.candidates)
                    run.checkpoint(checkpoint)
        except BaseException as error:
            # What comes while a piece is waited for finds everything in order; in the midst of a piece it does not.
            if run.settled and run.used:
                run.checkpoint()
                if isinstance(error, KeyboardInterrupt):
                    kept = f"{folder_of(path)} keeps {filler.found:,} scenes: go on with --resume"
                    raise KeyboardInterrupt(f"interrupted; {kept}") from error
            raise
        if run.used:
            run.checkpoint()
        tally = _tally(filler, run.used)
        if filler.complete:
            shards.join(lambda sink, blocks: module.write(sink, header(tally), labels, blocks))
        elif keep_partial and filler.found:
            # The rest is in no checkpoint: killed in the midst of joining, the run can still be resumed to its end.
            rest = filler.rest()
            assert rest is not None
            if inspect is not None:
                inspect(rest)
            tally = _tally(filler, run.used)
            shards.join(
                lambda sink, blocks: module.write(sink, header(tally), labels, itertools.chain(blocks, [rest])),
                whole=False,
            )
    return tally


class _Run:
    """A run that stores what it finds. `settled` unless it is in the midst of taking a piece or of a checkpoint."""

    def __init__(
        self, shards: Shards, filler: Filler, used: int, inspect: Callable[[Block], None] | None = None
    ) -> None:
        self.settled = True
        self.used = used
        self._shards, self._filler, self._inspect = shards, filler, inspect
        self._last = time.monotonic()

    def take(self, candidates: Block, cell: Cell) -> None:
        self.settled = False
        for block in self._filler.offer(candidates, cell):
            if self._inspect is not None:
                self._inspect(block)
            self._shards.append(block)
        self.used += 1
        self.settled = True

    def checkpoint(self, after: float = 0.0) -> None:
        """A checkpoint, where the last one is that many seconds ago."""
        if time.monotonic() - self._last >= after:
            self.settled = False
            facts, waiting = self._filler.state()
            self._shards.checkpoint({"pieces": self.used, "filler": facts}, waiting)
            self._last = time.monotonic()
            self.settled = True


def _tally(filler: Filler, used: int) -> Tally:
    return Tally(filler.done, used, filler.candidates, tuple(sorted(filler.strays)))
