"""A world in a running PyBullet. It, `painter` and `drop` are the only modules that import pybullet.

PyBullet reads the SDF that Gazebo does, but takes neither inertia nor friction from it, and rounds bodies off by a
millimetre: these are set afterwards. (It lets the rounding of convex pieces be set where these are STL files.)
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pybullet

from scenegen.errors import RequestError
from scenegen.errors.program import NOT_CONNECTED
from scenegen.worlds.export import sdf
from scenegen.worlds.export.world import World

MARGIN = 1e-5  # metres by which bodies are rounded off


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
        _settle(numbers.pop(0), sdf.ROUGH, client)
    for number, body in zip(numbers, world.bodies, strict=True):
        _settle(number, body.friction, client)
        if not body.fixed:
            moments = np.diag(body.moments).tolist()  # its axes are the object's, or nearly so
            pybullet.changeDynamics(number, -1, localInertiaDiagonal=moments, physicsClientId=client)
    return {body.name: number for body, number in zip(world.bodies, numbers, strict=True)}


def _settle(number: int, friction: float, client: int) -> None:
    pybullet.changeDynamics(
        number, -1, lateralFriction=friction, restitution=0.0, collisionMargin=MARGIN, physicsClientId=client
    )
