"""Scenes beyond those that a library begins with, drawn once for all the environments that want them.

Many tables follow one curriculum, so they want the same bands at about the same time, and planning a draw costs more
than hundreds of its scenes. What a draw gives depends on what is asked for alone, not on who asks first.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Mapping

from scenegen.curriculum.sources import Ends, Sampler, Scenes

KEPT = 1 << 18  # scenes that are remembered: 50 MB of seven objects

_Key = tuple[tuple[tuple[str, Ends], ...], int, int]


class Draws:
    """`asked(ranges, n, number, patience)`: draw `number` (0, 1, ...) of up to n scenes with phi in the ranges, as many
    as are found in so many seconds."""

    def __init__(self, sampler: Sampler) -> None:
        self._sampler = sampler
        self._kept: OrderedDict[_Key, Scenes] = OrderedDict()
        self._count = 0

    def asked(self, ranges: Mapping[str, Ends], n: int, number: int, patience: float) -> Scenes:
        """Not to be written to: others get the same arrays. Raises RequestError where there are none."""
        key = (tuple(ranges.items()), n, number)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        seed = int.from_bytes(hashlib.blake2b(repr(key).encode(), digest_size=8).digest()) >> 1
        self._kept[key] = scenes = self._sampler.draw(ranges, n, seed, patience=patience)
        self._count += len(scenes)
        while self._count > KEPT and len(self._kept) > 1:
            self._count -= len(self._kept.popitem(last=False)[1])
        return scenes
