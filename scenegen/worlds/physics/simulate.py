"""Scenes in simulators that are running."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.scenes import Scene
from scenegen.errors import RequestError
from scenegen.errors.requests import NEEDED_HERE
from scenegen.needs import need
from scenegen.scenes.formats.lines import block_of
from scenegen.scenes.numbers import member_of
from scenegen.validation import as_path
from scenegen.worlds.export.setting import NOTHING, world_of


def load_pybullet(
    scene: Scene, client: Any = 0, *, table: bool = True, meshes: str | Path | None = None
) -> dict[str, int]:
    """Add a scene, such as `scenes[3]`, to a running PyBullet: objects with mass, inertia, friction and collision
    shapes, on a table unless `table` is false; no floor, no gravity, no camera.

        client = pybullet.connect(pybullet.DIRECT)
        bodies = scenegen.load_pybullet(scenes[3], client)
        where, turn = pybullet.getBasePositionAndOrientation(bodies["mug"], client)

    `client` is what `pybullet.connect` returned, or a BulletClient. Returns the number of each object's body. PyBullet
    speaks of a body's centre of mass: an object's own frame, in the middle of its footprint at its lowest point, lies
    by its local inertial position (`getDynamicsInfo(...)[3]`) below that. The table's top is z = 0.

    Raises RequestError where PyBullet is not installed or the client is not connected, DataError where an object stands
    beyond any table, and for files in `meshes` that cannot be used: the folder that the spec was in, from which objects
    with a mesh or URDF file then have convex pieces, mass and friction.
    """
    from scenegen.api.scenes import Scene

    need("pybullet", "for `load_pybullet()`")
    from scenegen.worlds.physics.load import load

    if not isinstance(scene, Scene):
        raise RequestError(NEEDED_HERE(what="one scene", value=repr(scene), remedy="pick one of a set: scenes[0]"))
    header = member_of(scene.header, scene.counts) if scene.header.counts else scene.header
    own = NOTHING
    if meshes is not None:
        from scenegen.worlds.export.world import own_bodies_of

        own = own_bodies_of(header, as_path("meshes", meshes))
    world = world_of(header, block_of([scene.data()], header, tuple(scene.phi)), own)
    if scene.rest is not None:
        world = replace(world, rest=scene.rest[None, ~np.isnan(scene.rest[:, 0])])
    return load(world, getattr(client, "_client", client), table=table)
