"""The header of a file of settled scenes, as a pydantic model. Format `scenegen/settled`, version 1."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, SerializerFunctionWrapHandler, model_serializer

from scenegen.scene.data import SpecRef

FORMAT: Literal["scenegen/settled"] = "scenegen/settled"
VERSION: Literal[1] = 1

Positive = Annotated[FiniteFloat, Field(gt=0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class SimulatorData(_Strict):
    """Where scenes were simulated, and for how many seconds."""

    name: str
    version: str
    seconds: Positive


class SettledHeader(_Strict):
    """What holds for all scenes of the file: the spec, its objects and labels, the simulation, and how far an object
    may be moved (mm) or turned (degrees) in a scene that counts as settled. `surfaces` are those of each object that
    stands on one of several, in the order of their numbers; scenes say on which it was planned."""

    format: Literal["scenegen/settled"] = FORMAT
    version: Literal[1] = VERSION
    spec: SpecRef
    objects: list[str]
    labels: list[str]
    simulator: SimulatorData
    max_shift_mm: Positive
    max_turn_deg: Positive
    surfaces: dict[str, list[str]] = Field(default_factory=dict)

    @model_serializer(mode="wrap")
    def _surfaces_where_they_are(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = dump(self)
        return {name: value for name, value in data.items() if value or name != "surfaces"}
