"""What simulators need to know of an object: its mass, its friction, convex pieces to collide with, room inside it.

Everything is in the object's own frame: metres, z = 0 its lowest point, heading along +x.
"""

from __future__ import annotations

import math

from scenegen.geometry import Box, Circle, Polygon
from scenegen.geometry.footprint import Point, signed_area
from scenegen.things.library import Shape, own_size
from scenegen.things.mesh import Mesh, prism
from scenegen.things.outline import simplified
from scenegen.things.solids import SOLIDS, slab_mesh
from scenegen.things.surfaces import asset_of, slabs_of, stretch_of

DENSITY = 500.0  # kg/m^3 of what is not in the library: of wood, and of tableware that is half air
FRICTION = 0.5  # of what is not in the library
RIM_SIDES = 24  # of prisms that stand for round things
CORNERS = 64  # of a prism at most


def mass_of(shape: Shape) -> float:
    """Kilograms: the library's, in proportion where the shape is stretched, else of wood that fills its prism."""
    asset = asset_of(shape)
    if asset is not None:
        x, y, z = stretch_of(shape)
        return asset.mass * x * y * z * (own_size(shape)[2] / asset.height if shape.open else 1.0)
    return DENSITY * signed_area(_corners(shape)) * shape.height


def friction_of(shape: Shape) -> float:
    """The coefficient of sliding friction against a table of wood."""
    asset = asset_of(shape)
    return FRICTION if asset is None else asset.friction


def collision_of(shape: Shape) -> tuple[Mesh, ...]:
    """Convex closed meshes that stay within footprint and height; together they are what the object collides with.

    Of a shape with sizes of its own, the prism over its footprint.
    """
    asset = asset_of(shape)
    if asset is None or asset.name not in SOLIDS:
        return (prism(_corners(shape), 0.0, shape.height),)
    if shape.open:
        return tuple(map(slab_mesh, slabs_of(shape)))
    return tuple(piece.scaled(*stretch_of(shape)) for piece in SOLIDS[asset.name]())


def _corners(shape: Shape) -> list[Point]:
    match shape.footprint:
        case Circle(radius):
            turns = [math.tau * k / RIM_SIDES for k in range(RIM_SIDES)]
            return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        case Box(length, width):
            x, y = length / 2.0, width / 2.0
            return [(-x, -y), (x, -y), (x, y), (-x, y)]
        case Polygon(vertices):
            return list(simplified(vertices, CORNERS))
