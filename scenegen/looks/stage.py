"""What is drawn, as plain data: the table and the things on it. It crosses to the worker processes as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.files import OTHER_OBJECTS
from scenegen.geometry import Box, Circle, Footprint, Polygon
from scenegen.looks.camera import VIEW_ANGLES
from scenegen.pose import FLAT, THETA, TWO_PI, flat
from scenegen.scenes.blocks import objects_of
from scenegen.scenes.data import (
    VERSION_WITH_HEIGHTS,
    Pose,
    SceneFile,
    check_sizes,
    chosen_surfaces,
    footprint_of,
    heights_of,
    varying,
)
from scenegen.things import ASSETS, PLAIN, UNKNOWN, Shape, has_picture
from scenegen.things.library import RGB
from scenegen.things.outline import MAX_DRAWN_CORNERS, simplify
from scenegen.things.palette import object_colors, parse_rgb, region_colors
from scenegen.things.surfaces import base_heights, overlapping

Floats = npt.NDArray[np.float64]

TABLE_MARGIN = 0.07  # of the table round the workspace, in sides of the workspace
RIM = 0.015  # of the table round what reaches beyond that, likewise
MAX_TABLE_GROWTH = 0.60  # how many sides of the workspace the table grows at most for what stands off it
MAX_REGION_GROWTH = 0.25  # and for regions, which are cut off there
TALLEST = 0.60  # what the camera makes room for, in sides of the workspace
TALLEST_DECLARED = 1.5  # likewise, where a spec says how high things stand
FAR_OUT = 16.0  # sides of the workspace: how far from the origin it is drawn where it is
WOOD: RGB = (0.83, 0.72, 0.58)
USUAL_WIDTH = 640  # pixels: default width of the picture of a square workspace
ASPECT_RATIOS = (0.75, 3.0)  # least and largest width over height of a default picture
FILLED = 0.87  # share of the height of a 4:3 picture that a square table fills
SIZE_STEP = 16  # pixels: sides of such pictures are multiples of it
ABSENT = (math.nan,) * len(FLAT)


@dataclass(frozen=True, slots=True)
class PictureObject:
    """An object: what it looks like, its main colour, and what is written beside it, if anything."""

    shape: Shape
    color: RGB
    label: str = ""


@dataclass(frozen=True, slots=True)
class PictureRegion:
    """A region: its footprint at a fixed pose (x, y, heading), and its colour; with a `height`, the top of a board."""

    footprint: Footprint
    pose: tuple[float, float, float]
    color: RGB
    height: float = 0.0


@dataclass(frozen=True, slots=True)
class PictureSetup:
    """What all scenes of a file share. Rectangles are (x lowest, y lowest, x highest, y highest) in metres."""

    workspace: tuple[float, float, float, float]
    table: tuple[float, float, float, float]
    height: float
    things: tuple[PictureObject, ...]
    patches: tuple[PictureRegion, ...] = ()
    declared: tuple[float, ...] = ()  # how high each object stands in every scene, where the spec says that

    @property
    def side(self) -> float:
        """The workspace's longer side, in metres."""
        return max(self.workspace[2] - self.workspace[0], self.workspace[3] - self.workspace[1])

    @property
    def thickness(self) -> float:
        """Of the table top, in metres."""
        return 0.035 * self.side

    def corners(self) -> Floats:
        """(12, 3): what a picture has to show, namely the table and the room that objects take above the workspace."""
        x0, y0, x1, y1 = self.table
        u0, v0, u1, v1 = self.workspace
        top = [(x, y, self.height) for x in (u0, u1) for y in (v0, v1)]
        return np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (-self.thickness, 0.0)] + top)

    def near_origin(self) -> tuple[PictureSetup, tuple[float, float]]:
        """The stage as it is drawn, and where in the world its origin is: (0, 0), but for a workspace so far out that
        the renderer's single precision would show. That one is moved to begin at the origin."""
        x, y = self.workspace[:2]
        if max(abs(x), abs(y)) <= FAR_OUT * self.side:
            return self, (0.0, 0.0)
        workspace, table = (
            (left - x, low - y, right - x, high - y) for left, low, right, high in (self.workspace, self.table)
        )
        patches = tuple(replace(one, pose=(one.pose[0] - x, one.pose[1] - y, one.pose[2])) for one in self.patches)
        return replace(self, workspace=workspace, table=table, patches=patches), (x, y)


def _reach(footprint: Footprint, poses: Floats, axis: int, sign: float) -> float:
    """How far a footprint with poses (P, 3) gets along an axis, in metres: the largest of sign * coordinate."""
    away = sign * poses[:, axis]
    if isinstance(footprint, Circle):
        return float(np.max(away)) + footprint.radius
    if isinstance(footprint, Box):
        x, y = footprint.length / 2.0, footprint.width / 2.0
        corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    else:
        corners = np.array(footprint.vertices)
    cos, sin = np.cos(poses[:, THETA]), np.sin(poses[:, THETA])
    turn = np.stack([cos, -sin] if axis == 0 else [sin, cos])
    return float(np.max(away + np.max(sign * corners @ turn, axis=0)))


def _table(
    workspace: tuple[float, float, float, float], things: list[tuple[Footprint, Floats]], most: float
) -> list[float]:
    """The workspace and a margin, grown to hold all of every thing (footprint, poses), by `most` sides at most."""
    side = max(workspace[2] - workspace[0], workspace[3] - workspace[1])
    table = []
    for axis, sign in ((0, -1.0), (1, -1.0), (0, 1.0), (1, 1.0)):
        edge = workspace[axis if sign < 0 else axis + 2]
        reached = max((_reach(footprint, poses, axis, sign) - sign * edge for footprint, poses in things), default=0.0)
        table.append(edge + sign * min(max(reached + RIM * side, TABLE_MARGIN * side), (TABLE_MARGIN + most) * side))
    return table


def poses_of(file: SceneFile) -> npt.NDArray[np.float64]:
    """(scenes, objects, 3): x, y, theta in the order of `file.objects`; (scenes, objects, 4), with the height above the
    table, where objects do not stand equally high in all scenes. NaN for objects that are not there. Raises DataError
    where a pose is missing."""
    names = [item.name for item in file.objects]
    rows = []
    for number, scene in enumerate(file.scenes, start=1):
        missing = [name for name in objects_of(file, scene.counts or {}) if name not in scene.poses]
        if missing:
            raise DataError(OTHER_OBJECTS(scene=f"scene {number}", missing=missing[0], wanted=tuple(names)))
        rows.append([_row(scene.poses[name]) if name in scene.poses else ABSENT for name in names])
    poses = np.array(rows, dtype=np.float64).reshape(len(rows), len(names), len(FLAT))
    if not varying(file):
        return poses
    heights = heights_of(file, chosen_surfaces(file, file.scenes))
    assert heights is not None
    return np.concatenate([poses, heights[..., None]], axis=2)


def stage_of(
    file: SceneFile, *, distinct: bool = False, held: Mapping[int, tuple[float, float, float]] | None = None
) -> PictureSetup:
    """The stage of a scenes file; `distinct` colours apart what looks the same. `held` are poses of objects that stand
    there in every scene, by their numbers. Raises DataError for sizes that cannot be drawn, and where a scene lacks a
    pose."""
    check_sizes(file)
    (x0, x1), (y0, y1) = file.workspace.x, file.workspace.y
    workspace = (x0, y0, x1, y1)
    side = max(x1 - x0, y1 - y0)
    known = [item.shape.asset if item.shape.asset in {*ASSETS, *PLAIN} else UNKNOWN for item in file.objects]
    shapes = [
        Shape(asset, footprint_of(item.shape.footprint), item.shape.height, open=tuple(item.shape.open))
        for item, asset in zip(file.objects, known, strict=True)
    ]
    named = [(item.name, asset) for item, asset in zip(file.objects, known, strict=True)]
    colors = [
        parse_rgb(item.shape.color) if item.shape.color else usual
        for item, usual in zip(file.objects, object_colors(named, distinct=distinct), strict=True)
    ]
    # A block that stands for something the library does not know says what.
    labels = [
        item.name if asset == UNKNOWN and not has_picture(item.name) else ""
        for item, asset in zip(file.objects, known, strict=True)
    ]
    things = tuple(map(PictureObject, shapes, colors, labels))
    patches = _patches(file)
    poses = poses_of(file)
    here = [poses[~np.isnan(poses[:, k, 0]), k] for k in range(len(shapes))]
    standing = [(shape.footprint, there) for shape, there in zip(shapes, here, strict=True) if len(there)]
    standing += [(shapes[which].footprint, np.array([pose])) for which, pose in (held or {}).items()]
    lying = [(patch.footprint, np.array([patch.pose])) for patch in patches]
    inner, outer = _table(workspace, lying, MAX_REGION_GROWTH), _table(workspace, standing, MAX_TABLE_GROWTH)
    table = [*map(min, inner[:2], outer[:2]), *map(max, inner[2:], outer[2:])]
    declared = _heights(file)
    tops = _bases(shapes, poses, declared) + np.array([shape.height for shape in shapes])
    tops = tops[~np.isnan(poses[..., 0])]
    boards = [patch.height for patch in patches]
    tallest = max(float(tops.max(initial=0.0)), *boards, 0.0)
    height = min(tallest, (TALLEST_DECLARED if file.version == VERSION_WITH_HEIGHTS or any(boards) else TALLEST) * side)
    return PictureSetup(workspace, (table[0], table[1], table[2], table[3]), height, things, patches, declared)


def usual_size(file: SceneFile, width: int = USUAL_WIDTH) -> tuple[int, int]:
    """The default size in pixels for the table of a file's workspace: 4:3 for a square one, wider for a wide one.

    It depends on the workspace and the objects' heights alone, so that all scenes of a spec get one size. All pictures
    have about as many pixels as one of 4:3 that is `width` wide.
    """
    long, deep = (high - low for low, high in (file.workspace.x, file.workspace.y))
    side = max(long, deep)
    margin = TABLE_MARGIN * side
    if not (long > 0.0 and deep > 0.0 and math.isfinite(side + 2.0 * margin)):
        return width, 3 * width // 4  # drawing reports the error of such a workspace
    # Objects at the far edge rise above the table. A 4:3 picture has some space for this.
    tallest = min(max((item.shape.height for item in file.objects), default=0.0), TALLEST * side)
    above = max(tallest / math.tan(math.radians(VIEW_ANGLES["perspective"][1])) - margin, 0.0)
    high = max(deep + 2.0 * margin, FILLED * (deep + 2.0 * margin + above))
    shape = min(max(4.0 / 3.0 * (long + 2.0 * margin) / high, ASPECT_RATIOS[0]), ASPECT_RATIOS[1])
    mean = width * math.sqrt(0.75)
    sides = mean * math.sqrt(shape), mean / math.sqrt(shape)
    return SIZE_STEP * round(sides[0] / SIZE_STEP), SIZE_STEP * round(sides[1] / SIZE_STEP)


def overlaps_of(file: SceneFile) -> list[list[str]]:
    """For each scene in words which objects stand in each other: `mug overlaps plate`. Raises as `stage_of` does."""
    shapes = [thing.shape for thing in stage_of(file).things]
    names = [item.name for item in file.objects]
    poses = poses_of(file)
    bases = _bases(shapes, poses, _heights(file)) if file.version == VERSION_WITH_HEIGHTS else None
    found = overlapping(shapes, flat(poses), bases)
    return [[f"{names[a]} overlaps {names[b]}" for a, b in pairs] for pairs in found]


def places_of(stage: PictureSetup, poses: Floats) -> Floats:
    """(scenes, objects, 4): x, y, theta and what each object stands on, for poses as `poses_of` gives them; poses that
    have a quaternion after the height, w first, keep it."""
    heights = _bases([thing.shape for thing in stage.things], poses, stage.declared)
    return np.concatenate([flat(poses), heights[..., None], poses[..., len(FLAT) + 1 :]], axis=2)


def _heights(file: SceneFile) -> tuple[float, ...]:
    """The heights that hold in every scene; none where they differ, or where poses say them."""
    if varying(file):
        return ()
    found = heights_of(file, np.empty((0, 0)))
    return () if found is None else tuple(found.tolist())


def _bases(shapes: list[Shape], poses: Floats, declared: tuple[float, ...]) -> Floats:
    """(scenes, objects): how high each object stands."""
    if poses.shape[-1] > len(FLAT):
        return poses[..., len(FLAT)]
    return base_heights(shapes, poses, declared=declared)


def _patches(file: SceneFile) -> tuple[PictureRegion, ...]:
    """The regions, each in a pale colour of its own."""
    patches: list[PictureRegion] = []
    for region, color in zip(file.regions, region_colors([region.name for region in file.regions]), strict=True):
        footprint = footprint_of(region.footprint)
        if isinstance(footprint, Polygon):  # every corner is looked at for every pixel
            footprint = Polygon(simplify(footprint.vertices, MAX_DRAWN_CORNERS))
        patches.append(PictureRegion(footprint, _row(region.pose), color, region.height))
    return tuple(patches)


def _row(pose: Pose) -> tuple[float, float, float]:
    # A heading of 1e300 radians would cost all digits: the remainder is exact.
    return pose.x, pose.y, math.remainder(pose.theta, TWO_PI)
