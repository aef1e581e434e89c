"""How objects are stretched from those of the library, and the room inside them."""

from __future__ import annotations

from scenegen.assets.hollow import Rooms
from scenegen.assets.library import ASSETS, PLAIN, Asset, Shape, own_size
from scenegen.assets.solids import HOLLOWS
from scenegen.primitives import Box, Circle, Polygon


def rooms_of(shape: Shape) -> Rooms:
    """(footprint, height): what fits inside the object, and how high it then stands; the deepest first, of solid
    things none."""
    asset = asset_of(shape)
    if asset is None or asset.name not in HOLLOWS:
        return ()
    x, y, z = _stretch(shape)
    rooms: list[tuple[Circle | Box, float]] = []
    for room, height in HOLLOWS[asset.name].rooms():
        scaled = Circle(room.radius * min(x, y)) if isinstance(room, Circle) else Box(room.length * x, room.width * y)
        rooms.append((scaled, height * z))
    return tuple(rooms)


def stretch_of(shape: Shape) -> tuple[float, float, float]:
    """How much longer, wider and higher an object is than the library's; 1 for shapes with sizes of their own."""
    asset = asset_of(shape)
    return (1.0, 1.0, 1.0) if asset is None else _stretch(shape)


def asset_of(shape: Shape) -> Asset | None:
    """The entry of the library that a shape is, perhaps stretched; None for shapes with sizes of their own."""
    if shape.asset in PLAIN or isinstance(shape.footprint, Polygon):
        return None
    return ASSETS.get(shape.asset)


def _stretch(shape: Shape) -> tuple[float, float, float]:
    (length, width), (own_length, own_width, own_height) = shape.footprint.extent, own_size(shape)
    return length / own_length, width / own_width, shape.height / own_height
