"""What objects can stand on: the named surfaces of things, and the upright pieces of open furniture.

All in the object's own frame: metres, z = 0 its lowest point, heading along +x, which is where furniture has its front.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

from scenegen.assets.boards import UNITS, Slab, Surface, Unit
from scenegen.assets.cabinet import Cabinet, Drawer
from scenegen.assets.library import PLAIN, Shape
from scenegen.assets.rack import Rack
from scenegen.primitives import MATH, PRIMITIVES, Box, Circle, Footprint, Polygon

TURNS = 180  # headings that are tried where a footprint has to fit between walls


__all__ = [
    "Surface",
    "cells_of",
    "fits",
    "narrowest",
    "pocketed",
    "reach_of",
    "rim_of",
    "sizes_of",
    "slabs_of",
    "surfaces_of",
]

TOPS: dict[str, Footprint] = {  # narrower than the footprint
    "can": Circle(0.0275),
    "jar": Circle(0.0365),
    "stand": Circle(0.108),
}
RIMS: dict[str, Footprint] = {"pot": Circle(0.006)}  # where the middle of a lid stands
FLAT = ("crackerbox", "book", "board", "phone", "napkin", "block")  # with a top as wide as they are


def surfaces_of(shape: Shape, upper: Shape | None = None) -> tuple[Surface, ...]:
    """The surfaces of an object, the one that is meant by the object's name alone first; none where nothing can stand
    on it. Where walls slope, `inside` lies as deep as the object `upper` goes; `rim` is instead of it where that stands
    on the rim."""
    from scenegen.assets.nesting import nested
    from scenegen.assets.rooms import rooms_of, stretch_of

    unit, (x, y, z) = UNITS.get(shape.asset), stretch_of(shape)
    pockets = pocketed(shape)
    if pockets is not None:
        return tuple(_stretched(one, x, y, z) for one in pockets.surfaces())
    if unit is not None:
        levels = tuple(_stretched(one, x, y, z) for one in _of_unit(unit))
        return (levels[-1], *levels[:-1])
    rooms = rooms_of(shape)
    if rooms:
        inside = Surface("inside", *rooms[0], walled=True)
        if upper is not None and not fits(upper.footprint, inside.outline):
            found = nested(shape, upper)
            inside = inside if found is None or (found.name == "rim" and shape.asset in RIMS) else found
        if shape.asset not in RIMS:
            return (inside,)
        return inside, _stretched(Surface("rim", RIMS[shape.asset], shape.height / z), x, y, z)
    if shape.asset in PLAIN or isinstance(shape.footprint, Polygon):
        return (Surface("top", shape.footprint, shape.height),)
    if shape.asset in TOPS:
        return (_stretched(Surface("top", TOPS[shape.asset], shape.height / z), x, y, z),)
    return (Surface("top", shape.footprint, shape.height),) if shape.asset in FLAT else ()


def sizes_of(shape: Shape, surface: Surface) -> dict[str, float]:
    """How large a surface is, in metres: `length` along the object's heading, `width` across it, and `depth`, the free
    height over it: up to the rim of a hollow thing or to the next board. Open above, it has no depth."""
    from scenegen.assets.rooms import rooms_of

    length, width = surface.outline.extent
    depth = surface.clear
    if not math.isfinite(depth) and surface.walled and rooms_of(shape):
        depth = shape.height - surface.height
    return {"length": length, "width": width, **({"depth": depth} if math.isfinite(depth) else {})}


def slabs_of(shape: Shape) -> tuple[Slab, ...]:
    """The pieces of open furniture; none of what is one prism, or hollow."""
    from scenegen.assets.rooms import stretch_of

    made, (x, y, z) = pocketed(shape) or UNITS.get(shape.asset), stretch_of(shape)
    if made is None:
        return ()
    return tuple(
        Slab((one.box[0] * x, one.box[1] * y, one.box[2] * x, one.box[3] * y), one.low * z, one.high * z)
        for one in made.slabs()
    )


def pocketed(shape: Shape) -> Cabinet | Drawer | Rack | None:
    """Furniture whose walled surfaces have nothing above them: all that stands there in full is clear of its pieces."""
    if isinstance(shape.footprint, Polygon):
        return None
    match shape.asset:
        case "cabinet":
            return Cabinet(shape.open) if shape.open else Cabinet()
        case "drawer":
            return Drawer()
        case "rack":
            return Rack()
        case _:
            return None


def _of_unit(unit: Unit) -> tuple[Surface, ...]:
    """The tops of its boards, the lid last."""
    x, y = unit.depth / 2.0, unit.width / 2.0
    inner = Slab((unit.back - x, unit.side - y, x, y - unit.side), 0.0, 0.0).footprint
    found = [
        Surface(f"shelf[{number}]", inner, low, high - unit.board - low, walled=True)
        for number, (low, high) in enumerate(zip(unit.levels, unit.levels[1:], strict=False), 1)
    ]
    return (*found, Surface("top", Box(unit.depth, unit.width), unit.levels[-1]))


def cells_of(shape: Shape) -> tuple[Box | Polygon, ...]:
    """What drawings from above show of furniture: the outlines of its surfaces; none of what is one prism or round."""
    made = surfaces_of(shape) if pocketed(shape) is not None or shape.asset == "bin" else ()
    seen = (one.outline for one in made if one.pull is None or one.pull.reach > 0.0)
    return tuple(outline for outline in seen if not isinstance(outline, Circle))


def rim_of(shape: Shape) -> float:
    """How high an object stands on pocketed furniture where it fits into no pocket: on the walls round them, metres."""
    made = pocketed(shape)
    from scenegen.assets.rooms import stretch_of

    return shape.height if made is None else made.rim * stretch_of(shape)[2]


def reach_of(outline: Footprint) -> float:
    """The distance from the origin of the frame to the farthest point, in metres."""
    match outline:
        case Circle(radius):
            return radius
        case Box(length, width):
            return math.hypot(length, width) / 2.0
        case _:
            return max(math.hypot(x, y) for x, y in outline.vertices)


@cache
def fits(upper: Footprint, outline: Footprint) -> bool:
    """Whether a footprint fits into an outline at one heading or another, its centre in the outline's middle."""
    x, y = _middle(outline)
    room = PRIMITIVES["room"].evaluate
    headings = (0.0, math.pi / 2.0, *(math.pi * turn / TURNS for turn in range(TURNS)))
    return any(room(MATH, upper, outline, x, y, theta, 0.0, 0.0, 0.0) >= 0.0 for theta in headings)


@cache
def narrowest(upper: Footprint, width: float) -> float | None:
    """The least that a footprint takes of x, of all headings at which it takes no more than `width` of y; None where
    it always takes more. Metres."""
    if isinstance(upper, Circle):
        return 2.0 * upper.radius if 2.0 * upper.radius <= width else None
    corners = upper.vertices if isinstance(upper, Polygon) else _corners(upper)
    found = []
    for turn in range(2 * TURNS):  # of a polygon, half a turn is enough as well
        cos, sin = math.cos(math.pi * turn / (2 * TURNS)), math.sin(math.pi * turn / (2 * TURNS))
        xs, ys = zip(*((cos * x - sin * y, sin * x + cos * y) for x, y in corners), strict=True)
        if max(ys) - min(ys) <= width:
            found.append(max(xs) - min(xs))
    return min(found, default=None)


def _corners(box: Box) -> tuple[tuple[float, float], ...]:
    x, y = box.length / 2.0, box.width / 2.0
    return (-x, -y), (x, -y), (x, y), (-x, y)


def _middle(outline: Footprint) -> tuple[float, float]:
    if not isinstance(outline, Polygon):
        return 0.0, 0.0
    x, y = zip(*outline.vertices, strict=True)
    return (min(x) + max(x)) / 2.0, (min(y) + max(y)) / 2.0


def _stretched(one: Surface, x: float, y: float, z: float) -> Surface:
    outline: Footprint
    match one.outline:
        case Circle(radius):
            outline = Circle(radius * min(x, y))
        case Box(length, width):
            outline = Box(length * x, width * y)
        case _:
            outline = Polygon(tuple((u * x, v * y) for u, v in one.outline.vertices))
    return replace(one, outline=outline, height=one.height * z, clear=one.clear * z)
