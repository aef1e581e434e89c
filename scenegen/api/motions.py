"""Motions as arrays: written, read, and taken apart into scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.api.scenes import SceneSet
from scenegen.errors import Diagnostic
from scenegen.formats.motions.table import MotionArrays, scenes_header
from scenegen.formats.motions.table import read_motions as read
from scenegen.formats.motions.table import write_motions as write
from scenegen.scene.motions import MotionFile
from scenegen.validation import as_path

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotionSet:
    """n motions of N objects over T steps: `poses` (n, T + 1, N, 3), x and y in metres and theta in radians, objects in
    the order of `objects`. `phi` and `facts` map names to (n,) values. `header` is the motion file without motions."""

    poses: Array
    phi: Mapping[str, Array]
    facts: Mapping[str, Array]
    header: MotionFile
    warnings: tuple[Diagnostic, ...] = field(default=())

    def __len__(self) -> int:
        return int(self.poses.shape[0])

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    @property
    def times(self) -> Array:
        """The moments in seconds, (T + 1,)."""
        return np.arange(self.poses.shape[1], dtype=np.float64) * self.header.time.dt

    def scenes(self, moment: int) -> SceneSet:
        """All motions at one moment, as a set of scenes: 0 is the first, -1 the last. phi is not kept. Raises
        IndexError."""
        return self._scenes(self.poses[:, moment])

    def motion(self, number: int) -> SceneSet:
        """The moments of one motion, from 0, as a set of scenes, in their order. Raises IndexError."""
        return self._scenes(self.poses[number])

    def _scenes(self, poses: Array) -> SceneSet:
        return SceneSet(poses, {}, scenes_header(self.header))

    def save(self, path: str | Path) -> Path:
        """Write the motions, as .json, .jsonl, .parquet or .csv by the path's ending; the file appears whole or not at
        all. A .csv file holds numbers alone. Raises RequestError, OutputError."""
        path = as_path("path", path)
        write(path, MotionArrays(self.header, self.poses, self.phi, self.facts))
        return path


def read_motions(path: str | Path) -> MotionSet:
    """The motions of a .json, .jsonl or .parquet file. Raises DataError, RequestError."""
    found = read(as_path("path", path))
    return MotionSet(found.poses, found.phi, found.facts, found.header)
