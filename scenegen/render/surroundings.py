"""What a picture shows beyond the table: the ground below it, and the walls of a room around both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.looks.camera import Camera, Floats
from scenegen.looks.look import Look
from scenegen.looks.textures import Textures
from scenegen.scene.stage import Stage

GROUND_BELOW = 3.0  # thicknesses of the table top
HORIZON = 0.02  # least slope of a ray to the ground: rays above the horizon end as far away
FLOOR = (0.935, 0.932, 0.925)
FLOOR_FAR = (0.865, 0.872, 0.880)
CORNER, REACH = 0.20, 0.22  # of the light that corners lose, and how far from them (m) it is two thirds less

Rows = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """For the pixels of a picture: the depth (h, w) of the ground or wall, its colour (h, w, 3) from 0 to 255, and
    whether it is a wall (h, w)."""

    depth: Floats
    color: Floats
    walls: npt.NDArray[np.bool_]


def surroundings(
    stage: Stage,
    camera: Camera,
    rays: tuple[Floats, Floats],
    bare: npt.NDArray[np.bool_],
    look: Look | None,
    textures: Textures,
) -> Surroundings:
    """What is behind everything; `rays` are origins and directions (h, w, 3) of the pixels, of which `bare` (h, w) show
    neither table nor objects. Colours are only right there."""
    origin, direction = rays
    level = -GROUND_BELOW * stage.thickness
    falling = np.minimum(direction[..., 2], -HORIZON)
    depth = (level - origin[..., 2]) / falling
    walls = np.zeros(bare.shape, dtype=bool)
    color = np.broadcast_to(_backdrop(bare.shape[0], look), (*bare.shape, 3))
    if look is None:
        return Surroundings(depth, color, walls)
    color = color.copy()
    room = None if camera.orthographic else look.room(stage.table, camera.eye)
    hits: list[tuple[npt.NDArray[np.bool_], int, tuple[float, float, float]]] = []
    if room is not None:
        below = np.where(direction[..., 2] < 0.0, (level - origin[..., 2]) / falling, np.inf)
        depth, which = _nearest_wall(origin, direction, room, below)
        walls = which >= 0
        normals = ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
        hits = [(which == k, 1 - k // 2, normal) for k, normal in enumerate(normals)]
    at = origin + depth[..., None] * direction
    ground = np.flatnonzero(bare & ~walls)
    color.reshape(-1, 3)[ground] *= _texture(
        textures, look.ground_texture, look.ground_texture_size, (at[..., 0], at[..., 1]), ground
    )
    if room is not None:
        x0, y0, x1, y1 = room
        points = at.reshape(-1, 3)[ground]
        sides = (points[:, 0] - x0, x1 - points[:, 0], points[:, 1] - y0, y1 - points[:, 1])
        color.reshape(-1, 3)[ground] *= _corner(np.min(sides, axis=0))
    for hit, along, normal in hits:
        there = np.flatnonzero(bare & hit)
        shares = _texture(textures, look.walls_texture, look.walls_texture_size, (at[..., along], at[..., 2]), there)
        bright = 255.0 * np.array(look.walls_color) * look.brightness(normal)
        color.reshape(-1, 3)[there] = bright * shares * _corner(at[..., 2].ravel()[there] - level)
    return Surroundings(depth, np.clip(color, 0.0, 255.0), walls)


def _nearest_wall(
    origin: Floats, direction: Floats, room: tuple[float, float, float, float], below: Floats
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """The depths at which rays (h, w, 3) from inside a room meet the ground, at `below` (h, w), or a wall; and which
    wall: 0 and 1 for the lowest and highest x, 2 and 3 for y, -1 for the ground."""
    depth, which = below, np.full(below.shape, -1, dtype=np.int64)
    for k, (axis, edge) in enumerate(((0, room[0]), (0, room[2]), (1, room[1]), (1, room[3]))):
        slope = direction[..., axis]
        outwards = slope > 1e-12 if k % 2 else slope < -1e-12
        here = np.where(outwards, (edge - origin[..., axis]) / np.where(outwards, slope, 1.0), np.inf)
        nearer = here < depth
        depth, which = np.where(nearer, here, depth), np.where(nearer, k, which)
    return depth, which


def _texture(textures: Textures, name: str, size: float, on: tuple[Floats, Floats], where: Rows) -> Floats:
    """(P, 3): the texture's factors at the pixels `where` of a surface with coordinates `on` it, (h, w) each."""
    pixels = np.maximum(*(np.hypot(*np.gradient(one)) for one in on))
    x, y = (one.ravel()[where] for one in on)
    return textures.shares(name, size, x, y, pixels.ravel()[where])


def _corner(away: Floats) -> Floats:
    """(P, 1): the light that is left at these distances from a corner, in metres."""
    return np.asarray(1.0 - CORNER * np.exp(-np.maximum(away, 0.0) / REACH))[:, None]


def _backdrop(height: int, look: Look | None) -> Floats:
    """(height, 1, 3): the ground's colour per row, a little darker far away."""
    far = np.linspace(1.0, 0.0, height)[:, None, None]
    floor = (far * np.array(FLOOR_FAR) + (1.0 - far) * np.array(FLOOR)) * 255.0
    if look is not None:
        floor = floor / np.array(FLOOR) * np.array(look.ground_color) * look.brightness()
    return np.asarray(np.clip(floor, 0.0, 255.0))
