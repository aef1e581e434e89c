"""Scenes in simulators, PyBullet and MuJoCo, on several processes.

The objects are those of files for simulators (`export.world`): convex pieces, mass, friction. They start where the
scene has them, on an infinite table with the spec's boards, under gravity. Fixed objects cannot be moved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.geometry.workspace import Floats, standing, turn_between
from scenegen.needs import need
from scenegen.processes.pool import Pool, check_workers
from scenegen.processes.process import cores
from scenegen.worlds.export import mjcf, sdf
from scenegen.worlds.export.world import World
from scenegen.worlds.physics.bodies import (
    BULLET_STEP,
    TABLE,
    TOUCH_GAP,
    Brick,
    Contact,
    InertialBody,
    board_of,
    contacts,
    piece_files,
    whole_of,
)

if TYPE_CHECKING:
    from scenegen.worlds.physics.bullet import PybulletWorld

# name -> its package. Names are those of packages, for which `needs` says how to install them.
SIMULATORS = ("mujoco", "pybullet")
SIMULATOR_TITLES = {"mujoco": "MuJoCo", "pybullet": "PyBullet"}
FINE_STEP = 1.0 / 960.0  # seconds: with pybullet's usual 240 steps a second, towers lean by up to 2 degrees
ROUND_SCENES = 8  # scenes given to a process at a time: up to two seconds of a core


@dataclass(frozen=True, slots=True, eq=False)
class RestResult:
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


class DropSimulator(Protocol):
    def rest(self, places: Floats, seconds: float) -> tuple[Floats, tuple[Contact, ...]]: ...


class MujocoWorld:
    """Drops scenes of one model: an infinite table, then the objects as bodies 1 to N (see `export.mjcf.bench`)."""

    def __init__(self, model: str) -> None:
        import mujoco  # here alone

        self._engine: Any = mujoco
        self._model = mujoco.MjModel.from_xml_string(model)
        self._data = mujoco.MjData(self._model)
        self._fixed = [body for body in range(1, self._model.nbody) if not self._model.body_jntnum[body]]
        self._joints = [
            (body - 1, self._model.jnt_qposadr[self._model.body_jntadr[body]])
            for body in range(1, self._model.nbody)
            if self._model.body_jntnum[body]
        ]

    def rest(self, places: Floats, seconds: float) -> tuple[Floats, tuple[Contact, ...]]:
        """Where the objects are after a time, (objects, 7): place and quaternion, w first; and what touched before.

        `places` (objects, 4) are x, y, theta and the height of what the object stands on; the time is rounded up to
        steps.
        """
        model, data = self._model, self._data
        poses = standing(places)
        self._engine.mj_resetData(model, data)
        for body in self._fixed:
            model.body_pos[body], model.body_quat[body] = poses[body - 1, :3], poses[body - 1, 3:]
        for which, start in self._joints:
            data.qpos[start : start + 7] = poses[which]
        contacts = self._contacts()
        self._engine.mj_step(model, data, math.ceil(seconds / model.opt.timestep - 1e-9))
        for which, start in self._joints:
            poses[which] = data.qpos[start : start + 7]
        return poses, contacts

    def _contacts(self) -> tuple[Contact, ...]:
        """What touches where the objects are. MuJoCo finds what is within its margin, which is 0 when it simulates."""
        model, data = self._model, self._data
        model.geom_margin[:] = TOUCH_GAP
        model.body_margin[:] = TOUCH_GAP
        self._engine.mj_kinematics(model, data)
        self._engine.mj_collision(model, data)
        model.geom_margin[:] = 0.0
        model.body_margin[:] = 0.0
        pairs = model.geom_bodyid[data.contact.geom].reshape(-1, 2) - 1  # the table is body 0
        assert TABLE == -1
        return contacts(
            (int(a), int(b), float(apart)) for (a, b), apart in zip(pairs, data.contact.dist.ravel(), strict=True)
        )


@dataclass(frozen=True, slots=True)
class MujocoSetup:
    """What a worker needs for MuJoCo: the model as XML."""

    model: str

    def world(self) -> DropSimulator:
        return MujocoWorld(self.model)


@dataclass(frozen=True, slots=True, eq=False)
class PybulletSetup:
    """What a worker needs for PyBullet: the bodies, of which the last are `boards`, and the files of their pieces (None
    where each body is its only piece); the table's friction, and the length of a step in seconds."""

    bodies: Sequence[InertialBody]
    files: Sequence[Sequence[str | Brick]] | None
    boards: int = 0
    friction: float = sdf.TABLE_FRICTION
    step: float = BULLET_STEP

    def world(self) -> PybulletWorld:
        from scenegen.worlds.physics.bullet import PybulletWorld

        return PybulletWorld(self.bodies, self.files, friction=self.friction, step=self.step, boards=self.boards)


class RestJob:
    """Scenes (m, N, 4): x, y, theta, z -> where they come to rest. The simulator is loaded with the first, in the
    worker."""

    def __init__(self, simulator: MujocoSetup | PybulletSetup, seconds: float) -> None:
        self._simulator, self._seconds = simulator, seconds
        self._world: DropSimulator | None = None

    def __call__(self, places: Floats) -> RestResult:
        if self._world is None:
            self._world = self._simulator.world()
        found = [self._world.rest(scene, self._seconds) for scene in places]
        poses = np.stack([one for one, _ in found])
        finite = np.isfinite(poses).all(axis=-1, keepdims=True)
        return RestResult(standing(places), np.where(finite, poses, np.nan), tuple(contacts for _, contacts in found))


class DropJob:
    """Scenes (m, N, 4): x, y, theta, height -> the motions (m, N, 2) that `PybulletWorld.drop` measures. pybullet is
    imported with the first scene, in the worker."""

    def __init__(self, simulator: PybulletSetup) -> None:
        self._simulator = simulator
        self._world: PybulletWorld | None = None  # of the process that drops

    def __call__(self, places: Floats) -> Floats:
        if self._world is None:
            self._world = self._simulator.world()
        return np.stack([self._world.drop(scene) for scene in places])


@contextmanager
def resting(
    world: World, simulator: str, seconds: float, workers: int | None = None
) -> Iterator[Callable[[Iterable[Floats]], Generator[RestResult, None, None]]]:
    """Lets rounds of scenes (m, N, 4) of a world's bodies, each x, y, theta, z, come to rest, in their order, on
    several processes, which start with the first scenes and run until the block ends. Results do not depend on their
    number.

    Raises RequestError for an unknown simulator, for one that is not installed, and for fewer than 1 worker,
    ScenegenError if a process fails.
    """
    check_simulator(simulator)
    workers = cores() if workers is None else check_workers(workers)
    with ExitStack() as opened:
        made: MujocoSetup | PybulletSetup
        if simulator == "mujoco":
            made = MujocoSetup(mjcf.bench(world).decode())
        else:
            bodies = [*map(whole_of, world.bodies), *(board_of(board, sdf.TABLE_FRICTION) for board in world.boards)]
            made = PybulletSetup(bodies, opened.enter_context(piece_files(bodies)), len(world.boards), step=FINE_STEP)
        what = "a process that simulates scenes"
        pool: Pool[Floats, RestResult] = Pool(RestJob(made, seconds), workers, what=what, unit="round")
        opened.callback(pool.close)
        yield pool.map


def check_simulator(name: str) -> None:
    """Raises RequestError for an unknown simulator, and for one that is not installed."""
    if name not in SIMULATORS:
        raise RequestError(UNKNOWN_CHOICE(what="simulator", name=str(name), known=SIMULATORS))
    need(name, f"to settle scenes in {SIMULATOR_TITLES[name]}")


def version_of(simulator: str) -> str:
    """The version that is installed."""
    return version(simulator)
