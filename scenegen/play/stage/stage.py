"""The stage of a suite: a mat that covers the workspaces of all its tasks, a tag at each corner; and its things, a tag
on each. The frame is that of the specs: x to the right, y away from the viewer, metres."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.geometry import Box, Circle, Polygon
from scenegen.geometry.footprint import measures
from scenegen.lang.spec import CheckedSpec
from scenegen.play.suites.suite import GradedStart, Suite
from scenegen.things.library import Shape
from scenegen.things.outline import corners_of

MAT_TAGS = 4  # ids 0 to 3 lie at the corners: near left, near right, far right, far left
MAX_TAGS = 587  # of the family 36h11
TAG_CELLS = 8  # cells across a tag with its black frame; one more all round is white
TAG_SHARE, TAG_SIZES = 0.15, (0.04, 0.12)  # of the longer side of the workspace; metres
GRID_STEP, GRID_STEPS = 0.02, (0.005, 0.5)  # metres
CIRCLE_SIDES = 64  # of the polygons that stand for round outlines
EPS_GRID = 1e-6  # metres: what still lies on a line of the grid


@dataclass(frozen=True, slots=True)
class StageThing:
    """An object of a suite: what tasks call it, its shape, the id of its tag, and that tag's side in metres."""

    name: str
    shape: Shape
    tag: int
    side: float

    @property
    def is_round(self) -> bool:
        """Whether no heading can be told from another."""
        return self.shape.asset == "cylinder"


@dataclass(frozen=True, slots=True)
class TableStage:
    """The mat is the rectangle `x`, `y` of the workspaces with `margin` around, so that no object covers a tag; then
    tags of the side `tag`. Lines of the grid are multiples of `step`. All in metres."""

    x: tuple[float, float]
    y: tuple[float, float]
    margin: float
    tag: float
    step: float
    things: tuple[StageThing, ...]

    @staticmethod
    def from_suite(suite: Suite, step: float = GRID_STEP) -> TableStage:
        """Raises RequestError for more things than tags, and for a step that is no grid."""
        if not GRID_STEPS[0] <= step <= GRID_STEPS[1]:
            wanted = "from {:g} to {:g} m".format(*GRID_STEPS)
            raise RequestError(OUT_OF_RANGE(argument="grid", value=f"{step:g} m", wanted=wanted))
        specs = [task.spec.checked for task in suite.tasks]
        things = _things(specs)
        if len(things) > MAX_TAGS - MAT_TAGS:
            wanted = f"{MAX_TAGS - MAT_TAGS} at most, one for each tag"
            raise RequestError(OUT_OF_RANGE(argument="objects", value=len(things), wanted=wanted))
        spaces = [spec.workspace for spec in specs]
        x = min(one.x[0] for one in spaces), max(one.x[1] for one in spaces)
        y = min(one.y[0] for one in spaces), max(one.y[1] for one in spaces)
        least, most = TAG_SIZES
        tag = min(max(_whole_cm(TAG_SHARE * max(x[1] - x[0], y[1] - y[0])), least), most)
        return TableStage(
            x, y, _whole_cm(max(measures(one.shape.footprint).outer for one in things)), tag, step, things
        )

    @property
    def edge(self) -> float:
        """From the workspace to the edge of the mat."""
        return self.margin + self.tag * (1.0 + 2.0 / TAG_CELLS)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the mat."""
        return self.x[1] - self.x[0] + 2.0 * self.edge, self.y[1] - self.y[0] + 2.0 * self.edge

    def tag_corners(self) -> Array:
        """(4, 4, 2): of each tag of the mat far left, far right, near right and near left, as a detector has them."""
        far = self.margin + self.tag / TAG_CELLS + self.tag / 2.0
        x, y = (self.x[0] - far, self.x[1] + far), (self.y[0] - far, self.y[1] + far)
        centres = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
        return centres[:, None] + square_corners(self.tag)

    def lines(self, axis: int) -> list[tuple[str, float]]:
        """The lines of the grid across an axis by their names: letters along x, numbers along y."""
        low, high = (self.x, self.y)[axis]
        first, last = math.ceil((low - EPS_GRID) / self.step), math.floor((high + EPS_GRID) / self.step)
        return [(str(k + 1) if axis else _letters(k), (first + k) * self.step) for k in range(last - first + 1)]

    def name_place(self, x: float, y: float) -> str:
        """The nearest crossing of lines, and how far off it is where that is a millimetre or more."""
        found, rest = "", []
        for axis, (value, ways) in enumerate(((x, ("right", "left")), (y, ("away", "near")))):
            name, place = min(self.lines(axis), key=lambda one: abs(one[1] - value))
            found += name
            if abs(value - place) >= 0.0005:
                rest.append(f"{100.0 * abs(value - place):.1f} cm {ways[value < place]}")
        return " ".join([found, *(["+", ", ".join(rest)] if rest else [])])

    def thing(self, spec: CheckedSpec, which: int) -> StageThing:
        """That of an object of a task."""
        name, shape = spec.objects[which], replace(spec.shapes[which], color="")
        return next(one for one in self.things if one.shape == shape and one.name.partition(" ")[0] == name)

    def tops(self, start: GradedStart) -> list[tuple[StageThing, float]]:
        """Each object of a start, and the height of its top above the mat, in metres."""
        spec = start.task.spec.checked
        return [
            (self.thing(spec, which), float(pose[2]) + shape.height)
            for which, (pose, shape) in enumerate(zip(start.poses, spec.shapes, strict=True))
        ]


def square_corners(side: float) -> Array:
    """(4, 2): the corners of a tag around its middle, in a detector's order."""
    return side / 2.0 * np.array([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])


def outline_at(shape: Shape, pose: Array) -> Array:
    """(P, 2): the corners of an object's outline at (x, y, theta)."""
    x, y, theta = pose
    turn = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
    return np.asarray(np.array(corners_of(shape.footprint, CIRCLE_SIDES)) @ turn + (x, y))


def _things(specs: list[CheckedSpec]) -> tuple[StageThing, ...]:
    """Objects of one name and shape, whatever their colour, are one thing; others of that name have a number after
    it."""
    found: dict[tuple[str, Shape], str] = {}
    for name, shape in (pair for spec in specs for pair in zip(spec.objects, spec.shapes, strict=True)):
        more = sum(other == name for other, _ in found)
        found.setdefault((name, replace(shape, color="")), f"{name} ({more + 1})" if more else name)
    return tuple(
        StageThing(name, shape, MAT_TAGS + k, _tag_side(shape.footprint))
        for k, ((_, shape), name) in enumerate(found.items())
    )


def _tag_side(footprint: Circle | Box | Polygon) -> float:
    """The side of a tag that lies on a footprint with its white edge: whole millimetres."""
    inner = measures(footprint).inner
    room = min(footprint.extent) if isinstance(footprint, Box) else math.sqrt(2.0) * abs(inner)
    return max(math.floor(1000.0 * room * TAG_CELLS / (TAG_CELLS + 2) + EPS_GRID), 1) / 1000.0


def _whole_cm(length: float) -> float:
    return math.ceil(100.0 * length - EPS_GRID) / 100.0


def _letters(number: int) -> str:
    """A to Z, then AA, AB, ..."""
    name = ""
    while number >= 0:
        number, rest = divmod(number, 26)
        name, number = chr(ord("A") + rest) + name, number - 1
    return name
