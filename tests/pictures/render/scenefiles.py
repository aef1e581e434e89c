"""Scene files for the tests of this folder."""

import hashlib

from scenegen.scenes.data import (
    ObjectData,
    Pose,
    RequestData,
    SceneData,
    SceneFile,
    ShapeData,
    SpecRef,
    WorkspaceData,
    footprint_data,
)
from scenegen.things import shape_of


def shape_data(shape):
    return ShapeData(asset=shape.asset, footprint=footprint_data(shape.footprint), height=shape.height)


def scene_file(
    names, poses, x=(0.0, 1.0), y=(0.0, 1.0), phi=None, source="leftOf(mug, plate)\n", asked=None, shapes=(), regions=()
):
    """`poses`: for every scene, one (x, y, theta) per name. `shapes` are those of the first names."""
    looks = [*shapes, *map(shape_of, names[len(shapes) :])]
    return SceneFile(
        spec=SpecRef(source=source, sha256=hashlib.sha256(source.encode()).hexdigest()),
        workspace=WorkspaceData(x=x, y=y),
        objects=[ObjectData(name=name, shape=shape_data(look)) for name, look in zip(names, looks, strict=True)],
        regions=list(regions),
        sampler={"method": "rejection", "seed": 0},
        request=RequestData(phi=asked or {"task": (0.05, 0.2), "safe": (0.0, None)}, n=max(1, len(poses))),
        scenes=[
            SceneData(
                poses={name: Pose(x=x, y=y, theta=t) for name, (x, y, t) in zip(names, rows, strict=True)},
                phi=phi or {"task": 0.12, "safe": -0.31},
            )
            for rows in poses
        ],
    )
