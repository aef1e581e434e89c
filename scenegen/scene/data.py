"""The scene file, as pydantic models: the one border that scene data crosses on its way in or out.

Format `scenegen/scenes`, version 1. The JSON Schema of `SceneFile` ships in docs/ and a golden test holds it still.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from scenegen.primitives import Box, Circle, Footprint, Polygon
from scenegen.primitives.hull import is_convex, signed_area

FORMAT: Literal["scenegen/scenes"] = "scenegen/scenes"
VERSION: Literal[1] = 1

Bounds = tuple[FiniteFloat, FiniteFloat]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Pose(_Strict):
    """Where an object stands: its centre in metres, its heading in radians, counter-clockwise from the x axis."""

    x: FiniteFloat
    y: FiniteFloat
    theta: FiniteFloat


class SceneData(_Strict):
    """One scene: a pose for each object, and the satisfaction value phi of each label in float64."""

    poses: dict[str, Pose]
    phi: dict[str, FiniteFloat]


class CircleFootprint(_Strict):
    kind: Literal["circle"] = "circle"
    radius: Annotated[FiniteFloat, Field(gt=0)]


class BoxFootprint(_Strict):
    """`length` along the object's heading, `width` across it, in metres."""

    kind: Literal["box"] = "box"
    length: Annotated[FiniteFloat, Field(gt=0)]
    width: Annotated[FiniteFloat, Field(gt=0)]


class PolygonFootprint(_Strict):
    """A convex polygon: corners (x, y) in metres in the object's frame, counter-clockwise, x along its heading."""

    kind: Literal["polygon"] = "polygon"
    vertices: Annotated[list[tuple[FiniteFloat, FiniteFloat]], Field(min_length=3)]

    @model_validator(mode="after")
    def _convex(self) -> Self:
        if not is_convex(self.vertices) or signed_area(self.vertices) <= 0.0:
            raise ValueError("the corners are not those of a convex polygon, counter-clockwise")
        return self


FootprintData = Annotated[CircleFootprint | BoxFootprint | PolygonFootprint, Field(discriminator="kind")]


class ShapeData(_Strict):
    """What an object looks like: footprint and height in metres, and an entry of the asset library, or one of `box`,
    `cylinder`, `prism`, `urdf` and `mesh`; `path` is the file of the last two as the spec names it."""

    asset: str
    footprint: FootprintData
    height: Annotated[FiniteFloat, Field(gt=0)]
    path: str = ""


class RegionData(_Strict):
    """A named part of the table at a fixed place."""

    name: str
    footprint: FootprintData
    pose: Pose


def footprint_data(footprint: Footprint) -> CircleFootprint | BoxFootprint | PolygonFootprint:
    """A footprint as scene files hold it."""
    match footprint:
        case Circle(radius):
            return CircleFootprint(radius=radius)
        case Box(length, width):
            return BoxFootprint(length=length, width=width)
        case Polygon(vertices):
            return PolygonFootprint(vertices=list(vertices))


def footprint_of(data: CircleFootprint | BoxFootprint | PolygonFootprint) -> Footprint:
    """The footprint that a scene file holds."""
    match data:
        case CircleFootprint():
            return Circle(data.radius)
        case BoxFootprint():
            return Box(data.length, data.width)
        case PolygonFootprint():
            return Polygon(tuple(data.vertices))


class ObjectData(_Strict):
    name: str
    shape: ShapeData


class SpecRef(_Strict):
    """The spec's canonical text, the SHA-256 of that text in UTF-8, and the opening comment's first line, if any."""

    source: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    title: str = ""

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if hashlib.sha256(self.source.encode()).hexdigest() != self.sha256:
            raise ValueError("the spec's text does not have the checksum beside it")
        return self


class WorkspaceData(_Strict):
    x: Bounds
    y: Bounds


class RequestData(_Strict):
    """What was asked for: a range [lowest, highest] per label (null is an open end), the count, the spread."""

    phi: dict[str, tuple[FiniteFloat | None, FiniteFloat | None]]
    n: Annotated[int, Field(ge=1)]
    spread: Literal["flat", "base"] = "flat"


class SceneFile(_Strict):
    """A set of scenes with everything needed to re-score and draw them.

    The labels are those of the scenes' phi; a file without scenes names them in `labels`, which no other file has.
    """

    format: Literal["scenegen/scenes"] = FORMAT
    version: Literal[1] = VERSION
    spec: SpecRef
    workspace: WorkspaceData
    objects: list[ObjectData]
    regions: list[RegionData] = Field(default_factory=list)
    sampler: dict[str, Any]
    request: RequestData
    labels: list[str] | None = None
    scenes: list[SceneData]

    @property
    def label_names(self) -> tuple[str, ...]:
        """The labels, in the order of the first scene."""
        return tuple(self.scenes[0].phi) if self.scenes else tuple(self.labels or ())

    @model_serializer(mode="wrap")
    def _labels_where_they_stand(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = dump(self)
        if data.get("labels") is None:
            data.pop("labels", None)
        return data

    def without_scenes(self, labels: Sequence[str] = ()) -> Self:
        """The header: as it stands before scenes, or, with `labels`, as it stands alone."""
        return self.model_copy(update={"scenes": [], "labels": list(labels) or None})
