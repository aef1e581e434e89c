"""The scene file, as pydantic models: the one border that scene data crosses on its way in or out.

Format `scenegen/scenes`, version 1. The JSON Schema of `SceneFile` ships in docs/ and a golden test holds it still.
"""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

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


class ShapeData(_Strict):
    """What an object looks like: an entry of the asset library with its footprint and height in metres."""

    asset: str
    footprint: Annotated[CircleFootprint | BoxFootprint, Field(discriminator="kind")]
    height: Annotated[FiniteFloat, Field(gt=0)]


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
    """A set of scenes with everything needed to re-score and draw them."""

    format: Literal["scenegen/scenes"] = FORMAT
    version: Literal[1] = VERSION
    spec: SpecRef
    workspace: WorkspaceData
    objects: list[ObjectData]
    regions: list[dict[str, Any]] = Field(default_factory=list)
    sampler: dict[str, Any]
    request: RequestData
    scenes: list[SceneData]
