"""One scene as one line of JSON, in .json and .jsonl files alike.

Formatting a template takes a few microseconds a scene, a general JSON encoder several times that; matching a line
against the same template saves as much when it is read.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

import numpy as np

from scenegen.formats.blocks import Array, Block, check_numbers
from scenegen.scene.data import SceneData
from scenegen.scene.workspace import AXES

# Numbers that are finite whatever their digits; others are left to a careful reader.
_NUMBER = r"(-?(?:0|[1-9][0-9]{0,16})(?:\.[0-9]+)?(?:[eE][+-]?[0-9]{1,2})?)"
_HOLE = "\0"  # cannot stand in JSON text


class SceneLines:
    """The text of scenes of some objects and labels."""

    def __init__(self, objects: Sequence[str], labels: Sequence[str]) -> None:
        pose = ", ".join(f"{_text(axis)}: {_HOLE}" for axis in AXES)
        poses = ", ".join(f"{_text(name)}: {{{pose}}}" for name in objects)
        phi = ", ".join(f"{_text(label)}: {_HOLE}" for label in labels)
        parts = f'{{"poses": {{{poses}}}, "phi": {{{phi}}}}}'.split(_HOLE)
        self._template = "%r".join(part.replace("%", "%%") for part in parts)
        self._pattern = re.compile(_NUMBER.join(map(re.escape, parts)))

    def of(self, block: Block) -> list[str]:
        """A line for each scene of a block; floats are written so that they read back bit for bit."""
        check_numbers(block)
        numbers: list[list[float]] = np.concatenate([block.rows, block.phi]).T.tolist()
        return [self._template % tuple(scene) for scene in numbers]

    def numbers(self, line: str) -> list[float] | None:
        """The 3N coordinates and L values of phi in a line as `of` writes it; None for any other text."""
        match = self._pattern.fullmatch(line)
        return None if match is None else [float(number) for number in match.groups()]


def _text(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def numbers_of(scene: SceneData, objects: Sequence[str], labels: Sequence[str]) -> list[float]:
    """The 3N coordinates and L values of phi of a scene that has these objects and labels."""
    poses = (scene.poses[name] for name in objects)
    return [*(value for pose in poses for value in (pose.x, pose.y, pose.theta)), *(scene.phi[name] for name in labels)]


def block_from(numbers: Sequence[Sequence[float]], objects: int, labels: int) -> Block:
    """Scenes as a block, from the 3N coordinates and L values of phi of each."""
    table: Array = np.array(numbers, dtype=np.float64).reshape(len(numbers), 3 * objects + labels).T
    return Block(np.ascontiguousarray(table[: 3 * objects]), np.ascontiguousarray(table[3 * objects :]))


def block_of(scenes: Sequence[SceneData], objects: Sequence[str], labels: Sequence[str]) -> Block:
    """Scenes as a block; every one has these objects and labels."""
    return block_from([numbers_of(scene, objects, labels) for scene in scenes], len(objects), len(labels))
