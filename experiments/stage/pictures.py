"""The pictures of docs/stage.md, and what the commands say there: a start of the suite `tabletop`, set with one object
4 cm off, photographed and checked.

    python -m experiments.stage.pictures
"""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from experiments.stage.photographs import Shot, draw_shot, mat_raster, render_in_color
from scenegen.play.stage.camera import Grey, Photograph, find_camera
from scenegen.play.stage.check import check_poses
from scenegen.play.stage.measure import poses_by_tags
from scenegen.play.stage.overlay import draw_overlay, judge_picture, render_start
from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.suite import GradedStart, Suite

FOLDER = Path("docs/images/stage")
EPISODE, SEED = 7, 11
WIDE = 1400  # pixels


def is_in_front(shot: Shot) -> bool:
    """Whether a camera looks from the viewer's side."""
    eye = -cv2.Rodrigues(shot.turn)[0].T @ shot.shift
    return bool(eye[1] < -0.25 and abs(eye[0]) < 0.1 and shot.matrix[0, 0] > 1500.0 and min(shot.light) > 0.7)


def photograph_of_page() -> tuple[Grey, TableStage, GradedStart]:
    """The photograph (h, w, 3) that docs/stage.md shows, and what it is of."""
    suite = Suite.load("tabletop")
    stage, start, rng = TableStage.from_suite(suite), suite[EPISODE], np.random.default_rng(SEED)
    poses = start.task.scenes.poses[start.row].copy()
    poses[0, :2] += (-0.03, -0.03)
    shots = (draw_shot(rng, stage, 0.75) for _ in range(1000))
    shot = next(one for one in shots if is_in_front(one))
    return render_in_color(stage, start, poses, shot, rng, mat_raster(stage)), stage, start


def main() -> None:
    picture, stage, start = photograph_of_page()
    FOLDER.mkdir(parents=True, exist_ok=True)
    mat = Image.fromarray((255 * mat_raster(stage)[0]).astype(np.uint8))
    mat.resize((WIDE // 3, round(WIDE / 3 * mat.height / mat.width))).save(FOLDER / "mat.png")
    photo = Photograph.from_picture(picture, "table.png")
    camera = find_camera(stage, photo, None, start)
    print("\n".join(check_poses(start, poses_by_tags(stage, start, photo, camera)).lines(stage)))
    said = judge_picture(stage, start, photo, camera)
    drawn = draw_overlay(stage, start, photo, camera, said, render_start(stage, start, camera))
    with Image.open(io.BytesIO(drawn)) as opened:
        small = opened.resize((WIDE, round(WIDE * opened.height / opened.width)), Image.Resampling.LANCZOS)
    small.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(FOLDER / "overlay.png", optimize=True)


if __name__ == "__main__":
    main()
