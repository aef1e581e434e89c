"""The bodies of a scene file's objects that are from files of one's own, read again from these files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from scenegen.assets.meshfile import MeshError
from scenegen.assets.own_body import OwnBody, mesh_body, robot_body
from scenegen.assets.surface import check_texture
from scenegen.assets.urdf_tree import UrdfError
from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_BODY
from scenegen.scene.data import SceneFile, ShapeData
from scenegen.scene.own_files import is_read, own_file, reason_of


def own_bodies_of(file: SceneFile, folder: Path, *, painted: bool = False) -> dict[str, OwnBody]:
    """By the objects' names, in the objects' frames (z = 0 the lowest point of the outline): the bodies of those whose
    shape is `mesh` or `asset` of a glTF, .obj, .stl or URDF file, or `urdf`. `folder` is where the spec lay; a file
    outside it is not read. With `painted`, they have what is drawn, with colours and textures, too. Objects from other
    mesh files have none, and collide as their outline.

    Raises DataError where a file cannot be read or cut into convex pieces, where it has another outline than the scenes
    were made with, and where no object has such a file, RequestError where CoACD is needed and not installed.
    """
    known: dict[str, OwnBody | None] = {}
    bodies: dict[str, OwnBody] = {}
    for item in file.objects:
        key = item.shape.model_dump_json()
        try:
            if key not in known:
                known[key] = _body(folder, item.shape, painted) if is_read(item.shape, folder) else None
        except (MeshError, UrdfError) as error:
            raise DataError(UNUSABLE_BODY(path=item.shape.path, name=item.name, reason=reason_of(error))) from None
        body = known[key]
        if body is not None:
            bodies[item.name] = body
    if not bodies:
        raise DataError(NO_MODEL())
    return bodies


def _body(folder: Path, shape: ShapeData, painted: bool) -> OwnBody:
    file = own_file(folder, shape)
    if file.is_robot:
        made = robot_body(file.data, file.beside, painted=painted).turned(file.matrix)
    else:
        made = mesh_body(file.path, file.data, file.beside, file.matrix, painted=painted)
    for texture in {one.texture for one in made.skins if one.texture} if painted else ():
        check_texture(texture, "a texture of it")
    mass = made.mass if file.mass is None else file.mass
    friction = made.friction if file.friction is None else file.friction
    return replace(made, mass=mass, friction=friction).moved(file.offset)
