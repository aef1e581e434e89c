"""What is drawn, as plain data: the table and the things on it. It crosses to the worker processes as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.assets import ASSETS, UNKNOWN, colors_of
from scenegen.assets.palette import RGB
from scenegen.errors import DataError, Diagnostic
from scenegen.scene.data import SceneFile, ShapeData, footprint_of

MARGIN = 0.07  # of the table round the workspace, in sides of the workspace; objects may reach over its edge
BEYOND = 0.60  # how many sides of the workspace the table grows at most for objects that stand off it
TALLEST = 0.35  # what the camera makes room for, in sides of the workspace


@dataclass(frozen=True, slots=True)
class Thing:
    """An object: its asset, main colour, and factors that bring the asset's meshes to the object's own size."""

    asset: str
    color: RGB
    scale: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Stage:
    """What all scenes of a file share. Rectangles are (x lowest, y lowest, x highest, y highest) in metres."""

    workspace: tuple[float, float, float, float]
    table: tuple[float, float, float, float]
    height: float
    things: tuple[Thing, ...]

    @property
    def side(self) -> float:
        """The workspace's longer side, in metres."""
        return max(self.workspace[2] - self.workspace[0], self.workspace[3] - self.workspace[1])

    @property
    def thickness(self) -> float:
        """Of the table top, in metres."""
        return 0.035 * self.side

    def corners(self) -> npt.NDArray[np.float64]:
        """(12, 3): what a picture has to show, namely the table and the room that objects take above the workspace."""
        x0, y0, x1, y1 = self.table
        u0, v0, u1, v1 = self.workspace
        top = [(x, y, self.height) for x in (u0, u1) for y in (v0, v1)]
        return np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (-self.thickness, 0.0)] + top)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Stage:
        things = tuple(Thing(t["asset"], tuple(t["color"]), tuple(t["scale"])) for t in data["things"])
        return cls(tuple(data["workspace"]), tuple(data["table"]), data["height"], things)


def _thing(shape: ShapeData, color: RGB) -> Thing:
    asset = ASSETS.get(shape.asset, ASSETS[UNKNOWN])
    (length, width), (own_length, own_width) = footprint_of(shape.footprint).extent, asset.footprint.extent
    return Thing(asset.name, color, (length / own_length, width / own_width, shape.height / asset.height))


def _table(workspace: tuple[float, float, float, float], poses: npt.NDArray[np.float64]) -> list[float]:
    """The workspace and a margin, grown to hold every object that stands a little off it."""
    side = max(workspace[2] - workspace[0], workspace[3] - workspace[1])
    table = []
    for axis, sign in ((0, -1.0), (1, -1.0), (0, 1.0), (1, 1.0)):
        edge = workspace[axis if sign < 0 else axis + 2]
        reached = float(np.max(sign * (poses[..., axis] - edge))) if poses.size else 0.0
        table.append(edge + sign * (MARGIN * side + min(max(reached, 0.0), BEYOND * side)))
    return table


def poses_of(file: SceneFile) -> npt.NDArray[np.float64]:
    """(scenes, objects, 3): x, y, theta in the order of `file.objects`. Raises DataError where a pose is missing."""
    names = [item.name for item in file.objects]
    rows = []
    for number, scene in enumerate(file.scenes, start=1):
        missing = [name for name in names if name not in scene.poses]
        if missing:
            raise DataError(Diagnostic(f"scene {number} has no pose for `{missing[0]}`", help="the file is incomplete"))
        rows.append([[(p := scene.poses[name]).x, p.y, math.remainder(p.theta, 2.0 * math.pi)] for name in names])
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(names), 3)


def stage_of(file: SceneFile) -> Stage:
    """The stage of a scenes file. Raises DataError where its workspace is empty or a scene lacks a pose."""
    (x0, x1), (y0, y1) = file.workspace.x, file.workspace.y
    if not (x1 > x0 and y1 > y0):
        raise DataError(Diagnostic("the workspace is empty", help="give its x and y as [lowest, highest] in metres"))
    workspace = (x0, y0, x1, y1)
    side = max(x1 - x0, y1 - y0)
    shapes = [item.shape for item in file.objects]
    known = [shape.asset if shape.asset in ASSETS else UNKNOWN for shape in shapes]
    colors = colors_of([(item.name, asset) for item, asset in zip(file.objects, known, strict=True)])
    things = tuple(_thing(shape, color) for shape, color in zip(shapes, colors, strict=True))
    tallest = max((shape.height for shape in shapes), default=0.0)
    table = _table(workspace, poses_of(file))
    return Stage(workspace, (table[0], table[1], table[2], table[3]), min(tallest, TALLEST * side), things)
