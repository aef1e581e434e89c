"""The wood of the table: planks along x with grain, made of smooth noise, and the workspace's edge as a thin inlay."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.render.camera import Floats
from scenegen.render.stage import Stage

PLANKS = 6  # in the depth of the workspace
WARMTH = np.array([0.35, 1.0, 1.75])  # how much more a dark streak takes of green and blue than of red
SEAM, INLAY = 0.0016, 0.0020  # half widths, in sides of the workspace


def wood(stage: Stage, x: Floats, y: Floats) -> Floats:
    """(h, w, 3): factors of the table's own colour where it is seen at (x, y) (h, w), in metres.

    Whatever is finer than a pixel fades out, so that nothing shimmers in the distance.
    """
    side = stage.side
    pixel_x, pixel_y = np.abs(np.gradient(x, axis=1)) / side, np.abs(np.gradient(y, axis=0)) / side
    along, lane = x / side, (y - stage.workspace[1]) / side * PLANKS
    number = np.floor(lane)
    chance = _hash(number.astype(np.int64), np.full(1, 7, dtype=np.int64))
    u, v = along + 9.0 * chance, lane - number + 5.0 * number
    rings = 1.7 * v + 1.5 * _noise(1.3 * u, 1.1 * v) + 0.35 * _noise(3.7 * u, 3.0 * v)
    streaks = 0.5 + 0.5 * np.sin(2.0 * np.pi * 2.6 * rings)
    fibre = _noise(11.0 * u, 46.0 * v) - 0.5
    pores = _noise(26.0 * u, 88.0 * v) ** 6
    dark = 0.065 * (chance - 0.5)
    dark += 0.055 * (streaks**2 - 0.4) * _seen(pixel_y, 22.0 * PLANKS / 6.0)
    dark += 0.060 * fibre * _seen(pixel_y, 46.0 * PLANKS)
    dark += 0.220 * pores * _seen(pixel_y, 88.0 * PLANKS)
    lines = 0.130 * _line(np.abs(lane - np.round(lane)) / PLANKS, SEAM, pixel_y)
    x0, y0, x1, y1 = stage.workspace
    outside = np.maximum(np.maximum(x0 - x, x - x1), np.maximum(y0 - y, y - y1)) / side
    lines += 0.030 * (outside > 0.0) + 0.240 * _line(np.abs(outside), INLAY, np.maximum(pixel_x, pixel_y))
    return np.asarray(1.0 - dark[..., None] * WARMTH - lines[..., None])


def _seen(pixel: Floats, waves: float) -> Floats:
    """1 where pixels are small against waves of that number per side, falling to 0 where they are as large."""
    return np.clip(1.6 - 2.2 * pixel * waves, 0.0, 1.0)


def _line(distance: Floats, half: float, pixel: Floats) -> Floats:
    """A line of this half width with smooth ends, never thinner than a pixel but fainter instead."""
    wide = np.maximum(half, 0.75 * pixel)
    return np.clip(1.5 - distance / wide, 0.0, 1.0) * np.minimum(1.0, half / wide + 0.25)


def _hash(i: npt.NDArray[np.int64], j: npt.NDArray[np.int64]) -> Floats:
    """A number in [0, 1) for every pair of integers, the same on every machine."""
    mixed = (i * 374761393 + j * 668265263) & 0xFFFFFFFF
    mixed = ((mixed ^ (mixed >> 13)) * 1274126177) & 0xFFFFFFFF
    return np.asarray((mixed ^ (mixed >> 16)) / 4294967296.0)


def _noise(u: Floats, v: Floats) -> Floats:
    """Smooth noise in [0, 1]: random values at integer points, in between interpolated."""
    iu, iv = np.floor(u), np.floor(v)
    fu, fv = u - iu, v - iv
    fu, fv = fu * fu * (3.0 - 2.0 * fu), fv * fv * (3.0 - 2.0 * fv)
    i, j = iu.astype(np.int64), iv.astype(np.int64)
    near = _hash(i, j) + fu * (_hash(i + 1, j) - _hash(i, j))
    far = _hash(i, j + 1) + fu * (_hash(i + 1, j + 1) - _hash(i, j + 1))
    return np.asarray(near + fv * (far - near))
