"""One simulated second of a scene in pybullet: how far its objects move. It, `painter` and `load` import pybullet.

The world is made anew for every scene. Moving the bodies of the last scene instead would save 2 ms, but its contacts
and the engine's order of pairs would live on in the next one, whose last digits, and with them now and then the
verdict, would depend on what came before (measured: not one of 60 scenes came out the same in another order).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pybullet

from scenegen.render.bodies import Body
from scenegen.render.motion import within

Floats = npt.NDArray[np.float64]

STEP = 1.0 / 240.0  # seconds
LOOKS, BETWEEN = 30, 8  # times that the second is stopped to look, and steps in between
GRAVITY = 9.81
FRICTION = 0.5  # between any two things; pybullet multiplies those of the two
MARGIN = 1e-5  # metres by which pybullet rounds off bodies. So they start: on their margins, at rest. Falls, or wider
# margins, tip over what is a few millimetres high; like this, things down to a millimetre stand.


class World:
    """Drops scenes of some bodies on an endless table. Holds a connection to pybullet: use it as a context manager."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        self._bodies = bodies
        self._vertices = [
            [(x, y, z) for z in (-body.height / 2.0, body.height / 2.0) for x, y in body.outline] for body in bodies
        ]
        self._client = pybullet.connect(pybullet.DIRECT)

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    def drop(self, places: Floats) -> Floats:
        """(objects, 2): how far each object got from where it started, in metres, and how far it turned, in degrees;
        the largest of each within the second.

        `places` (objects, 4) are x, y, theta and the height of what the object stands on. The second ends early when
        an object has moved too far: then those are to blame that have done so by then, not those they would hit later.
        """
        numbers = self._set_up(places)
        before = [self._where(number) for number in numbers]
        moved = np.zeros((len(numbers), 2))
        for _ in range(LOOKS):
            pybullet.stepSimulation(physicsClientId=self._client)
            now = [self._where(number) for number in numbers]
            moved = np.maximum(moved, [_motion(a, b) for a, b in zip(before, now, strict=True)])
            if not within(*moved.T).all():
                break
        return moved

    def _set_up(self, places: Floats) -> list[int]:
        """A world with the table and the objects in it; the numbers of the objects' bodies."""
        client = self._client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        # One call makes several steps; eight of them, so that the length of each is exact.
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=BETWEEN * STEP, numSubSteps=BETWEEN, deterministicOverlappingPairs=1, physicsClientId=client
        )
        self._add(pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client), 0.0)
        numbers = []
        for body, vertices, (x, y, theta, height) in zip(self._bodies, self._vertices, places.tolist(), strict=True):
            cos, sin = math.cos(theta), math.sin(theta)
            u, v = body.center
            z = height + body.height / 2.0 + MARGIN
            half = (theta + body.turn) / 2.0
            form = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=vertices, physicsClientId=client)
            at, turn = (x + cos * u - sin * v, y + sin * u + cos * v, z), (0.0, 0.0, math.sin(half), math.cos(half))
            numbers.append(self._add(form, body.mass, at, turn, body.inertia))
        return numbers

    def _add(
        self,
        form: int,
        mass: float,
        at: tuple[float, float, float] = (0.0, 0.0, 0.0),
        turn: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0),
        inertia: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> int:
        number: int = pybullet.createMultiBody(
            mass, form, basePosition=at, baseOrientation=turn, useMaximalCoordinates=1, physicsClientId=self._client
        )
        pybullet.changeDynamics(
            number,
            -1,
            mass=mass,
            localInertiaDiagonal=inertia,
            lateralFriction=math.sqrt(FRICTION),
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            collisionMargin=MARGIN,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )
        return number

    def _where(self, number: int) -> Where:
        found: Where = pybullet.getBasePositionAndOrientation(number, physicsClientId=self._client)
        return found


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
