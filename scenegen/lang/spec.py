"""A spec that passed the checker."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic
from scenegen.geometry.footprint import Footprint
from scenegen.geometry.workspace import Workspace
from scenegen.pose import span_of
from scenegen.things import Shape, shape_of

if TYPE_CHECKING:
    from scenegen.lang.formula.core import Core
    from scenegen.lang.formula.timed import Timed

Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """A named part of the table: its footprint at a fixed place, (x, y, heading). With a `height` above the table it is
    the top of a board."""

    name: str
    footprint: Footprint
    pose: Pose
    height: float = 0.0


@dataclass(frozen=True, slots=True)
class Support:
    """What an object stands on by declaration: a surface of the object `carrier`, or a region of the table (None).

    `outline` is in the frame of what carries, which `pose` places for a region; `height` is above the carrier's lowest
    point. On a `walled` surface all of the footprint is inside the outline, elsewhere the centre. `box` is that of a
    region: left, bottom, right, top; `far` how far from the carrier's origin the centre can be, where that is known.
    """

    name: str
    carrier: int | None
    outline: Footprint
    height: float
    walled: bool = False
    pose: Pose = (0.0, 0.0, 0.0)
    box: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    far: float | None = None


@dataclass(frozen=True, slots=True)
class SurfaceChoice:
    """What an object stands on where the declaration names several surfaces: one of `options` in each scene.

    Which one is a number in [0, 1], x of a further entry `switch` of the core's objects, which no file or picture
    shows: option k from `ends[k - 1]` up to `ends[k]`. The other numbers of the switch mean nothing.
    """

    switch: int
    options: tuple[Support, ...]
    ends: tuple[float, ...]

    @property
    def middles(self) -> tuple[float, ...]:
        """A number for each option."""
        return tuple((low + high) / 2.0 for low, high in zip((0.0, *self.ends), self.ends, strict=False))


@dataclass(frozen=True, slots=True)
class Count:
    """An array whose number of elements is drawn: `least` to `most`, both included. Or an object of a category: the
    number, from 1, is that of one of `assets`, after which the object that is there is called."""

    name: str
    least: int
    most: int
    assets: tuple[str, ...] = ()

    @property
    def numbers(self) -> range:
        """Every number of elements that there can be."""
        return range(self.least, self.most + 1)


@dataclass(frozen=True, slots=True)
class CheckedSpec:
    """What a spec means: the workspace, the objects in storage order, and the core formula with its labels.

    `source` is the canonical text that scene and model files carry; `name` is where it was read from; `title` is the
    sentence of its opening comment, if it has one. `shapes` has one entry per object (left out: by their names);
    `fixed` maps the index of each object that the spec holds in place (`at`) to its pose. `supports` maps the index of
    each object that the spec declares to stand on something (`on`) to its support; `heights` is then how high each
    object's lowest point is above the table, and empty where no object has a support. `choices` maps the index of each
    object that stands on one of several surfaces to these; its height, and that of what it carries, is None.
    `warnings` is what the checker noticed and let pass. `timed` is what a spec over time means; its `core` has formulas
    over time then, which no reader of cores takes.

    A spec with random numbers of things has `counts`. It stands for `members`, an ordinary spec for each combination of
    numbers, in lexicographic order; all else here is that of the last one, which has all the objects.
    """

    name: str
    source: str
    workspace: Workspace
    core: Core
    title: str = ""
    shapes: tuple[Shape, ...] = ()
    fixed: Mapping[int, Pose] = field(default_factory=dict)
    regions: tuple[Region, ...] = ()
    supports: Mapping[int, Support] = field(default_factory=dict)
    heights: tuple[float | None, ...] = ()
    choices: Mapping[int, SurfaceChoice] = field(default_factory=dict)
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False)
    timed: Timed | None = None
    counts: tuple[Count, ...] = ()
    members: tuple[CheckedSpec, ...] = ()

    def __post_init__(self) -> None:
        if not self.shapes:
            object.__setattr__(self, "shapes", tuple(shape_of(name) for name in self.core.objects))

    @property
    def objects(self) -> tuple[str, ...]:
        """The objects, without the switches of choices."""
        if self.timed is not None:
            return self.timed.objects
        return self.core.objects[: len(self.core.objects) - len(self.choices)]

    @property
    def declares_heights(self) -> bool:
        """Whether some object has a declared support: all heights are then declared."""
        return bool(self.supports or self.choices)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.core.labels)

    @property
    def sha256(self) -> str:
        """SHA-256 of the canonical text: two specs that differ in layout and comments alone share it."""
        return hashlib.sha256(self.source.encode()).hexdigest()

    def box(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest value of every row of (3N, B) storage, each (3N,); equal for objects held in place."""
        lowest, highest = self.workspace.box(len(self.core.objects if self.timed is None else self.objects))
        for index, pose in self.fixed.items():
            held = span_of(index, len(pose))
            lowest[held] = highest[held] = pose
        return lowest, highest
