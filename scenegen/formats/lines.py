"""One scene as one line of JSON, in .json and .jsonl files alike.

Formatting a template takes a few microseconds per scene, a general JSON encoder several times as much; matching a line
with the same template saves as much time in reading.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from operator import attrgetter

import numpy as np

from scenegen.formats.blocks import Array, Block, check_numbers
from scenegen.pose import NAMES, row_count, rows_of
from scenegen.scene.data import SceneData, SceneFile
from scenegen.scene.standing import chosen_surface

# Numbers that are finite for any digits; others are left to the strict reader.
_NUMBER = r"(-?(?:0|[1-9][0-9]{0,16})(?:\.[0-9]+)?(?:[eE][+-]?[0-9]{1,2})?)"
_COORDINATES = attrgetter(*NAMES)
_HOLE = "\0"  # cannot occur in JSON text


class SceneLines:
    """The text of scenes of a file. `numbers` is how many things there are in all of them, if that is drawn."""

    def __init__(self, header: SceneFile, labels: Sequence[str], numbers: Mapping[str, int] | None = None) -> None:
        self._header = header
        self._names = {
            header.objects.index(one): [_text(surface.on) for surface in one.support.any]
            for one in header.choosers
            if one.support is not None
        }
        place = ", ".join(f"{_text(axis)}: {_HOLE}" for axis in NAMES)
        more = f', "on": {_HOLE}'
        poses = (
            f"{_text(one.name)}: {{{place}{more if number in self._names else ''}}}"
            for number, one in enumerate(header.objects)
        )
        phi = ", ".join(f"{_text(label)}: {_HOLE}" for label in labels)
        every = ", ".join(poses)
        counts = f'"counts": {json.dumps(numbers, ensure_ascii=False)}, ' if numbers else ""
        parts = f'{{{counts}"poses": {{{every}}}, "phi": {{{phi}}}}}'.split(_HOLE)
        order: list[int] = []  # of the numbers in a line, as they stand in a block
        kinds: list[list[str] | None] = []  # of each number in a line, the texts that stand for 1, 2, ...
        for number in range(len(header.objects)):
            order.extend(rows_of(number))
            if number in self._names:
                order.append(row_count(len(header.objects)) + list(self._names).index(number))
        order.extend(range(header.coordinates, header.coordinates + len(labels)))
        chosen = dict(zip(range(row_count(len(header.objects)), header.coordinates), self._names.values(), strict=True))
        kinds = [chosen.get(row) for row in order]
        self._order, self._kinds = (order, kinds) if self._names else ([], [])
        self._template = "%r".join(part.replace("%", "%%") for part in parts)
        self._pattern = re.compile(_NUMBER.join(map(re.escape, parts)))
        if self._names:
            holes = ["%r" if kind is None else "%s" for kind in kinds]
            wanted = [_NUMBER if kind is None else f"({'|'.join(map(re.escape, kind))})" for kind in kinds]
            self._template = "".join(
                part.replace("%", "%%") + hole for part, hole in zip(parts, [*holes, ""], strict=True)
            )
            self._pattern = re.compile(
                "".join(re.escape(part) + hole for part, hole in zip(parts, [*wanted, ""], strict=True))
            )

    def of(self, block: Block) -> list[str]:
        """A line for each scene of a block; floats are written so that they read back bit for bit."""
        check_numbers(self._header, block)
        numbers: list[list[float]] = np.concatenate([block.rows, block.phi]).T.tolist()
        if not self._names:
            return [self._template % tuple(scene) for scene in numbers]
        return [
            self._template
            % tuple(
                scene[row] if kind is None else kind[int(scene[row]) - 1]
                for row, kind in zip(self._order, self._kinds, strict=True)
            )
            for scene in numbers
        ]

    def numbers(self, line: str) -> list[float] | None:
        """The numbers of a scene, in the order of a block, in a line as `of` writes it; None for any other text."""
        match = self._pattern.fullmatch(line)
        if match is None:
            return None
        if not self._names:
            return [float(number) for number in match.groups()]
        found = [0.0] * len(self._order)
        for row, kind, text in zip(self._order, self._kinds, match.groups(), strict=True):
            found[row] = float(text) if kind is None else 1.0 + kind.index(text)
        return found


def _text(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def numbers_of(scene: SceneData, header: SceneFile, labels: Sequence[str], name: str = "a scene") -> list[float]:
    """The numbers of a scene of these objects and labels, in the order of a block; `name` is that of the scene in
    errors. Raises DataError for an object on a surface that the header does not have."""
    absent = (math.nan,) * len(NAMES)
    poses = (scene.poses.get(one.name) for one in header.objects)
    places = [value for pose in poses for value in (absent if pose is None else _COORDINATES(pose))]
    on = (
        chosen_surface(name, one, scene.poses[one.name]) if one.name in scene.poses else math.nan
        for one in header.choosers
    )
    return [*places, *on, *(scene.phi[label] for label in labels)]


def block_from(numbers: Sequence[Sequence[float]], coordinates: int, labels: int) -> Block:
    """Scenes as a block, from the coordinates and L values of phi of each."""
    table: Array = np.array(numbers, dtype=np.float64).reshape(len(numbers), coordinates + labels).T
    return Block(np.ascontiguousarray(table[:coordinates]), np.ascontiguousarray(table[coordinates:]))


def block_of(scenes: Sequence[SceneData], header: SceneFile, labels: Sequence[str]) -> Block:
    """Scenes as a block; every one has the objects of the header, and these labels. Raises DataError as `numbers_of`
    does."""
    numbers = [numbers_of(scene, header, labels, f"scene {number}") for number, scene in enumerate(scenes, 1)]
    return block_from(numbers, header.coordinates, len(labels))
