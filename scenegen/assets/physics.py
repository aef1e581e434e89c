"""What simulators need to know of an object: its mass, its friction, convex pieces to collide with, room inside it.

Everything is in the object's own frame: metres, z = 0 its lowest point, heading along +x.
"""

from __future__ import annotations

import math

from scenegen.assets.hollow import Rooms
from scenegen.assets.library import ASSETS, PLAIN, Asset, Shape
from scenegen.assets.mesh import Mesh, prism
from scenegen.assets.outline import simplified
from scenegen.assets.solids import HOLLOWS, SOLIDS
from scenegen.primitives import Box, Circle, Polygon
from scenegen.primitives.hull import Point, signed_area

DENSITY = 500.0  # kg/m^3 of what is not in the library: of wood, and of tableware that is half air
FRICTION = 0.5  # of what is not in the library
SIDES = 24  # of prisms that stand for round things
CORNERS = 64  # of a prism at most


def mass_of(shape: Shape) -> float:
    """Kilograms: the library's, in proportion where the shape is stretched, else of wood that fills its prism."""
    asset = _asset(shape)
    if asset is not None:
        x, y, z = _stretch(shape, asset)
        return asset.mass * x * y * z
    return DENSITY * signed_area(_corners(shape)) * shape.height


def friction_of(shape: Shape) -> float:
    """The coefficient of sliding friction against a table of wood."""
    asset = _asset(shape)
    return FRICTION if asset is None else asset.friction


def collision_of(shape: Shape) -> tuple[Mesh, ...]:
    """Convex closed meshes that stay within footprint and height; together they are what the object collides with.

    Of a shape with sizes of its own, the prism over its footprint.
    """
    asset = _asset(shape)
    if asset is None or asset.name not in SOLIDS:
        return (prism(_corners(shape), 0.0, shape.height),)
    return tuple(piece.scaled(*_stretch(shape, asset)) for piece in SOLIDS[asset.name]())


def rooms_of(shape: Shape) -> Rooms:
    """(footprint, height): what fits inside the object, and how high it then stands; the deepest first, of solid
    things none."""
    asset = _asset(shape)
    if asset is None or asset.name not in HOLLOWS:
        return ()
    x, y, z = _stretch(shape, asset)
    rooms: list[tuple[Circle | Box, float]] = []
    for room, height in HOLLOWS[asset.name].rooms():
        scaled = Circle(room.radius * min(x, y)) if isinstance(room, Circle) else Box(room.length * x, room.width * y)
        rooms.append((scaled, height * z))
    return tuple(rooms)


def _asset(shape: Shape) -> Asset | None:
    """The entry of the library that a shape is, perhaps stretched; None for shapes with sizes of their own."""
    if shape.asset in PLAIN or isinstance(shape.footprint, Polygon):
        return None
    return ASSETS.get(shape.asset)


def _stretch(shape: Shape, asset: Asset) -> tuple[float, float, float]:
    (length, width), (own_length, own_width) = shape.footprint.extent, asset.footprint.extent
    return length / own_length, width / own_width, shape.height / asset.height


def _corners(shape: Shape) -> list[Point]:
    match shape.footprint:
        case Circle(radius):
            turns = [math.tau * k / SIDES for k in range(SIDES)]
            return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        case Box(length, width):
            x, y = length / 2.0, width / 2.0
            return [(-x, -y), (x, -y), (x, y), (-x, y)]
        case Polygon(vertices):
            return list(simplified(vertices, CORNERS))
