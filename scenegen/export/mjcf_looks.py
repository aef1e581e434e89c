"""How MJCF files look: light, cameras and the colours of table, floor and walls, as usual or by a look."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scenegen.export.dressing import FOLDER, Covering, Dressed
from scenegen.export.world import TALL, WOOD, World
from scenegen.export.xml import Element, node, short

GREY = "0.66 0.67 0.69 1"
STIFFER = "scenegen"  # the class of what collides, and of all that is of it
SLIPPERY = 0.01  # MuJoCo uses the larger friction of two: on the table, the object's
WIDE = 3.0  # metres: half the floor
SEEN_ONLY = {"contype": "0", "conaffinity": "0", "group": "2", "mass": "0"}


def visual(root: Element, world: World, dressed: Dressed | None) -> None:
    """Ambient light and the size of pictures."""
    place = node(root, "visual")
    if dressed is None:
        node(place, "headlight", ambient="0.35 0.35 0.35", diffuse="0.25 0.25 0.25", specular="0 0 0")
    else:
        ambient = _light(dressed, dressed.look.light_ambient)
        node(place, "headlight", ambient=ambient, diffuse="0 0 0", specular="0 0 0")
    node(place, "quality", shadowsize="4096")
    node(place, "map", shadowclip="2", shadowscale="1")
    node(place, "global", offwidth="1920", offheight="1080")
    x0, y0, x1, y1 = world.table
    node(root, "statistic", center=short([(x0 + x1) / 2, (y0 + y1) / 2, 0.0]), extent=short([max(x1 - x0, y1 - y0)]))


def assets(parent: Element, world: World, dressed: Dressed | None) -> None:
    """The sky, and the materials of a look."""
    sky = {"rgb1": "0.86 0.89 0.93", "rgb2": "0.97 0.97 0.97", "width": "256", "height": "256"}
    node(parent, "texture", type="skybox", builtin="gradient", **sky)
    if dressed is None:
        return
    x0, y0, x1, y1 = world.table
    _texture(parent, "table", dressed.table)
    _material(parent, "table", dressed.table, "table", x1 - x0, y1 - y0)
    _texture(parent, "floor", dressed.ground)
    _material(parent, "floor", dressed.ground, "floor", 2.0 * WIDE, 2.0 * WIDE)
    for number, wall in enumerate(dressed.each_wall(-TALL, world.table), start=1):
        if number == 1:
            _texture(parent, "wall", dressed.walls)
        _material(parent, f"wall_{number}", dressed.walls, "wall", wall.width, wall.height)


def table_cover(dressed: Dressed | None) -> dict[str, str]:
    """The attributes of the table's top."""
    return {"rgba": rgba(WOOD)} if dressed is None else {"material": "table"}


def leg_color(dressed: Dressed | None) -> str:
    return rgba(WOOD if dressed is None else dressed.table.mean)


def surroundings(parent: Element, world: World, dressed: Dressed | None) -> None:
    """Light, cameras, the floor and walls."""
    x0, y0, x1, y1 = world.table
    x, y, side = (x0 + x1) / 2, (y0 + y1) / 2, max(x1 - x0, y1 - y0)
    above = {"pos": short([x - 0.6 * side, y - 0.6 * side, 2 * side]), "directional": "true"}
    if dressed is None:
        node(parent, "light", **above, diffuse="0.45 0.45 0.45", specular="0.1 0.1 0.1", dir="0.3 0.3 -1")
    else:
        towards = np.array(dressed.look.towards)
        above["pos"] = short(np.array([x, y, 0.0]) + 2.0 * side * towards / np.linalg.norm(towards))
        sun = _light(dressed, dressed.look.light_intensity)
        node(parent, "light", **above, diffuse=sun, specular="0.1 0.1 0.1", dir=short(-towards))
    node(parent, "camera", name=world.free_name("top"), pos=short([x, y, 1.6 * side]), fovy="45")
    turned = {"xyaxes": "1 0 0 0 0.7 0.714", "fovy": "45"}
    node(parent, "camera", name=world.free_name("front"), pos=short([x, y - 1.1 * side, 1.1 * side]), **turned)
    floor = {"type": "plane", "size": short([WIDE, WIDE, 1.0]), "pos": short([0.0, 0.0, -TALL])}
    cover = {"rgba": GREY} if dressed is None else {"material": "floor"}
    node(parent, "geom", class_=STIFFER, name=world.free_name("floor"), **floor, **cover, friction=f"{SLIPPERY}")
    if dressed is None:
        return
    right, up, _ = dressed.camera.view[:3, :3]
    place = {"pos": short(dressed.camera.eye), "xyaxes": short([*right, *up])}
    node(parent, "camera", name=world.free_name("look"), **place, fovy=short([dressed.look.camera_fov]))
    for number, wall in enumerate(dressed.each_wall(-TALL, world.table), start=1):
        shape = {"type": "plane", "size": short([wall.width / 2.0, wall.height / 2.0, 1.0])}
        place = {"pos": short(wall.middle), "xyaxes": short([*wall.across, *wall.up])}
        node(parent, "geom", **shape, **place, material=f"wall_{number}", **SEEN_ONLY)


def _texture(parent: Element, name: str, covering: Covering) -> None:
    if covering.file:
        node(parent, "texture", name=name, type="2d", file=f"{FOLDER}/{covering.file}")


def _material(parent: Element, name: str, what: Covering, texture: str, width: float, height: float) -> None:
    """For one geom of this size: MuJoCo's repeats per metre (`texuniform`) are of half a metre."""
    given = {"texture": texture, "texrepeat": short(what.repeats(width, height))} if what.file else {}
    node(parent, "material", name=name, **given, rgba=rgba(what.color), specular="0.1", shininess="0.1")


def rgba(color: Iterable[float]) -> str:
    """An opaque colour."""
    return f"{short(color)} 1"


def _light(dressed: Dressed, strength: float) -> str:
    return short(min(strength * channel, 1.0) for channel in dressed.look.light_color)
