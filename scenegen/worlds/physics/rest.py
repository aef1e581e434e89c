"""Where the objects of scenes come to rest, in PyBullet or MuJoCo, on several processes.

The objects are those of files for simulators (`export.world`): convex pieces, mass, friction. They start where the
scene has them, on an infinite table with the spec's boards, under gravity. Fixed objects cannot be moved.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Protocol

import numpy as np

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.geometry.attitude import Floats, standing, turn_between
from scenegen.needs import need
from scenegen.processes.pool import Pool, check_workers
from scenegen.processes.process import cores
from scenegen.worlds.export import mjcf, sdf
from scenegen.worlds.export.world import World
from scenegen.worlds.physics.bodies import Body, Brick, board_of, piece_files, whole_of

if TYPE_CHECKING:
    from scenegen.worlds.physics.bodies import Contact

# name -> its package. Names are those of packages, for which `needs` says how to install them.
SIMULATORS = ("mujoco", "pybullet")
TITLES = {"mujoco": "MuJoCo", "pybullet": "PyBullet"}
FINE = 1.0 / 960.0  # seconds: with pybullet's usual 240 steps a second, towers lean by up to 2 degrees
ROUND = 8  # scenes given to a process at a time: up to two seconds of a core


@dataclass(frozen=True, slots=True, eq=False)
class Rested:
    """Of m scenes of N objects: `planned` and `poses` (m, N, 7), place and quaternion (w first) before and after, and
    what touched before, by scene. A simulation that diverged leaves NaN."""

    planned: Floats
    poses: Floats
    contacts: tuple[tuple[Contact, ...], ...]

    @property
    def shift(self) -> Floats:
        """(m, N): how far each object's origin is from where it was planned, in metres."""
        return np.asarray(np.linalg.norm(self.poses[..., :3] - self.planned[..., :3], axis=-1))

    @property
    def turn(self) -> Floats:
        """(m, N): by how much each is turned against the plan, about any axis, in degrees."""
        return turn_between(self.planned[..., 3:], self.poses[..., 3:])


class Dropping(Protocol):
    def rest(self, places: Floats, seconds: float) -> tuple[Floats, tuple[Contact, ...]]: ...


@dataclass(frozen=True, slots=True)
class InMujoco:
    """What a worker needs for MuJoCo: the model as XML."""

    model: str

    def world(self) -> Dropping:
        from scenegen.worlds.physics.drop_mujoco import World

        return World(self.model)


@dataclass(frozen=True, slots=True, eq=False)
class InPybullet:
    """What a worker needs for PyBullet: the bodies, and the files of their pieces."""

    bodies: Sequence[Body]
    files: Sequence[Sequence[str | Brick]]
    boards: int

    def world(self) -> Dropping:
        from scenegen.worlds.physics.drop import World

        return World(self.bodies, self.files, friction=sdf.ROUGH, step=FINE, boards=self.boards)


class Rest:
    """Scenes (m, N, 4): x, y, theta, z -> where they come to rest. The simulator is loaded with the first, in the
    worker."""

    def __init__(self, simulator: InMujoco | InPybullet, seconds: float) -> None:
        self._simulator, self._seconds = simulator, seconds
        self._world: Dropping | None = None

    def __call__(self, places: Floats) -> Rested:
        if self._world is None:
            self._world = self._simulator.world()
        found = [self._world.rest(scene, self._seconds) for scene in places]
        poses = np.stack([one for one, _ in found])
        finite = np.isfinite(poses).all(axis=-1, keepdims=True)
        return Rested(standing(places), np.where(finite, poses, np.nan), tuple(contacts for _, contacts in found))


class Resting:
    """Lets scenes of a world's bodies come to rest on several processes, which start with the first scenes and run
    until `close`: use it as a context manager. Results do not depend on the number of processes.

    Raises RequestError for an unknown simulator, for one that is not installed, and for fewer than 1 worker.
    """

    def __init__(self, world: World, simulator: str, seconds: float, workers: int | None = None) -> None:
        check_simulator(simulator)
        workers = cores() if workers is None else check_workers(workers)
        self._opened = ExitStack()
        made: InMujoco | InPybullet
        if simulator == "mujoco":
            made = InMujoco(mjcf.bench(world).decode())
        else:
            bodies = [*map(whole_of, world.bodies), *(board_of(board, sdf.ROUGH) for board in world.boards)]
            files = self._opened.enter_context(piece_files(bodies))
            made = InPybullet(bodies, files, len(world.boards))
        self._pool: Pool[Floats, Rested] = Pool(
            Rest(made, seconds), workers, what="a process that simulates scenes", unit="round"
        )

    def __enter__(self) -> Resting:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        self._pool.close()
        self._opened.close()

    def rest(self, rounds: Iterable[Floats]) -> Generator[Rested, None, None]:
        """What becomes of rounds of scenes (m, N, 4), each x, y, theta, z; in their order. Raises ScenegenError if a
        process fails."""
        return self._pool.map(rounds)


def check_simulator(name: str) -> None:
    """Raises RequestError for an unknown simulator, and for one that is not installed."""
    if name not in SIMULATORS:
        raise RequestError(UNKNOWN_CHOICE(what="simulator", name=str(name), known=SIMULATORS))
    need(name, f"to settle scenes in {TITLES[name]}")


def version_of(simulator: str) -> str:
    """The version that is installed."""
    return version(simulator)
