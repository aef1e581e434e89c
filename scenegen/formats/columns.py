"""Scenes as a table, one a row: the names of the columns, in Parquet files and data frames alike."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.errors import OutputError
from scenegen.errors.files import COLUMN_TWICE
from scenegen.pose import NAMES
from scenegen.scene.data import SceneFile

PHI = "phi."
COUNT = "count."
RARITY = "log10p."  # after phi, in data sets: how rare each scene's phi is


def columns(header: SceneFile, labels: Sequence[str]) -> list[str]:
    """The names of the columns, in their order: the 3N coordinates `mug.x`, ..., then `mug.on` of each object that
    stands on one of several surfaces (its number in the header, counted from 1), then `count.block` of each array whose
    number of elements is drawn, then phi of each label.

    Raises OutputError if an object `phi` and a label `x` would share one.
    """
    places = [f"{one.name}.{axis}" for one in header.objects for axis in NAMES]
    more = [*(f"{one.name}.on" for one in header.choosers), *(f"{COUNT}{one.name}" for one in header.counts)]
    names = [*places, *more, *(f"{PHI}{label}" for label in labels)]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise OutputError(COLUMN_TWICE(name=twice))
    return names
