"""How USD files look: materials, lights and cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenegen.assets.palette import RGB
from scenegen.export.usd.stage import Stage

MATERIALS, SHADER = "Looks", "surface"  # names of the prims
FOCUS, SHAPE = 24.0, 16.0 / 9.0  # mm; width to height of pictures
FIELD = 45.0  # degrees, from the lower edge of a picture to the upper
# Degrees about x and y. The sun is as bright as a new light in Isaac Sim; the other one brightens its shadows.
SUN, FILL = (3000.0, 25.0, -25.0), (1000.0, -35.0, 40.0)
ANGLE = 1.0  # degrees: the width of both


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


def lights(stage: Stage, root: str) -> None:
    """A sun, and a weaker light from the other side."""
    for name, (intensity, about_x, about_y) in (("sun", SUN), ("fill", FILL)):
        stage.light(f"{root}/{name}", intensity=intensity, angle=ANGLE, turns=(about_x, about_y, 0.0))


def cameras(stage: Stage, root: str, table: tuple[float, float, float, float]) -> None:
    """One above the table and one in front of it."""
    x0, y0, x1, y1 = table
    x, y, side = (x0 + x1) / 2.0, (y0 + y1) / 2.0, max(x1 - x0, y1 - y0)
    high = 2.0 * FOCUS * math.tan(math.radians(FIELD / 2.0))
    lens = (FOCUS, high * SHAPE, high)
    stage.camera(f"{root}/top", at=(x, y, 1.6 * side), turn=0.0, lens=lens)
    stage.camera(f"{root}/front", at=(x, y - 1.1 * side, 1.1 * side), turn=45.0, lens=lens)
