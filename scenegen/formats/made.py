"""Requests as manifests of sets have them: of a set, of each shard of a data set, and how rare phi is."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from scenegen.formats.blocks import Array

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0)]


class Part(BaseModel):
    """A range of phi of which a data set has as many scenes as of the others."""

    model_config = ConfigDict(strict=True, defer_build=True)

    label: str
    phi: tuple[FiniteFloat, FiniteFloat]


class Asked(BaseModel):
    """What of a set's request is read again: by those that go on with it, and by cards and reports. The rest of it is
    only compared."""

    model_config = ConfigDict(strict=True, defer_build=True)

    spec: Sha256
    phi: dict[str, tuple[FiniteFloat | None, FiniteFloat | None]]
    n: Count
    seed: Seed
    spread: Literal["flat", "base"]
    scenegen: str
    numpy: str
    parts: list[Part] = []


class Rareness(BaseModel):
    """How rare phi of one label is: log10 of the smaller of P(phi' <= phi) and P(phi' >= phi) for the base
    distribution, at rising values of phi; linear between them, constant beyond."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    phi: Annotated[list[FiniteFloat], Field(min_length=1)]
    log10p: list[FiniteFloat]

    @model_validator(mode="after")
    def _a_curve(self) -> Self:
        if len(self.phi) != len(self.log10p) or any(low > high for low, high in pairwise(self.phi)):
            raise ValueError("the values of phi do not rise, or are not as many as those of log10p")
        return self

    def __call__(self, phi: Array) -> Array:
        """log10 p of some values of phi."""
        found: Array = np.interp(phi, self.phi, self.log10p)
        return found


class Made(BaseModel):
    """The request that gives a shard: of a data set, whose shards are runs of their own."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    phi: dict[str, tuple[FiniteFloat, FiniteFloat]]
    n: Count
    seed: Seed
