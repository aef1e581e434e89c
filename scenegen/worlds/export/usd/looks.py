"""How USD files look: materials, lights and cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenegen.things.palette import RGB
from scenegen.worlds.export.usd.stage import Stage
from scenegen.worlds.export.world import FOLDER, Covering, Dressed, Wall

MATERIALS, SHADER = "Looks", "surface"  # names of the prims
FOCUS, SHAPE = 24.0, 16.0 / 9.0  # mm; width to height of pictures
FIELD = 45.0  # degrees, from the lower edge of a picture to the upper
# Degrees about x and y. The sun is as bright as a new light in Isaac Sim; the other one brightens its shadows.
SUN, FILL = (3000.0, 25.0, -25.0), (1000.0, -35.0, 40.0)
ANGLE = 1.0  # degrees: the width of both
USUAL_SUN, USUAL_FILL = 0.46, 0.60  # intensity and ambient light of a look that are as bright as these


@dataclass(frozen=True, slots=True)
class Look:
    """What a surface looks like: its colour, and how rough and metallic it is, from 0 to 1."""

    color: RGB
    roughness: float = 0.6
    metallic: float = 0.0


def materials(stage: Stage, root: str) -> str:
    """The place for the materials of what is below `root`."""
    place = f"{root}/{MATERIALS}"
    stage.scope(place)
    return place


def material(stage: Stage, root: str, name: str, look: Look) -> None:
    """A material below `root`, for `cover`."""
    path = f"{root}/{MATERIALS}/{name}"
    values: dict[str, float | RGB] = {
        "diffuseColor": look.color,
        "roughness": look.roughness,
        "metallic": look.metallic,
    }
    stage.material(path, SHADER)
    stage.inputs(f"{path}/{SHADER}", values)


def cover(stage: Stage, root: str, part: str, name: str, color: RGB) -> None:
    """Give `part`, a mesh or box below `root`, a material of this colour."""
    stage.bind(part, f"{root}/{MATERIALS}/{name}")
    stage.tint(part, color)


def recolor(stage: Stage, root: str, part: str, name: str, color: RGB) -> None:
    """Another colour for a part and its material, which are in the file that `root` refers to."""
    stage.inputs(f"{root}/{MATERIALS}/{name}/{SHADER}", {"diffuseColor": color})
    stage.tint(part, color)


def covering(stage: Stage, root: str, name: str, what: Covering) -> None:
    """A material below `root` for a rectangle of `cover_rectangle`."""
    material(stage, root, name, Look(what.color))
    if what.file:
        stage.image(f"{root}/{MATERIALS}/{name}", SHADER, f"./{FOLDER}/{what.file}", what.color)


def cover_rectangle(stage: Stage, root: str, part: str, name: str, wall: Wall, what: Covering) -> None:
    """A rectangle, with a material of `covering`."""
    across, up, middle = (np.array(one) for one in (wall.across, wall.up, wall.middle))
    sides = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) / 2.0
    corners = middle + sides[:, :1] * wall.width * across + sides[:, 1:] * wall.height * up
    stage.quad(part, corners, (sides + 0.5) * what.repeats(wall.width, wall.height))
    cover(stage, root, part, name, what.mean)


def lights(stage: Stage, root: str, dressed: Dressed | None) -> None:
    """A sun, and a weaker light from the other side."""
    if dressed is None:
        for name, (intensity, about_x, about_y) in (("sun", SUN), ("fill", FILL)):
            stage.light(f"{root}/{name}", intensity=intensity, angle=ANGLE, turns=(about_x, about_y, 0.0))
        return
    look = dressed.look
    x, y, z = look.towards
    # Turned about x and then y, what shines along -z shines along -towards.
    turns = (-math.degrees(math.atan2(y, math.hypot(x, z))), math.degrees(math.atan2(x, z)), 0.0)
    strength = SUN[0] * look.light_intensity / USUAL_SUN
    stage.light(f"{root}/sun", intensity=strength, angle=ANGLE, turns=turns, color=look.light_color)
    strength, about_x, about_y = FILL[0] * look.light_ambient / USUAL_FILL, *FILL[1:]
    stage.light(f"{root}/fill", intensity=strength, angle=ANGLE, turns=(about_x, about_y, 0.0), color=look.light_color)


def camera_of(stage: Stage, path: str, dressed: Dressed) -> None:
    """The camera of a look."""
    width, height = dressed.camera.size
    high = 2.0 * FOCUS * math.tan(math.radians(dressed.look.camera_fov) / 2.0)
    stage.camera_by(path, dressed.camera.view, (FOCUS, high * width / height, high))


def cameras(stage: Stage, root: str, table: tuple[float, float, float, float]) -> None:
    """One above the table and one in front of it."""
    x0, y0, x1, y1 = table
    x, y, side = (x0 + x1) / 2.0, (y0 + y1) / 2.0, max(x1 - x0, y1 - y0)
    high = 2.0 * FOCUS * math.tan(math.radians(FIELD / 2.0))
    lens = (FOCUS, high * SHAPE, high)
    stage.camera(f"{root}/top", at=(x, y, 1.6 * side), turn=0.0, lens=lens)
    stage.camera(f"{root}/front", at=(x, y - 1.1 * side, 1.1 * side), turn=45.0, lens=lens)
