"""Which scenes settle: each is simulated on the table for one second, and its objects must stay at rest.

A scene settles if no object's centre of mass gets more than 1 cm from where it started and none turns by more than 5
degrees, about any axis, at any of the 30 moments of the second at which it is looked at. The objects start at rest on
what they stand on (see `things.surfaces`), on an infinite table, under gravity and friction, without bounce. They are
prisms of footprint x height where heights are read from poses; where a spec declares heights they have their own convex
pieces, since things then stand in others (see `bodies`). Fixed objects cannot be moved. The scenes keep their poses
from before the simulation, because phi was verified for them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Index
from scenegen.errors import Diagnostic
from scenegen.errors.requests import UNSETTLED
from scenegen.lang.spec import levels
from scenegen.needs import need
from scenegen.pose import as_poses, flat
from scenegen.processes.pool import Pool, check_workers
from scenegen.processes.process import cores
from scenegen.sampling.plan import Account, Piece, Plan, Selection, Tally, digest
from scenegen.scenes.blocks import BLOCK
from scenegen.search.effort import NEVER, Budget, Stop
from scenegen.things import Shape
from scenegen.things.surfaces import base_heights
from scenegen.worlds.export import sdf
from scenegen.worlds.export.world import Patch, boards_of, bodies_of
from scenegen.worlds.physics.bodies import PRISM_FRICTION, board_of, is_still, piece_files, prism_of, whole_of
from scenegen.worlds.physics.simulation import ROUND_SCENES, DropJob, PybulletSetup

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

PRISM_TABLE_FRICTION = math.sqrt(PRISM_FRICTION)  # the table's friction where bodies are prisms


@dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """For every scene and object, (scenes, objects): how far it moved, in metres, and how far it turned, in degrees.

    If a scene does not settle, both are taken at the moment when the first of its objects had moved too far.
    """

    shift: Floats
    turn: Floats

    @property
    def moved(self) -> Mask:
        """(scenes, objects): which objects moved too far; NaN, from an unstable simulation, counts as well."""
        return np.asarray(~is_still(self.shift, self.turn))

    @property
    def stays(self) -> Mask:
        """(scenes,): which scenes settled."""
        return np.asarray(~self.moved.any(axis=1))


class Settler:
    """Drops scenes of the same objects on several processes, which start with the first scenes and run until `close`:
    use it as a context manager. Results do not depend on the number of processes, nor on which scenes are dropped
    together.

    `fixed` are the indices of the objects that cannot be moved. `declared`: a spec declares what things stand on, and
    `settle` gets their heights. `boards` are those of the spec. `workers` is by default one per core. Raises
    RequestError for another number than 1 to 256, and if pybullet is not installed.
    """

    def __init__(
        self,
        shapes: Sequence[Shape],
        *,
        fixed: Collection[int] = (),
        declared: bool = False,
        boards: Sequence[Patch] = (),
        workers: int | None = None,
    ) -> None:
        workers = cores() if workers is None else check_workers(workers)
        need("pybullet", "to settle scenes")
        self._shapes = shapes
        self._opened = ExitStack()
        if not declared:
            bodies = [prism_of(shape, fixed=which in fixed) for which, shape in enumerate(shapes)]
            bodies += [board_of(board, PRISM_TABLE_FRICTION) for board in boards]
            made = PybulletSetup(bodies, None, len(boards), PRISM_TABLE_FRICTION)
        else:
            names = [f"{which}" for which in range(len(shapes))]
            bodies = [whole_of(one) for one in bodies_of(names, shapes, {f"{which}" for which in fixed})]
            bodies += [board_of(board, sdf.TABLE_FRICTION) for board in boards]
            made = PybulletSetup(bodies, self._opened.enter_context(piece_files(bodies)), len(boards))
        self._pool: Pool[Floats, Floats] = Pool(
            DropJob(made), workers, what="a process that drops scenes", unit="round"
        )

    def __enter__(self) -> Settler:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        self._pool.close()
        self._opened.close()

    def settle(self, poses: Floats, heights: Floats | None = None, stop: Stop = NEVER) -> Displacements:
        """The motions of scenes (scenes, objects, 3); `heights` (scenes, objects) are what a spec declares of them, if
        it does. Raises ScenegenError if a process fails, and what `stop` raises;
        it is called after each round, and an exception ends all processes."""
        heights = base_heights(self._shapes, poses, solid=True, declared=heights)
        places = np.concatenate([flat(poses), heights[..., None]], axis=2)
        motions = np.empty((*poses.shape[:2], 2))
        rounds = [slice(start, start + ROUND_SCENES) for start in range(0, len(poses), ROUND_SCENES)]
        with closing(self._pool.map([places[part] for part in rounds])) as found:
            for part, motion in zip(rounds, found, strict=True):
                motions[part] = motion
                stop.check()
        return Displacements(motions[..., 0], motions[..., 1])


def worst_objects(names: Sequence[str], moved: npt.NDArray[Any]) -> str:
    """`` `mug` in 12, `plate` in 5 ``: the five objects that moved too far in the most scenes, and how many more did;
    empty if none did."""
    order = [int(k) for k in np.argsort(-moved, kind="stable") if moved[k]]
    more = f" and {len(order) - 5} more objects" if len(order) > 5 else ""
    return ", ".join(f"`{names[k]}` in {int(moved[k]):,}" for k in order[:5]) + more


@dataclass(frozen=True, slots=True)
class Refusals:
    """Of `scenes`, `refused` did not settle. `moved` has for each of `objects` the number of scenes in which it moved
    too far."""

    objects: tuple[str, ...]
    scenes: int
    refused: int
    moved: tuple[int, ...]

    def summary(self) -> str:
        """`17 of 64 scenes did not settle: mug moved in 12, plate in 5`; the worst five objects are named."""
        text = f"{self.refused:,} of {self.scenes:,} scenes did not settle"
        worst = worst_objects(self.objects, np.array(self.moved))
        return f"{text}: {worst.replace(' in ', ' moved in ', 1)}" if worst else text

    def diagnostic(self) -> Diagnostic | None:
        """A warning with the summary; None if every scene settled."""
        if not self.refused:
            return None
        return UNSETTLED(summary=self.summary(), often=True if self.refused * 2 > self.scenes else None)


MAX_PIECE_DROPS = 256  # about how many scenes of a piece are dropped: a few seconds of one core
MIN_CELL_DROPS = 2  # of each cell


@dataclass(slots=True)
class _Memory:
    """The state of a process: its settler, and the scenes that settled in each cell, by piece."""

    settler: Settler | None = None
    kept: dict[int, Index] = field(default_factory=dict)

    def __reduce__(self) -> tuple[type[_Memory], tuple[()]]:
        return _Memory, ()  # other processes begin with none


@dataclass(frozen=True, slots=True, eq=False)
class Settling(Selection):
    """`plan` without the scenes that do not settle; of motions the scene in which they begin is dropped.

    One process draws it and drops the scenes on all `workers` (drawing takes a thousandth of the time of dropping). A
    piece takes the first few candidates of every cell. Cells that earlier pieces have filled are skipped: the runner
    would not use their scenes. `stop` can interrupt a piece; it does not change the result. The facts of a piece are
    the numbers of scenes dropped and refused, then those in which each object moved too far, then the plan's own.
    """

    workers: int | None = None
    stop: Stop = NEVER
    _memory: _Memory = field(default_factory=_Memory, repr=False)

    shared_by: ClassVar[int] = 1

    @property
    def plan_digest(self) -> str:
        return digest("settling", self._at_once, self.plan.plan_digest)

    @property
    def fact_count(self) -> int:
        return 2 + len(self.problem.spec.objects) + self.plan.fact_count

    @property
    def scenes_per_piece(self) -> float:
        return min(self.plan.scenes_per_piece, self._at_once * len(self.reached_cells))

    @property
    def _at_once(self) -> int:
        """The number of scenes of a cell that a piece drops: 1.5 times the requested number, since some will not
        settle."""
        cells = len(self.reached_cells)
        return max(MIN_CELL_DROPS, min(math.ceil(1.5 * self.scenes_wanted / cells), MAX_PIECE_DROPS // cells))

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

    def draw(self, k: int) -> Piece:
        """Those of the first candidates of piece k in each cell that settle. Raises what `stop` raises."""
        found = self.plan.draw(k)
        full = self._full(k)
        first = [np.flatnonzero(found.cell == cell)[: self._at_once] for cell in self.reached_cells if cell not in full]
        taken = np.sort(np.concatenate([np.empty(0, dtype=np.intp), *first]))
        spec, rows = self.problem.spec, found.rows[:, taken]
        poses = as_poses(self.problem.scenes(rows))
        settled = self._settler().settle(poses, levels(spec, rows), self.stop)
        kept = taken[settled.stays]
        if self.scenes_wanted <= BLOCK:
            self._memory.kept[k] = np.bincount(found.cell[kept], minlength=max(self.reached_cells) + 1)
        counts = [len(taken), len(taken) - len(kept), *settled.moved.sum(axis=0)]
        facts = np.concatenate([np.array(counts, dtype=np.float64), found.facts])
        return Piece(found.rows[:, kept], found.phi[:, kept], found.cell[kept], facts)

    def _full(self, k: int) -> set[int]:
        """The cells that have their share from pieces before k, as far as this process drew them. None if not all
        scenes fit into the runner's memory at once: it then discards some, and takes others later."""
        before: Any = sum(kept for piece, kept in self._memory.kept.items() if piece < k)
        return set(
            np.flatnonzero(np.atleast_1d(before) >= math.ceil(self.scenes_wanted / len(self.reached_cells))).tolist()
        )

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


def select(plan: Plan, budget: Budget) -> Settling:
    """The plan without the scenes that do not settle, dropped on the workers of its request."""
    return Settling(plan.problem, plan, plan.problem.request.workers, budget, why=plan.why)
