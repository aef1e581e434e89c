"""A spec that passed the checker."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.assets import Shape, shape_of
from scenegen.errors import Diagnostic
from scenegen.lang.core import Core
from scenegen.primitives import Footprint
from scenegen.scene.workspace import Workspace

Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """A named part of the table: its footprint at a fixed place, (x, y, heading)."""

    name: str
    footprint: Footprint
    pose: Pose


@dataclass(frozen=True, slots=True)
class CheckedSpec:
    """What a spec means: the workspace, the objects in storage order, and the core formula with its labels.

    `source` is the canonical text that scene and model files carry; `name` is where it was read from; `title` is the
    sentence of its opening comment, if it has one. `shapes` has one entry per object (left out: by their names);
    `fixed` maps the index of each object that the spec holds in place (`at`) to its pose. `warnings` is what the
    checker noticed and let pass.
    """

    name: str
    source: str
    workspace: Workspace
    core: Core
    title: str = ""
    shapes: tuple[Shape, ...] = ()
    fixed: Mapping[int, Pose] = field(default_factory=dict)
    regions: tuple[Region, ...] = ()
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if not self.shapes:
            object.__setattr__(self, "shapes", tuple(shape_of(name) for name in self.core.objects))

    @property
    def objects(self) -> tuple[str, ...]:
        return self.core.objects

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.core.labels)

    @property
    def sha256(self) -> str:
        """SHA-256 of the canonical text: two specs that differ in layout and comments alone share it."""
        return hashlib.sha256(self.source.encode()).hexdigest()

    def box(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest value of every row of (3N, B) storage, each (3N,); equal for objects held in place."""
        lowest, highest = self.workspace.box(len(self.objects))
        for index, pose in self.fixed.items():
            lowest[3 * index : 3 * index + 3] = highest[3 * index : 3 * index + 3] = pose
        return lowest, highest
