"""The meshes of a scene file's objects, read again from their files, to be drawn as they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_MODEL
from scenegen.scenes.data import SceneFile, ShapeData
from scenegen.scenes.own_files import is_read, own_file, reason_of
from scenegen.things.meshfile import ColoredMesh, check_texture, mesh_surfaces
from scenegen.things.outline import MeshError
from scenegen.things.urdf import robot_surfaces

Model = tuple[ColoredMesh, ...]


def still_outlines(file: SceneFile, folder: Path) -> tuple[str, ...]:
    """The names of objects from files that are not drawn as they are, of scenes that `models_of` has read."""
    return tuple(one.name for one in file.objects if one.shape.path and not is_read(one.shape, folder))


def models_of(file: SceneFile, folder: Path) -> tuple[Model | None, ...]:
    """The surfaces of every object whose shape is `mesh` or `asset` of a glTF, .obj, .stl or URDF file, or `urdf`, in
    the object's frame (z = 0 the lowest point of its outline); None for other objects. `folder` is where the spec lay;
    a file outside it is not read.

    Raises DataError where a file cannot be read or drawn, where it has another outline than the scenes were made
    with, and where no object has such a file.
    """
    known: dict[str, Model | None] = {}
    models: list[Model | None] = []
    for item in file.objects:
        key = item.shape.model_dump_json()
        try:
            if key not in known:
                known[key] = _model(folder, item.shape) if is_read(item.shape, folder) else None
        except MeshError as error:
            raise DataError(UNUSABLE_MODEL(path=item.shape.path, name=item.name, reason=reason_of(error))) from None
        models.append(known[key])
    if not any(models):
        raise DataError(NO_MODEL())
    return tuple(models)


def _model(folder: Path, shape: ShapeData) -> Model:
    file = own_file(folder, shape)
    made = robot_surfaces(file.data, file.beside) if file.is_robot else mesh_surfaces(file.path, file.data, file.beside)
    for texture in {one.texture for one in made if one.texture}:
        check_texture(texture, "a texture of it")
    return tuple(replace(one, vertices=one.vertices @ file.matrix.T + file.offset) for one in made)
