"""Settled scenes as arrays, and in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.formats.settled import write_settled
from scenegen.formats.settled_blocks import MM, SettledBlock, Touch
from scenegen.scene.settled import SettledHeader
from scenegen.validation import as_path

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SettledScenes:
    """Where n scenes of N objects came to rest.

    `poses` (n, N, 7) are x, y, z of each object's lowest point under the middle of its footprint, in metres, and its
    attitude as a quaternion qw, qx, qy, qz. Against the plan, `shift` (n, N) is how far that point moved, in metres,
    and `turn` (n, N) the angle by which the object turned, about any axis, in degrees; `moved` (n, N) says which
    objects moved farther than allowed. `phi` has by label the values (n,) at the settled poses, each object read as x,
    y and the heading of the nearest upright attitude. `contacts` are by scene the pairs of objects that touched before,
    None for the table, and how deep they were in each other, in metres. NaN where a simulation diverged, and for
    objects that are not there. `header` says the rest. `on` (n, M) is the surface that each object of
    `header.surfaces` stood on in the plan, counted from 1.
    """

    poses: Array
    shift: Array
    turn: Array
    moved: npt.NDArray[np.bool_]
    phi: Mapping[str, Array]
    contacts: tuple[tuple[Touch, ...], ...]
    header: SettledHeader
    on: Array | None = None

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        return f"<SettledScenes: {Summary.of(self.header, self._block()).last_line}>"

    @property
    def settled(self) -> npt.NDArray[np.bool_]:
        """(n,): which scenes settled: none of their objects moved farther than allowed."""
        return np.asarray(~self.moved.any(axis=1))

    @property
    def deepest(self) -> Array:
        """(n,): the depth of each scene's deepest contact before it was simulated, in metres."""
        return self._block().deepest

    def save(self, path: str | Path) -> Path:
        """Write them as .json, .jsonl or .parquet; the file appears whole or not at all. Raises RequestError,
        OutputError."""
        path = as_path("path", path)
        write_settled(path, self.header, [self._block()])
        return path

    def _block(self) -> SettledBlock:
        phi = np.array(list(self.phi.values())).reshape(len(self.phi), len(self))
        return SettledBlock(self.poses, self.shift, self.turn, self.moved, phi, self.contacts, self.on)


@dataclass(slots=True)
class Summary:
    """What became of the scenes of a run so far, in words."""

    header: SettledHeader
    scenes: int = 0
    far: int = 0
    shift: float = 0.0
    turn: float = 0.0
    depth: float = 0.0
    moved: Array | None = None

    @staticmethod
    def of(header: SettledHeader, block: SettledBlock) -> Summary:
        summary = Summary(header)
        summary.add(block)
        return summary

    def add(self, block: SettledBlock) -> None:
        """Count a block's scenes."""
        far = np.asarray(block.moved.any(axis=1))
        self.scenes += block.count
        self.far += int(far.sum())
        still = block.present & ~far[:, None]
        self.shift = max(self.shift, float(block.shift[still].max(initial=0.0)))
        self.turn = max(self.turn, float(block.turn[still].max(initial=0.0)))
        self.depth = max(self.depth, float(block.deepest.max(initial=0.0)))
        self.moved = block.moved.sum(axis=0) + (0 if self.moved is None else self.moved)

    @property
    def first_line(self) -> str:
        """How far objects moved where scenes settled, and how deep they were in each other before."""
        before = f"before, no contact was deeper than {MM * self.depth:.2f} mm"
        if self.far == self.scenes:
            return f"no scene settled; {before}"
        moved = f"{MM * self.shift:.2f} mm and {self.turn:.2f} degrees"
        return f"where scenes settled, objects moved by at most {moved}; {before}"

    @property
    def last_line(self) -> str:
        """How many scenes settled, and which objects moved too far in the others."""
        name, seconds = self.header.simulator.name, self.header.simulator.seconds
        text = f"{self.scenes - self.far:,} of {self.scenes:,} scenes settled ({name}, {seconds:g} s)"
        if not self.far or self.moved is None:
            return text
        order = [int(k) for k in np.argsort(-self.moved, kind="stable") if self.moved[k]]
        shown = ", ".join(f"`{self.header.objects[k]}` in {int(self.moved[k]):,}" for k in order[:5])
        more = f" and {len(order) - 5} more objects" if len(order) > 5 else ""
        return f"{text}; in {self.far:,} an object moved too far: {shown}{more}"
