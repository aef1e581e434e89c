"""The look of one scene, and the distributions it is drawn from."""

from __future__ import annotations

import colorsys
import json
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.looks.camera import Camera, Floats, at_angles, from_place
from scenegen.resources import __version__
from scenegen.things.colored_mesh import WHITE
from scenegen.things.library import RGB
from scenegen.validation import as_int

LOOK_VIEW = "look"  # the view whose camera a look places
SEED_LIMIT = 2**63  # one more than the largest seed
MIN_TABLE_CHANNEL = 0.03  # of a channel of the table's colour: the cloths on it are painted as shares of that
LENS_FRAME_MM = 24.0  # mm: height of the picture behind the lens, for focal lengths
USUAL_COLORS: dict[str, RGB] = {  # colours of surfaces for which none is given, but for pictures from files
    "table": (0.83, 0.72, 0.58),
    "ground": (0.935, 0.932, 0.925),
    "walls": (0.90, 0.89, 0.86),
}

Random = np.random.Generator
Draw = Callable[[Random], Any]
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Tint:
    """How an object's colours change: `hue` turned by a share of the circle, the others multiplied."""

    name: str
    hue: float = 0.0
    saturation: float = 1.0
    brightness: float = 1.0

    def __call__(self, color: RGB) -> RGB:
        hue, saturation, value = colorsys.rgb_to_hsv(*color)
        bright = min(value * self.brightness, 1.0)
        return colorsys.hsv_to_rgb((hue + self.hue) % 1.0, min(saturation * self.saturation, 1.0), bright)


@dataclass(frozen=True, slots=True)
class Look:
    """The look of one scene. Colours are RGB from 0 to 1; angles are degrees; lengths are metres. Azimuths are counted
    from the viewer's side (-y) to the right. A texture is a name of `textures.BUILT_IN`, or a file's.

    `walls_distance` is that of the walls from the table, 0 if there are none. `camera_distance` is in distances from
    which the whole table just fits the picture. With a `camera_position`, the camera is there and looks at
    `camera_look_at`, or at the middle of the table; azimuth, elevation and distance then mean nothing.
    """

    table_color: RGB
    table_texture: str
    table_texture_size: float  # what a texture from a file covers from its left to its right
    ground_color: RGB
    ground_texture: str
    ground_texture_size: float
    walls_distance: float
    walls_color: RGB
    walls_texture: str
    walls_texture_size: float
    light_azimuth: float
    light_elevation: float
    light_color: RGB
    light_intensity: float
    light_ambient: float
    camera_azimuth: float
    camera_elevation: float
    camera_distance: float
    camera_fov: float  # height of the picture, as an angle
    camera_position: Point | None = None
    camera_look_at: Point | None = None
    camera_roll: float = 0.0  # how far the camera leans to the right
    tints: tuple[Tint, ...] = ()  # of the objects, in their order

    @property
    def towards(self) -> Point:
        """The direction to the light, with z = 1."""
        turn, across = math.radians(self.light_azimuth), 1.0 / math.tan(math.radians(self.light_elevation))
        return across * math.sin(turn), -across * math.cos(turn), 1.0

    @property
    def table(self) -> RGB:
        red, green, blue = (max(channel, MIN_TABLE_CHANNEL) for channel in self.table_color)
        return red, green, blue

    @property
    def textures(self) -> tuple[str, ...]:
        """The names of the textures that are seen."""
        return (self.table_texture, self.ground_texture, *([self.walls_texture] if self.walls_distance else []))

    def brightness(self, normal: Point = (0.0, 0.0, 1.0)) -> Floats:
        """(3,): the light on a surface with this normal, of length 1."""
        towards = np.array(self.towards)
        facing = max(float(towards @ normal) / float(np.linalg.norm(towards)), 0.0)
        return np.asarray((self.light_ambient + self.light_intensity * facing) * np.array(self.light_color))

    def camera(self, points: Floats, size: tuple[int, int]) -> Camera:
        """The camera. It shows all of (P, 3) `points`, in metres, unless its position is given or it is rolled."""
        if self.camera_position is not None:
            middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
            target = np.array(self.camera_look_at or (middle[0], middle[1], 0.0))
            return from_place(points, size, np.array(self.camera_position), target, self.camera_fov, self.camera_roll)
        angles = self.camera_azimuth, self.camera_elevation, self.camera_fov
        return at_angles(points, size, *angles, distance=self.camera_distance, roll=self.camera_roll)

    def shift(self, x: float, y: float) -> Look:
        """The look in a frame whose origin is at (x, y)."""

        def there(point: Point | None) -> Point | None:
            return None if point is None else (point[0] - x, point[1] - y, point[2])

        return replace(self, camera_position=there(self.camera_position), camera_look_at=there(self.camera_look_at))

    def room(self, table: tuple[float, float, float, float], eye: Floats) -> tuple[float, float, float, float] | None:
        """Where the walls stand, (x lowest, y lowest, x highest, y highest), None if there are none. The camera at
        `eye` (3,) is always inside: the walls behind it step back."""
        if not self.walls_distance:
            return None
        away, behind = self.walls_distance, 0.25
        x0, y0, x1, y1 = table
        x, y = float(eye[0]), float(eye[1])
        low, high = (
            (min(x0 - away, x - behind), min(y0 - away, y - behind)),
            (max(x1 + away, x + behind), max(y1 + away, y + behind)),
        )
        return (*low, *high)

    def as_json(self) -> dict[str, Any]:
        """All values, the focal length for a picture 24 mm high among them; what does not apply is left out."""
        data = {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}
        del data["tints"]
        data["camera_focal_length"] = LENS_FRAME_MM / 2.0 / math.tan(math.radians(self.camera_fov) / 2.0)
        if self.camera_position is not None:
            for name in ("azimuth", "elevation", "distance"):
                del data[f"camera_{name}"]
        if not self.walls_distance:
            data = {name: value for name, value in data.items() if not name.startswith("walls_")}
        if self.tints:
            keys = ("hue", "saturation", "brightness")
            data["objects"] = {tint.name: {key: getattr(tint, key) for key in keys} for tint in self.tints}
        return {name: value for name, value in data.items() if value is not None}


def check_seed(seed: int) -> int:
    """Raises RequestError for a seed of looks that is no whole number from 0 to 2^63 - 1."""
    if not 0 <= as_int("seed", seed) < SEED_LIMIT:
        raise RequestError(OUT_OF_RANGE(argument="seed", value=seed, wanted="from 0 to 2^63 - 1"))
    return seed


def field_of(focal_length: float) -> float:
    """The height of a picture as an angle, in degrees, for a focal length in mm and a picture 24 mm high."""
    return 2.0 * math.degrees(math.atan(LENS_FRAME_MM / 2.0 / focal_length))


@dataclass(frozen=True, slots=True)
class LookDistribution:
    """Distributions of the fields of a look, by their names, and of the fields of tints; `files` are those of textures,
    by the names that looks have for them."""

    draws: dict[str, Draw]
    tints: dict[str, Draw] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)

    def draw_look(self, seed: int, index: int, names: Sequence[str] = ()) -> Look:
        """The look of scene `index` of a file, whose objects are `names`. Each field has random numbers of its own, so
        that another distribution of one leaves the others as they are."""

        def draw_value(name: str, draw: Draw) -> Any:
            return draw(np.random.default_rng([seed, index, zlib.crc32(name.encode())]))

        values = {name: draw_value(name, draw) for name, draw in self.draws.items()}
        for part, usual in USUAL_COLORS.items():
            if values[f"{part}_color"] is None:
                values[f"{part}_color"] = WHITE if values[f"{part}_texture"] in self.files else usual
        tints = tuple(
            Tint(name, **{key: draw_value(f"objects_{key} {name}", draw) for key, draw in self.tints.items()})
            for name in (names if self.tints else ())
        )
        return Look(**values, tints=tints)

    def draw_looks(self, seed: int, count: int, names: Sequence[str] = ()) -> list[Look]:
        """The looks of `count` scenes."""
        return [self.draw_look(seed, index, names) for index in range(count)]


LOOKS_FILE = "looks.jsonl"


def looks_jsonl(
    looks: Sequence[Look], seed: int, files: Sequence[tuple[str, Any]], cameras: Sequence[Camera | None]
) -> bytes:
    """A line for each scene: its number, a key and value that name its files, the seed, all values of its look, and if
    there is a camera of its own, `size`, `intrinsics` (3, 3) in pixels and `world_to_camera` (4, 4), in the frames of
    cameras.json."""
    lines = []
    for number, (look, (key, names), camera) in enumerate(zip(looks, files, cameras, strict=True), start=1):
        record: dict[str, Any] = {"scene": number, key: names, "seed": seed, "version": __version__}
        record["look"] = look.as_json()
        if camera is not None:
            k = camera.intrinsics()
            record["size"] = list(camera.size)
            record["intrinsics"] = [[k["fx"], 0.0, k["cx"]], [0.0, k["fy"], k["cy"]], [0.0, 0.0, 1.0]]
            record["world_to_camera"] = [
                [round(value, 12) + 0.0 for value in row] for row in camera.extrinsics().tolist()
            ]
        lines.append(json.dumps(record))
    return ("\n".join(lines) + "\n").encode()
