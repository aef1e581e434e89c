"""Scenes as a table, one a row: the names of the columns, in Parquet files and data frames alike."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.errors import Diagnostic, OutputError
from scenegen.scene.workspace import AXES

PHI = "phi."


def columns(objects: Sequence[str], labels: Sequence[str]) -> list[str]:
    """The names of the columns, in their order: the 3N coordinates `mug.x`, ..., then phi of each label.

    Raises OutputError where an object `phi` and a label `x` would share one.
    """
    names = [f"{name}.{axis}" for name in objects for axis in AXES] + [f"{PHI}{label}" for label in labels]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        title = f"two columns of the table would be called `{twice}`"
        raise OutputError(Diagnostic(title, help="rename the object `phi`, or write .jsonl"))
    return names
