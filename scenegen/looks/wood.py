"""The wood of the table: planks along x with grain, made of smooth noise, and the workspace's edge as a thin inlay."""

from __future__ import annotations

import numpy as np

from scenegen.looks.camera import Floats
from scenegen.scene.stage import Stage

PLANKS = 6  # in the depth of the workspace
WARMTH = np.array([0.35, 1.0, 1.75])  # how much more a dark streak reduces green and blue than red
TABLE = 256  # side of the square of random numbers, a power of two
SEAM, INLAY = 0.0016, 0.0020  # half widths, in sides of the workspace


def wood(stage: Stage, x: Floats, y: Floats, pixels: tuple[Floats, Floats], *, inlay: bool = True) -> Floats:
    """(P, 3): factors of the table's own colour at the visible points (x, y) (P,), in metres, for pixels of these sizes
    along x and y. `inlay` shows the edge of the workspace; a table of a look has none.

    Details finer than a pixel fade out, which avoids aliasing in the distance.
    """
    side = stage.side
    pixel_x, pixel_y = (size / side for size in pixels)
    chances = np.random.default_rng(2).random(TABLE * TABLE)
    along, lane = x / side, (y - stage.workspace[1]) / side * PLANKS
    number = np.floor(lane)
    chance = chances.take(number.astype(np.int64) & (TABLE - 1))
    u, v = along + 9.0 * chance, lane - number + 5.0 * number
    rings = 1.7 * v + 1.5 * _noise(chances, 1.3 * u, 1.1 * v) + 0.35 * _noise(chances, 3.7 * u, 3.0 * v)
    streaks = 0.5 + 0.5 * np.sin(2.0 * np.pi * 2.6 * rings)
    fibre = _noise(chances, 11.0 * u, 46.0 * v) - 0.5
    pores = _noise(chances, 26.0 * u, 88.0 * v) ** 6
    dark = 0.065 * (chance - 0.5)
    dark += 0.055 * (streaks**2 - 0.4) * _seen(pixel_y, 22.0 * PLANKS / 6.0)
    dark += 0.060 * fibre * _seen(pixel_y, 46.0 * PLANKS)
    dark += 0.220 * pores * _seen(pixel_y, 88.0 * PLANKS)
    lines = 0.130 * _line(np.abs(lane - np.round(lane)) / PLANKS, SEAM, pixel_y)
    x0, y0, x1, y1 = stage.workspace
    outside = np.maximum(np.maximum(x0 - x, x - x1), np.maximum(y0 - y, y - y1)) / side
    if inlay:
        lines += 0.030 * (outside > 0.0) + 0.240 * _line(np.abs(outside), INLAY, np.maximum(pixel_x, pixel_y))
    return np.asarray(1.0 - dark[..., None] * WARMTH - lines[..., None])


def _seen(pixel: Floats, waves: float) -> Floats:
    """1 if pixels are small compared to waves of that number per side, falling to 0 if they are as large."""
    return np.clip(1.6 - 2.2 * pixel * waves, 0.0, 1.0)


def _line(distance: Floats, half: float, pixel: Floats) -> Floats:
    """A line of this half width with smooth edges; instead of becoming thinner than a pixel, it becomes fainter."""
    wide = np.maximum(half, 0.75 * pixel)
    return np.clip(1.5 - distance / wide, 0.0, 1.0) * np.minimum(1.0, half / wide + 0.25)


def _noise(chances: Floats, u: Floats, v: Floats) -> Floats:
    """Smooth noise in [0, 1]: random values at integer points, interpolated in between; it repeats every `TABLE`."""
    iu, iv = np.floor(u), np.floor(v)
    fu, fv = u - iu, v - iv
    fu, fv = fu * fu * (3.0 - 2.0 * fu), fv * fv * (3.0 - 2.0 * fv)
    i, j = iu.astype(np.int64), iv.astype(np.int64)
    left, right = i & (TABLE - 1), (i + 1) & (TABLE - 1)
    near, far = (j & (TABLE - 1)) * TABLE, ((j + 1) & (TABLE - 1)) * TABLE
    a, b, c, d = (chances.take(place) for place in (near + left, near + right, far + left, far + right))
    below = a + fu * (b - a)
    return np.asarray(below + fv * (c + fu * (d - c) - below))
