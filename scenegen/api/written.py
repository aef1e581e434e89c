"""What `sample_to` returns: where scenes are, how many, and what phi is in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.errors import Diagnostic
from scenegen.scene.data import SceneFile


@dataclass(frozen=True, slots=True)
class Met:
    """phi of one label over the scenes of a file."""

    lowest: float
    mean: float
    highest: float


@dataclass(frozen=True, slots=True)
class Written:
    """A scene file or set: where it is, how many scenes it holds, its header, and what phi is in it, by label."""

    path: Path | str
    count: int
    header: SceneFile
    phi: Mapping[str, Met]
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False)

    def __len__(self) -> int:
        return self.count
