"""Pictures as files: PNG for eyes, 16-bit PNG for depth, indexed PNG for masks, NPZ for programs."""

from __future__ import annotations

import importlib.util
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image as Images

from scenegen.errors import RequestError, quote_names
from scenegen.errors.program import NO_EGL
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.lang.spec import SpecCamera
from scenegen.looks.camera import VIEWS, Camera, frame, from_place
from scenegen.looks.look import LOOK_VIEW
from scenegen.things.colored_mesh import ColoredMesh
from scenegen.things.palette import PALETTE
from scenegen.validation import as_int, as_words

Image = npt.NDArray[np.float32]
Picture = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.uint16]
Model = tuple[ColoredMesh, ...]  # an object as its own files show it
Rows = npt.NDArray[np.intp] | slice  # indices of pixels of a picture, row by row

GROUND_ID, TABLE_ID, FIRST_ID = 0, 1, 2  # in masks: the ground, the table, the first object


@dataclass(frozen=True, slots=True)
class RenderedView:
    """One picture. `color` is RGB (h, w, 3), or RGBA (h, w, 4); `depth` (h, w) is the distance along the view direction
    at the centre of a pixel, in metres; `mask` (h, w) has the number of the visible object."""

    color: Picture
    depth: Image
    mask: Mask


RENDERERS = ("software", "egl")
DEPTH_UNIT = 1e-4  # metres: the unit of depth in PNG files, 6.5 m at most


@dataclass(frozen=True, slots=True)
class PictureOptions:
    """The pictures to draw of every scene."""

    views: tuple[str, ...]
    size: tuple[int, int]
    transparent: bool = False
    depth: bool = False
    masks: bool = False
    renderer: str = "software"
    declared: SpecCamera | None = None  # the camera of a spec whose name the one view has

    def is_of_look(self, view: str) -> bool:
        """Whether a look places the camera of a view."""
        return view == LOOK_VIEW and self.declared is None

    def camera(self, view: str, points: npt.NDArray[np.float64]) -> Camera:
        """The camera of a view that no look places; (P, 3) `points` are what there is to see."""
        one = self.declared
        if one is None:
            return frame(view, points, self.size)
        return from_place(points, self.size, np.array(one.eye), np.array(one.target), math.degrees(one.field))

    def shift(self, x: float, y: float) -> PictureOptions:
        """The same pictures where the origin is at (x, y)."""
        one = self.declared
        if one is None:
            return self
        eye, target = ((place[0] - x, place[1] - y, place[2]) for place in (one.eye, one.target))
        return replace(self, declared=replace(one, eye=eye, target=target))

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


def encode(shot: RenderedView, options: PictureOptions, ids: int) -> Sequence[bytes]:
    """The files of a shot, in the order of `options.endings`; masks hold numbers below `ids`."""
    files = [png(shot.color)]
    arrays: dict[str, Any] = {}
    if options.depth:
        ticks = np.clip(np.rint(shot.depth / DEPTH_UNIT), 0, 65535).astype(np.uint16)
        files.append(_png_bytes(Images.fromarray(ticks)))
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
    return _png_bytes(Images.fromarray(picture))


def _mask(shot: RenderedView, ids: int) -> bytes:
    """The numbers themselves; up to 256 of them as an indexed picture, so that people can distinguish them too."""
    if ids > 256:
        return _png_bytes(Images.fromarray(shot.mask))
    image = Images.fromarray(shot.mask.astype(np.uint8))
    colors = [(0.0, 0.0, 0.0), (0.3, 0.3, 0.3), *(PALETTE[k % len(PALETTE)] for k in range(254))]
    image.putpalette([round(255 * channel) for color in colors for channel in color])
    return _png_bytes(image)


def _png_bytes(image: Images.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, format="PNG", compress_level=5)
    return out.getvalue()


MIN_PICTURE_SIDE, MAX_PICTURE_SIDE = 16, 4096  # pixels along a side of a picture


def declared_camera(cameras: Sequence[SpecCamera], name: str) -> SpecCamera:
    """The camera of a spec that has this name. Raises RequestError where there is none."""
    for one in cameras:
        if one.name == name:
            return one
    example = "write `camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3` in the spec"
    known = tuple(one.name for one in cameras)
    raise RequestError(UNKNOWN_CHOICE(what="camera", name=str(name), known=known, instead=None if known else example))


def camera_size(camera: SpecCamera, wanted: tuple[int, int] | None) -> tuple[int, int]:
    """The size of a camera's pictures in pixels: as wanted, or about as many as 640 x 480 has. Raises RequestError for
    a size of another shape than the camera's."""
    scale = math.sqrt(640.0 * 480.0)
    scale = min(scale, MAX_PICTURE_SIDE / max(math.sqrt(camera.aspect), 1.0 / math.sqrt(camera.aspect)))
    usual = round(scale * math.sqrt(camera.aspect)), round(scale / math.sqrt(camera.aspect))
    if not isinstance(wanted, tuple | list) or len(wanted) != 2:
        return usual if wanted is None else wanted  # which is refused
    width, height = as_int("width", wanted[0]), as_int("height", wanted[1])
    if abs(width - height * camera.aspect) > 1.0 and abs(height - width / camera.aspect) > 1.0:
        shape = f"of the shape that `{camera.name}` has, such as {usual[0]}x{usual[1]}"
        raise RequestError(OUT_OF_RANGE(argument="size", value=f"{width} x {height}", wanted=shape))
    return width, height


def check_request(views: tuple[str, ...], size: tuple[int, int], workers: int | None, *, looks: bool = False) -> None:
    """Raises RequestError for invalid views, an invalid size in pixels, or an invalid number of processes."""
    known = (*VIEWS, LOOK_VIEW) if looks else VIEWS
    views = as_words("views", views, '("top",)')
    if not views:
        wanted = f"at least one view; there are {quote_names(known)}"
        raise RequestError(WRONG_VALUE(argument="views", value="empty", wanted=wanted))
    for view in views:
        if view not in known:
            raise RequestError(UNKNOWN_CHOICE(what="view", name=view, known=known))
    if not isinstance(size, tuple | list) or len(size) != 2:
        wanted = "width and height in pixels, as (640, 480)"
        raise RequestError(WRONG_VALUE(argument="size", value=repr(size), wanted=wanted))
    size = as_int("width", size[0]), as_int("height", size[1])
    if not all(MIN_PICTURE_SIDE <= side <= MAX_PICTURE_SIDE for side in size):
        wanted = f"from {MIN_PICTURE_SIDE} to {MAX_PICTURE_SIDE} pixels wide and high"
        raise RequestError(OUT_OF_RANGE(argument="size", value=f"{size[0]} x {size[1]}", wanted=wanted))
    if workers is not None and as_int("workers", workers) < 1:
        raise RequestError(OUT_OF_RANGE(argument="workers", value=workers, wanted="1 or more"))


def check_renderer(renderer: str) -> None:
    """Raises RequestError for a renderer that is unknown or not available."""
    if renderer not in RENDERERS:
        raise RequestError(UNKNOWN_CHOICE(what="renderer", name=renderer, known=RENDERERS))
    if renderer == "egl" and importlib.util.find_spec("eglRenderer") is None:
        raise RequestError(NO_EGL())
