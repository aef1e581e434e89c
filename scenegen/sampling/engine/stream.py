"""A file of scenes of any size, with constant memory: blocks are stored as they come, and joined at the end."""

from __future__ import annotations

import contextlib
import io
import itertools
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from scenegen.arrays import Array
from scenegen.errors.program import INTERRUPTED
from scenegen.processes.pool import run_pieces
from scenegen.processes.process import stop_signals
from scenegen.sampling.engine.blocks import Cells, Drawing, RunProgress
from scenegen.sampling.plan import Plan, Tally
from scenegen.sampling.request import Progress
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.files import begin_writing
from scenegen.scenes.formats.registry import format_of
from scenegen.scenes.shards import Shards, folder_of, open_shards

if TYPE_CHECKING:
    from scenegen.scenes.motions import AnyFile

# --------------------------------------------------------------------------------------------------------------------
# A file, or a shard of a set, that a thread packs while its scenes are still being drawn: packing takes as long as
# drawing where scenes are easy to find, and nearly all of it is in libraries that let other threads run.


T = TypeVar("T")

WAIT = 0.5  # seconds after which a thread that waits looks whether all is over


class BlockPacker(Generic[T]):
    """`work` gets the blocks in a thread, as they are added; one of them waits at most."""

    def __init__(self, threads: ThreadPoolExecutor, work: Callable[[Iterator[Block]], T]) -> None:
        self._blocks: queue.Queue[Block | None] = queue.Queue(1)
        self._over = threading.Event()
        self._result = threads.submit(lambda: work(self._added()))

    def add(self, block: Block) -> None:
        """One more block. Raises what the work has raised."""
        if not self._put(block):
            self._result.result()

    def finish(self) -> None:
        """There are no more blocks."""
        self._put(None)

    def _put(self, block: Block | None) -> bool:
        """Whether the work goes on: it has failed if it ends before its last block."""
        while not self._result.done():
            with contextlib.suppress(queue.Full):
                self._blocks.put(block, timeout=WAIT)
                return True
        return False

    @property
    def done(self) -> bool:
        return self._result.done()

    def result(self) -> T:
        """What the work returns, once that is known. Raises what it raises."""
        return self._result.result()

    def give_up(self) -> None:
        """The work is not to be completed: its iterator of blocks raises CancelledError."""
        self._over.set()
        self._result.cancel()

    def _added(self) -> Iterator[Block]:
        while True:
            try:
                block = self._blocks.get(timeout=WAIT)
            except queue.Empty:
                if self._over.is_set():
                    raise CancelledError from None
                continue
            if block is None:
                return
            yield block


# --------------------------------------------------------------------------------------------------------------------
# The run.


CHECKPOINT = 5.0  # seconds of work that kill -9 may cost; the times of checkpoints do not change the file


def stream_scenes(
    path: Path,
    plan: Plan,
    labels: Sequence[str],
    header: Callable[[Tally], AnyFile],
    *,
    request: Mapping[str, object],
    workers: int = 1,
    resume: bool = False,
    keep_partial: bool = False,
    spent: Callable[[], bool] = lambda: False,
    inspect: Callable[[Block], None] | None = None,
    joining: Callable[[Block], None] | None = None,
    stored: Callable[[Block], Block] | None = None,
    progress: Progress | None = None,
    checkpoint: float = CHECKPOINT,
    size: int = BLOCK,
) -> Tally:
    """Write the scenes of a request to a file in the format of the path's ending, however many there are.

    They are collected in `x.parquet.part/` and joined at the end, so that the file appears whole or not at all; with
    several workers, a format whose header comes last is joined while they are collected. After an interrupt or kill -9
    at any moment, the same call with `resume` continues from the last checkpoint and ends with the same bytes as an
    uninterrupted run; without `resume`, an existing folder is refused. With `resume` and no
    folder, the run starts from the beginning. The bytes do not depend on `workers`, nor on when the run was
    interrupted. SIGINT, SIGTERM and SIGHUP end the run after the current piece, with a checkpoint; KeyboardInterrupt
    then says how to resume. A second signal ends it at once.

    `labels` are the spec's. `header` makes the scene file without scenes from the final tally; it is tried with an
    empty tally before the work begins. `request` is JSON that, with the plan, determines the scenes: put the spec's
    hash, ranges, n, seed, method and the versions of scenegen, numpy and torch there. `inspect` is called with every
    block before it is stored, and raises if the block is wrong; `joining` is called with every block that goes into the
    file, including those from before an interruption; `stored` makes of it what the file holds.

    If `spent`, called after each piece, returns True, or too many pieces in a row gave nothing, the run ends early. The
    tally then has fewer scenes than requested, and only the checkpoint is written; with `keep_partial` the file gets
    the scenes found so far. Raises RequestError, DataError (a damaged checkpoint), OutputError, and what `run_pieces`
    raises.
    """
    trial = header(Tally(0, 0, 0, 0))
    kind = format_of(path, trial.format)
    kind.write(io.BytesIO(), trial, labels, [])
    coordinates = plan.problem.rows
    standing = RunProgress(plan, size)
    facts = {**request, "plan": plan.plan_digest, "n": plan.wanted, "seed": plan.seed, "block": size}
    with contextlib.ExitStack() as ending:
        shards = ending.enter_context(open_shards(path, facts, coordinates, resume=resume))
        ending.enter_context(_saying_how_to_go_on(path, shards))
        if shards.state:
            waiting = np.empty((0, 0)) if shards.joined else shards.pool()
            standing.restore(shards.state, waiting, coordinates)
        if shards.joined:
            shards.discard()
            return standing.tally()

        def write(header: AnyFile, blocks: Iterable[Block], **options: Any) -> None:
            def seen(sink: IO[bytes]) -> Iterator[Block]:
                for block in blocks:
                    if joining is not None:
                        joining(block)
                    yield block if stored is None else stored(block)
                    begin_writing(sink)

            shards.join(lambda sink: kind.write(sink, header, labels, seen(sink), **options))

        run = _StoredRun(shards, standing, inspect, write)
        if workers > 1 and getattr(kind, "HEADER_LAST", False):
            ending.enter_context(run.packed_ahead(trial))
        pieces = run_pieces(Drawing(plan, len(labels)), itertools.count(standing.used), workers)
        try:
            with stop_signals() as stop, closing(pieces):
                for piece in standing.follow(pieces, spent, progress):
                    run.take(*piece)
                    run.checkpoint(checkpoint)
                    if stop.asked is not None:
                        raise stop.asked
        except BaseException:
            # An interrupt while waiting for a piece finds a consistent state; one while a piece is processed does not.
            if run.settled and standing.used:
                run.checkpoint()
            raise
        if standing.used:
            run.checkpoint(checkpoint if run.ahead and standing.assembler.complete else 0.0)
        tally = standing.tally()
        if standing.assembler.complete:
            run.join(header(tally))
        elif keep_partial and standing.assembler.found:
            # The rest is not in a checkpoint: a run that is killed while joining can still be resumed.
            rest = standing.assembler.rest()
            assert rest is not None
            if inspect is not None:
                inspect(rest)
            tally = replace(standing.tally(), scarcest=tally.scarcest)
            run.join(header(tally), rest)
    return tally


@contextlib.contextmanager
def _saying_how_to_go_on(path: Path, shards: Shards) -> Iterator[None]:
    """An interrupt, also one while the file is joined, says what is kept."""
    try:
        yield
    except KeyboardInterrupt as error:
        if not shards.state:
            raise
        raise KeyboardInterrupt(INTERRUPTED(folder=folder_of(path), scenes=shards.state["found"])) from error


class _StoredRun:
    """A run that stores its blocks, and `write`s the file of them. `settled` is False while a piece is processed or a
    checkpoint is written."""

    def __init__(
        self,
        shards: Shards,
        standing: RunProgress,
        inspect: Callable[[Block], None] | None,
        write: Callable[..., None],
    ) -> None:
        self.settled = True
        self._standing, self._shards, self._inspect, self._write = standing, shards, inspect, write
        self._last = time.monotonic()
        self._packing: BlockPacker[None] | None = None  # the file, if it is packed while the run goes on
        self._header: AnyFile | None = None

    @property
    def ahead(self) -> bool:
        """Whether the file is packed already but for its end."""
        return self._packing is not None

    @contextlib.contextmanager
    def packed_ahead(self, header: AnyFile) -> Iterator[None]:
        """The file is packed by a thread from now on, with a preliminary header; a context manager, at the end of which
        an unfinished one is given up."""
        before = self._shards.blocks()  # of a run that is resumed
        with ThreadPoolExecutor(1) as threads:
            self._packing = BlockPacker(
                threads,
                lambda added: self._write(header, itertools.chain(before, added), final=lambda: self._header),
            )
            try:
                yield
            finally:
                self._packing.give_up()

    def join(self, header: AnyFile, rest: Block | None = None) -> None:
        """Make the file of all blocks, and `rest`. Raises OutputError."""
        if self._packing is None:
            self._write(header, itertools.chain(self._shards.blocks(), [] if rest is None else [rest]))
        else:
            self._header = header
            if rest is not None:
                self._packing.add(rest)
            self._packing.finish()
            self._packing.result()
        self._shards.finish(whole=rest is None)

    def take(self, candidates: Block, cell: Cells, facts: Array) -> None:
        self.settled = False
        for block in self._standing.take(candidates, cell, facts):
            if self._inspect is not None:
                self._inspect(block)
            self._shards.append(block)
            if self._packing is not None:
                self._packing.add(block)
        self.settled = True

    def checkpoint(self, after: float = 0.0) -> None:
        """Makes a checkpoint if the last one is that many seconds ago."""
        if time.monotonic() - self._last >= after:
            self.settled = False
            self._shards.checkpoint(*self._standing.state())
            self._last = time.monotonic()
            self.settled = True
