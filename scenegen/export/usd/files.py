"""Scenes as USD (https://openusd.org), with the physics of UsdPhysics.

A scene's file has `/Scene`, its default prim, with the table and every object, a rigid body of its own frame: in the
middle of its footprint at its lowest point. Objects refer to `meshes/NAME.usda`, where each form is once, with mass,
contacts, meshes that are drawn and convex pieces that collide; a scene adds places and colours. Objects that are held
in place are colliders without a body. What a user who refers to the scene has already is outside of the default prim,
in `/Environment`: gravity, lights, cameras and a floor.

Files of a scene each are text, to be read and compared. A file with all scenes has each as a variant of the set
`scene`: time samples would make rigid bodies follow an animation.
"""

from __future__ import annotations

from collections.abc import Iterator

from scenegen.export.usd.form import body_file, picture
from scenegen.export.usd.scene import Scene
from scenegen.export.world import World
from scenegen.export.xml import check_room

ENDING = ".usda"
KEY, KEY_EACH = 3_000, 1_500  # bytes of memory for a variant, and for each object in it
SET = "scene"


def meshes(world: World) -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    named = set[str]()
    for body in world.bodies:
        if body.form.name not in named:
            named.add(body.form.name)
            yield f"{body.form.name}{ENDING}", body_file(body)
            for number, paint in body.form.paints.items():
                yield picture(body.form, number), paint.png


def files(world: World, folder: str, *, together: bool) -> Iterator[bytes]:
    """The scenes as one file with a variant for each, or as a file each. `folder` is the path of the meshes from
    there. Raises RequestError for too many scenes in one file."""
    if together:
        check_room(len(world.poses), KEY + KEY_EACH * len(world.bodies))
    if world.dressing is not None:
        for index, number in enumerate(world.scenes):
            yield Scene(world, folder, ENDING, world.dressing.of(number, world.table)).one(index)
        return
    scene = Scene(world, folder, ENDING)
    if together:
        yield scene.all_in_one(SET)
        return
    for index in range(len(world.poses)):
        yield scene.one(index)
