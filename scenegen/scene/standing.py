"""How high the objects of scene files stand, where files say so."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.files import OTHER_SURFACE
from scenegen.scene.data import RAISED, ObjectData, Pose, RestingPose, SceneData, SceneFile, carried_first

Floats = npt.NDArray[np.float64]


def varying(header: SceneFile) -> bool:
    """Whether some object stands higher in one scene than in another."""
    return any(one.support is not None and one.support.z is None for one in header.objects)


def heights_of(header: SceneFile, on: Floats) -> Floats | None:
    """How high above the table each object's lowest point is, in metres: (N,), or (n, N) where that is not the same in
    every scene; None where heights follow from the poses. `on` (n, M) says for each of the file's choosers on which of
    its surfaces it stands, counted from 1, and NaN of one that is not there."""
    if header.version != RAISED:
        return None
    supports = [one.support for one in header.objects]
    known = np.array([0.0 if one is None or one.z is None else one.z for one in supports])
    order = carried_first(header.objects)
    if not order:
        return known
    place = {one.name: number for number, one in enumerate(header.objects)}
    column = {one.name: number for number, one in enumerate(header.choosers)}
    found = np.tile(known, (len(on), 1))
    for which in order:
        name, support = header.objects[which].name, supports[which]
        assert support is not None
        levels = np.stack(
            [one.rise + (found[:, place[one.carrier]] if one.carrier else np.zeros(len(on))) for one in support.any]
        )
        chosen = (
            np.nan_to_num(on[:, column[name]], nan=1.0).astype(np.intp) - 1
            if name in column
            else np.zeros(len(on), dtype=np.intp)
        )
        found[:, which] = levels[chosen, np.arange(len(on))]
    return found


def chosen_surface(scene: str, chooser: ObjectData, pose: Pose) -> float:
    """On which of its surfaces an object stands, counted from 1. Raises DataError."""
    assert chooser.support is not None
    names = [one.on for one in chooser.support.any]
    found = pose.on if isinstance(pose, RestingPose) else ""
    if found not in names:
        raise DataError(OTHER_SURFACE(scene=scene, name=chooser.name, surface=found, known=names))
    return 1.0 + names.index(found)


def chosen_surfaces(header: SceneFile, scenes: list[SceneData]) -> Floats:
    """(n, M): on which of its surfaces each chooser stands, counted from 1. Raises DataError."""
    choosers = header.choosers
    found = [
        [
            chosen_surface(f"scene {number}", one, scene.poses[one.name]) if one.name in scene.poses else np.nan
            for one in choosers
        ]
        for number, scene in enumerate(scenes, 1)
    ]
    return np.array(found, dtype=np.float64).reshape(len(scenes), len(choosers))


def pose_of(chooser: ObjectData | None, pose: tuple[float, float, float], on: float = 0.0) -> Pose:
    """The pose of an object, with the name of the surface that it stands on where that is one of several."""
    x, y, theta = pose
    if chooser is None:
        return Pose(x=x, y=y, theta=theta)
    assert chooser.support is not None
    return RestingPose(x=x, y=y, theta=theta, on=chooser.support.any[int(on) - 1].on)
