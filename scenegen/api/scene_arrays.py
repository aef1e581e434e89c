"""Scenes of one spec as arrays: what is done with sets of scenes is done with these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen import given
from scenegen.assets import Shape
from scenegen.data.arrange import arranged, check_held, order_of
from scenegen.errors import Diagnostic
from scenegen.formats import table
from scenegen.formats.blocks import BLOCK, Block
from scenegen.lang.spec import CheckedSpec
from scenegen.scene.data import (
    ObjectData,
    Pose,
    RegionData,
    RequestData,
    SceneData,
    SceneFile,
    ShapeData,
    SpecRef,
    WorkspaceData,
    footprint_data,
)
from scenegen.scene.workspace import turned

Array = npt.NDArray[np.float64]

NAMED = 10  # objects that a set names when it speaks of itself


@dataclass(frozen=True, slots=True, eq=False)
class SceneArrays:
    """Scenes of one spec.

    `poses` is (n, N, 3): x and y in metres, theta in radians, objects in the order of `objects`. `phi` maps each label
    to (n,) values in float64. `header` is the scene file without its scenes.
    """

    poses: Array
    phi: Mapping[str, Array]
    header: SceneFile
    warnings: tuple[Diagnostic, ...] = field(default=())

    def __len__(self) -> int:
        return int(self.poses.shape[0])

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    def names(self) -> str:
        """The first objects in words."""
        more = len(self.objects) - NAMED
        return ", ".join(self.objects[:NAMED]) + (f" and {more} more" if more > 0 else "")

    def places(self, index: int) -> tuple[dict[str, Pose], dict[str, float]]:
        """The poses of one scene by object, and its phi by label. Raises IndexError."""
        poses = {
            name: Pose(x=float(x), y=float(y), theta=float(theta))
            for name, (x, y, theta) in zip(self.objects, self.poses[index], strict=True)
        }
        return poses, {name: float(values[index]) for name, values in self.phi.items()}

    def file(self) -> SceneFile:
        """The scene file: validated data, ready to be written."""
        if not len(self):
            return self.header.without_scenes(tuple(self.phi))
        scenes = [SceneData(poses=poses, phi=phi) for poses, phi in map(self.places, range(len(self)))]
        return self.header.model_copy(update={"scenes": scenes})

    def save(self, path: str | Path) -> Path:
        """Write the scenes, as .json, .jsonl or .parquet by the path's ending; the file appears whole or not at all."""
        path = given.path("path", path)
        table.write_scenes(path, self.header, tuple(self.phi), self.blocks())
        return path

    def blocks(self) -> Iterator[Block]:
        """The scenes as file formats take them."""
        for start in range(0, len(self), BLOCK):
            part = slice(start, start + BLOCK)
            rows = self.poses[part].reshape(-1, 3 * len(self.objects)).T
            phi = np.array([values[part] for values in self.phi.values()]).reshape(len(self.phi), rows.shape[1])
            yield Block(rows, phi)


def make_header(spec: CheckedSpec, sampler: Mapping[str, object], request: RequestData) -> SceneFile:
    """A scene file without scenes."""
    return SceneFile(
        spec=SpecRef(source=spec.source, sha256=spec.sha256, title=spec.title),
        workspace=WorkspaceData(x=spec.workspace.x, y=spec.workspace.y),
        objects=[
            ObjectData(name=name, shape=_shape_data(shape))
            for name, shape in zip(spec.objects, spec.shapes, strict=True)
        ],
        regions=[
            RegionData(
                name=region.name,
                footprint=footprint_data(region.footprint),
                pose=Pose(x=region.pose[0], y=region.pose[1], theta=region.pose[2]),
            )
            for region in spec.regions
        ],
        sampler=dict(sampler),
        request=request,
        scenes=[],
    )


def _shape_data(shape: Shape) -> ShapeData:
    return ShapeData(asset=shape.asset, footprint=footprint_data(shape.footprint), height=shape.height, path=shape.path)


def rows_of(spec: CheckedSpec, scenes: SceneArrays) -> Array:
    """The poses as (3N, n) storage in the spec's order of objects, headings in [0, 2 pi).

    Raises DataError for scenes of other objects, and where an object that the spec holds in place stands elsewhere.
    """
    stored = scenes.poses.reshape(len(scenes), 3 * len(scenes.objects)).T
    rows = turned(arranged(stored, order_of(spec, scenes.objects)))
    check_held(spec, rows)
    return rows
