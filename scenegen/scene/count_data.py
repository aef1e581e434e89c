"""How many things there can be in the scenes of a file, where that is drawn."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer


class CountData(BaseModel):
    """An array of objects whose number of elements is drawn, from `least` to `most`: the file has an object for each
    that there can be, `block[1]` to `block[8]`. With `assets` it is an object of a category: the file has an object
    for each asset that can be drawn, `mug:red` and `mug:blue`, of which one is there in each scene, and the number says
    which, counted from 1."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    name: str
    least: Annotated[int, Field(ge=1)]
    most: Annotated[int, Field(ge=1)]
    assets: list[str] = Field(default_factory=list)

    @model_serializer(mode="wrap")
    def _assets_where_they_are(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = dump(self)
        return {name: value for name, value in data.items() if value or name != "assets"}


def check_counts(counts: Sequence[CountData], objects: Collection[str]) -> None:
    """Raises ValueError for an array of which the file has not all elements, and for one that is counted twice."""
    for one in counts:
        enough = one.least < one.most <= len(objects)
        if one.assets:
            names = {f"{one.name}:{asset}" for asset in one.assets}
            if one.least != 1 or not 1 < one.most == len(names) == len(one.assets) or not names <= set(objects):
                raise ValueError(f"the objects are not those of the assets of {one.name}")
            continue
        if not enough or any(f"{one.name}[{number}]" not in objects for number in range(1, one.most + 1)):
            raise ValueError(f"there are not {one.least} to {one.most} objects of {one.name}")
    if len({one.name for one in counts}) < len(counts):
        raise ValueError("two of the counts are of the same array")
