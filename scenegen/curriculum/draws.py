"""Scenes in addition to those that a library starts with, drawn once for all environments.

Many tables follow one curriculum, so they need the same bands at about the same time, and planning a draw costs more
than hundreds of its scenes. The result of a draw depends only on the request, not on which environment is first.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Mapping

from scenegen.curriculum.sources import Sampler, Scenes
from scenegen.sampling.request import Range

KEPT = 1 << 18  # maximum number of cached scenes: 50 MB of seven objects

_Key = tuple[tuple[tuple[str, tuple[float | None, float | None]], ...], int, int]


class Draws:
    """`draw(phi, n, number, patience)`: draw `number` (0, 1, ...) of up to n scenes with phi in the ranges, as many
    as are found in so many seconds."""

    def __init__(self, sampler: Sampler) -> None:
        self._sampler = sampler
        self._kept: OrderedDict[_Key, Scenes] = OrderedDict()
        self._count = 0

    def draw(self, phi: Mapping[str, Range], n: int, number: int, patience: float) -> Scenes:
        """Do not write to the arrays: others get the same ones. Raises RequestError if there are no scenes."""
        key = (tuple((label, (one.low, one.high)) for label, one in phi.items()), n, number)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        seed = int.from_bytes(hashlib.blake2b(repr(key).encode(), digest_size=8).digest()) >> 1
        self._kept[key] = scenes = self._sampler.draw(phi, n, seed, patience=patience)
        self._count += len(scenes)
        while self._count > KEPT and len(self._kept) > 1:
            self._count -= len(self._kept.popitem(last=False)[1])
        return scenes
