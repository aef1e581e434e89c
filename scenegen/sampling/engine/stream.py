"""Runs a plan's pieces to the end: blocks of scenes in memory, or a file of any size with constant memory."""

from __future__ import annotations

import contextlib
import io
import itertools
import queue
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from scenegen.errors.program import INTERRUPTED
from scenegen.processes.ahead import IdleWorkers
from scenegen.processes.pool import run_pieces
from scenegen.processes.process import stop_signals
from scenegen.sampling.engine.blocks import BlockAssembler, Cells, Drawing, draw_pieces
from scenegen.sampling.plan import Array, Plan, Tally
from scenegen.sampling.request import Progress
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.files import begin_writing
from scenegen.scenes.formats.registry import HEADER_LAST, SCENES, TEXT, format_of
from scenegen.scenes.shards import Shards, folder_of, open_shards
from scenegen.search.effort import StoppedError

if TYPE_CHECKING:
    from scenegen.scenes.motions import AnyFile

# --------------------------------------------------------------------------------------------------------------------
# The scene file into which the blocks of a run are joined.


PART = 8192  # scenes whose text a process makes at a time
MANY = 4 * PART  # scenes from which on other processes make their text: fewer take less time than a process to start


class JoinedFile:
    """`joining` is called with every block that goes into the file; `stored` makes of it what the file holds. With
    several workers the text of many `scenes` is made by as many processes."""

    def __init__(
        self,
        shards: Shards,
        path: Path,
        labels: Sequence[str],
        joining: Callable[[Block], None] | None,
        stored: Callable[[Block], Block] | None,
        workers: int,
        reserve: IdleWorkers | None,
        scenes: int,
        kind: str,
    ) -> None:
        self._shards, self._labels = shards, labels
        self._format = format_of(path, kind)
        self._ending = path.suffix.lower() if kind == SCENES else ""
        self._joining, self._stored = joining, stored
        self._workers, self._reserve, self._scenes = workers, reserve, scenes

    @property
    def can_be_ahead(self) -> bool:
        """Whether it can be packed while scenes are drawn, by a core that one worker would not use."""
        return self._workers > 1 and self._ending in HEADER_LAST

    def write(self, header: AnyFile, blocks: Iterable[Block], *, final: Callable[[], AnyFile] | None = None) -> None:
        """`final` gives the header after the last block, if the format can wait for it. Raises OutputError."""
        with ExitStack() as ending:
            options: dict[str, Any] = {} if final is None else {"final": final}
            if self._workers > 1 and self._ending in TEXT and self._scenes >= MANY:

                def each(job: Callable[[Block], bytes], blocks: Iterable[Block]) -> Generator[bytes, None, None]:
                    made = run_pieces(job, _parts(blocks), self._workers, self._reserve)
                    ending.callback(made.close)
                    return made

                options["each"] = each

            def write(sink: IO[bytes]) -> None:
                self._format.write(sink, header, self._labels, self._seen(blocks, sink), **options)

            self._shards.join(write)

    def _seen(self, blocks: Iterable[Block], sink: IO[bytes]) -> Iterator[Block]:
        for block in blocks:
            if self._joining is not None:
                self._joining(block)
            yield block if self._stored is None else self._stored(block)
            begin_writing(sink)


def _parts(blocks: Iterable[Block]) -> Iterator[Block]:
    for block in blocks:
        for start in range(0, block.count, PART):
            yield block.part(start, start + PART)


# --------------------------------------------------------------------------------------------------------------------
# A file that a thread packs while its scenes are still being drawn: little of it is left after the last one.


T = TypeVar("T")

AHEAD = 1 << 26  # bytes of blocks that wait to be packed
WAIT = 0.5  # seconds after which a thread that waits looks whether all is over


class ByteBudget:
    """For blocks that wait: at most AHEAD bytes, or a single block."""

    def __init__(self) -> None:
        self._taken = 0
        self._changed = threading.Condition()

    def take(self, size: int) -> bool:
        """Whether there is room for so many bytes; waits for it for a moment."""
        with self._changed:
            if not self._changed.wait_for(lambda: not self._taken or self._taken + size <= AHEAD, WAIT):
                return False
            self._taken += size
            return True

    def leave(self, size: int) -> None:
        with self._changed:
            self._taken -= size
            self._changed.notify_all()


class BlockPacker(Generic[T]):
    """`work` gets the blocks in a thread, as they are added. Several can share the room for those that wait."""

    def __init__(self, threads: ThreadPoolExecutor, room: ByteBudget, work: Callable[[Iterator[Block]], T]) -> None:
        self._room = room
        self._blocks: queue.SimpleQueue[Block | None] = queue.SimpleQueue()
        self._current: Block | None = None  # is being packed
        self._over = threading.Event()  # by an error, or by giving up
        self._result = threads.submit(self._run, work)

    def add(self, block: Block) -> None:
        """One more block. Raises what the work has raised."""
        while not self._over.is_set():
            if self._room.take(_size(block)):
                self._blocks.put(block)
                break
        if self._over.is_set():  # it may have ended since
            self._empty()
        if self._result.done():  # before its last block: it has failed
            self._result.result()

    def finish(self) -> None:
        """There are no more blocks."""
        self._blocks.put(None)

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

    def _run(self, work: Callable[[Iterator[Block]], T]) -> T:
        """Runs in the thread."""
        try:
            return work(self._added())
        finally:
            self._over.set()
            self._leave(self._current)
            self._empty()

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
            self._current = block
            yield block
            self._current = None
            self._leave(block)

    def _empty(self) -> None:
        """Blocks that nobody will take leave their room to those of others."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._leave(self._blocks.get_nowait())

    def _leave(self, block: Block | None) -> None:
        if block is not None:
            self._room.leave(_size(block))


def _size(block: Block) -> int:
    return block.rows.nbytes + block.phi.nbytes


CHECKPOINT = 5.0  # seconds of work that kill -9 may cost; the times of checkpoints do not change the file


@dataclass(slots=True)
class RunProgress:
    """The progress of a run. `used` pieces have given the sums `facts`; the last `idle` of them gave no new scene.
    `cut` says how far the piece had come that the time limit cut short."""

    plan: Plan
    assembler: BlockAssembler
    used: int = 0
    idle: int = 0
    facts: Array = field(default_factory=lambda: np.empty(0))
    cut: str = ""

    @property
    def over(self) -> bool:
        """Whether the run has come to its end by itself."""
        if self.assembler.complete:
            return self.used >= self.plan.fewest
        patience = self.plan.patience
        return patience is not None and self.idle >= patience

    def take(self, candidates: Block, cell: Cells, facts: Array) -> Generator[Block, None, None]:
        """The blocks that one more piece completes."""
        found = self.assembler.found
        yield from self.assembler.offer(candidates, cell)
        if len(facts) > len(self.facts):  # an empty piece may have fewer facts than others
            self.facts, facts = facts.copy(), self.facts
        self.facts[: len(facts)] += facts
        self.idle = self.idle + 1 if self.assembler.found == found else 0
        self.used += 1

    def tally(self) -> Tally:
        assembler = self.assembler
        strays, facts = tuple(sorted(assembler.strays)), tuple(map(float, self.facts))
        return Tally(
            assembler.done,
            assembler.found,
            self.used,
            assembler.candidates,
            strays,
            facts,
            assembler.scarcest,
            self.cut,
        )

    def state(self) -> tuple[dict[str, object], Array]:
        """Everything that the request does not determine: JSON, and the scenes of unfinished blocks."""
        facts, waiting = self.assembler.state()
        state = {"pieces": self.used, "idle": self.idle, "found": self.assembler.found}
        return {**state, "facts": self.facts.tolist(), "assembler": facts}, waiting

    def restore(self, state: Mapping[str, Any], waiting: Array, coordinates: int) -> None:
        self.used, self.idle = int(state["pieces"]), int(state["idle"])
        self.facts = np.array(state["facts"], dtype=np.float64)
        self.assembler.restore(state["assembler"], waiting, coordinates)


def run_blocks(
    plan: Plan,
    labels: int,
    *,
    workers: int = 1,
    reserve: IdleWorkers | None = None,
    spent: Callable[[], bool] = lambda: False,
    progress: Progress | None = None,
    size: int = BLOCK,
) -> Generator[Block, None, Tally]:
    """The scenes of a request in blocks of `size`; the generator's return value is the tally.

    `labels` is the number of the spec's labels. `spent` is called after each piece; if it returns True, the run ends
    with fewer scenes than requested. Raises what `run_pieces` raises.
    """
    run = RunProgress(plan, BlockAssembler(plan.reached, plan.wanted, plan.seed, size, plan.groups))
    with closing(draw_pieces(Drawing(plan, labels), itertools.count(), workers, reserve)) as results:
        while not run.over:
            try:
                made = next(results)
            except StoppedError as stopped:  # time was up in the midst of the piece
                run.cut = stopped.how_far
                break
            yield from run.take(*made)
            if progress is not None:
                progress(run.assembler.found, plan.wanted, run.assembler.candidates)
            if spent():
                break
    scarcest = run.assembler.scarcest
    rest = run.assembler.rest()
    if rest is not None:
        yield rest
    return replace(run.tally(), scarcest=scarcest)


def stream_scenes(
    path: Path,
    plan: Plan,
    labels: Sequence[str],
    header: Callable[[Tally], AnyFile],
    *,
    request: Mapping[str, object],
    workers: int = 1,
    reserve: IdleWorkers | None = None,
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
    format_of(path, trial.format).write(io.BytesIO(), trial, labels, [])
    coordinates = plan.problem.rows
    with contextlib.ExitStack() as ending:
        standing = RunProgress(plan, BlockAssembler(plan.reached, plan.wanted, plan.seed, size, plan.groups))
        drawing = Drawing(plan, len(labels))

        def drawn(first: int) -> Generator[tuple[Block, Cells, Array], None, None]:
            pieces = draw_pieces(drawing, itertools.count(first), workers, reserve)
            return ending.enter_context(closing(pieces))

        results = None if resume else drawn(0)  # a run that is resumed does not know yet where it goes on
        facts = {**request, "plan": plan.plan_digest, "n": plan.wanted, "seed": plan.seed, "block": size}
        shards = ending.enter_context(open_shards(path, facts, coordinates, resume=resume))
        ending.enter_context(_saying_how_to_go_on(path, shards))
        file = JoinedFile(shards, path, labels, joining, stored, workers, reserve, plan.wanted, trial.format)
        run = _StoredRun(shards, standing, inspect)
        if shards.state:
            waiting = np.empty((0, 0)) if shards.joined else shards.pool()
            standing.restore(shards.state, waiting, coordinates)
        if shards.joined:
            shards.discard()
            return standing.tally()
        if file.can_be_ahead:
            ending.enter_context(run.packed_ahead(file, trial))
        results = drawn(standing.used) if results is None else results
        try:
            with stop_signals() as stop, closing(results):
                while not standing.over:
                    try:
                        made = next(results)
                    except StoppedError as stopped:  # time was up in the midst of the piece
                        standing.cut = stopped.how_far
                        break
                    run.take(*made)
                    if progress is not None:
                        progress(standing.assembler.found, plan.wanted, standing.assembler.candidates)
                    run.checkpoint(checkpoint)
                    if stop.asked is not None:
                        raise stop.asked
                    if spent():
                        break
        except BaseException:
            # An interrupt while waiting for a piece finds a consistent state; one while a piece is processed does not.
            if run.settled and standing.used:
                run.checkpoint()
            raise
        if standing.used:
            run.checkpoint(checkpoint if run.ahead and standing.assembler.complete else 0.0)
        tally = standing.tally()
        if standing.assembler.complete:
            run.join(file, header(tally))
        elif keep_partial and standing.assembler.found:
            # The rest is not in a checkpoint: a run that is killed while joining can still be resumed.
            rest = standing.assembler.rest()
            assert rest is not None
            if inspect is not None:
                inspect(rest)
            tally = replace(standing.tally(), scarcest=tally.scarcest)
            run.join(file, header(tally), rest)
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
    """A run that stores its blocks. `settled` is False while a piece is processed or a checkpoint is written."""

    def __init__(self, shards: Shards, standing: RunProgress, inspect: Callable[[Block], None] | None) -> None:
        self.settled = True
        self.standing = standing
        self._shards, self._inspect = shards, inspect
        self._last = time.monotonic()
        self._packing: BlockPacker[None] | None = None  # the file, if it is packed while the run goes on
        self._header: AnyFile | None = None

    @property
    def ahead(self) -> bool:
        """Whether the file is packed already but for its end."""
        return self._packing is not None

    @contextlib.contextmanager
    def packed_ahead(self, file: JoinedFile, header: AnyFile) -> Iterator[None]:
        """The file is packed by a thread from now on, with a preliminary header; a context manager, at the end of which
        an unfinished one is given up."""

        def final() -> AnyFile:
            assert self._header is not None
            return self._header

        before = self._shards.blocks()  # of a run that is resumed
        with ThreadPoolExecutor(1) as threads:
            self._packing = BlockPacker(
                threads, ByteBudget(), lambda added: file.write(header, itertools.chain(before, added), final=final)
            )
            try:
                yield
            finally:
                self._packing.give_up()

    def join(self, file: JoinedFile, header: AnyFile, rest: Block | None = None) -> None:
        """Make the file of all blocks, and `rest`. Raises OutputError."""
        if self._packing is None:
            file.write(header, itertools.chain(self._shards.blocks(), [] if rest is None else [rest]))
        else:
            self._header = header
            if rest is not None:
                self._packing.add(rest)
            self._packing.finish()
            self._packing.result()
        self._shards.finish(whole=rest is None)

    def take(self, candidates: Block, cell: Cells, facts: Array) -> None:
        self.settled = False
        for block in self.standing.take(candidates, cell, facts):
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
            self._shards.checkpoint(*self.standing.state())
            self._last = time.monotonic()
            self.settled = True
