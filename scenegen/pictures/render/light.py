"""Deferred lighting: soft shadows, the wood of the table and the ground behind it, from a picture's depth buffer.

pybullet's software renderer shades surfaces well, but its shadows have a fixed bias of 5 cm, more than the height of
most tableware. So shadows are computed here in numpy from two depth buffers, the camera's and the light's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import numpy.typing as npt

from scenegen.geometry.footprint import Box, Circle, Footprint
from scenegen.looks.camera import Camera, Floats, downwards
from scenegen.looks.look import Look
from scenegen.looks.stage import WOOD, PictureRegion, PictureSetup
from scenegen.looks.textures import WOOD as WOODEN
from scenegen.looks.textures import Textures, wood
from scenegen.pictures.render.files import GROUND_ID, TABLE_ID, Image, Mask, Picture, RenderedView, Rows
from scenegen.things.library import RGB
from scenegen.things.surfaces import reach_of

# Widths, relative to the workspace's side; each is limited to a share of the region's size.
BORDER, HEM, SEAM, THREAD = 0.0045, 0.0110, 0.0020, 0.0060
OPAQUE, EDGE = 0.50, 0.85  # opacity of the cloth and of its border


def cover(stage: PictureSetup, x: Floats, y: Floats, wood: Floats, table: RGB = WOOD) -> Floats:
    """(h, w, 3): factors of the table's own colour at the visible points (x, y) (h, w), in metres.

    `table` is that colour, `wood` (h, w, 3) are the factors of the bare table. Regions that overlap show through each
    other, later ones on top.
    """
    tint = wood.copy()
    pixel = np.maximum(np.abs(np.gradient(x, axis=1)), np.abs(np.gradient(y, axis=0)))
    flat, sizes, columns, rows = tint.reshape(-1, 3), pixel.ravel(), x.ravel(), y.ravel()
    for patch in stage.patches:
        if patch.height:  # a board, which is a body of its own
            continue
        across, along, theta = patch.pose
        far = reach_of(patch.footprint)
        near = np.flatnonzero((np.abs(columns - across) <= far) & (np.abs(rows - along) <= far))
        dx, dy = columns[near] - across, rows[near] - along
        cos, sin = math.cos(theta), math.sin(theta)
        alpha, light = _cloth(patch, dx * cos + dy * sin, dy * cos - dx * sin, sizes[near], stage.side)
        color = np.array(patch.color) / np.array(table)
        flat[near] = flat[near] * (1.0 - alpha[:, None]) + (alpha * light)[:, None] * color
    return tint


def _cloth(patch: PictureRegion, x: Floats, y: Floats, pixel: Floats, side: float) -> tuple[Floats, Floats]:
    """Opacity and brightness of the cloth at (x, y) (P,) in its own frame, for pixels of that size."""
    inside = _inside(patch.footprint, x, y)
    narrow = min(patch.footprint.extent)

    def band(start: float, end: float) -> Floats:
        """1 if the distance from the edge lies between two widths, else 0, with smooth transitions."""
        low, high = (min(width * side, share * narrow) for width, share in ((start, 0.12), (end, 0.15)))
        return np.clip((inside - low) / pixel + 0.5, 0.0, 1.0) * np.clip((high - inside) / pixel + 0.5, 0.0, 1.0)

    covered = np.clip(inside / pixel + 0.5, 0.0, 1.0)
    border = band(0.0, BORDER)
    seam = band(HEM, HEM + SEAM)
    turns = math.tau / (THREAD * side)
    shown = np.clip(THREAD * side / (3.0 * pixel) - 0.5, 0.0, 1.0)  # threads finer than pixels would cause aliasing
    weave = 0.03 * shown * (np.sin(turns * x) + np.sin(turns * y))
    return covered * (
        OPAQUE + (EDGE - OPAQUE) * np.maximum(border, 0.5 * seam)
    ), 1.0 + weave - 0.30 * border - 0.15 * seam


def _inside(footprint: Footprint, x: Floats, y: Floats) -> Floats:
    """Distance from the edge, positive inside; outside it is a lower bound."""
    match footprint:
        case Circle(radius):
            return np.asarray(radius - np.hypot(x, y))
        case Box(length, width):
            return np.minimum(length / 2.0 - np.abs(x), width / 2.0 - np.abs(y))
        case _:
            corners = footprint.vertices
            edges = zip(corners, (*corners[1:], corners[0]), strict=True)
            return reduce(np.minimum, (_line_distance(a, b, x, y) for a, b in edges))


def _line_distance(a: tuple[float, float], b: tuple[float, float], x: Floats, y: Floats) -> Floats:
    """Distance from the line through a and b, positive on the left of the way from a to b."""
    (ax, ay), (bx, by) = a, b
    return np.asarray(((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay))


GROUND_BELOW = 3.0  # thicknesses of the table top
HORIZON = 0.02  # least slope of a ray to the ground: rays above the horizon end as far away
FLOOR_COLOR = (0.935, 0.932, 0.925)
FLOOR_FAR = (0.865, 0.872, 0.880)
CORNER, REACH = 0.20, 0.22  # of the light that corners lose, and how far from them (m) it is two thirds less


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """For the pixels of a picture: the depth (h, w) of the ground or wall, its colour (h, w, 3) from 0 to 255, and
    whether it is a wall (h, w)."""

    depth: Floats
    color: Floats
    walls: npt.NDArray[np.bool_]


def surroundings(
    stage: PictureSetup,
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
    floor = (far * np.array(FLOOR_FAR) + (1.0 - far) * np.array(FLOOR_COLOR)) * 255.0
    if look is not None:
        floor = floor / np.array(FLOOR_COLOR) * np.array(look.ground_color) * look.brightness()
    return np.asarray(np.clip(floor, 0.0, 255.0))


# Ambient light from the sky: corners and the table beside objects get less of it, so that objects look placed on the
# table.
# Seen from above, the scene is a height map. Blurred over a distance `r`, it gives the height of a point's
# surroundings; if these are `h` higher than the point, they hide the share h^2 / (h^2 + r^2) of the sky from it.
SKY_MAP = 512  # pixels along a side of the height map
SKY_SCALES = ((0.008, 0.40), (0.025, 0.35), (0.065, 0.25))  # distances in metres, and their weights
STEEPEST = 3.0  # surroundings higher than so many distances hide no more
BIAS = 0.001  # metres; lower steps hide nothing


def landscape_camera(stage: PictureSetup) -> Camera:
    """The view from above, of the table and a little more."""
    x0, y0, x1, y1 = stage.table
    room = 0.02 * stage.side
    return downwards([x0 - room, y0 - room], [x1 + room, y1 + room], (SKY_MAP, SKY_MAP), (0.0, 0.0))


class Ambient:
    """How much of the sky is hidden from the points that a camera sees; the rays of its pixels are given as (h, w, 3)
    origins and directions."""

    def __init__(self, stage: PictureSetup, origin: Floats, direction: Floats) -> None:
        self.camera = landscape_camera(stage)
        matrix = self.camera.projection @ self.camera.view
        pixels = np.array([SKY_MAP / 2.0, -SKY_MAP / 2.0])
        start = (origin @ matrix[:2, :3].T + matrix[:2, 3] + (1.0, -1.0)) * pixels
        step = (direction @ matrix[:2, :3].T) * pixels
        self._start, self._step = (part.reshape(-1, 2).astype(np.float32) for part in (start, step))
        self._z, self._dz = (part[..., 2].ravel().astype(np.float32) for part in (origin, direction))
        self._texel = (
            2.0 / float(matrix[1, 1]) / SKY_MAP,
            2.0 / float(matrix[0, 0]) / SKY_MAP,
        )  # metres, by rows and columns

    def landscape(self, buffer: Image) -> Sequence[Image]:
        """The surroundings' height, blurred over every scale, from the height map's depth buffer."""
        heights = np.maximum(np.float32(-self.camera.view[2, 3]) - self.camera.depth(buffer), np.float32(0.0))
        blurred = []
        for reach, _ in SKY_SCALES:
            around = np.minimum(heights, np.float32(STEEPEST * reach))
            for axis in (0, 1, 0, 1):
                around = _box_blur(around, max(1, round(reach / self._texel[axis] / 2.0)), axis)
            blurred.append(around.ravel())
        return blurred

    def hidden_sky(self, landscape: Sequence[Image], depth: Image, where: Rows) -> Image:
        """(P,): the hidden share of the sky at depths (P,) of the pixels `where`, counted row by row."""
        at = np.clip(self._start[where] + depth[:, None] * self._step[where], 0, SKY_MAP - 1).astype(np.int32)
        index = at[:, 1] * SKY_MAP + at[:, 0]
        hidden = np.zeros(len(index), dtype=np.float32)
        z = self._z[where] + depth * self._dz[where] + np.float32(BIAS)
        for around, (reach, weight) in zip(landscape, SKY_SCALES, strict=True):
            rise = np.maximum(around.take(index) - z, np.float32(0.0))
            rise *= rise
            hidden += np.float32(weight) * rise / (rise + np.float32(reach * reach))
        return hidden


def _box_blur(image: Image, half: int, axis: int) -> Image:
    """The mean of 2 half + 1 pixels along an axis; beyond the edges there is nothing."""
    size = image.shape[axis]
    room = [(half + 1, half) if k == axis else (0, 0) for k in (0, 1)]
    total = np.cumsum(np.pad(image, room), axis=axis, dtype=np.float64)
    ahead, behind = (slice(2 * half + 1, 2 * half + 1 + size), slice(0, size))
    moved = total[ahead] - total[behind] if axis == 0 else total[:, ahead] - total[:, behind]
    return (moved / (2 * half + 1)).astype(np.float32)


TOWARDS = (-0.36, -0.28, 1.0)  # direction of the light: from the left, from behind the viewer
LIGHT_MAP = 1024  # pixels along a side of the light's depth buffer
PAD = 24  # empty pixels around it, more than the width of a shadow's edge
SOFT = 0.013  # metres; radius of a shadow's blurred edge
TAPS = 16
RAMP = 0.03  # metres above a point of an object over which an occluder's effect increases from 0 to 1
FULL_SHADOW_LOSS = (0.34, 0.33, 0.30)  # share of red, green and blue that a full shadow removes
HIDDEN_SKY_LOSS = (0.62, 0.64, 0.66)  # the same for a fully hidden sky
ON_THINGS = 0.55  # weight of the hidden sky on objects: their own walls hide half of it
FAINT = 0.5  # weight of both on the ground below the table
EMPTY_DEPTH = 0.9999  # the depth buffer's value, up to rounding, where nothing was drawn


def light_camera(stage: PictureSetup, towards: tuple[float, float, float] = TOWARDS) -> Camera:
    """The light's view: from above, sheared along its rays, so that points on one ray share a pixel."""
    x0, y0, x1, y1 = stage.table
    room = 0.02 * stage.side + 2.0 * SOFT
    drop = stage.thickness * GROUND_BELOW
    rise = max(stage.height, 0.05 * stage.side)
    slide = (-towards[0], -towards[1])  # offset of a shadow from its object, per metre of height
    low = [start - room + min(-drop * part, rise * part) for start, part in zip((x0, y0), slide, strict=True)]
    high = [end + room + max(-drop * part, rise * part) for end, part in zip((x1, y1), slide, strict=True)]
    return downwards(low, high, (LIGHT_MAP, LIGHT_MAP), slide)


class Lighting:
    """Lights the pictures of one camera. The table and the ground never move, so they are drawn and lit once, here.

    `factor` is how many pixels of a raw picture make one of the result, along each side. `colors`, `buffer` and
    `light_buffer` are the raw picture and the camera's and the light's depth buffers of the bare table. `transparent`
    leaves out all but the table and what is on it. A `look` has colours and `textures` of its own for the table and
    what is around it.
    """

    def __init__(
        self,
        stage: PictureSetup,
        camera: Camera,
        factor: int,
        colors: Picture,
        buffer: Image,
        light_buffer: Image,
        *,
        transparent: bool = False,
        look: Look | None = None,
        textures: Textures,
    ) -> None:
        self.factor = factor
        self.camera = camera
        self.transparent = transparent
        raw = camera.with_size((camera.size[0] * factor, camera.size[1] * factor))
        columns, rows = np.meshgrid(np.arange(raw.size[0], dtype=np.float64), np.arange(raw.size[1], dtype=np.float64))
        # pybullet samples a pixel at its lower left corner; `centre_pixels` corrects this if pixels are not averaged.
        away = 0.0 if factor > 1 else 0.5
        origin, direction = raw.rays(columns + away, rows + 1.0 - away)
        bare = buffer >= EMPTY_DEPTH
        around = surroundings(stage, raw, (origin, direction), bare, look, textures)
        depth = np.where(bare, around.depth, raw.depth(buffer)).astype(np.float32)
        at = origin + depth[..., None] * direction
        top = ~bare & (np.abs(at[..., 2]) < 0.02 * stage.thickness)
        x, y = at[..., 0], at[..., 1]
        sizes = np.abs(np.gradient(x, axis=1)), np.abs(np.gradient(y, axis=0))
        bare_wood = np.ones_like(at)
        if look is None or look.table_texture == WOODEN:
            bare_wood[top] = wood(stage, x[top], y[top], (sizes[0][top], sizes[1][top]), inlay=look is None)
        else:
            name, size = look.table_texture, look.table_texture_size
            bare_wood[top] = textures.shares(name, size, x[top], y[top], np.maximum(*sizes)[top])
        cloths = cover(stage, x, y, bare_wood, WOOD if look is None else look.table)
        edges = (1.0, 1.0, 1.0) if look is None else textures.mean(look.table_texture)
        tint = np.where(top[..., None], cloths, edges)

        # Of four raw pixels, the upper right one is sampled in the middle of the four.
        self.every = every = (slice(None, None, factor), slice(factor // 2, None, factor))
        self.light = light_camera(stage, TOWARDS if look is None else look.towards)
        matrix = self.light.projection @ self.light.view
        pixels = np.array([LIGHT_MAP / 2.0, -LIGHT_MAP / 2.0])
        start = (origin[every] @ matrix[:2, :3].T + matrix[:2, 3] + (1.0, -1.0)) * pixels
        step = (direction[every] @ matrix[:2, :3].T) * pixels
        self.start, self.step = (part.reshape(-1, 2).astype(np.float32) for part in (start, step))
        self.origin_z, self.direction_z = (
            part[every][..., 2].ravel().astype(np.float32) for part in (origin, direction)
        )
        self.texel = 2.0 / float(matrix[0, 0]) / LIGHT_MAP
        self.taps = _disc(min(max(SOFT / self.texel, 1.2), PAD - 2.0))
        self.depth = depth[every]
        self.mask = np.where(bare[every], GROUND_ID, TABLE_ID).astype(np.uint16)
        self.ambient = Ambient(stage, origin[every], direction[every])

        hidden = self._blocked_share(self._heights(light_buffer), self.depth.ravel(), slice(None), True)
        ground = bare[every].ravel()
        walls = ground & around.walls[every].ravel()  # too far away for shadows
        under = np.where(ground & ~walls, FAINT * hidden, 0.0).astype(np.float32)
        reach = np.where(walls, 0.0, FAINT - under)
        self.reach = np.where(ground, reach, 1.0).astype(np.float32)  # of the shadows of objects
        self.sky = np.where(ground, 0.0, 1.0).astype(np.float32)
        dim = _dim(under, np.zeros_like(under)).reshape(*self.depth.shape, 3)
        dim = dim.repeat(factor, axis=0).repeat(factor, axis=1)
        floor = np.zeros(3) if transparent else around.color
        backdrop = np.where(bare[..., None], floor, colors * tint)
        self.backdrop = np.clip(backdrop * dim + 0.5, 0.0, 255.0).astype(np.uint8)
        self.bare = bare

    def __call__(
        self, colors: Picture, buffer: Image, seen: Mask, light_buffer: Image, landscape: Image
    ) -> RenderedView:
        """The finished picture (h, w) from the raw one (h f, w f, 3), its depth buffer, what is `seen` in it (as in
        masks), the light's depth buffer and that of the height map `landscape`, all of the objects only: the table and
        the ground cannot hide them.

        Objects and their background are lit separately and then combined: if both are in one pixel, neither gets the
        other's shadow.
        """
        things = buffer < EMPTY_DEPTH
        share = _shrink(things[..., None].astype(np.uint8), self.factor)
        front = np.flatnonzero(share > 0.0)
        nearest = _nearest(buffer, self.factor).ravel()[front]
        around = self.ambient.landscape(landscape)
        heights = self._heights(light_buffer)
        every = slice(None)
        behind = _shrink(np.where(things[..., None], np.uint8(0), self.backdrop), self.factor)
        shadow = self._blocked_share(heights, self.depth.ravel(), every, True) * self.reach
        sky = self.ambient.hidden_sky(around, self.depth.ravel(), every) * self.sky
        lit = behind * _dim(shadow, sky).reshape(behind.shape)
        depth = self.camera.depth(nearest)
        shadow = self._blocked_share(heights, depth, front, False)
        sky = self.ambient.hidden_sky(around, depth, front) * np.float32(ON_THINGS)
        ahead = _shrink(np.where(things[..., None], colors, np.uint8(0)), self.factor)
        lit.reshape(-1, 3)[front] += ahead.reshape(-1, 3)[front] * _dim(shadow, sky)
        here = things[self.every]
        middle = np.where(here, self.camera.depth(buffer[self.every]), self.depth)
        mask = np.where(here, seen[self.every], self.mask).astype(np.uint16)
        return RenderedView(self._to_bytes(lit, things), middle.astype(np.float32), mask)

    def _to_bytes(self, lit: Image, things: npt.NDArray[np.bool_]) -> Picture:
        """Bytes, with an alpha channel if the ground is left out; its colours were mixed with black."""
        if not self.transparent:
            return np.asarray(np.clip(lit + 0.5, 0.0, 255.0), dtype=np.uint8)
        solid = np.where(things | ~self.bare, np.uint8(255), np.uint8(0))
        alpha = _shrink(solid[..., None], self.factor)
        pure = lit * 255.0 / np.maximum(alpha, 1.0)
        return np.asarray(np.clip(np.concatenate([pure, alpha], axis=2) + 0.5, 0.0, 255.0), dtype=np.uint8)

    def _heights(self, light_buffer: Image) -> Image:
        """(LIGHT_MAP + 2 PAD, LIGHT_MAP + 2 PAD): heights along the light's rays, in metres."""
        eye = np.float32(-self.light.view[2, 3])
        return np.pad(eye - self.light.depth(light_buffer), PAD, constant_values=np.float32(-1e9))

    def _blocked_share(self, heights: Image, depth: Image, where: Rows, level: bool) -> Image:
        """(P,): the share of the blur disc that is hidden from the light, 0 to 1, at depths (P,) of the pixels `where`;
        `level` says that these are of the table or the ground."""
        stride = heights.shape[1]
        z = self.origin_z[where] + depth * self.direction_z[where]
        at = self.start[where] + depth[:, None] * self.step[where]
        np.clip(at, 0, LIGHT_MAP - 1, out=at)
        cell = at.astype(np.int32) + PAD
        index = cell[:, 1] * stride + cell[:, 0]
        # A wall would shade itself within the blur: on objects, only clearly higher occluders count, with a smooth
        # transition.
        above = z + (np.float32(0.0012 + 0.1 * self.texel) if level else 0.004 + np.clip(z, 0.0, 0.02))
        flat = heights.ravel()
        hidden = np.zeros(index.shape, dtype=np.float32)
        for dx, dy in self.taps:
            there = flat.take(index + (dy * stride + dx))
            hidden += there > above if level else np.clip((there - above) * np.float32(1.0 / RAMP), 0.0, 1.0)
        return np.asarray(hidden / len(self.taps), dtype=np.float32)


def _dim(shadow: Image, sky: Image) -> Image:
    """(P, 3): the remaining light if these shares of it and of the sky are hidden."""
    left = 1.0 - shadow[:, None] * np.array(FULL_SHADOW_LOSS, dtype=np.float32)
    return np.asarray(left * (1.0 - sky[:, None] * np.array(HIDDEN_SKY_LOSS, dtype=np.float32)), dtype=np.float32)


def _nearest(buffer: Image, factor: int) -> Image:
    """The least of squares of `factor` pixels."""
    parts = [buffer[row::factor, column::factor] for row in range(factor) for column in range(factor)]
    return np.asarray(np.minimum.reduce(parts))


def _shrink(picture: Picture, factor: int) -> Image:
    """The means of squares of `factor` pixels."""
    height, width, channels = picture.shape
    total = np.zeros((height // factor, width // factor, channels), dtype=np.uint16)
    for row in range(factor):
        for column in range(factor):
            total += picture[row::factor, column::factor]
    return total.astype(np.float32) / np.float32(factor * factor)


def _disc(radius: float) -> list[tuple[int, int]]:
    """Offsets spread evenly over a disc (a sunflower's), in pixels."""
    turn = math.pi * (3.0 - math.sqrt(5.0))
    spread = [(math.sqrt((k + 0.5) / TAPS) * radius, k * turn) for k in range(TAPS)]
    return [(round(r * math.cos(a)), round(r * math.sin(a))) for r, a in spread]
