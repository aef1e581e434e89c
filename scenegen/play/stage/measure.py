"""Where the objects of a start stand: from tags in a photograph, from clicks on the corners of outlines, or from a
table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import permutations
from pathlib import Path

import numpy as np

from scenegen.api.reading import read_scenes
from scenegen.arrays import Array
from scenegen.errors import DataError, RequestError
from scenegen.errors.files import NOT_SCENES, TABLE_COLUMN
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.errors.worlds import STAGE_MAT, STAGE_PHOTO, STAGE_THINGS
from scenegen.geometry import Circle
from scenegen.play.stage.camera import Lens, Photograph, StageCamera, find_camera
from scenegen.play.stage.stage import MAT_TAGS, StageThing, TableStage, square_corners
from scenegen.play.suites.suite import GradedStart
from scenegen.pose import THETA, TWO_PI
from scenegen.scenes.formats.tables import read_table
from scenegen.things.outline import corners_of

MOST_PRINT_ERROR = 0.012  # relative, of sizes that a photograph tells
MOST_RULER_ERROR = 0.005  # relative, of the ruler of the mat
MOST_SPREAD = 0.006  # metres: two standard deviations of places in a picture
MOST_CORNER_ERROR = 0.008  # metres: a click that is off by more is on another corner
MAX_CLICKED_CORNERS = 6  # of an outline with corners: every order of more takes too long


def measure_poses(
    stage: TableStage,
    start: GradedStart,
    photo: Path | None = None,
    corners: Path | None = None,
    poses: Path | None = None,
    camera: Path | None = None,
    ruler: float | None = None,
) -> Array:
    """(N, 3): where the objects of a start stand, from a table of poses, or from a photograph: by their tags, or by
    clicked corners of their outlines. `camera` is a file of what is known of it, `ruler` how long the mat's is, in
    metres. Raises DataError for what does not show it, and for an object off the table."""
    if photo is None:
        assert poses is not None
        found = poses_by_table(start, poses)
    else:
        if ruler is not None:
            check_ruler(str(photo), ruler)
        picture = Photograph.read(photo)
        seen = find_camera(stage, picture, None if camera is None else Lens.read(camera), start)
        _check_spread(stage, start, picture, seen)
        if corners is None:
            found = poses_by_tags(stage, start, picture, seen)
        else:
            found = poses_by_corners(stage, start, corners, seen)
    check_table(stage, start, found)
    return found


def poses_by_tags(stage: TableStage, start: GradedStart, photo: Photograph, camera: StageCamera) -> Array:
    """(N, 3). Raises DataError where an object's tag is not seen, or another thing's is on the mat, and where the tags
    are of another size on the mat than on the things: the printer changed one of both."""
    tops = stage.tops(start)
    wanted = [thing for thing, _ in tops]
    seen = [thing for thing in stage.things if thing.tag in photo.tags]
    strangers = [one.name for one in seen if one not in wanted and _is_on(stage, one, photo, camera)]
    missing = [name for name, one in zip(start.objects, wanted, strict=True) if one not in seen]
    if strangers or missing:
        raise DataError(STAGE_THINGS(file=photo.name, stranger=strangers, missing=missing))
    found = [pose_by_tag(one, height, photo, camera) for one, height in tops]
    size = float(np.median([size for _, size in found]))
    if abs(size - 1.0) > MOST_PRINT_ERROR:
        raise DataError(STAGE_MAT(file=photo.name, percent=100.0 / size))
    return np.array([pose for pose, _ in found])


def pose_by_tag(thing: StageThing, height: float, photo: Photograph, camera: StageCamera) -> tuple[Array, float]:
    """The pose (3,) of a thing whose tag is seen, at that height in metres, and the size of the tag relative to what it
    should be."""
    return _place(camera.place(photo.tags[thing.tag], height), square_corners(thing.side))


def check_ruler(file: str, length: float) -> None:
    """Raises DataError where the ruler of the mat, which should be 10 cm long, is not, and RequestError for a length
    that no printer makes of it."""
    if not 0.05 <= length <= 0.2:
        wanted = "from 5 to 20 cm, such as 97mm"
        raise RequestError(OUT_OF_RANGE(argument="ruler", value=f"{length:g} m", wanted=wanted))
    if abs(length / 0.1 - 1.0) > MOST_RULER_ERROR:
        raise DataError(STAGE_MAT(file=file, percent=1000.0 * length))


def poses_by_corners(stage: TableStage, start: GradedStart, path: Path, camera: StageCamera) -> Array:
    """(N, 3), from a table with the columns object, u and v: pixels of corners of the tops of outlines, in any order;
    of round outlines three or more points. A heading that corners leave open is the one nearest to the start's. Raises
    DataError."""
    table = read_table(path, "corners", NOT_SCENES)
    if "object" not in table.names:
        raise DataError(TABLE_COLUMN(file=path, name="object", known=sorted(table.names)))
    names = [str(one) for one in table.cells("object")]
    pixels = np.column_stack([table.column("u"), table.column("v")])
    missing = [one for one in start.objects if one not in names]
    strangers = sorted(set(names) - set(start.objects))
    if missing or strangers:
        raise DataError(STAGE_THINGS(file=path, stranger=strangers, missing=missing))
    found = []
    for which, (thing, height) in enumerate(stage.tops(start)):
        name, usual = start.objects[which], start.task.scenes.poses[start.row][which]
        points = camera.place(pixels[[one == name for one in names]], height)
        pose, off = _fit_outline(thing, points, float(usual[THETA]))
        if off > MOST_CORNER_ERROR:
            raise DataError(STAGE_THINGS(file=path, name=name, off=1000.0 * off))
        found.append(pose)
    return np.array(found)


def poses_by_table(start: GradedStart, path: Path) -> Array:
    """(N, 3), from the first row of a table of poses, or the first scene of a file. Raises DataError, also for headings
    that are no radians."""
    poses: Array = read_scenes(path, stop=1, spec=start.task.spec).poses[0]
    for name, theta in zip(start.objects, poses[:, THETA].tolist(), strict=True):
        if abs(theta) > TWO_PI:
            raise DataError(STAGE_THINGS(file=path, name=name, theta=theta))
    return poses


def check_table(stage: TableStage, start: GradedStart, poses: Array) -> None:
    """Raises DataError for an object off the table: beyond the margin of the mat."""
    ends = [(low - stage.margin, high + stage.margin) for low, high in (stage.x, stage.y)]
    for name, (x, y, _) in zip(start.objects, poses.tolist(), strict=True):
        if not all(low <= value <= high for value, (low, high) in zip((x, y), ends, strict=True)):
            table = " and ".join(f"{100.0 * low:.0f} to {100.0 * high:.0f} cm" for low, high in ends)
            raise DataError(STAGE_THINGS(name=name, x=100.0 * x, y=100.0 * y, table=table))


def _check_spread(stage: TableStage, start: GradedStart, photo: Photograph, camera: StageCamera) -> None:
    """Raises DataError where the tags of the mat that are seen hardly tell where things are."""
    spread = 2.0 * max(
        camera.place_error(camera.project(np.array([[*pose[:2], height]])), height)
        for pose, (_, height) in zip(start.task.scenes.poses[start.row], stage.tops(start), strict=True)
    )
    if spread > MOST_SPREAD:
        seen = sum(tag in photo.tags for tag in range(MAT_TAGS))
        raise DataError(STAGE_PHOTO(file=photo.name, seen=seen, spread=1000.0 * spread))


def _is_on(stage: TableStage, thing: StageThing, photo: Photograph, camera: StageCamera) -> bool:
    """Whether a thing is on the mat, and does not just lie beside it."""
    place: list[float] = camera.place(photo.tags[thing.tag], thing.shape.height).mean(axis=0).tolist()
    ends = zip(place, (stage.x, stage.y), strict=True)
    return all(low - stage.margin < value < high + stage.margin for value, (low, high) in ends)


def _place(seen: Array, own: Array) -> tuple[Array, float]:
    """The pose (3,) at which points (P, 2) of an object's frame lie as seen (P, 2), by least squares, and their size
    relative to what it should be."""
    middle, own_middle = seen.mean(axis=0), own.mean(axis=0)
    a = (own - own_middle) @ np.array([1.0, 1.0j])
    b = (seen - middle) @ np.array([1.0, 1.0j])
    ratio = complex(np.vdot(a, b) / np.vdot(a, a).real)
    turn = ratio / abs(ratio)
    shift = complex(*middle) - turn * complex(*own_middle)
    return np.array([shift.real, shift.imag, math.atan2(turn.imag, turn.real) % TWO_PI]), abs(ratio)


def _fit_outline(thing: StageThing, points: Array, heading: float) -> tuple[Array, float]:
    """The pose (3,) at which an outline has these points (P, 2) as corners, and how far off the worst is, in metres."""
    footprint = thing.shape.footprint
    if isinstance(footprint, Circle):
        if len(points) < 3:
            return np.zeros(3), math.inf
        system = np.column_stack([2.0 * points, np.ones(len(points))])
        x, y, _ = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
        off = np.abs(np.hypot(*(points - (x, y)).T) - footprint.radius).max()
        return np.array([x, y, heading]), float(off)
    corners = np.array(corners_of(footprint, 0))
    fits = [_fit_corners(points, corners[list(order)]) for order in _orders(len(points), len(corners))]
    least = min((off for _, off in fits), default=math.inf)
    if least == math.inf:
        return np.zeros(3), math.inf
    near = [pose for pose, off in fits if off <= least + 1e-4]
    return min(near, key=lambda pose: abs(math.remainder(pose[THETA] - heading, TWO_PI))), least


def _orders(points: int, corners: int) -> Iterator[Sequence[int]]:
    """Which corners so many points may be."""
    if 2 <= points <= min(corners, MAX_CLICKED_CORNERS):
        yield from permutations(range(corners), points)


def _fit_corners(points: Array, corners: Array) -> tuple[Array, float]:
    pose, _ = _place(points, corners)
    cos, sin = math.cos(pose[THETA]), math.sin(pose[THETA])
    there = corners @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]
    return pose, float(np.hypot(*(there - points).T).max())
