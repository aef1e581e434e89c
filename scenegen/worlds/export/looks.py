"""Looks for simulators: what the table, the ground and the walls of each scene are covered with, and its camera."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES
from scenegen.looks.camera import Camera
from scenegen.looks.look import Look, Point, check_seed, looks_jsonl
from scenegen.looks.stage import PictureSetup, stage_of, usual_size
from scenegen.looks.textures import PLAIN, WOOD, Pixels, image_of, mean_of, wood
from scenegen.scenes.data import SceneFile
from scenegen.things.library import RGB

WOOD_PIXELS = 1024  # pixels along the longer side of a wooden table
WALL_HEIGHT = 3.0  # metres: walls, from the floor

Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class TexturedColor:
    """A colour, and the file in `FOLDER` of the texture that multiplies it, if there is one: `width` and `height`
    metres of the surface, repeated, or where these are 0, all of it. `mean` is what it looks like from afar."""

    color: RGB
    mean: RGB
    file: str = ""
    width: float = 0.0
    height: float = 0.0

    def repeats(self, width: float, height: float) -> tuple[float, float]:
        """How often the texture is on a rectangle of these metres, from left to right and from its lower edge up."""
        return (width / self.width, height / self.height) if self.width else (1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Wall:
    """A rectangle that is seen from one side: its middle, the directions of its width and height, of length 1, and
    both in metres."""

    middle: Point
    across: Point
    width: float
    height: float
    up: Point = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class SceneLook:
    """The look of one scene."""

    look: Look
    camera: Camera
    table: TexturedColor
    ground: TexturedColor
    walls: TexturedColor
    room: Rectangle | None

    def each_wall(self, floor: float, table: Rectangle) -> Iterator[Wall]:
        """The walls of the room, which stand at the height `floor`. Simulators let walls cast shadows, pictures do not:
        those on the side of the light are only so high that it shines on the whole `table`, whose top is z = 0."""
        if self.room is None:
            return
        x0, y0, x1, y1 = self.room
        across, along, _ = self.look.towards  # of the light, for each metre of height
        for at, inwards, width, gap, light in (
            (((x0 + x1) / 2.0, y1), (0.0, -1.0), x1 - x0, y1 - table[3], along),
            (((x0 + x1) / 2.0, y0), (0.0, 1.0), x1 - x0, table[1] - y0, -along),
            ((x0, (y0 + y1) / 2.0), (1.0, 0.0), y1 - y0, table[0] - x0, -across),
            ((x1, (y0 + y1) / 2.0), (-1.0, 0.0), y1 - y0, x1 - table[2], across),
        ):
            high = min(WALL_HEIGHT, max(gap, 0.0) / light - floor) if light > 0.0 else WALL_HEIGHT
            yield Wall((*at, floor + high / 2.0), (-inwards[1], inwards[0], 0.0), width, high)


class SceneLooks:
    """The looks of the scenes of a file. `cameras` are those of their view "look"; `stage` is the table of pictures;
    `files` are those of textures, by name."""

    def __init__(
        self,
        looks: Sequence[Look],
        cameras: Sequence[Camera],
        stage: PictureSetup,
        files: Mapping[str, bytes],
        seed: int,
    ) -> None:
        self._looks, self._cameras, self._stage, self._seed = looks, cameras, stage, seed
        self._files = files
        used = dict.fromkeys(name for look in looks for name in look.textures if name not in (PLAIN, WOOD))
        self._names = _file_names(list(used))
        images = {name: image_of(name, files) for name in used}
        self._ratios = {name: image.shape[0] / image.shape[1] for name, image in images.items()}
        self._means = {name: mean_of(image) for name, image in images.items()}
        self._wooden: dict[Rectangle, str] = {}  # tables, and the files of their wood

    def scene_look(self, scene: int, table: Rectangle) -> SceneLook:
        """The look of a scene, by its number from 1, with the simulator's table (x lowest, y lowest, x highest, y
        highest)."""
        look, camera = self._looks[scene - 1], self._cameras[scene - 1]
        if look.table_texture == WOOD:
            file = self._wooden.setdefault(table, f"{WOOD}_{len(self._wooden) + 1}.png")
            top = TexturedColor(look.table, look.table, file)
        else:
            top = self._covering(look.table, look.table_texture, look.table_texture_size)
        room = look.room(self._stage.table, camera.eye)
        seen = PLAIN if room is None else look.walls_texture  # which is not among `textures` without walls
        return SceneLook(
            look,
            camera,
            top,
            self._covering(look.ground_color, look.ground_texture, look.ground_texture_size),
            self._covering(look.walls_color, seen, look.walls_texture_size),
            room,
        )

    def textures(self) -> Iterator[tuple[str, bytes]]:
        """The files of the textures that scenes were given: name, PNG."""
        for name, file in self._names.items():
            yield file, _png_bytes(image_of(name, self._files))
        for table, file in self._wooden.items():
            yield file, _png_bytes(_wood(self._stage, table))

    def record(self, files: Sequence[str]) -> bytes:
        """`looks.jsonl` for scenes in these files."""
        return looks_jsonl(self._looks, self._seed, [("file", name) for name in files], self._cameras)

    def _covering(self, color: RGB, texture: str, size: float) -> TexturedColor:
        if texture == PLAIN:
            return TexturedColor(color, color)
        red, green, blue = (one * share for one, share in zip(color, self._means[texture], strict=True))
        return TexturedColor(color, (red, green, blue), self._names[texture], size, size * self._ratios[texture])


def _file_names(textures: Sequence[str]) -> dict[str, str]:
    """A file name for each texture, no two alike, whatever the case of letters."""
    names: dict[str, str] = {}
    used = set[str]()
    for texture in textures:
        stem = "".join(one if one.isascii() and one.isalnum() else "_" for one in PurePosixPath(texture).stem)
        stem = stem or "texture"
        name, number = stem, 1
        while name.lower() in used:
            number += 1
            name = f"{stem}_{number}"
        used.add(name.lower())
        names[texture] = f"{name}.png"
    return names


def _png_bytes(image: Pixels) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(image).save(out, format="PNG")
    return out.getvalue()


def _wood(stage: PictureSetup, table: Rectangle) -> Pixels:
    """(h, w, 3): the wood of a whole table, from above."""
    x0, y0, x1, y1 = table
    pixel = max(x1 - x0, y1 - y0) / WOOD_PIXELS
    across, along = (max(round(length / pixel), 1) for length in (x1 - x0, y1 - y0))
    x = x0 + (np.arange(across) + 0.5) / across * (x1 - x0)
    y = y1 - (np.arange(along) + 0.5) / along * (y1 - y0)
    columns, rows = np.meshgrid(x, y)
    sizes = np.full(columns.size, pixel), np.full(columns.size, pixel)
    shares = wood(stage, columns.ravel(), rows.ravel(), sizes, inlay=False).reshape(along, across, 3)
    return np.rint(255.0 * np.clip(shares, 0.0, 1.0)).astype(np.uint8)


def dressing_of(file: SceneFile, looks: str | Path, seed: int) -> SceneLooks:
    """The looks of scenes, with the cameras of their pictures. Raises RequestError, DataError."""
    from scenegen.looks.configuration import read_looks  # Pillow

    if not file.scenes:
        raise RequestError(NO_SCENES())
    given = read_looks(looks)
    drawn = given.draw_looks(check_seed(seed), len(file.scenes), [item.name for item in file.objects])
    stage, size = stage_of(file), usual_size(file)
    cameras = [look.camera(stage.corners(), size) for look in drawn]
    return SceneLooks(drawn, cameras, stage, given.files, seed)
