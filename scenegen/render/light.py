"""Deferred lighting: soft shadows, the wood of the table and the ground behind it, from a picture's depth buffer.

pybullet's software renderer shades surfaces well, but its shadows have a fixed bias of 5 cm, more than the height of
most tableware. So shadows are computed here in numpy from two depth buffers, the camera's and the light's.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.looks.camera import Camera, downwards
from scenegen.looks.look import Look
from scenegen.looks.textures import WOOD as WOODEN
from scenegen.looks.textures import Textures
from scenegen.looks.wood import wood
from scenegen.render.ambient import Ambient
from scenegen.render.cloth import cover
from scenegen.render.picture import GROUND, TABLE, Image, Mask, Picture, Rows, Shot
from scenegen.render.surroundings import GROUND_BELOW, surroundings
from scenegen.scene.stage import WOOD, Stage

TOWARDS = (-0.36, -0.28, 1.0)  # direction of the light: from the left, from behind the viewer
MAP = 1024  # pixels along a side of the light's depth buffer
PAD = 24  # empty pixels around it, more than the width of a shadow's edge
SOFT = 0.013  # metres; radius of a shadow's blurred edge
TAPS = 16
RAMP = 0.03  # metres above a point of an object over which an occluder's effect increases from 0 to 1
DARKEST = (0.34, 0.33, 0.30)  # share of red, green and blue that a full shadow removes
HIDDEN = (0.62, 0.64, 0.66)  # the same for a fully hidden sky
ON_THINGS = 0.55  # weight of the hidden sky on objects: their own walls hide half of it
FAINT = 0.5  # weight of both on the ground below the table
EMPTY = 0.9999  # the depth buffer's value, up to rounding, where nothing was drawn


def light_camera(stage: Stage, towards: tuple[float, float, float] = TOWARDS) -> Camera:
    """The light's view: from above, sheared along its rays, so that points on one ray share a pixel."""
    x0, y0, x1, y1 = stage.table
    room = 0.02 * stage.side + 2.0 * SOFT
    drop = stage.thickness * GROUND_BELOW
    rise = max(stage.height, 0.05 * stage.side)
    slide = (-towards[0], -towards[1])  # offset of a shadow from its object, per metre of height
    low = [start - room + min(-drop * part, rise * part) for start, part in zip((x0, y0), slide, strict=True)]
    high = [end + room + max(-drop * part, rise * part) for end, part in zip((x1, y1), slide, strict=True)]
    return downwards(low, high, (MAP, MAP), slide)


class Lighting:
    """Lights the pictures of one camera. The table and the ground never move, so they are drawn and lit once, here.

    `factor` is how many pixels of a raw picture make one of the result, along each side. `colors`, `buffer` and
    `light_buffer` are the raw picture and the camera's and the light's depth buffers of the bare table. `transparent`
    leaves out all but the table and what is on it. A `look` has colours and `textures` of its own for the table and
    what is around it.
    """

    def __init__(
        self,
        stage: Stage,
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
        raw = camera.resized((camera.size[0] * factor, camera.size[1] * factor))
        columns, rows = np.meshgrid(np.arange(raw.size[0], dtype=np.float64), np.arange(raw.size[1], dtype=np.float64))
        # pybullet samples a pixel at its lower left corner; `centred` corrects this if pixels are not averaged.
        away = 0.0 if factor > 1 else 0.5
        origin, direction = raw.rays(columns + away, rows + 1.0 - away)
        bare = buffer >= EMPTY
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
        pixels = np.array([MAP / 2.0, -MAP / 2.0])
        start = (origin[every] @ matrix[:2, :3].T + matrix[:2, 3] + (1.0, -1.0)) * pixels
        step = (direction[every] @ matrix[:2, :3].T) * pixels
        self.start, self.step = (part.reshape(-1, 2).astype(np.float32) for part in (start, step))
        self.origin_z, self.direction_z = (
            part[every][..., 2].ravel().astype(np.float32) for part in (origin, direction)
        )
        self.texel = 2.0 / float(matrix[0, 0]) / MAP
        self.taps = _disc(min(max(SOFT / self.texel, 1.2), PAD - 2.0))
        self.depth = depth[every]
        self.mask = np.where(bare[every], GROUND, TABLE).astype(np.uint16)
        self.ambient = Ambient(stage, origin[every], direction[every])

        hidden = self._hidden(self._heights(light_buffer), self.depth.ravel(), slice(None), True)
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

    def __call__(self, colors: Picture, buffer: Image, seen: Mask, light_buffer: Image, landscape: Image) -> Shot:
        """The finished picture (h, w) from the raw one (h f, w f, 3), its depth buffer, what is `seen` in it (as in
        masks), the light's depth buffer and that of the height map `landscape`, all of the objects only: the table and
        the ground cannot hide them.

        Objects and their background are lit separately and then combined: if both are in one pixel, neither gets the
        other's shadow.
        """
        things = buffer < EMPTY
        share = _shrink(things[..., None].astype(np.uint8), self.factor)
        front = np.flatnonzero(share > 0.0)
        nearest = _nearest(buffer, self.factor).ravel()[front]
        around = self.ambient.landscape(landscape)
        heights = self._heights(light_buffer)
        every = slice(None)
        behind = _shrink(np.where(things[..., None], np.uint8(0), self.backdrop), self.factor)
        shadow = self._hidden(heights, self.depth.ravel(), every, True) * self.reach
        sky = self.ambient.hidden(around, self.depth.ravel(), every) * self.sky
        lit = behind * _dim(shadow, sky).reshape(behind.shape)
        depth = self.camera.depth(nearest)
        shadow = self._hidden(heights, depth, front, False)
        sky = self.ambient.hidden(around, depth, front) * np.float32(ON_THINGS)
        ahead = _shrink(np.where(things[..., None], colors, np.uint8(0)), self.factor)
        lit.reshape(-1, 3)[front] += ahead.reshape(-1, 3)[front] * _dim(shadow, sky)
        here = things[self.every]
        middle = np.where(here, self.camera.depth(buffer[self.every]), self.depth)
        mask = np.where(here, seen[self.every], self.mask).astype(np.uint16)
        return Shot(self._finished(lit, things), middle.astype(np.float32), mask)

    def _finished(self, lit: Image, things: npt.NDArray[np.bool_]) -> Picture:
        """Bytes, with an alpha channel if the ground is left out; its colours were mixed with black."""
        if not self.transparent:
            return np.asarray(np.clip(lit + 0.5, 0.0, 255.0), dtype=np.uint8)
        solid = np.where(things | ~self.bare, np.uint8(255), np.uint8(0))
        alpha = _shrink(solid[..., None], self.factor)
        pure = lit * 255.0 / np.maximum(alpha, 1.0)
        return np.asarray(np.clip(np.concatenate([pure, alpha], axis=2) + 0.5, 0.0, 255.0), dtype=np.uint8)

    def _heights(self, light_buffer: Image) -> Image:
        """(MAP + 2 PAD, MAP + 2 PAD): heights along the light's rays, in metres."""
        eye = np.float32(-self.light.view[2, 3])
        return np.pad(eye - self.light.depth(light_buffer), PAD, constant_values=np.float32(-1e9))

    def _hidden(self, heights: Image, depth: Image, where: Rows, level: bool) -> Image:
        """(P,): the share of the blur disc that is hidden from the light, 0 to 1, at depths (P,) of the pixels `where`;
        `level` says that these are of the table or the ground."""
        stride = heights.shape[1]
        z = self.origin_z[where] + depth * self.direction_z[where]
        at = self.start[where] + depth[:, None] * self.step[where]
        np.clip(at, 0, MAP - 1, out=at)
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
    left = 1.0 - shadow[:, None] * np.array(DARKEST, dtype=np.float32)
    return np.asarray(left * (1.0 - sky[:, None] * np.array(HIDDEN, dtype=np.float32)), dtype=np.float32)


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
