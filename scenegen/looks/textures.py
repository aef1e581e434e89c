"""Textures: patterns that are built in, and pictures from files, repeated over a surface."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.looks.camera import Floats
from scenegen.looks.stage import PictureSetup
from scenegen.things.library import RGB

PLAIN, WOOD = "plain", "wood"
PATTERNS = ("checker", "stripes", "speckle")  # greys, which multiply a colour
TEXTURE_NAMES = (PLAIN, *PATTERNS)
IMAGE_ENDINGS = (".png", ".jpg", ".jpeg")
PATTERN_SIDE = 256  # pixels of a pattern
MAX_TEXTURE_SIDE = 1024  # pixels along a side of a picture: larger ones are made smaller
MAX_TEXTURE_BYTES, MAX_TEXTURE_PIXELS = 32_000_000, 50_000_000  # of a file
MAX_TEXTURE_FILES, MAX_TEXTURES_BYTES = 1_000, 512_000_000  # of all textures together
MAX_PYRAMIDS = 6  # pyramids that a process keeps; one of a picture takes up to 17 MB
DARK_SHARE = 0.72  # of the dark squares and stripes

Pixels = npt.NDArray[np.uint8]
Level = npt.NDArray[np.float32]  # (h, w, 3), from 0 to 1


def check_image(data: bytes) -> bytes:
    """A PNG or JPEG file that can be decoded. Raises ValueError."""
    from PIL import Image  # loaded only where there are textures

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
                if image.width * image.height > MAX_TEXTURE_PIXELS:
                    raise ValueError(f"it has more than {MAX_TEXTURE_PIXELS:,} pixels")
                image.convert("RGB")
    except (OSError, SyntaxError, Image.DecompressionBombError):
        raise ValueError("it is not a PNG or JPEG picture, or is damaged") from None
    return data


def image_of(name: str, files: Mapping[str, bytes]) -> Pixels:
    """(h, w, 3): a pattern, or the picture of a file that `check_image` has passed, with its upper row first."""
    if name in PATTERNS:
        return _pattern(name)
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        with Image.open(io.BytesIO(files[name]), formats=("PNG", "JPEG")) as image:
            made = image.convert("RGB")
    made.thumbnail((MAX_TEXTURE_SIDE, MAX_TEXTURE_SIDE))
    return np.asarray(made)


def mean_of(image: Pixels) -> RGB:
    """The mean of its pixels, from 0 to 1."""
    red, green, blue = (image.reshape(-1, 3).mean(axis=0) / 255.0).tolist()
    return red, green, blue


class Textures:
    """The textures of some looks; `files` are those of pictures, by name."""

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self.files = dict(files)
        self._pyramids: dict[str, list[Level]] = {}

    def shares(self, name: str, size: float, x: Floats, y: Floats, pixels: Floats) -> Floats:
        """(P, 3): factors of a surface's colour at its points (x, y) (P,), for pixels of these sizes (P,), all in
        metres. The texture, `size` wide, repeats; its lower left corner is at the origin."""
        if name == PLAIN:
            return np.ones((len(x), 3))
        levels = self._levels(name)
        height, width = levels[0].shape[:2]
        u, v = x / size, -y / (size * height / width)
        # So many pixels of the texture for one of the picture: the level where this is about one.
        wanted = np.clip(np.log2(np.maximum(pixels / size * width, 1e-9)), 0.0, len(levels) - 1.0)
        result = np.empty((len(x), 3))
        lower = np.floor(wanted).astype(np.int64)
        for level in np.unique(lower).tolist():
            here = np.flatnonzero(lower == level)
            finer = _bilinear(levels[level], u[here], v[here])
            coarser = _bilinear(levels[min(level + 1, len(levels) - 1)], u[here], v[here])
            share = (wanted[here] - level)[:, None]
            result[here] = (1.0 - share) * finer + share * coarser
        return result

    def mean(self, name: str) -> RGB:
        """What it does to a surface's colour, seen from afar."""
        if name in (PLAIN, WOOD):
            return 1.0, 1.0, 1.0
        red, green, blue = self._levels(name)[0].reshape(-1, 3).mean(axis=0).tolist()
        return red, green, blue

    def _levels(self, name: str) -> list[Level]:
        """The texture, and ever smaller ones, down to a single pixel."""
        if name not in self._pyramids:
            while len(self._pyramids) >= MAX_PYRAMIDS:
                del self._pyramids[next(iter(self._pyramids))]
            levels = [image_of(name, self.files).astype(np.float32) / np.float32(255.0)]
            while max(levels[-1].shape[:2]) > 1:
                levels.append(_halve(_halve(levels[-1], 0), 1))
            self._pyramids[name] = levels
        return self._pyramids[name]


def _halve(image: Level, axis: int) -> Level:
    """Means of two pixels each along an axis, if there are two."""
    half = image.shape[axis] // 2
    if not half:
        return image
    first, second = (np.take(image, np.arange(half) * 2 + k, axis=axis) for k in (0, 1))
    return np.asarray((first + second) / np.float32(2.0), dtype=np.float32)


def _bilinear(image: Level, u: Floats, v: Floats) -> Floats:
    """(P, 3) at (u, v) (P,), in widths and heights of the image from its upper left corner; it repeats."""
    height, width = image.shape[:2]
    column, row = u * width - 0.5, v * height - 0.5
    j, i = np.floor(column), np.floor(row)
    across, down = (column - j)[:, None], (row - i)[:, None]
    left, top = j.astype(np.int64) % width, i.astype(np.int64) % height
    right, low = (left + 1) % width, (top + 1) % height
    above = (1.0 - across) * image[top, left] + across * image[top, right]
    below = (1.0 - across) * image[low, left] + across * image[low, right]
    return np.asarray((1.0 - down) * above + down * below)


def _pattern(name: str) -> Pixels:
    rows, columns = np.mgrid[:PATTERN_SIDE, :PATTERN_SIDE] * 4 // PATTERN_SIDE  # four squares or stripes along a side
    if name == "checker":
        grey = np.where((rows + columns) % 2, DARK_SHARE, 1.0)
    elif name == "stripes":
        grey = np.where(columns % 2, DARK_SHARE, 1.0)
    else:  # speckle: noise of several sizes that repeats without a seam
        frequencies = np.fft.fftfreq(PATTERN_SIDE) * PATTERN_SIDE
        waves = np.hypot(*np.meshgrid(frequencies, frequencies))
        drawn = np.random.default_rng(7).normal(size=(PATTERN_SIDE, PATTERN_SIDE))
        noise = np.fft.fft2(drawn) * (waves > 0) / (1.0 + waves / 6.0)
        smooth = np.fft.ifft2(noise).real
        grey = np.clip(0.88 + 0.07 * smooth / smooth.std(), 0.55, 1.0)
    return np.repeat(np.rint(255.0 * grey).astype(np.uint8)[..., None], 3, axis=2)


def list_files(folder: Path, pattern: str) -> list[str]:
    """The names, relative to `folder`, of the pictures that match `pattern`, in order. Raises ValueError."""
    if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
        raise ValueError("files takes a pattern of files below the folder of this file")
    names = sorted(
        path.relative_to(folder).as_posix()
        for path in folder.glob(pattern)
        if path.suffix.lower() in IMAGE_ENDINGS and path.is_file()
    )
    if not names:
        raise ValueError(f"there is no .png or .jpg file {pattern} in {folder}")
    if len(names) > MAX_TEXTURE_FILES:
        raise ValueError(f"{pattern} matches {len(names):,} pictures, more than {MAX_TEXTURE_FILES:,}")
    return names


PLANKS = 6  # in the depth of the workspace
WARMTH = np.array([0.35, 1.0, 1.75])  # how much more a dark streak reduces green and blue than red
NOISE_SIDE = 256  # side of the square of random numbers, a power of two
SEAM, INLAY = 0.0016, 0.0020  # half widths, in sides of the workspace


def wood(stage: PictureSetup, x: Floats, y: Floats, pixels: tuple[Floats, Floats], *, inlay: bool = True) -> Floats:
    """(P, 3): factors of the table's own colour at the visible points (x, y) (P,), in metres, for pixels of these sizes
    along x and y. `inlay` shows the edge of the workspace; a table of a look has none.

    Details finer than a pixel fade out, which avoids aliasing in the distance.
    """
    side = stage.side
    pixel_x, pixel_y = (size / side for size in pixels)
    chances = np.random.default_rng(2).random(NOISE_SIDE * NOISE_SIDE)
    along, lane = x / side, (y - stage.workspace[1]) / side * PLANKS
    number = np.floor(lane)
    chance = chances.take(number.astype(np.int64) & (NOISE_SIDE - 1))
    u, v = along + 9.0 * chance, lane - number + 5.0 * number
    rings = 1.7 * v + 1.5 * _noise(chances, 1.3 * u, 1.1 * v) + 0.35 * _noise(chances, 3.7 * u, 3.0 * v)
    streaks = 0.5 + 0.5 * np.sin(2.0 * np.pi * 2.6 * rings)
    fibre = _noise(chances, 11.0 * u, 46.0 * v) - 0.5
    pores = _noise(chances, 26.0 * u, 88.0 * v) ** 6
    dark = 0.065 * (chance - 0.5)
    dark += 0.055 * (streaks**2 - 0.4) * _visible_share(pixel_y, 22.0 * PLANKS / 6.0)
    dark += 0.060 * fibre * _visible_share(pixel_y, 46.0 * PLANKS)
    dark += 0.220 * pores * _visible_share(pixel_y, 88.0 * PLANKS)
    lines = 0.130 * _line(np.abs(lane - np.round(lane)) / PLANKS, SEAM, pixel_y)
    x0, y0, x1, y1 = stage.workspace
    outside = np.maximum(np.maximum(x0 - x, x - x1), np.maximum(y0 - y, y - y1)) / side
    if inlay:
        lines += 0.030 * (outside > 0.0) + 0.240 * _line(np.abs(outside), INLAY, np.maximum(pixel_x, pixel_y))
    return np.asarray(1.0 - dark[..., None] * WARMTH - lines[..., None])


def _visible_share(pixel: Floats, waves: float) -> Floats:
    """1 if pixels are small compared to waves of that number per side, falling to 0 if they are as large."""
    return np.clip(1.6 - 2.2 * pixel * waves, 0.0, 1.0)


def _line(distance: Floats, half: float, pixel: Floats) -> Floats:
    """A line of this half width with smooth edges; instead of becoming thinner than a pixel, it becomes fainter."""
    wide = np.maximum(half, 0.75 * pixel)
    return np.clip(1.5 - distance / wide, 0.0, 1.0) * np.minimum(1.0, half / wide + 0.25)


def _noise(chances: Floats, u: Floats, v: Floats) -> Floats:
    """Smooth noise in [0, 1]: random values at integer points, interpolated between; it repeats every `NOISE_SIDE`."""
    iu, iv = np.floor(u), np.floor(v)
    fu, fv = u - iu, v - iv
    fu, fv = fu * fu * (3.0 - 2.0 * fu), fv * fv * (3.0 - 2.0 * fv)
    i, j = iu.astype(np.int64), iv.astype(np.int64)
    left, right = i & (NOISE_SIDE - 1), (i + 1) & (NOISE_SIDE - 1)
    near, far = (j & (NOISE_SIDE - 1)) * NOISE_SIDE, ((j + 1) & (NOISE_SIDE - 1)) * NOISE_SIDE
    a, b, c, d = (chances.take(place) for place in (near + left, near + right, far + left, far + right))
    below = a + fu * (b - a)
    return np.asarray(below + fv * (c + fu * (d - c) - below))
