"""The motion file, as pydantic models: scenes over time, or pairs of a start and a goal (two moments).

Format `scenegen/motions`, version 1. What stands before the motions is as in scene files (scenes/data.py).
"""

from __future__ import annotations

from operator import not_
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    model_validator,
)

from scenegen.pose import row_count
from scenegen.scenes.blocks import check_numbers, objects_of
from scenegen.scenes.data import (
    CountData,
    EndsData,
    ObjectData,
    RegionData,
    SceneFile,
    SpecRef,
    WorkspaceData,
    check_counts,
)

MOTIONS_FORMAT: Literal["scenegen/motions"] = "scenegen/motions"
MOTIONS_VERSION: Literal[1] = 1

Point = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
"""x and y in metres, theta in radians."""


class _StrictMotionModel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class TimeData(_StrictMotionModel):
    """The moments: `steps` + 1 of them, `dt` seconds apart."""

    steps: Annotated[int, Field(ge=0)]
    dt: Annotated[FiniteFloat, Field(gt=0)] = 1.0


class MotionRequestData(_StrictMotionModel):
    """What was asked for: a range [lowest, highest] by name of phi (null is an open end), and the count."""

    phi: dict[str, EndsData]
    n: Annotated[int, Field(ge=1)]


class MotionData(_StrictMotionModel):
    """One motion: the poses of each object, moment by moment, and phi by name. `facts` are other numbers about it, such
    as the distance from start to goal; null where a motion has none. Where the number of things is drawn, `counts` has
    it, the same at all moments, and objects that are not there have no poses."""

    counts: dict[str, Annotated[int, Field(ge=1)]] | None = None
    poses: dict[str, list[Point]]
    phi: dict[str, FiniteFloat]
    facts: dict[str, FiniteFloat | None] = Field(default_factory=dict)


class MotionFile(_StrictMotionModel):
    """Motions with everything needed to score and draw them again."""

    format: Literal["scenegen/motions"] = MOTIONS_FORMAT
    version: Literal[1] = MOTIONS_VERSION
    spec: SpecRef
    workspace: WorkspaceData
    objects: list[ObjectData]
    counts: list[CountData] = Field(default_factory=list, exclude_if=not_)
    regions: list[RegionData] = Field(default_factory=list)
    time: TimeData
    sampler: dict[str, Any]
    request: MotionRequestData
    motions: list[MotionData]

    @model_validator(mode="after")
    def _whole(self) -> Self:
        check_counts(self.counts, {one.name for one in self.objects})
        for number, motion in enumerate(self.motions, 1):
            numbers = motion.counts or {}
            check_numbers(self.counts, numbers)
            if motion.poses.keys() != set(objects_of(self, numbers)):
                raise ValueError(f"motion {number} does not have the objects of the file")
            if any(len(points) != self.time.steps + 1 for points in motion.poses.values()):
                raise ValueError(f"motion {number} does not have {self.time.steps + 1} moments")
            if motion.phi.keys() != self.motions[0].phi.keys() or motion.facts.keys() != self.motions[0].facts.keys():
                raise ValueError(f"motion {number} has other values than the first")
        return self

    @property
    def coordinates(self) -> int:
        """How many numbers place the objects of a motion."""
        return (self.time.steps + 1) * row_count(len(self.objects))


AnyFile = SceneFile | MotionFile
"""The header of a file of scenes, or of motions."""
