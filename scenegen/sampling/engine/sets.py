"""A plan's scenes as a set of shards, by any engine, with the same bytes from each.

The same assembler as for files decides which candidates are kept: it depends on their cells alone. So it works on
places instead of scenes here: each candidate is (number of its part, place in it), and only the engine moves scenes. A
part is a piece, or the scenes that waited when the last shard ended.

Where the run stands is recorded between two pieces: the piece that completes a shard is drawn again after an
interruption, and those of its blocks that lie in complete shards are left out.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import OutputError, ScenegenError
from scenegen.errors.program import INTERRUPTED
from scenegen.processes.process import stop_signals
from scenegen.sampling.engine.blocks import Drawing, RunProgress
from scenegen.sampling.engine.engines import DrawnPiece, Engine, SceneHandle, ShardWriter
from scenegen.sampling.plan import Plan, Tally
from scenegen.sampling.request import Progress
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.sets import Checkpoint, Manifest, begin, finish, read_waiting, save_checkpoint, write_manifest
from scenegen.scenes.stores import Store

SPARE = 4  # blocks of candidates that are held though none of them waits any more


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
    run = _SetRun(store, plan, engine, found, writing, block)
    if found.complete:
        return None, found
    if found.checkpoint is not None:
        run.restore(found.checkpoint)
    standing = run.standing
    with stop_signals() as stop, closing(engine.pieces(Drawing(plan, len(found.labels)), standing.used)) as pieces:
        for drawn in standing.follow(pieces, spent, progress):
            run.take(drawn)
            if stop.asked is not None:
                run.publish(wait=True)
                raise KeyboardInterrupt(INTERRUPTED(folder=store.location, scenes=run.manifest.scenes)) from stop.asked
    tally = standing.tally()
    if keep_partial and not standing.assembler.complete:
        run.keep_rest()
        tally = replace(standing.tally(), scarcest=tally.scarcest)
    run.publish(wait=True)
    if standing.assembler.complete or (keep_partial and run.manifest.scenes):
        run.manifest = run.manifest.model_copy(
            update={"complete": True, "checkpoint": None, "sampler": dict(account(tally))}
        )
        write_manifest(store, run.manifest)
        finish(store, run.manifest)
    return tally, run.manifest


@dataclass(slots=True)
class _Moment:
    """A run between two pieces: its state, the scenes that wait, if any, and the cells of these, (1, m)."""

    state: dict[str, object]
    waiting: SceneHandle | None
    cells: Array


@dataclass(slots=True)
class _SetRun:
    store: Store
    plan: Plan
    engine: Engine
    manifest: Manifest
    writing: ShardWriter
    block: int
    standing: RunProgress = field(init=False)
    _parts: dict[int, SceneHandle] = field(default_factory=dict)
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

    def restore(self, checkpoint: Checkpoint) -> None:
        """Go on from where an earlier run stood."""
        waiting = read_waiting(self.store, checkpoint)
        labels = len(self.manifest.labels)  # their phi stands after the coordinates, the number of the cell is last
        places = self._pool(Block(waiting[: -labels - 1], waiting[-labels - 1 : -1])) if waiting.size else waiting
        cells = waiting[-1:] if waiting.size else waiting
        self.standing.restore(checkpoint.state, np.concatenate([places, cells]) if waiting.size else waiting, 2)

    def take(self, drawn: DrawnPiece) -> None:
        """One more piece."""
        count = len(drawn.cell)
        before = self.standing.state() if self._can_end_a_shard(count) else None
        begun = len(self._begun)
        number = self.standing.used
        self._parts[number], self._sizes[number] = drawn.scenes, count
        places = np.stack([np.full(count, float(number)), np.arange(count, dtype=np.float64)])
        for block in self.standing.take(Block(places, np.empty((0, count))), drawn.cell, drawn.facts):
            self._add(block.rows, before)
        if len(self._begun) > begun and self.standing.assembler.complete:
            self._begun[-1] = _Moment(self.standing.state()[0], None, np.empty((1, 0)))
        if (
            len(self._begun) > begun
            or sum(self._sizes.values()) > SPARE * self.block + 2 * self.standing.assembler.waiting
        ):
            self._compact()
        self.publish()

    def keep_rest(self) -> None:
        """The scenes of unfinished blocks as the last shard."""
        before = self.standing.state()
        rest = self.standing.assembler.rest()
        if rest is not None:
            self._add(rest.rows, before)
        if self._blocks:
            self._begin_shard(before)

    def publish(self, *, wait: bool = False) -> None:
        """Name in the manifest what is complete."""
        for shard in self.engine.written(wait=wait):
            before = self.manifest.checkpoint
            point = self._saved(self._begun.pop(0), len(self.manifest.shards) + 1)
            self.manifest = self.manifest.model_copy(
                update={"shards": [*self.manifest.shards, shard], "checkpoint": point}
            )
            write_manifest(self.store, self.manifest)
            if before is not None and before.waiting is not None:
                self.store.delete(before.waiting)

    def _can_end_a_shard(self, count: int) -> bool:
        """Whether a piece of so many candidates can complete a shard."""
        assembler = self.standing.assembler
        end = min(self._done + self.manifest.shard_size, self.plan.wanted)
        return assembler.found + count >= end

    def _moment(self, state: dict[str, object], waiting: Array) -> _Moment:
        """What `RunProgress.state` returned before the piece that is being taken; the parts of then are still there."""
        if not waiting.size:
            return _Moment(state, None, np.empty((1, 0)))
        return _Moment(state, self.engine.choose(waiting[:2], self._parts), waiting[2:])

    def _saved(self, moment: _Moment, number: int) -> Checkpoint:
        """A moment, on disk."""
        if moment.waiting is None:
            return save_checkpoint(self.store, number, moment.state, None)
        scenes = self.engine.fetch(moment.waiting)
        waiting = np.concatenate([scenes.rows, scenes.phi, moment.cells])
        return save_checkpoint(self.store, number, moment.state, waiting)

    def _add(self, places: Array, before: tuple[dict[str, object], Array] | None) -> None:
        """A finished block, unless it lies in a complete shard."""
        end = self.standing.assembler.done
        if end <= self._done:
            return
        block = self.engine.pick(places, self._parts)
        try:
            self._blocks.append(self.engine.pack(self.writing, self._number, block))
        except OutputError:
            with suppress(ScenegenError):  # the one that is raised tells more
                self.publish(wait=True)  # the shards before this one are kept
            raise
        self._count += places.shape[1]
        if self._count >= self.manifest.shard_size or end == self.plan.wanted:
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
        pool = None if not waiting.size else self.engine.fetch(self.engine.choose(waiting[:2], self._parts))
        self._parts.clear()
        self._sizes.clear()
        if pool is not None:
            places = self._pool(pool)
            self.standing.restore(state, np.concatenate([places, waiting[2:]]), 2)

    def _pool(self, scenes: Block) -> Array:
        """A part of scenes that wait; returns their places."""
        number = next(self._pools)
        self._parts[number], self._sizes[number] = self.engine.hold(scenes), 0
        return np.stack([np.full(scenes.count, float(number)), np.arange(scenes.count, dtype=np.float64)])
