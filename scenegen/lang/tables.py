"""Tables of numbers that other programs wrote, and the .csv files that hold them: scenes, motions, recorded poses.

Only columns that are asked for are looked at: what else a file holds may be text, or nothing at all.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.diagnostic import Kind
from scenegen.errors.files import TABLE_CELL, TABLE_COLUMN, TABLE_ROW
from scenegen.pose import NAMES

SEPARATORS = ",;\t"  # of the columns of a .csv file
MAX_TABLE_BYTES = 1 << 30


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows `start` to `stop` of a file; `names` are those of its columns, `cells` gives those of one, all rows of it:
    numbers, or things that may be some. A part of a file has the `number` that the file gives it. `wrong` is what is
    said of a file that is no such table."""

    file: str
    wrong: Kind
    names: tuple[str, ...]
    cells: Callable[[str], Any]
    start: int
    stop: int
    number: int | None = None

    def __len__(self) -> int:
        return self.stop - self.start

    def column(self, name: str, *, holes: bool = False) -> Array:
        """The numbers of a column. Raises DataError where it is not there, or holds anything else; with `holes`, empty
        cells, null and NaN are NaN."""
        if name not in self.names:
            raise DataError(TABLE_COLUMN(file=self.file, name=name, known=sorted(filter(None, self.names))))
        if self.names.count(name) > 1:
            raise DataError(self.wrong(file=self.file, reason=f"two columns have the name `{name}`"))
        cells = self.cells(name)[self.start : self.stop]
        found = cells if isinstance(cells, np.ndarray) else np.array([_number(cell) for cell in cells])
        for place in np.flatnonzero(~np.isfinite(found)):
            row, cell = self.start + int(place) + 1, cells[place]
            if holes and (cell is None or str(cell).strip().lower() in ("", "nan")):
                continue
            shown = cell if isinstance(cell, str) else str(cell) if isinstance(cell, float) else json.dumps(cell)
            point = re.fullmatch(r"\s*([+-]?\d+),(\d+)\s*", shown)
            facts = {"value": shown[:40], "point": None if point is None else ".".join(point.groups())}
            raise DataError(TABLE_CELL(file=self.file, row=row, name=name, **facts))
        return np.asarray(found, dtype=np.float64)

    def part(self, start: int, stop: int, number: int) -> Table:
        """Some rows, counted from those of this table."""
        return replace(self, start=self.start + start, stop=self.start + stop, number=number)


def _number(cell: Any) -> float:
    """NaN for what is none, and for Python's `1_000`, which other programs read otherwise."""
    try:
        return math.nan if isinstance(cell, bool) or cell is None or "_" in str(cell) else float(cell)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def csv_cells(path: Path | str, text: str, wrong: Kind) -> tuple[tuple[str, ...], Callable[[str], list[str]], int]:
    """The names of a .csv file's columns, what gives the cells of one, and how many rows there are; `path` is what
    diagnostics call it. Raises DataError."""
    csv.field_size_limit(MAX_TABLE_BYTES)  # what is not needed may be a picture
    whole = io.StringIO(text, newline=None)
    headings = (line for line in whole if line.strip() and not (line[0] == "#" and not _places(line)[0]))
    heading = next(headings, "")
    said = re.fullmatch(r'"?sep=(.)"?', heading.rstrip("\n"), re.IGNORECASE)  # Excel's
    heading = next(headings, "") if said else heading
    between = said[1] if said else _places(heading)[-1]
    odd = re.search(r"\S( |\|| \| )\S", heading)
    if between not in SEPARATORS or (between not in heading and odd):
        reason = f"its columns are separated by `{between if said else odd and odd[1]}`; it takes `,`, `;` and tabs"
        raise DataError(wrong(file=path, reason=reason))
    reader = csv.reader(chain([heading], whole), strict=True, delimiter=between, skipinitialspace=True)
    try:
        lines = [line for line in reader if line]
    except csv.Error as error:
        raise DataError(wrong(file=path, reason=f"line {reader.line_num}, counted from its heading: {error}")) from None
    names = [name.strip() for name in lines.pop(0)] if lines else []
    while names and not names[-1]:  # a comma at the end of every line
        names.pop()
    for number, line in enumerate(lines, 1):
        if len(line) < len(names) or any(cell.strip() for cell in line[len(names) :]):
            raise DataError(TABLE_ROW(file=path, row=number, given=len(line), wanted=len(names)))

    def cells(name: str) -> list[str]:
        place = names.index(name)
        return [line[place] for line in lines]

    return tuple(names), cells, len(lines)


def _places(heading: str) -> tuple[int, int, str]:
    """How many columns a heading has that are poses, how many it has, and what separates them: that by which there are
    most."""

    def cut(between: str) -> tuple[int, int, str]:
        names = next(csv.reader([heading], delimiter=between, skipinitialspace=True), [])
        return sum(name.strip().rpartition(".")[2] in NAMES for name in names), len(names), between

    return max(map(cut, SEPARATORS), key=lambda one: one[:2])
