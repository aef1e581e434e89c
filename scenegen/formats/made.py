"""What the manifest of a data set has beside that of a set: each shard's own request, and how rare phi is."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict

from scenegen.formats.blocks import Array


class Rareness(BaseModel):
    """How rare phi of one label is: log10 of the smaller of P(phi' <= phi) and P(phi' >= phi) for the base
    distribution, at rising values of phi; linear between them, constant beyond."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    phi: list[float]
    log10p: list[float]

    def __call__(self, phi: Array) -> Array:
        """log10 p of some values of phi."""
        found: Array = np.interp(phi, self.phi, self.log10p)
        return found


class Made(BaseModel):
    """The request that gives a shard: of a data set, whose shards are runs of their own."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    phi: dict[str, tuple[float, float]]
    n: int
    seed: int
