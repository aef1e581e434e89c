"""How many things there can be in the scenes of a file, where that is drawn."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class CountData(BaseModel):
    """An array of objects whose number of elements is drawn, from `least` to `most`: the file has an object for each
    that there can be, `block[1]` to `block[8]`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    name: str
    least: Annotated[int, Field(ge=1)]
    most: Annotated[int, Field(ge=1)]


def check_counts(counts: Sequence[CountData], objects: Collection[str]) -> None:
    """Raises ValueError for an array of which the file has not all elements, and for one that is counted twice."""
    for one in counts:
        enough = one.least < one.most <= len(objects)
        if not enough or any(f"{one.name}[{number}]" not in objects for number in range(1, one.most + 1)):
            raise ValueError(f"there are not {one.least} to {one.most} objects of {one.name}")
    if len({one.name for one in counts}) < len(counts):
        raise ValueError("two of the counts are of the same array")
