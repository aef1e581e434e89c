"""Scenes in PyBullet: how far objects move, and where they come to rest. Only this module and `painter` import it.

Every scene gets a new world. Moving the bodies of the last scene instead would save 2 ms, but its contacts and the
engine's order of pairs would affect the next scene: its last digits, and sometimes the verdict, would depend on the
scenes before it (measured: in another order none of 60 scenes gave the same result).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pybullet

from scenegen.errors import RequestError
from scenegen.errors.program import NOT_CONNECTED
from scenegen.things.urdf import URDF_ENDING
from scenegen.worlds.export import sdf
from scenegen.worlds.export.world import World
from scenegen.worlds.physics.bodies import BULLET_STEP, TABLE, Brick, Contact, InertialBody, Triple, contacts, is_still

Floats = npt.NDArray[np.float64]

CHECKS_PER_SECOND = 30  # calls a second, each of several steps; after each, `drop` looks where the objects are
GRAVITY = 9.81
HULL_MARGIN = 1e-5  # metres by which pybullet rounds off bodies. They start at rest on their margins. Falls, or wider
# margins, tip over objects that are a few millimetres high; with these, objects down to a millimetre stand.
UNTURNED = (0.0, 0.0, 0.0, 1.0)


class PybulletWorld:
    """Drops scenes of some bodies on an infinite table. Holds a connection to pybullet: use it as a context manager.

    `files` has of each body's pieces the STL file, or middle and sizes of a box, in its frame of inertia; without them
    each body is its only piece, by its corners. The last `boards` of the bodies are boards: parts of the table, at the
    origin in every scene. `friction` is that of the table, `step` the length of a step in seconds.
    """

    def __init__(
        self,
        bodies: Sequence[InertialBody],
        files: Sequence[Sequence[str | Brick]] | None = None,
        *,
        friction: float,
        step: float = BULLET_STEP,
        boards: int = 0,
    ) -> None:
        self._bodies, self._files, self._friction, self._boards = bodies, files, friction, boards
        self._steps = round(1.0 / CHECKS_PER_SECOND / step)
        self._step = step
        self._vertices = [body.corners.tolist() for body in bodies] if files is None else []
        self._client = pybullet.connect(pybullet.DIRECT)
        self._plane = TABLE  # its number

    def __enter__(self) -> PybulletWorld:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    def drop(self, places: Floats) -> Floats:
        """(objects, 2): how far each object got from where it started, in metres, and how far it turned, in degrees;
        the largest of each within one second.

        `places` (objects, 4) are x, y, theta and the height of what the object stands on. The simulation ends early
        when an object has moved too far: so the objects that moved first are reported, not those they would hit later.
        """
        numbers = self._set_up(places)
        before = [self._where(number) for number in numbers]
        moved = np.zeros((len(numbers), 2))
        for _ in range(CHECKS_PER_SECOND):
            pybullet.stepSimulation(physicsClientId=self._client)
            now = [self._where(number) for number in numbers]
            moved = np.maximum(moved, [_motion(a, b) for a, b in zip(before, now, strict=True)])
            if not is_still(*moved.T).all():
                break
        return moved

    def rest(self, places: Floats, seconds: float) -> tuple[Floats, tuple[Contact, ...]]:
        """Where the objects are after a time, (objects, 7): place and quaternion, w first; and what touched before.

        `places` as above; the time is rounded up to thirtieths of a second.
        """
        numbers = self._set_up(places)
        contacts = self._contacts(numbers)
        for _ in range(math.ceil(seconds * CHECKS_PER_SECOND - 1e-9)):
            pybullet.stepSimulation(physicsClientId=self._client)
        found = [self._frame(number, body) for number, body in zip(numbers, self._bodies, strict=False)]
        return np.array(found), contacts

    def _set_up(self, places: Floats) -> list[int]:
        """A world with the table and the objects in it; the numbers of the objects' bodies."""
        client = self._client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        # One call makes several steps: as many as fill the time between two looks, all of the same length.
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._steps * self._step,
            numSubSteps=self._steps,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        self._plane = self._add(plane, 0.0, self._friction)
        numbers = []
        everything = [*places.tolist(), *[[0.0] * 4] * self._boards]
        for which, (body, (x, y, theta, height)) in enumerate(zip(self._bodies, everything, strict=True)):
            cos, sin = math.cos(theta), math.sin(theta)
            u, v, w = body.center
            z = height + w + HULL_MARGIN
            half = (theta + body.turn) / 2.0
            at, turn = (x + cos * u - sin * v, y + sin * u + cos * v, z), (0.0, 0.0, math.sin(half), math.cos(half))
            made = self._robot(which, at, turn)
            form = self._form(which) if made is None else -1
            numbers.append(self._add(form, body.mass, body.friction, at, turn, body.inertia, made))
        return numbers[: len(places)]

    def _robot(self, which: int, at: Triple, turn: tuple[float, float, float, float]) -> int | None:
        """A body with more pieces than one call takes; None where it has fewer."""
        pieces = () if self._files is None else self._files[which]
        if len(pieces) != 1 or not isinstance(pieces[0], str) or not pieces[0].endswith(URDF_ENDING):
            return None
        number: int = pybullet.loadURDF(pieces[0], at, turn, physicsClientId=self._client)
        return number

    def _form(self, which: int) -> int:
        """The collision shape of a body."""
        if self._files is None:
            form: int = pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=self._vertices[which], physicsClientId=self._client
            )
            return form
        pieces = self._files[which]
        count = len(pieces)
        # As hulls, boxes push sideways what rests on their edges: a pot on a board crept by a millimetre a second.
        bricks = [([0.0] * 3, [2.0] * 3) if isinstance(piece, str) else piece for piece in pieces]
        hull, brick = pybullet.GEOM_MESH, pybullet.GEOM_BOX
        form = pybullet.createCollisionShapeArray(  # from files alone, where a body has several pieces
            shapeTypes=[hull if isinstance(piece, str) else brick for piece in pieces],
            fileNames=[piece if isinstance(piece, str) else "" for piece in pieces],
            halfExtents=[[size / 2.0 for size in sizes] for _, sizes in bricks],
            collisionFramePositions=[middle for middle, _ in bricks],
            meshScales=[[1.0, 1.0, 1.0]] * count,
            # what neither has a use for, but pybullet reads all the same
            radii=[0.0] * count,
            lengths=[0.0] * count,
            planeNormals=[[0.0, 0.0, 1.0]] * count,
            physicsClientId=self._client,
        )
        return int(form)

    def _add(
        self,
        form: int,
        mass: float,
        friction: float,
        at: Triple = (0.0, 0.0, 0.0),
        turn: tuple[float, float, float, float] = UNTURNED,
        inertia: Triple = (0.0, 0.0, 0.0),
        made: int | None = None,
    ) -> int:
        """A body of this form, or the one that is `made` already, at this place; its number."""
        # Of bodies in maximal coordinates pybullet sets the margin of a single piece alone.
        place = {"basePosition": at, "baseOrientation": turn, "useMaximalCoordinates": int(self._files is None)}
        client = self._client
        number: int = pybullet.createMultiBody(mass, form, **place, physicsClientId=client) if made is None else made
        pybullet.changeDynamics(
            number,
            -1,
            mass=mass,
            localInertiaDiagonal=inertia,
            lateralFriction=friction,
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            collisionMargin=HULL_MARGIN,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )
        return number

    def _contacts(self, numbers: Sequence[int]) -> tuple[Contact, ...]:
        """What touches where the objects are, by their clear distances: margins are not part of a body. Boxes have
        theirs inside, so the depths of these come out two margins too small at most."""
        client = self._client
        pybullet.performCollisionDetection(physicsClientId=client)
        which = {number: index for index, number in enumerate(numbers)}
        points = []
        for point in pybullet.getContactPoints(physicsClientId=client):
            rounded = HULL_MARGIN if self._plane in point[1:3] else 2.0 * HULL_MARGIN
            points.append((which.get(point[1], TABLE), which.get(point[2], TABLE), point[8] + rounded))
        return contacts(points)

    def _where(self, number: int) -> Where:
        found: Where = pybullet.getBasePositionAndOrientation(number, physicsClientId=self._client)
        return found

    def _frame(self, number: int, body: InertialBody) -> list[float]:
        """Place and quaternion (w first) of an object's own frame."""
        half = -body.turn / 2.0
        at, turn = self._where(number)
        _, turn = pybullet.multiplyTransforms(at, turn, (0.0, 0.0, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
        (x, y, z), _ = pybullet.multiplyTransforms(at, turn, [-value for value in body.center], UNTURNED)
        return [x, y, z, turn[3], *turn[:3]]


Where = tuple[tuple[float, float, float], tuple[float, float, float, float]]


def _motion(before: Where, now: Where) -> tuple[float, float]:
    """The distance of two places, in metres, and the angle of the one rotation between two attitudes, in degrees."""
    (ax, ay, az, aw), (bx, by, bz, bw) = before[1], now[1]
    # From sine and cosine of half the angle: the arc cosine alone would lose small angles.
    cos = abs(ax * bx + ay * by + az * bz + aw * bw)
    sin = math.hypot(
        aw * bx - ax * bw - ay * bz + az * by,
        aw * by + ax * bz - ay * bw - az * bx,
        aw * bz - ax * by + ay * bx - az * bw,
    )
    return math.dist(before[0], now[0]), math.degrees(2.0 * math.atan2(sin, cos))


# A world in a running PyBullet.
# PyBullet reads the SDF that Gazebo does, but takes neither inertia nor friction from it, and rounds bodies off by a
# millimetre: these are set afterwards. (It lets the rounding of convex pieces be set where these are STL files.)


def load(world: World, client: int, *, table: bool) -> dict[str, int]:
    """Add the first scene of a world; returns the number of each object's body, by name. With `table` the table is
    added too, with the smallest number. Raises RequestError if the client is not connected."""
    if not pybullet.isConnected(physicsClientId=client):
        raise RequestError(NOT_CONNECTED(client=client))
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "meshes").mkdir()
        for name, data in sdf.meshes(world, hulls="stl"):
            (Path(folder) / "meshes" / name).write_bytes(data)
        path = Path(folder) / "scene.sdf"
        path.write_bytes(sdf.bare(world, "meshes", table=table, hulls="stl"))
        numbers = list(pybullet.loadSDF(str(path), physicsClientId=client))
    if table:
        _settle(numbers.pop(0), sdf.TABLE_FRICTION, client)
    for number, body in zip(numbers, world.bodies, strict=True):
        _settle(number, body.friction, client)
        if not body.fixed:
            moments = np.diag(body.moments).tolist()  # its axes are the object's, or nearly so
            pybullet.changeDynamics(number, -1, localInertiaDiagonal=moments, physicsClientId=client)
    return {body.name: number for body, number in zip(world.bodies, numbers, strict=True)}


def _settle(number: int, friction: float, client: int) -> None:
    pybullet.changeDynamics(
        number, -1, lateralFriction=friction, restitution=0.0, collisionMargin=HULL_MARGIN, physicsClientId=client
    )
