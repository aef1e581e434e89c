"""Randomised looks: what the table, the ground, the light and the camera of one picture are, and how they are drawn."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scenegen.assets.palette import RGB
from scenegen.render.camera import Camera, Floats, at_angles

VIEW = "look"  # the view whose camera a look places
SEEDS = 2**63  # one more than the largest seed
DARKEST = 0.03  # of a channel of the table's colour: the cloths on it are painted as shares of that

Random = np.random.Generator
Draw = Callable[[Random], Any]


@dataclass(frozen=True, slots=True)
class Look:
    """The look of one picture. Colours are RGB from 0 to 1; angles are degrees. Azimuths are counted from the viewer's
    side (-y) to the right. `camera_distance` is in distances from which the whole table just fits the picture."""

    table_color: RGB
    table_texture: str  # wood or plain
    ground_color: RGB
    light_azimuth: float
    light_elevation: float
    light_color: RGB
    light_intensity: float
    light_ambient: float
    camera_azimuth: float
    camera_elevation: float
    camera_distance: float
    camera_fov: float  # height of the picture, as an angle

    @property
    def towards(self) -> tuple[float, float, float]:
        """The direction to the light, with z = 1."""
        turn, across = math.radians(self.light_azimuth), 1.0 / math.tan(math.radians(self.light_elevation))
        return across * math.sin(turn), -across * math.cos(turn), 1.0

    @property
    def table(self) -> RGB:
        red, green, blue = (max(channel, DARKEST) for channel in self.table_color)
        return red, green, blue

    @property
    def brightness(self) -> Floats:
        """(3,): the light on a level surface."""
        level = self.light_intensity * math.sin(math.radians(self.light_elevation))
        return np.asarray((self.light_ambient + level) * np.array(self.light_color))

    def camera(self, points: Floats, size: tuple[int, int]) -> Camera:
        """The camera, which shows all of (P, 3) `points` in metres."""
        angles = self.camera_azimuth, self.camera_elevation, self.camera_fov
        return at_angles(points, size, *angles, distance=self.camera_distance)

    def as_json(self) -> dict[str, Any]:
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


@dataclass(frozen=True, slots=True)
class Looks:
    """Distributions of the fields of a look, by their names."""

    draws: dict[str, Draw]

    def at(self, seed: int, index: int) -> Look:
        """The look of scene `index` of a file. Each field has random numbers of its own, so that another distribution
        of one leaves the others as they are."""
        drawn = {
            name: draw(np.random.default_rng([seed, index, zlib.crc32(name.encode())]))
            for name, draw in self.draws.items()
        }
        return Look(**drawn)
