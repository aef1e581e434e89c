"""Light after the fact: soft shadows, the wood of the table and the ground behind it, from a picture's depth buffer.

pybullet's software renderer shades surfaces well but its shadows have a fixed bias of 5 cm, more than most tableware is
high. So it is asked for two depth buffers, the camera's and the light's, and shadows are worked out here in numpy.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.render.camera import Camera, Floats, downwards
from scenegen.render.cloth import cover
from scenegen.render.stage import Stage

Image = npt.NDArray[np.float32]
Picture = npt.NDArray[np.uint8]

TOWARDS = (-0.36, -0.28, 1.0)  # direction of the light: from the left, from behind the viewer
SLIDE = (-TOWARDS[0], -TOWARDS[1])  # how far a shadow lies from what casts it, per metre of height
MAP = 1024  # pixels along a side of the light's depth buffer
PAD = 24  # pixels round it in which nothing stands, more than a shadow's edge is wide
SOFT = 0.013  # metres; radius of a shadow's blurred edge
TAPS = 16
DARKEST = (0.31, 0.30, 0.28)  # share of red, green and blue that a full shadow takes away
FAINT = 0.5  # how much of that is left on the ground below the table
EMPTY = 0.9999  # the depth buffer's value, but for rounding, where nothing was drawn
GROUND_BELOW = 3.0  # thicknesses of the table top
GROUND = (0.905, 0.915, 0.925)
GROUND_FAR = (0.83, 0.85, 0.87)


def light_camera(stage: Stage) -> Camera:
    """The light's view: from above, with heights slid along its rays, so that points on one ray share a pixel."""
    x0, y0, x1, y1 = stage.table
    room = 0.02 * stage.side + 2.0 * SOFT
    drop = stage.thickness * GROUND_BELOW
    rise = max(stage.height, 0.05 * stage.side)
    low = [x0 - room - drop * SLIDE[0], y0 - room - drop * SLIDE[1]]
    high = [x1 + room + rise * SLIDE[0], y1 + room + rise * SLIDE[1]]
    return downwards(low, high, (MAP, MAP), SLIDE)


class Lighting:
    """Lights the pictures of one camera. The table and the ground never move: they are drawn and lit once, here.

    `factor` is how many pixels of a raw picture make one of the result, along each side. `colors`, `buffer` and
    `light_buffer` are the raw picture and the camera's and the light's depth buffers of the bare table.
    """

    def __init__(
        self, stage: Stage, camera: Camera, factor: int, colors: Picture, buffer: Image, light_buffer: Image
    ) -> None:
        self.factor = factor
        raw = camera.resized((camera.size[0] * factor, camera.size[1] * factor))
        columns, rows = np.meshgrid(np.arange(raw.size[0], dtype=np.float64), np.arange(raw.size[1], dtype=np.float64))
        # pybullet samples a pixel at its lower left corner.
        origin, direction = raw.rays(columns, rows + 1.0)
        bare = buffer >= EMPTY
        ground = (-GROUND_BELOW * stage.thickness - origin[..., 2]) / direction[..., 2]
        depth = np.where(bare, ground, raw.depth(buffer)).astype(np.float32)
        at = origin + depth[..., None] * direction
        top = ~bare & (np.abs(at[..., 2]) < 0.02 * stage.thickness)
        wood = _wood(stage, at[..., 0], at[..., 1])
        tint = np.where(top[..., None], cover(stage, at[..., 0], at[..., 1], wood), 1.0)

        every = (slice(None, None, factor), slice(None, None, factor))
        self.camera = camera
        self.light = light_camera(stage)
        matrix = self.light.projection @ self.light.view
        pixels = np.array([MAP / 2.0, -MAP / 2.0])
        self.start = ((origin[every] @ matrix[:2, :3].T + matrix[:2, 3] + (1.0, -1.0)) * pixels).astype(np.float32)
        self.step = ((direction[every] @ matrix[:2, :3].T) * pixels).astype(np.float32)
        self.origin_z, self.direction_z = (part[..., 2][every].astype(np.float32) for part in (origin, direction))
        self.texel = 2.0 / float(matrix[0, 0]) / MAP
        self.taps = _disc(min(max(SOFT / self.texel, 1.2), PAD - 2.0))
        self.depth = depth[every]

        under = np.where(bare[every], FAINT * self._hidden(self.depth, bare[every], light_buffer), 0.0)
        self.reach = np.where(bare[every], FAINT - under, 1.0).astype(np.float32)  # of the shadows of things
        dim = _dim(under.astype(np.float32)).repeat(factor, axis=0).repeat(factor, axis=1)
        backdrop = np.where(bare[..., None], _backdrop(raw.size[1]), colors * tint)
        self.backdrop = np.clip(backdrop * dim + 0.5, 0.0, 255.0).astype(np.uint8)

    def __call__(self, colors: Picture, buffer: Image, light_buffer: Image) -> Picture:
        """The finished picture (h, w, 3) from the raw one (h f, w f, 3), its depth buffer and the light's, all of the
        things alone: nothing of the table or the ground can hide them."""
        things = buffer < EMPTY
        image = _shrink(np.where(things[..., None], colors, self.backdrop), self.factor)
        here = things[:: self.factor, :: self.factor]
        depth = np.where(here, self.camera.depth(buffer[:: self.factor, :: self.factor]), self.depth)
        shadow = self._hidden(depth, ~here, light_buffer) * np.where(here, np.float32(1.0), self.reach)
        return np.asarray(np.clip(image * _dim(shadow) + 0.5, 0.0, 255.0), dtype=np.uint8)

    def _hidden(self, depth: Image, level: npt.NDArray[np.bool_], light_buffer: Image) -> Image:
        """How much of the disc that softens a shadow's edge is hidden from the light, 0 to 1, per pixel."""
        heights = np.pad(self.light_height - self.light.depth(light_buffer), PAD, constant_values=np.float32(-1e9))
        stride = heights.shape[1]
        z = self.origin_z + depth * self.direction_z
        at = self.start + depth[..., None] * self.step
        np.clip(at, 0, MAP - 1, out=at)
        cell = at.astype(np.int32) + PAD
        index = cell[..., 1] * stride + cell[..., 0]
        # A wall would shade itself within the blur: on things, only what is clearly higher counts.
        above = z + np.where(level, np.float32(0.0012 + 0.1 * self.texel), 0.004 + np.clip(z, 0.0, 0.03))
        flat = heights.ravel()
        hidden = np.zeros(index.shape, dtype=np.float32)
        for dx, dy in self.taps:
            hidden += flat.take(index + (dy * stride + dx)) > above
        return np.asarray(hidden / len(self.taps), dtype=np.float32)

    @property
    def light_height(self) -> np.float32:
        """Height of the light's eye above the table, in metres."""
        return np.float32(-self.light.view[2, 3])


def _dim(shadow: Image) -> Image:
    return np.asarray(1.0 - shadow[..., None] * np.array(DARKEST, dtype=np.float32), dtype=np.float32)


def _shrink(picture: Picture, factor: int) -> Image:
    """The means of squares of `factor` pixels."""
    total = np.zeros((picture.shape[0] // factor, picture.shape[1] // factor, 3), dtype=np.uint16)
    for row in range(factor):
        for column in range(factor):
            total += picture[row::factor, column::factor]
    return total.astype(np.float32) / np.float32(factor * factor)


def _disc(radius: float) -> list[tuple[int, int]]:
    """Offsets spread evenly over a disc (a sunflower's), in pixels."""
    turn = math.pi * (3.0 - math.sqrt(5.0))
    spread = [(math.sqrt((k + 0.5) / TAPS) * radius, k * turn) for k in range(TAPS)]
    return [(round(r * math.cos(a)), round(r * math.sin(a))) for r, a in spread]


def _wood(stage: Stage, x: Floats, y: Floats) -> Floats:
    """How light the table is at (x, y): planks along x, faint grain, and the edge of the workspace as a thin line."""
    side = stage.side
    pixel_x = np.abs(np.gradient(x, axis=1))
    pixel_y = np.abs(np.gradient(y, axis=0))
    plank = side / 7.0
    lane = (y - stage.table[1]) / plank
    number = np.floor(lane)
    tone = 1.0 + 0.022 * np.sin(number * 12.9898 + 1.3) * np.cos(number * 4.1)
    across = (np.abs(lane - np.round(lane))) * plank
    seam = np.clip(1.0 - across / np.maximum(0.0022 * side, pixel_y), 0.0, 1.0)
    u, v = x / side, y / side
    grain = np.sin(v * 260.0 + 3.0 * np.sin(u * 5.0 + number * 2.1) + 1.5 * np.sin(u * 13.0 + number))
    grain = grain * (0.5 + 0.5 * np.sin(u * 3.1 + number * 5.7 + v * 9.0))
    fine = np.clip(1.5 - pixel_y / side * 160.0, 0.0, 1.0)
    light = tone * (1.0 + 0.012 * grain * fine) - 0.055 * seam
    x0, y0, x1, y1 = stage.workspace
    dx, dy = np.maximum(x0 - x, x - x1), np.maximum(y0 - y, y - y1)
    outside = np.maximum(dx, dy)
    half = np.maximum(0.0022 * side, 0.75 * np.maximum(pixel_x, pixel_y))
    line = np.clip(1.0 - np.abs(outside) / half, 0.0, 1.0)
    light = light - 0.035 * (outside > 0.0) - 0.20 * line
    return np.asarray(light)


def _backdrop(height: int) -> Floats:
    """(height, 1, 3): the ground's colour per row, a little darker far away."""
    far = np.linspace(1.0, 0.0, height)[:, None, None]
    return np.asarray((far * np.array(GROUND_FAR) + (1.0 - far) * np.array(GROUND)) * 255.0)
