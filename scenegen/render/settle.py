"""Which scenes stay as they are: each is dropped on the table for one simulated second, and its objects must rest.

A scene settles if no object's centre of mass gets more than 1 cm from where it started and none turns by more than 5
degrees, about any axis, at any of the 30 moments of the second at which it is looked at. The objects are prisms of
footprint x height (see `bodies`) that start at rest on what they stand on (see `assets.support`), on an endless table,
under gravity and friction, without bounce. Fixed objects cannot be moved. The poses that are judged are handed out
unchanged, not those after the second: phi was verified for them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.assets import Shape
from scenegen.assets.support import base_heights
from scenegen.errors import Diagnostic, RequestError
from scenegen.formats.blocks import Block
from scenegen.needs import need
from scenegen.render.bodies import body_of
from scenegen.render.dropper import COUNT
from scenegen.render.motion import within
from scenegen.render.process import Process, cores

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ROUND = 32  # scenes given to a process at a time


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """Of every scene and object, (scenes, objects): how far it got, in metres, and how far it turned, in degrees.

    Where a scene does not settle, both are those of the moment at which the first of its objects had moved too far.
    """

    shift: Floats
    turn: Floats

    @property
    def moved(self) -> Mask:
        """(scenes, objects): which objects moved too far; those of a scene that blew up, with NaN, count as well."""
        return np.asarray(~within(self.shift, self.turn))

    @property
    def kept(self) -> Mask:
        """(scenes,): which scenes settled."""
        return np.asarray(~self.moved.any(axis=1))


class Settler:
    """Drops scenes of the same objects on several processes, which start at the first scenes and run until `close`:
    use it as a context manager. What comes out does not depend on their number, nor on which scenes come together.

    `fixed` are the indices of the objects that cannot be moved. `workers` is by default one per core. Raises
    RequestError for fewer than 1, and where pybullet is not installed.
    """

    def __init__(self, shapes: Sequence[Shape], *, fixed: Collection[int] = (), workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise RequestError(Diagnostic(f"{workers} workers cannot drop scenes", help="ask for 1 or more"))
        need("pybullet", "to settle scenes")
        self._shapes = shapes
        bodies = [body_of(shape, fixed=number in fixed) for number, shape in enumerate(shapes)]
        self._job = {"bodies": [dataclasses.asdict(body) for body in bodies]}
        self._workers = workers or cores()
        self._crew: list[Process] = []

    def __enter__(self) -> Settler:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        while self._crew:
            self._crew.pop().end()

    def settle(self, poses: Floats) -> Settled:
        """What becomes of scenes (scenes, objects, 3). Raises ScenegenError where a process fails."""
        places = np.concatenate([poses, base_heights(self._shapes, poses, solid=True)[..., None]], axis=2)
        motions = np.empty((*poses.shape[:2], 2))
        wanted = max(1, min(self._workers, len(poses)))
        while len(self._crew) < wanted and len(poses):
            self._crew.append(Process("scenegen.render.dropper", self._job, "drops scenes", "fewer workers"))
        for start in range(0, len(poses), ROUND * wanted):
            stop = min(start + ROUND * wanted, len(poses))
            # Every one of them reads all of its request before it answers, so nobody waits for anybody in a circle.
            shares = [slice(start + number, stop, wanted) for number in range(wanted)]
            for worker, share in zip(self._crew, shares, strict=False):
                part = places[share]
                worker.send(COUNT.pack(len(part)) + part.tobytes())
            for worker, share in zip(self._crew, shares, strict=False):
                part = motions[share]
                part[:] = np.frombuffer(worker.read(part.size * 8)).reshape(part.shape)
        return Settled(motions[..., 0], motions[..., 1])


def settle_scenes(
    shapes: Sequence[Shape], poses: Floats, *, fixed: Collection[int] = (), workers: int | None = None
) -> Settled:
    """What becomes of scenes (scenes, objects, 3) of objects of these shapes; see `Settler`."""
    with Settler(shapes, fixed=fixed, workers=workers) as settler:
        return settler.settle(poses)


class Refusals:
    """How many scenes did not settle, and which objects were to blame. `moved` has a count of scenes per object."""

    def __init__(self, objects: Sequence[str]) -> None:
        self.objects = tuple(objects)
        self.scenes = self.refused = 0
        self.moved = np.zeros(len(self.objects), dtype=np.intp)

    def add(self, found: Settled) -> None:
        self.scenes += len(found.kept)
        self.refused += int((~found.kept).sum())
        self.moved += found.moved.sum(axis=0)

    def summary(self) -> str:
        """`17 of 64 scenes did not settle: mug moved in 12, plate in 5`; the worst five objects are named."""
        text = f"{self.refused:,} of {self.scenes:,} scenes did not settle"
        worst = [int(k) for k in np.argsort(-self.moved, kind="stable") if self.moved[k]]
        if not worst:
            return text
        shown = [f"`{self.objects[k]}` in {self.moved[k]:,}" for k in worst[:5]]
        first = shown[0].replace(" in ", " moved in ", 1)
        more = f" and {len(worst) - 5} more objects" if len(worst) > 5 else ""
        return f"{text}: {', '.join([first, *shown[1:]])}{more}"

    def diagnostic(self) -> Diagnostic | None:
        """A warning with the summary; None where every scene settled."""
        if not self.refused:
            return None
        hint = "objects that overlap push each other away: `require noOverlap()` leaves such scenes out from the start"
        return Diagnostic(self.summary(), help=hint if self.refused * 2 > self.scenes else "", severity="warning")


def settled_blocks(blocks: Iterable[Block], settler: Settler, refusals: Refusals) -> Iterator[Block]:
    """The scenes of each block that settle, in their order; blocks of which none does are left out."""
    for block in blocks:
        found = settler.settle(block.rows.T.reshape(block.count, -1, 3))
        refusals.add(found)
        kept = np.flatnonzero(found.kept)
        if len(kept):
            yield Block(block.rows[:, kept], block.phi[:, kept])
