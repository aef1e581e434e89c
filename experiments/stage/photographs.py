"""Photographs of a stage, rendered: the mat and the tags of things warped by a camera with a lens, then blur, light and
noise. What stands there is known, so what `scenegen stage check` makes of a picture can be held against it.

    python -m experiments.stage.photographs tabletop -n 500
    python -m experiments.stage.photographs tabletop -n 20 --faults
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.looks.stage import stage_of
from scenegen.play.stage.camera import Grey, Lens, Photograph, find_camera
from scenegen.play.stage.mat import LABEL_GREY, draw_mat, tag_cells
from scenegen.play.stage.measure import pose_by_tag, poses_by_tags
from scenegen.play.stage.pdf import Stroke, Words
from scenegen.play.stage.stage import MAT_TAGS, TAG_CELLS, TableStage, outline_at
from scenegen.play.suites.suite import GradedStart, Suite

PIXELS_PER_METRE = 5000.0  # of the mat's raster
SUPERSAMPLED = 2  # pixels of the rendering across one of the photograph
COARSE = 8  # of these pixels, between which places are interpolated
WIDTH, HEIGHT = 1920, 1440
TABLE_GREY, TOP_GREY, SIDE_GREY = 0.45, 0.93, 0.6


@dataclass(frozen=True)
class Shot:
    """A camera (OpenCV's matrix, distortion, turn as a vector, shift), and how the picture is spoilt: blur and noise as
    standard deviations in pixels and in levels of 255, light from left to right."""

    matrix: Array
    distortion: Array
    turn: Array
    shift: Array
    blur: float
    noise: float
    light: tuple[float, float]


def draw_shot(rng: np.random.Generator, stage: TableStage, distance: float) -> Shot:
    """A camera at a distance in metres from the middle of the mat, 40 to 85 degrees above it, as phones and webcams
    are."""
    focal = WIDTH * rng.uniform(0.55, 0.9)
    matrix = np.array(
        [
            [focal, 0.0, (WIDTH - 1) / 2 + rng.normal(0, 8)],
            [0.0, focal, (HEIGHT - 1) / 2 + rng.normal(0, 8)],
            [0, 0, 1.0],
        ]
    )
    middle = np.array([*(sum(ends) / 2 + rng.normal(0, 0.01) for ends in (stage.x, stage.y)), 0.0])
    up, round_ = np.radians(rng.uniform(40, 85)), rng.uniform(0, 2 * np.pi)
    eye = middle + distance * np.array([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)])
    ahead = (middle - eye) / distance
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    roll = rng.normal(0, 0.1)
    down = np.cross(ahead, right)
    turn = np.array([np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right, ahead])
    return Shot(
        matrix, np.array([rng.normal(0, 0.04), rng.normal(0, 0.02), *rng.normal(0, 0.0005, 2), 0.0]),
        cv2.Rodrigues(turn)[0].ravel(), -turn @ eye, rng.uniform(0.4, 1.2), rng.uniform(1, 6),
        (rng.uniform(0.45, 1.0), rng.uniform(0.45, 1.0)),
    )  # fmt: skip


def mat_raster(stage: TableStage) -> tuple[Array, Callable[[Array], Array]]:
    """The mat as brightness from 0 to 1, and what leads from points (P, 2) in metres to its pixels."""
    drawing = draw_mat(stage, "rendered", "a0")
    (left, low), (right, high) = drawing.low, drawing.high
    picture = np.full((round((high - low) * PIXELS_PER_METRE), round((right - left) * PIXELS_PER_METRE)), 255, np.uint8)

    def pixels(points: Array) -> Array:
        return np.stack([points[..., 0] - left, high - points[..., 1]], axis=-1) * PIXELS_PER_METRE - 0.5

    for part in drawing.parts:
        if isinstance(part, Words):
            at = pixels(np.array([part.x - 0.3 * part.size, part.y - 0.3 * part.size])).round().astype(int).tolist()
            cv2.putText(
                picture,
                part.text,
                at,
                cv2.FONT_HERSHEY_SIMPLEX,
                part.size * PIXELS_PER_METRE / 25,
                round(255 * LABEL_GREY),
                2,
            )
            continue
        assert isinstance(part, Stroke)
        corners = (16 * pixels(np.array(part.points))).round().astype(np.int32)
        if part.fill:  # a rectangle: each pixel by the share of it that is covered
            ends = pixels(np.array(part.points)) + 0.5
            down, along = (cover_pixels(ends[:, 1 - axis], picture.shape[axis]) for axis in (0, 1))
            part_of = np.ix_(np.flatnonzero(down), np.flatnonzero(along))
            share = (down[:, None] * along)[part_of]
            picture[part_of] = (picture[part_of] * (1.0 - share) + 255 * part.grey * share).round()
        else:
            wide = max(1, round(part.width * PIXELS_PER_METRE))
            cv2.polylines(picture, [corners], False, round(255 * part.grey), wide, cv2.LINE_AA, 4)
    return (picture / 255.0).astype(np.float32), pixels


def cover_pixels(ends: Array, count: int) -> Array:
    """(count,): the share of each pixel that lies between the least and the largest of some places."""
    pixels = np.arange(count)
    return np.asarray((np.minimum(pixels + 1.0, ends.max()) - np.maximum(pixels, ends.min())).clip(0.0, 1.0))


def render_photograph(
    stage: TableStage,
    start: GradedStart,
    poses: Array,
    shot: Shot,
    rng: np.random.Generator,
    *,
    raster: tuple[Array, Callable[[Array], Array]],
    tags: list[int | None] | None = None,
    scale: float = 1.0,
    tag_scale: float = 1.0,
    bend: float = 0.0,
    covered: Sequence[int] = (),
    shades: Sequence[float] = (),
) -> Grey:
    """The picture (h, w) of objects at poses (N, 3). `tags` are those on them, None for none; mat and tags printed at
    `scale` and `tag_scale`; `bend` raises an edge of the mat by so many metres; `covered` are tags of the mat under
    something; `shades` are how light objects are."""
    many = SUPERSAMPLED
    matrix = shot.matrix.copy()
    matrix[:2] *= many
    matrix[:2, 2] += (many - 1) / 2
    rows, columns = (np.arange(0, many * side + COARSE, COARSE, dtype=np.float64) for side in (HEIGHT, WIDTH))
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 1, 2)
    plain = cv2.undistortPoints(grid, matrix, shot.distortion).reshape(len(rows), len(columns), 2)
    turn = cv2.Rodrigues(shot.turn)[0]
    eye = -turn.T @ shot.shift
    rays = np.concatenate([plain, np.ones((*plain.shape[:2], 1))], axis=-1) @ turn

    def places(height: float | Array) -> Array:
        """What is seen at a height, for pixels COARSE apart."""
        return np.asarray(eye[:2] + rays[..., :2] * ((height - eye[2]) / rays[..., 2])[..., None])

    def between(coarse: Array, left: int, top: int, right: int, bottom: int) -> Array:
        """The same for each pixel of a part of the picture."""
        u, v = np.arange(left, right, dtype=np.float32) / COARSE, np.arange(top, bottom, dtype=np.float32) / COARSE
        across, down = np.meshgrid(u, v)
        return np.asarray(cv2.remap(coarse.astype(np.float32), across, down, cv2.INTER_LINEAR))

    mat, pixels = raster
    flat = places(0.0)
    for _ in range(3 if bend else 0):  # a surface that rises to one side
        share = np.clip((flat[..., 0] - stage.x[0]) / (stage.x[1] - stage.x[0]), 0.0, 1.2)
        flat = places(bend * share**2)
    at = between(pixels(flat / scale), 0, 0, WIDTH * many, HEIGHT * many)
    picture = cv2.remap(mat, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderValue=TABLE_GREY)
    for tag_id in covered:
        lid = np.column_stack([stage.tag_corners()[tag_id] * scale, np.full(4, 0.01)])
        seen = cv2.projectPoints(lid, shot.turn, shot.shift, matrix, shot.distortion)[0].reshape(-1, 2)
        cv2.fillConvexPoly(picture, seen.round().astype(np.int32), 0.7)
    spec = start.task.spec.checked
    heights = [float(one[2]) for one in start.poses]
    far = np.argsort([-np.hypot(*(pose[:2] - eye[:2])) for pose in poses])
    for which in far:
        thing, pose, base = stage.thing(spec, which), poses[which], heights[which]
        outline, top = outline_at(thing.shape, pose), base + thing.shape.height
        body = np.concatenate([np.column_stack([outline, np.full(len(outline), z)]) for z in (base, top)])
        seen = cv2.projectPoints(body, shot.turn, shot.shift, matrix, shot.distortion)[0].reshape(-1, 2)
        side, lid_grey = (shades[which] * share for share in (0.75, 1.0)) if shades else (SIDE_GREY, TOP_GREY)
        cv2.fillConvexPoly(picture, cv2.convexHull((16 * seen).round().astype(np.int32)), side, cv2.LINE_AA, 4)
        lid = (16 * seen[len(outline) :]).round().astype(np.int32)
        cv2.fillConvexPoly(picture, lid, lid_grey, cv2.LINE_AA, 4)
        tag = thing.tag if tags is None else tags[which]
        if tag is None:
            continue
        low, high = np.floor(seen.min(axis=0)).astype(int) - 2, np.ceil(seen.max(axis=0)).astype(int) + 3
        low, high = np.maximum(low, 0), np.minimum(high, [WIDTH * many, HEIGHT * many])
        if (low >= high).any():
            continue
        part = slice(low[1], high[1]), slice(low[0], high[0])
        local = between(places(top) - pose[:2], *low, *high)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        side = thing.side * tag_scale
        x, y = local[..., 0] * cos + local[..., 1] * sin, local[..., 1] * cos - local[..., 0] * sin
        cell = 20
        printed = np.kron(np.pad(~tag_cells(tag), 1, constant_values=True).astype(np.float64), np.ones((cell, cell)))
        zoom = TAG_CELLS * cell / side
        along, down = x * zoom + printed.shape[1] / 2 - 0.5, printed.shape[0] / 2 - y * zoom - 0.5
        drawn = cv2.remap(
            printed, along.astype(np.float32), down.astype(np.float32), cv2.INTER_LINEAR, borderValue=-1.0
        )
        inside = np.maximum(abs(x), abs(y)) < side * (0.5 + 1 / TAG_CELLS)
        picture[part] = np.where(inside, drawn * TOP_GREY, picture[part])
    picture = cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    picture = cv2.GaussianBlur(picture, (0, 0), shot.blur)
    picture *= np.linspace(*shot.light, WIDTH, dtype=np.float32)[None]
    noise = shot.noise * rng.standard_normal(picture.shape, dtype=np.float32)
    spoilt: Grey = np.clip(picture * 255.0 + noise, 0, 255).round().astype(np.uint8)
    return spoilt


def render_in_color(
    stage: TableStage,
    start: GradedStart,
    poses: Array,
    shot: Shot,
    rng: np.random.Generator,
    raster: tuple[Array, Callable[[Array], Array]],
) -> Grey:
    """The same (h, w, 3), objects in their colours."""
    colors = [one.color for one in stage_of(start.task.scenes.file()).things]
    planes = [
        render_photograph(
            stage, start, poses, shot, rng, raster=raster, shades=[0.15 + 0.75 * one[k] for one in colors]
        )
        for k in range(3)
    ]
    return np.stack(planes, axis=-1)


FAULTS: dict[str, dict[str, Any]] = {  # how a picture is wrong, and what names it
    "another object": {"says": "which this start does not have"},
    "no tag on an object": {"says": "does not show"},
    "a mat bent by 3 cm": {"bend": 0.03, "says": "is not flat"},
    "a mat printed at 97 %": {"scale": 0.97, "says": "was printed at 9"},
    "a mat of 40 x 40 cm": {"other": 0.05, "says": "is that of another suite"},
}


def measure_photographs(suite: Suite, n: int, seed: int, rows_file: Path | None, calibrated: bool) -> None:
    """Errors of objects in n pictures from 0.5 to 1.5 m, each object 7 mm and 5 degrees off its place."""
    stage, rng = TableStage.from_suite(suite), np.random.default_rng(seed)
    raster = mat_raster(stage)
    rows, failed = [], Counter[str]()
    for _ in range(n):
        start, poses = draw_scene(suite, rng)
        distance = rng.uniform(0.5, 1.5)
        shot = draw_shot(rng, stage, distance)
        picture = render_photograph(stage, start, poses, shot, rng, raster=raster)
        photo = Photograph.from_picture(picture, "a picture")
        seen = sum(tag in photo.tags for tag in range(MAT_TAGS))
        lens = Lens(shot.matrix, shot.distortion) if calibrated else None
        try:
            camera = find_camera(stage, photo, lens, start)
        except DataError as error:
            failed[error.diagnostics[0].text("title")] += len(poses)
            rows += [(distance, np.inf, np.inf, seen, np.inf)] * len(poses)
            continue
        for pose, (thing, height) in zip(poses, stage.tops(start), strict=True):
            if thing.tag not in photo.tags:
                failed["the tag of an object is not seen"] += 1
                rows.append((distance, np.inf, np.inf, seen, np.inf))
                continue
            off = pose_by_tag(thing, height, photo, camera)[0] - pose
            turned = abs((np.degrees(off[2]) + 180.0) % 360.0 - 180.0)
            doubt = camera.place_error(photo.tags[thing.tag], height)
            rows.append((distance, 1000.0 * np.hypot(*off[:2]), turned, seen, 1000.0 * doubt))
    each = np.array(rows)
    if rows_file is not None:  # parts of one long run, each with a seed of its own
        before = np.loadtxt(rows_file).reshape(-1, 5) if rows_file.exists() else np.empty((0, 5))
        each = np.concatenate([before, each])
        np.savetxt(rows_file, each, fmt="%.4f")
    print(
        "pictures | objects | found % | within 3 mm and 1 deg % | mm: median | 95 % | deg: median | 95 % | expected mm"
    )
    for low, high in ((0.5, 0.75), (0.75, 1.0), (0.9, 1.1), (1.0, 1.25), (1.25, 1.5), (0.5, 1.5)):
        print_row(f"{low}-{high} m", each[(each[:, 0] >= low) & (each[:, 0] < high)])
    for count in range(MAT_TAGS + 1):
        print_row(f"{count} tags of the mat", each[each[:, 3] == count])
    for what, count in failed.most_common():
        print(f"{count} objects in pictures refused: {what}")


def print_row(name: str, some: Array) -> None:
    """Of objects (K, 5): distance, millimetres and degrees off, tags of the mat, and the standard deviation that was
    expected."""
    found = some[np.isfinite(some[:, 1])]
    if len(found):
        good = ((some[:, 1] <= 3.0) & (some[:, 2] <= 1.0)).mean()
        ends = [f"{np.quantile(found[:, k], q):.2f}" for k in (1, 2) for q in (0.5, 0.95)]
        shares = f"{100 * len(found) / len(some):.1f} | {100 * good:.1f}"
        print(f"{name} | {len(some)} | {shares} | {' | '.join(ends)} | {np.median(found[:, 4]):.2f}")
    else:
        print(f"{name} | {len(some)} | 0")


def name_faults(suite: Suite, n: int, seed: int) -> None:
    """How many of n pictures with a fault are refused with the words that name it."""
    stage, rng = TableStage.from_suite(suite), np.random.default_rng(seed)
    for fault, given in FAULTS.items():
        named = 0
        for _ in range(n):
            start, poses = draw_scene(suite, rng)
            tags: list[int | None] = [stage.thing(start.task.spec.checked, k).tag for k in range(len(poses))]
            if fault == "another object":
                tags[0] = next(one.tag for one in stage.things if one.tag not in tags)
            if fault == "no tag on an object":
                tags[0] = None
            printed = grow_mat(stage, given.get("other", 0.0))
            shot = draw_shot(rng, stage, rng.uniform(0.7, 1.2))
            more = {name: value for name, value in given.items() if name in ("bend", "scale")}
            picture = render_photograph(
                stage, start, poses, shot, rng, raster=mat_raster(printed), tags=tags, **more
            )  # fmt: skip
            try:
                photo = Photograph.from_picture(picture, "a picture")
                poses_by_tags(stage, start, photo, find_camera(stage, photo, None, start))
            except DataError as error:
                named += given["says"] in error.diagnostics[0].text("title")
        print(f"{fault}: named in {named} of {n}")


def grow_mat(stage: TableStage, by: float) -> TableStage:
    """The mat of a workspace that is larger by so many metres on each side."""
    return replace(stage, x=(stage.x[0] - by, stage.x[1] + by), y=(stage.y[0] - by, stage.y[1] + by))


def draw_scene(suite: Suite, rng: np.random.Generator) -> tuple[GradedStart, Array]:
    """A start, and where its objects stand: 7 mm and 5 degrees off."""
    start = suite[int(rng.integers(len(suite)))]
    poses = start.task.scenes.poses[start.row]
    return start, poses + rng.normal(0.0, (0.007, 0.007, np.radians(5.0)), poses.shape)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("suite")
    parser.add_argument("-n", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=Path)
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--faults", action="store_true")
    words = parser.parse_args()
    if words.faults:
        name_faults(Suite.load(words.suite), words.n, words.seed)
    else:
        measure_photographs(Suite.load(words.suite), words.n, words.seed, words.rows, words.calibrated)
