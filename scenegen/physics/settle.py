"""Which scenes settle: each is simulated on the table for one second, and its objects must stay at rest.

A scene settles if no object's centre of mass gets more than 1 cm from where it started and none turns by more than 5
degrees, about any axis, at any of the 30 moments of the second at which it is looked at. The objects start at rest on
what they stand on (see `assets.support`), on an infinite table, under gravity and friction, without bounce. They are
prisms of footprint x height where heights are read from poses; where a spec declares heights they have their own convex
pieces, since things then stand in others (see `bodies`). Fixed objects cannot be moved. The scenes keep their poses
from before the simulation, because phi was verified for them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.assets import Shape
from scenegen.assets.support import base_heights
from scenegen.bounds.effort import NEVER, Stop
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNSETTLED
from scenegen.export import sdf
from scenegen.export.setting import bodies_of
from scenegen.export.world import Patch
from scenegen.needs import need
from scenegen.physics.bodies import FRICTION, Body, Brick, board_of, piece_files, prism_of, whole_of
from scenegen.physics.motion import within
from scenegen.pose import flat
from scenegen.processes.pool import Pool
from scenegen.processes.process import cores

if TYPE_CHECKING:
    from scenegen.physics.drop import World

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ROUGH = math.sqrt(FRICTION)  # the table's friction where bodies are prisms
ROUND = 8  # scenes given to a process at a time: half a second of a full table


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """For every scene and object, (scenes, objects): how far it moved, in metres, and how far it turned, in degrees.

    If a scene does not settle, both are taken at the moment when the first of its objects had moved too far.
    """

    shift: Floats
    turn: Floats

    @property
    def moved(self) -> Mask:
        """(scenes, objects): which objects moved too far; NaN, from an unstable simulation, counts as well."""
        return np.asarray(~within(self.shift, self.turn))

    @property
    def kept(self) -> Mask:
        """(scenes,): which scenes settled."""
        return np.asarray(~self.moved.any(axis=1))


class Drop:
    """Scenes (scenes, objects, 4): x, y, theta, height -> the motions (scenes, objects, 2) that `drop.World` measures.
    pybullet is imported with the first scene, in the worker."""

    def __init__(
        self,
        bodies: Sequence[Body],
        files: Sequence[Sequence[str | Brick]] | None,
        friction: float,
        boards: int = 0,
    ) -> None:
        self.bodies, self.files, self.friction, self.boards = bodies, files, friction, boards
        self._world: World | None = None  # of the process that drops

    def __call__(self, places: Floats) -> Floats:
        if self._world is None:
            from scenegen.physics.drop import World

            self._world = World(self.bodies, self.files, friction=self.friction, boards=self.boards)
        return np.stack([self._world.drop(scene) for scene in places])


class Settler:
    """Drops scenes of the same objects on several processes, which start with the first scenes and run until `close`:
    use it as a context manager. Results do not depend on the number of processes, nor on which scenes are dropped
    together.

    `fixed` are the indices of the objects that cannot be moved. `declared`: a spec declares what things stand on, and
    `settle` gets their heights. `boards` are those of the spec. `workers` is by default one per core. Raises
    RequestError for fewer than 1, and if pybullet is not installed.
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
        if workers is not None and workers < 1:
            raise RequestError(OUT_OF_RANGE(argument="workers", value=workers, wanted="1 or more"))
        need("pybullet", "to settle scenes")
        self._shapes = shapes
        self._opened = ExitStack()
        if not declared:
            bodies = [prism_of(shape, fixed=which in fixed) for which, shape in enumerate(shapes)]
            bodies += [board_of(board, ROUGH) for board in boards]
            drop = Drop(bodies, None, ROUGH, len(boards))
        else:
            names = [f"{which}" for which in range(len(shapes))]
            bodies = [whole_of(one) for one in bodies_of(names, shapes, {f"{which}" for which in fixed})]
            bodies += [board_of(board, sdf.ROUGH) for board in boards]
            drop = Drop(bodies, self._opened.enter_context(piece_files(bodies)), sdf.ROUGH, len(boards))
        self._pool: Pool[Floats, Floats] = Pool(
            drop, workers or cores(), what="a process that drops scenes", unit="round"
        )

    def __enter__(self) -> Settler:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        self._pool.close()
        self._opened.close()

    def settle(self, poses: Floats, heights: Floats | None = None, stop: Stop = NEVER) -> Settled:
        """The motions of scenes (scenes, objects, 3); `heights` (scenes, objects) are what a spec declares of them, if
        it does. Raises ScenegenError if a process fails, and what `stop` raises;
        it is called after each round, and an exception ends all processes."""
        heights = base_heights(self._shapes, poses, solid=True, declared=heights)
        places = np.concatenate([flat(poses), heights[..., None]], axis=2)
        motions = np.empty((*poses.shape[:2], 2))
        rounds = [slice(start, start + ROUND) for start in range(0, len(poses), ROUND)]
        with closing(self._pool.map([places[part] for part in rounds])) as found:
            for part, motion in zip(rounds, found, strict=True):
                motions[part] = motion
                stop.check()
        return Settled(motions[..., 0], motions[..., 1])


def settle_scenes(
    shapes: Sequence[Shape],
    poses: Floats,
    *,
    fixed: Collection[int] = (),
    workers: int | None = None,
) -> Settled:
    """The motions of scenes (scenes, objects, 3) of objects of these shapes; see `Settler`."""
    with Settler(shapes, fixed=fixed, workers=workers) as settler:
        return settler.settle(poses)


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
        worst = [int(k) for k in np.argsort(-np.array(self.moved), kind="stable") if self.moved[k]]
        if not worst:
            return text
        shown = [f"`{self.objects[k]}` in {self.moved[k]:,}" for k in worst[:5]]
        first = shown[0].replace(" in ", " moved in ", 1)
        more = f" and {len(worst) - 5} more objects" if len(worst) > 5 else ""
        return f"{text}: {', '.join([first, *shown[1:]])}{more}"

    def diagnostic(self) -> Diagnostic | None:
        """A warning with the summary; None if every scene settled."""
        if not self.refused:
            return None
        return UNSETTLED(summary=self.summary(), often=True if self.refused * 2 > self.scenes else None)
