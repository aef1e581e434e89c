"""The meshes of objects for pictures, and what simulators need to know of them: mass, friction, convex pieces.

Everything is in the object's own frame: metres, z = 0 its lowest point, heading along +x. Pieces follow the pictures'
meshes to a few millimetres; what is thin or soft (cutlery, napkins) stays a prism. All stand flat on the table, so that
what rolls in life rests in a simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from itertools import pairwise

from scenegen.geometry.footprint import Point, Polygon, signed_area
from scenegen.things.furniture import WALL_SIDES, Crate, RoundSolid, Slab, Vessel
from scenegen.things.library import ASSETS, PLAIN, RGB, UNKNOWN, Asset, Shape, entry_of, own_size, stretch_of
from scenegen.things.mesh import Mesh, Part, box, loft, plain, prism
from scenegen.things.outline import corners_of
from scenegen.things.surfaces import HANDLE_WIDTH, slabs_of

DENSITY = 500.0  # kg/m^3 of what is not in the library: of wood, and of tableware that is half air
FRICTION = 0.5  # of what is not in the library
RIM_SIDES = 24  # of prisms that stand for round things
MAX_COLLISION_CORNERS = 64  # of a prism at most


def parts_of_asset(asset: Asset, color: RGB | None = None) -> tuple[Part, ...]:
    """Coloured closed meshes in the object's frame: centre of the footprint at the origin, z = 0 the table, heading
    along +x. `color` takes the place of the main colour. Every call makes new meshes."""
    module, _, function = asset.build.partition(":")
    made: tuple[Part, ...] = getattr(import_module(f"scenegen.things.{module}"), function)(color or asset.color)
    return made


def parts_of(shape: Shape, color: RGB) -> tuple[Part, ...]:
    """What is drawn of an object: closed meshes of its own size in its own frame, z = 0 the table.

    An entry of the library is stretched to the shape's footprint and height; a plain shape is made to measure (of a
    file: its outline, extruded); what is neither is a block, or a prism where the footprint is a polygon.
    """
    footprint = shape.footprint
    if shape.asset in PLAIN or isinstance(footprint, Polygon):
        return plain(footprint, shape.height, color)
    (length, width), (own_length, own_width, own_height) = footprint.extent, own_size(shape)
    scale = length / own_length, width / own_width, shape.height / own_height
    if shape.open:
        from scenegen.things.storage import cabinet

        parts = cabinet(color, shape.open)
    else:
        parts = parts_of_asset(ASSETS.get(shape.asset, ASSETS[UNKNOWN]), color)
    return tuple(replace(part, mesh=part.mesh.scale(*scale)) for part in parts)


def mass_of(shape: Shape) -> float:
    """Kilograms: the library's, in proportion where the shape is stretched, else of wood that fills its prism."""
    asset = entry_of(shape)
    if asset is not None:
        x, y, z = stretch_of(shape)
        return asset.mass * x * y * z * (own_size(shape)[2] / asset.height if shape.open else 1.0)
    return DENSITY * signed_area(_corners(shape)) * shape.height


def friction_of(shape: Shape) -> float:
    """The coefficient of sliding friction against a table of wood."""
    asset = entry_of(shape)
    return FRICTION if asset is None else asset.friction


def collision_of(shape: Shape) -> tuple[Mesh, ...]:
    """Convex closed meshes that stay within footprint and height; together they are what the object collides with.

    Of a shape with sizes of its own, the prism over its footprint.
    """
    asset = entry_of(shape)
    if asset is not None and shape.open:
        return tuple(map(_slab_mesh, slabs_of(shape)))
    pieces = None if asset is None else _pieces(asset)
    if pieces is None:
        return (prism(_corners(shape), 0.0, shape.height),)
    return tuple(piece.scale(*stretch_of(shape)) for piece in pieces)


def _corners(shape: Shape) -> Sequence[Point]:
    return corners_of(shape.footprint, RIM_SIDES, MAX_COLLISION_CORNERS)


ROUND_SIDES = 20  # of solid round pieces
DOME = ((0.0, 0.95), (0.18, 1.0), (0.6, 0.85), (1.0, 0.35))  # a mouse, in half its length, width and height


def _pieces(asset: Asset) -> tuple[Mesh, ...] | None:
    match asset.form:
        case None:
            return PIECES_OF[asset.name]() if asset.name in PIECES_OF else None
        case Vessel():
            return _vessel_pieces(asset.form)
        case Crate():
            return _crate_pieces(asset.form)
        case RoundSolid(rows):
            return _round(*rows)
        case furniture:
            return tuple(map(_slab_mesh, furniture.slabs()))


def _round(*rows: tuple[float, float]) -> tuple[Mesh, ...]:
    """Frusta through (z, radius), from the bottom up."""
    return tuple(
        loft([_ring(radius, low, ROUND_SIDES), _ring(other, high, ROUND_SIDES)])
        for (low, radius), (high, other) in pairwise(rows)
        if low < high
    )


def _ring(radius: float, z: float, sides: int) -> list[list[float]]:
    turns = [math.tau * k / sides for k in range(sides)]
    return [[radius * math.cos(turn), radius * math.sin(turn), z] for turn in turns]


def _vessel_pieces(vessel: Vessel) -> tuple[Mesh, ...]:
    """The solid bottom of a vessel, its wall cut into `WALL_SIDES` sectors, and its handle."""
    out = []
    for (z0, outer0, inner0), (z1, outer1, inner1) in pairwise(vessel.rows):
        if z1 == z0:
            continue
        if inner0 == inner1 == 0.0:
            out.append(loft([_ring(outer0, z0, WALL_SIDES), _ring(outer1, z1, WALL_SIDES)]))
            continue
        for k in range(WALL_SIDES):
            a, b = (math.tau * turn / WALL_SIDES for turn in (k, k + 1))
            out.append(loft([_sector(inner0, outer0, a, b, z0), _sector(inner1, outer1, a, b, z1)]))
    return (*out, *(_handle(*vessel.handle) if vessel.handle else ()))


def _sector(inner: float, outer: float, a: float, b: float, z: float) -> list[list[float]]:
    return [[r * math.cos(turn), r * math.sin(turn), z] for r, turn in ((inner, a), (outer, a), (outer, b), (inner, b))]


def _crate_pieces(crate: Crate) -> tuple[Mesh, ...]:
    """The floor of a crate and its four walls."""
    long, wide, tall = crate.length, crate.width, crate.height - crate.floor
    side, end = box(long, crate.wall, tall), box(crate.wall, wide - 2.0 * crate.wall, tall)
    y, x = (wide - crate.wall) / 2.0, (long - crate.wall) / 2.0
    walls = [side.shift(y=s * y, z=crate.floor) for s in (-1.0, 1.0)]
    walls += [end.shift(x=s * x, z=crate.floor) for s in (-1.0, 1.0)]
    return box(long, wide, crate.floor), *walls


def _handle(inner: float, outer: float, low: float, high: float) -> tuple[Mesh, ...]:
    """The ear of a mug: three bars from the wall at x = `inner` to x = `outer`."""
    thick, wide = 0.008, HANDLE_WIDTH
    bar = box(outer - inner, wide, thick).shift(x=(inner + outer) / 2.0)
    upright = box(thick, wide, high - low).shift(x=outer - thick / 2.0, z=low)
    return upright, bar.shift(z=low), bar.shift(z=high - thick)


def _teapot() -> tuple[Mesh, ...]:
    body = _round((0.0, 0.042), (0.022, 0.060), (0.048, 0.066), (0.094, 0.056), (0.114, 0.036), (0.150, 0.010))
    spout, grip = box(0.050, 0.020, 0.052).shift(x=0.085, z=0.052), box(0.046, 0.014, 0.068).shift(x=-0.087, z=0.030)
    return *(piece.shift(x=-0.002) for piece in body), spout, grip


def _laptop() -> tuple[Mesh, ...]:
    """The deck, and the lid that leans back."""
    lid = [
        [[x, -0.165, z], [x + 0.0085, -0.165, z], [x + 0.0085, 0.165, z], [x, 0.165, z]]
        for x, z in ((-0.078, 0.0), (-0.156, 0.224))
    ]
    return box(0.234, 0.330, 0.0195).shift(x=0.039), loft(lid)


def _slab_mesh(one: Slab) -> Mesh:
    """An upright piece as a box."""
    x0, y0, x1, y1 = one.box
    middle = {"x": (x0 + x1) / 2.0, "y": (y0 + y1) / 2.0, "z": one.low}
    return box(x1 - x0, y1 - y0, one.high - one.low).shift(**middle)


PIECES_OF: dict[str, Callable[[], tuple[Mesh, ...]]] = {  # of what has no form
    "teapot": _teapot,
    "laptop": _laptop,
    "mouse": lambda: tuple(part.scale(0.0575, 0.031, 0.038) for part in _round(*DOME)),
    "stapler": lambda: (box(0.150, 0.038, 0.010), box(0.149, 0.033, 0.048).shift(z=0.010)),
}
