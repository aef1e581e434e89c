"""Pictures as files: PNG for eyes, 16-bit PNG for depth, indexed PNG for masks, NPZ for programs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image as Images

from scenegen.assets.palette import PALETTE
from scenegen.render.picture import Picture, Shot

RENDERERS = ("software", "egl")
STEP = 1e-4  # metres: the unit of depth in PNG files, 6.5 m at most


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """The pictures to draw of every scene."""

    views: tuple[str, ...]
    size: tuple[int, int]
    transparent: bool = False
    depth: bool = False
    masks: bool = False
    renderer: str = "software"

    @property
    def names(self) -> bool:
        """Whether the names of unknown objects are written on pictures: not if depth or masks are saved for
        programs."""
        return not (self.depth or self.masks)

    @property
    def endings(self) -> tuple[str, ...]:
        """Endings of the files of one view of one scene, in the order in which they are made."""
        extra = [ending for ending, asked in (("_depth.png", self.depth), ("_mask.png", self.masks)) if asked]
        return (".png", *extra, *([".npz"] if extra else []))


def encode(shot: Shot, options: PictureOptions, ids: int) -> Sequence[bytes]:
    """The files of a shot, in the order of `options.endings`; masks hold numbers below `ids`."""
    files = [png(shot.color)]
    arrays: dict[str, Any] = {}
    if options.depth:
        ticks = np.clip(np.rint(shot.depth / STEP), 0, 65535).astype(np.uint16)
        files.append(_saved(Images.fromarray(ticks)))
        arrays["depth"] = shot.depth
    if options.masks:
        files.append(_mask(shot, ids))
        arrays["mask"] = shot.mask
    if arrays:
        out = io.BytesIO()
        np.savez_compressed(out, allow_pickle=False, **arrays)
        files.append(out.getvalue())
    return files


def png(picture: Picture) -> bytes:
    """(height, width, 3 or 4) as a PNG file."""
    return _saved(Images.fromarray(picture))


def _mask(shot: Shot, ids: int) -> bytes:
    """The numbers themselves; up to 256 of them as an indexed picture, so that people can distinguish them too."""
    if ids > 256:
        return _saved(Images.fromarray(shot.mask))
    image = Images.fromarray(shot.mask.astype(np.uint8))
    colors = [(0.0, 0.0, 0.0), (0.3, 0.3, 0.3), *(PALETTE[k % len(PALETTE)] for k in range(254))]
    image.putpalette([round(255 * channel) for color in colors for channel in color])
    return _saved(image)


def _saved(image: Images.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, format="PNG", compress_level=5)
    return out.getvalue()
