"""A plan's scenes on their way to a set of shards, or to one file: with the same bytes from any engine, and after any
interruption.

The assembler decides which candidates are kept: it depends on their cells alone. So it works on places instead of
scenes here: each candidate is (number of its source, place in it), and only the engine moves scenes. A source is a
piece, or the scenes that waited when the last shard ended.

A run writes shards, and commits each in the manifest together with where it stood: between two pieces, with the scenes
that waited. The piece that completes a shard is drawn again after an interruption, and those of its blocks that lie in
committed shards are left out. What was not committed is made again, with the same bytes.

The shards of a set have a fixed size. A file is a set in progress in the folder `x.jsonl.part/` until it is joined: its
shards end where a few seconds have passed, so that a kill costs no more than these.
"""

from __future__ import annotations

import io
import itertools
import json
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.errors.files import DAMAGED_SHARD, FOLDER_NOT_EMPTY, UNFINISHED_RUN
from scenegen.errors.program import INTERRUPTED
from scenegen.processes.process import stop_signals
from scenegen.sampling.engine.blocks import Drawing, RunProgress
from scenegen.sampling.engine.engines import BlockPacker, DrawnPiece, Engine, SceneHandle, ShardWriter
from scenegen.sampling.plan import Piece, Plan, Tally
from scenegen.sampling.request import Progress
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.files import DISK_FULL, begin_writing, output_error, put_in_place, sync_folder, target, whole_file
from scenegen.scenes.formats.registry import format_of
from scenegen.scenes.lock import acquire
from scenegen.scenes.motions import AnyFile
from scenegen.scenes.sets import (
    JOINED,
    SET_MANIFEST,
    Manifest,
    begin,
    discard,
    finish,
    is_ours,
    raw_blocks,
    read_waiting,
    refuse_taken,
    same_request,
    save_checkpoint,
    write_manifest,
)
from scenegen.scenes.stores import Store, store_at

SPARE_BLOCKS = 4  # blocks of candidates that are held though none of them waits any more
# seconds of work on a file that kill -9 may cost; the times of checkpoints do not change the file
CHECKPOINT_SECONDS = 5.0
OLDER_FORMAT = "scenegen/shards"  # the format of files in progress before they were sets


def write_set(
    store: Store,
    plan: Plan,
    engine: Engine,
    manifest: Manifest,
    writing: ShardWriter,
    account: Callable[[Tally], Mapping[str, Any]],
    *,
    resume: bool = False,
    keep_partial: bool = False,
    spent: Callable[[], bool] = lambda: False,
    progress: Progress | None = None,
    block: int = BLOCK,
) -> tuple[Tally | None, Manifest]:
    """Write the scenes of a request as shards, and return the tally and the manifest; no tally for a set that was
    complete already.

    `manifest` is that of the set before its first shard. If `spent`, called after each piece, returns True, the run
    ends early: the manifest then says where it stands, or with `keep_partial` that the set is complete as it is. A
    signal that asks to stop ends it after the current piece; KeyboardInterrupt then says how to go on. Raises what
    `begin` and the engine raise.
    """
    found = begin(store, manifest, resume=resume)
    if found.complete:
        return None, found
    run = _Run(store, plan, engine, found, writing, block)
    try:
        run.fill(spent, progress)
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(INTERRUPTED(folder=store.location, scenes=run.manifest.scenes)) from error
    tally, complete = run.standing.tally(), run.standing.assembler.complete
    if keep_partial and not complete:
        run.keep_rest()
        tally = replace(run.standing.tally(), scarcest=tally.scarcest)
    run.publish(wait=True)
    if complete or (keep_partial and run.manifest.scenes):
        run.update(complete=True, checkpoint=None, sampler=dict(account(tally)))
        finish(store, run.manifest)
    return tally, run.manifest


def folder_of(path: Path) -> Path:
    """The folder in which a file grows."""
    return path.with_name(f"{path.name}.part")


def write_file(
    path: Path,
    plan: Plan,
    engine: Engine,
    manifest: Manifest,
    writing: Callable[[Store], ShardWriter],
    header: Callable[[Tally], AnyFile],
    *,
    resume: bool = False,
    keep_partial: bool = False,
    spent: Callable[[], bool] = lambda: False,
    progress: Progress | None = None,
    joining: Callable[[Block], None] = lambda block: None,
    checkpoint: float = CHECKPOINT_SECONDS,
    block: int = BLOCK,
) -> Tally:
    """Write the scenes of a request to a file in the format of the path's ending, however many there are.

    They are collected in `x.parquet.part/` and joined at the end, so that the file appears whole or not at all; with
    several workers, a format whose header comes last is joined while they are collected. After an interrupt or kill -9
    at any moment, the same call with `resume` continues from the last checkpoint and ends with the same bytes as an
    uninterrupted run; without `resume`, an existing folder is refused. With `resume` and no folder, the run starts from
    the beginning. A signal that asks to stop ends the run after the current piece, with a checkpoint; KeyboardInterrupt
    then says how to resume.

    `header` makes the scene file without scenes from the final tally; it is tried with an empty tally before the work
    begins. `manifest` and `writing` are as of `write_set`. `joining` is called with every block that goes into the
    file, including those from before an interruption. If `spent`, called after each piece, returns True, or too many
    pieces in a row gave nothing, the run ends early. The tally then has fewer scenes than requested, and only the
    checkpoint is written; with `keep_partial` the file gets the scenes found so far. Raises RequestError, DataError (a
    damaged checkpoint), OutputError, and what the engine raises.
    """
    trial = header(Tally(0, 0, 0, 0))
    kind = format_of(path, trial.format)
    kind.write(io.BytesIO(), trial, manifest.labels, [])
    with ExitStack() as ending:
        kept = ending.enter_context(_FileInProgress.open(path))
        ending.enter_context(acquire(kept.store))
        ending.callback(kept.leave)
        ending.callback(engine.close)  # before that: it may be writing
        found = kept.begin(manifest, resume)
        into = writing(kept.store)
        run = _Run(kept.store, plan, engine, found, into, block, checkpoint)
        with _damage_refused(kept.store):
            run.restore(without_waiting=found.complete)
        kept.run = run
        if found.complete:  # the file is there, and only the folder has to be removed
            return run.standing.tally()

        def write(header: AnyFile, blocks: Iterable[Block], **options: Any) -> None:
            def blocks_joined(sink: IO[bytes]) -> Iterator[Block]:
                for one in blocks:
                    joining(one)
                    yield one
                    begin_writing(sink)

            with whole_file(kept.joined_file) as sink:
                kind.write(sink, header, manifest.labels, blocks_joined(sink), **options)

        ahead: BlockPacker[None] | None = None
        last: list[AnyFile] = []
        if engine.threaded and getattr(kind, "HEADER_LAST", False):
            before = kept.blocks(found)  # of a run that is resumed
            threads = ending.enter_context(ThreadPoolExecutor(1))
            ahead = BlockPacker(
                threads, lambda added: write(trial, itertools.chain(before, added), final=lambda: last[0])
            )
            ending.callback(ahead.give_up)
            run.writing = replace(into, ahead=ahead.add)
        run.fill(spent, progress)
        tally, rest = run.standing.tally(), []
        if not run.standing.assembler.complete:
            if not (keep_partial and tally.found):
                return tally
            # The rest is not in a checkpoint: a run that is killed while joining can still be resumed.
            rest = run.rest()
            tally = replace(run.standing.tally(), scarcest=tally.scarcest)
        last.append(header(tally))
        if ahead is None:
            write(last[0], itertools.chain(kept.blocks(run.manifest), rest))
        else:
            ahead.finish()
            ahead.result()
        put_in_place(kept.joined_file, kept.path)
        sync_folder(kept.path.parent)
        if not rest:
            run.update(complete=True)
        kept.over = True
    return tally


@dataclass(slots=True)
class _FileInProgress:
    """What there is of a file in progress: its folder as a store, and the run that fills it, once there is one."""

    path: Path
    store: Store
    run: _Run | None = None
    over: bool = False  # the file is in its place

    @classmethod
    @contextmanager
    def open(cls, path: Path) -> Generator[_FileInProgress, None, None]:
        """Errors of the block speak of the file, and say what is kept. At its end an empty folder is removed."""
        kept = cls(path, store_at(str(folder_of(path))))
        try:
            kept.path = target(path)
            kept.store = store_at(str(folder_of(kept.path)))
            Path(kept.store.root).mkdir(0o700, exist_ok=True)  # the file may replace one that is nobody else's business
            yield kept
        except KeyboardInterrupt as error:
            point = None if kept.run is None else kept.run.manifest.checkpoint
            if point is None:
                raise
            raise KeyboardInterrupt(INTERRUPTED(folder=kept.store.location, scenes=point.state["found"])) from error
        except (OutputError, OSError) as error:
            raise kept._explain(error) from error
        finally:
            with suppress(OSError):
                Path(kept.store.root).rmdir()

    @property
    def joined_file(self) -> Path:
        """The file, as long as it is in the folder."""
        return Path(self.store.root, JOINED)

    @property
    def has_checkpoint(self) -> bool:
        """Whether there is a checkpoint."""
        return self.run is not None and self.run.manifest.has_begun

    def begin(self, manifest: Manifest, resume: bool) -> Manifest:
        """The manifest to go on from, as of `sets.begin`. Raises RequestError, OutputError, and DataError for damage,
        of which all is found now, not when all else is drawn."""
        with _damage_refused(self.store):
            there = self.store.sizes()
            if SET_MANIFEST in there:
                _refuse_older(self.store)
            odd = sorted(name for name in there if not (is_ours(name) or name == SET_MANIFEST))
            if odd:
                raise OutputError(FOLDER_NOT_EMPTY(folder=self.store.location, odd=odd[0]))
            if SET_MANIFEST not in there:
                discard(self.store)  # of a run that had just begun, or was about to end
            found = refuse_taken(self.store, resume=True)
        if found is not None and found.complete:
            if self.path.exists():
                if not resume:
                    raise RequestError(UNFINISHED_RUN(folder=self.store.location, scenes=found.scenes))
                same_request(self.store, found, manifest)
                return found
            discard(self.store, complete=True)
        with _damage_refused(self.store):
            found = begin(self.store, manifest, resume=resume)
            for _ in raw_blocks(self.store, found):
                pass
        return found

    def blocks(self, manifest: Manifest) -> Iterator[Block]:
        with _damage_refused(self.store):
            yield from raw_blocks(self.store, manifest)

    def leave(self) -> None:
        """Remove what nobody will go on with."""
        if self.run is not None and (self.over or self.run.manifest.complete or not self.has_checkpoint):
            discard(self.store, complete=self.run.manifest.complete)

    def _explain(self, error: OutputError | OSError) -> OutputError:
        cause = error.__cause__ if isinstance(error, OutputError) else error
        if isinstance(cause, OSError):
            found = output_error(self.path, cause).diagnostics[0]
            if self.has_checkpoint:
                assert self.run is not None
                full = cause.errno in DISK_FULL or None
                found = found.but(folder=self.store.location, scenes=self.run.manifest.scenes, full=full)
            return OutputError(found)
        assert isinstance(error, OutputError)
        return error


@contextmanager
def _damage_refused(store: Store) -> Iterator[None]:
    """Whatever is wrong with a file in progress: it cannot be drawn again in part, so the run is refused."""
    try:
        yield
    except DataError as error:
        raise DataError(DAMAGED_SHARD(path=store.location, folder="it")) from error


def _refuse_older(store: Store) -> None:
    """Raises RequestError for a folder that an earlier version of scenegen has left."""
    known: Any = None
    with suppress(DataError, ValueError):
        known = json.loads(store.read(SET_MANIFEST))
    if isinstance(known, dict) and known.get("format") == OLDER_FORMAT:
        scenes = sum(one["scenes"] for one in known.get("shards", ()))
        raise RequestError(UNFINISHED_RUN(folder=store.location, scenes=scenes, older=True))


@dataclass(slots=True)
class _Moment:
    """A run between two pieces: its state, the scenes that wait, if any, and the cells of these, (1, m)."""

    state: dict[str, object]
    waiting: SceneHandle | None
    cells: Array


@dataclass(slots=True)
class _Run:
    """Goes on from the checkpoint of `manifest`. If `every` is given, shards end after so many seconds, too."""

    store: Store
    plan: Plan
    engine: Engine
    manifest: Manifest
    writing: ShardWriter
    block: int
    every: float | None = None
    standing: RunProgress = field(init=False)
    _settled: bool = True  # no piece is being taken, and nothing is being committed
    _last: float = field(default_factory=time.monotonic)  # when all was committed
    _sources: dict[int, SceneHandle] = field(default_factory=dict)
    _sizes: dict[int, int] = field(default_factory=dict)
    _blocks: list[SceneHandle] = field(default_factory=list)  # of the unfinished shard
    _count: int = 0  # scenes in them
    _done: int = 0  # scenes in complete and begun shards
    # from which a run goes on when the shards that were begun are complete
    _begun: list[_Moment] = field(default_factory=list)
    _pools: Any = field(default_factory=lambda: itertools.count(-1, -1))

    def __post_init__(self) -> None:
        self.standing = RunProgress(self.plan, self.block)
        self._done = self.manifest.scenes
        if self.every is None:
            self.restore()

    def restore(self, *, without_waiting: bool = False) -> None:
        """Go on from where an earlier run stood. Raises DataError for damage."""
        point = self.manifest.checkpoint
        if point is None:
            return
        waiting = np.empty((0, 0)) if without_waiting else read_waiting(self.store, point)
        if waiting.size:
            labels = len(self.manifest.labels)  # their phi stands after the coordinates, the number of the cell is last
            places = self._pool(Block(waiting[: -labels - 1], waiting[-labels - 1 : -1]))
            waiting = np.concatenate([places, waiting[-1:]])
        self.standing.restore(point.state, waiting, 2)

    def fill(self, spent: Callable[[], bool], progress: Progress | None) -> None:
        """Draw pieces and write shards until the run ends. Raises KeyboardInterrupt when a signal asks to stop."""
        standing, drawing = self.standing, Drawing(self.plan, len(self.manifest.labels))
        try:
            with stop_signals() as stop, closing(self.engine.pieces(drawing, standing.used)) as pieces:
                for drawn in standing.follow(pieces, spent, progress):
                    self.take(drawn)
                    if self.every is not None and time.monotonic() - self._last >= self.every:
                        self.commit_all()
                    if stop.asked is not None:
                        break
                if self.every is not None or stop.asked is not None:
                    self.commit_all()
                if stop.asked is not None:
                    raise stop.asked
        except BaseException:
            # An interrupt while waiting for a piece finds a consistent state; one while a piece is taken does not.
            if self._settled and self.every is not None:
                self.commit_all()
            raise

    def take(self, drawn: DrawnPiece) -> None:
        """One more piece."""
        self._settled = False
        scenes, cell, facts = drawn
        count = len(cell)
        before = self.standing.state() if self._can_end_a_shard(count) else None
        begun = len(self._begun)
        number = self.standing.used
        self._sources[number], self._sizes[number] = scenes, count
        places = np.stack([np.full(count, float(number)), np.arange(count, dtype=np.float64)])
        for block in self.standing.take(Piece(places, np.empty((0, count)), cell, facts)):
            self._add(block.rows, before)
        if len(self._begun) > begun and self.standing.assembler.complete:
            self._begun[-1] = _Moment(self.standing.state()[0], None, np.empty((1, 0)))
        if (
            len(self._begun) > begun
            or sum(self._sizes.values()) > SPARE_BLOCKS * self.block + 2 * self.standing.assembler.waiting
        ):
            self._compact()
        self.publish()
        self._settled = True

    def commit_all(self) -> None:
        """All that was drawn, durably: `kill -9` then loses nothing of it. Of a set its complete shards alone."""
        self._settled = False
        if self.every is None or not self.standing.used:
            self.publish(wait=True)
        else:
            before = self.standing.state()
            if self._blocks:
                self._begin_shard(before)
            self.publish(wait=True)
            if self.manifest.checkpoint is None or self.manifest.checkpoint.state != before[0]:
                self._commit(self._moment(*before))
            self._last = time.monotonic()
        self._settled = True

    def keep_rest(self) -> None:
        """The scenes of unfinished blocks as the last shard."""
        before = self.standing.state()
        rest = self.standing.assembler.rest()
        if rest is not None:
            self._add(rest.rows, before)
        if self._blocks:
            self._begin_shard(before)

    def rest(self) -> list[Block]:
        """The scenes of unfinished blocks, as files hold them."""
        rest = self.standing.assembler.rest()
        return [] if rest is None else [self.writing.ready(self.engine.fetch(self._choose(rest.rows)))]

    def publish(self, *, wait: bool = False) -> None:
        """Name in the manifest what is complete."""
        for shard in self.engine.finished_shards(wait=wait):
            self._commit(self._begun.pop(0), shard)

    def update(self, **changes: object) -> None:
        """Replace the manifest."""
        self.manifest = self.manifest.model_copy(update=changes)
        write_manifest(self.store, self.manifest)

    def _commit(self, moment: _Moment, *more: object) -> None:
        """A moment, on disk, and the shards that are complete then."""
        before, shards, waiting = self.manifest.checkpoint, [*self.manifest.shards, *more], None
        if moment.waiting is not None:
            scenes = self.engine.fetch(moment.waiting)
            waiting = np.concatenate([scenes.rows, scenes.phi, moment.cells])
        point = save_checkpoint(self.store, len(shards), moment.state, waiting)
        self.update(shards=shards, checkpoint=point)
        if before is not None and before.waiting not in (None, point.waiting):
            self.store.delete(before.waiting)

    def _can_end_a_shard(self, count: int) -> bool:
        """Whether a piece of so many candidates can complete a shard."""
        assembler = self.standing.assembler
        end = min(self._done + self.manifest.shard_size, self.plan.scenes_wanted)
        return assembler.count + count >= end

    def _moment(self, state: dict[str, object], waiting: Array) -> _Moment:
        """What `RunProgress.state` returned before the piece that is being taken; the sources of then are still
        there."""
        if not waiting.size:
            return _Moment(state, None, np.empty((1, 0)))
        return _Moment(state, self._choose(waiting[:2]), waiting[2:])

    def _choose(self, places: Array) -> SceneHandle:
        return self.engine.choose(places, self._sources)

    def _add(self, places: Array, before: tuple[dict[str, object], Array] | None) -> None:
        """A finished block, unless it lies in a complete shard."""
        end = self.standing.assembler.done
        if end <= self._done:
            return
        block = self.engine.pick(places, self._sources)
        try:
            self._blocks.append(self.engine.pack(self.writing, self._number, block))
        except OutputError:
            with suppress(ScenegenError):  # the one that is raised tells more
                self.publish(wait=True)  # the shards before this one are kept
            raise
        self._count += places.shape[1]
        if self._count >= self.manifest.shard_size or end == self.plan.scenes_wanted:
            assert before is not None
            self._begin_shard(before)

    @property
    def _number(self) -> int:
        """The shard that is being filled."""
        return len(self.manifest.shards) + len(self._begun)

    def _begin_shard(self, before: tuple[dict[str, object], Array]) -> None:
        number = self._number
        # After the last shard nothing waits: `take` records the end of the run.
        last = self.standing.assembler.complete
        self._begun.append(_Moment({}, None, np.empty((1, 0))) if last else self._moment(*before))
        self.engine.write(self.writing, number, self.standing.used + 1, list(self._blocks))
        self._done += self._count
        self._blocks, self._count = [], 0

    def _compact(self) -> None:
        """Let go of all candidates that do not wait."""
        state, waiting = self.standing.state()
        pool = self.engine.fetch(self._choose(waiting[:2])) if waiting.size else None
        self._sources.clear()
        self._sizes.clear()
        if pool is not None:
            places = self._pool(pool)
            self.standing.restore(state, np.concatenate([places, waiting[2:]]), 2)

    def _pool(self, scenes: Block) -> Array:
        """A source of scenes that wait; returns their places."""
        number = next(self._pools)
        self._sources[number], self._sizes[number] = self.engine.hold(scenes), 0
        return np.stack([np.full(scenes.count, float(number)), np.arange(scenes.count, dtype=np.float64)])
