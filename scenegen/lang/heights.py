"""Functions of heights: z, height, top, what things stand on, and the clearance of bodies in space.

Supports are declared, so heights are constants; only footprints depend on the scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from scenegen.assets.nesting import leeway
from scenegen.assets.surfaces import fits, pocketed, reach_of, slabs_of, surfaces_of
from scenegen.errors.declarations import MEASURED_TOO_EARLY, TOO_MANY_CASES
from scenegen.errors.language import SAME_ARGUMENT_TWICE
from scenegen.lang import ast
from scenegen.lang.choices import MOST_CASES, by_cases, height_in, level, picked
from scenegen.lang.functions import key_of
from scenegen.lang.places import Area, board_gap
from scenegen.lang.provenance import Frame
from scenegen.lang.spec import Support
from scenegen.lang.standing import base, load
from scenegen.lang.template import FIRST, Depends
from scenegen.lang.values import (
    AnyValue,
    ChosenValue,
    ListValue,
    NumberValue,
    ObjectValue,
    RegionValue,
    SurfaceValue,
    Value,
)
from scenegen.pose import FLAT
from scenegen.primitives import Circle, Footprint
from scenegen.primitives.units import LENGTH
from scenegen.scene.limits import BOARD

if TYPE_CHECKING:
    from scenegen.lang.context import Context

ROUNDING = 1e-9  # metres: heights are sums along a chain of supports


def height_function(lowering: Context, name: str, values: list[Value], node: ast.Call, frame: Frame) -> Value:
    """A call of one of HEIGHTS. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if any(isinstance(value, AnyValue) for value in values):
        return AnyValue(origin=origin)
    if lowering.heights is None:
        named = "name the surfaces: on any of [a, b]" if name == "surfaces" else None
        raise lowering.error(MEASURED_TOO_EARLY, node, frame, instead=named)
    value = values[0]
    if isinstance(value, ObjectValue) and value.index >= FIRST:
        raise Depends
    if name in ("z", "height", "top"):
        return NumberValue(_height(lowering, name, value), LENGTH, origin=origin)
    if name == "apart":
        return NumberValue(_apart(lowering, values, node, frame), LENGTH, origin=origin)
    if name == "bodies":
        return _bodies(lowering, value)
    if name == "surfaces":
        if isinstance(value, RegionValue | SurfaceValue | ChosenValue):
            return ListValue((value,), origin=origin)
        which = _object(lowering, value, name)
        upper = values[1] if len(values) > 1 else None
        return ListValue(surface_values(lowering, which, value, upper), origin=origin)
    which = _object(lowering, value, name)
    if name == "others":
        if len(values) > 1:
            items = lowering.coerce.items(values[1], "the argument `items` of `others`")
            if any(isinstance(one, ObjectValue) and one.index >= FIRST for one in items):
                raise Depends
            return ListValue(tuple(one for one in items if one != value), origin=origin)
        rest = [one for one in range(len(lowering.heights)) if one != which]
        return ListValue(tuple(ObjectValue(one, origin=origin) for one in rest), origin=origin)
    if name == "base":
        return base(lowering, which, origin)
    found = load(lowering, which, value)
    if found is None:
        raise lowering.error(TOO_MANY_CASES, node, frame, limit=MOST_CASES)
    return found


def _bodies(lowering: Context, value: Value) -> Value:
    """A list of objects and, as boards, the regions at a height; where there are none, the very list."""
    items = lowering.coerce.items(value, "the argument of `bodies`")
    boards = [RegionValue(name, area, origin=value.origin) for name, area in lowering.areas.items() if area.z > 0.0]
    key = ("bodies", key_of(value))
    if boards and key not in lowering.expansions:
        lowering.expansions[key] = (ListValue((*items, *boards), origin=value.origin), [value])
    return lowering.expansions[key][0] if boards else value


def surface_values(lowering: Context, which: int, value: Value, upper: Value | None = None) -> tuple[SurfaceValue, ...]:
    """The surfaces of an object; where walls slope, as deep as what stands on it fits."""
    shape = lowering.shapes[upper.index] if isinstance(upper, ObjectValue) else None
    found = surfaces_of(lowering.shapes[which], shape)
    return tuple(SurfaceValue(which, one, origin=value.origin) for one in found)


def _object(lowering: Context, value: Value, name: str) -> int:
    if isinstance(value, ObjectValue):
        return value.index
    raise lowering.coerce.wrong(value, "an object", f"the argument of `{name}`")


def _height(lowering: Context, name: str, value: Value) -> int:
    assert lowering.heights is not None
    builder = lowering.builder
    match value:
        case ChosenValue(chooser, options):
            return picked(lowering, lowering.choices[chooser], [_height(lowering, name, one) for one in options])
        case ObjectValue(which):
            own = lowering.shapes[which].height
            if name == "height":
                return builder.const(own)
            low = lowering.heights[which]
            if low is not None:
                return builder.const(low if name == "z" else low + own)
            number = level(lowering, which)
            return number if name == "z" else builder.apply("add", (number, builder.const(own)))
        case SurfaceValue(which, surface) if name != "height":
            low = lowering.heights[which]
            if low is not None:
                return builder.const(low + surface.height)
            return builder.apply("add", (level(lowering, which), builder.const(surface.height)))
        case RegionValue(_, area) if name != "height":
            return builder.const(area.z)
        case _:
            raise lowering.coerce.wrong(value, "an object", f"the argument of `{name}`")


def _apart(lowering: Context, values: list[Value], node: ast.Call, frame: Frame) -> int:
    """min over the upright pieces of both bodies of the larger of their clearances, in the plane and along z."""
    first, second = values
    if isinstance(first, RegionValue) and isinstance(second, RegionValue):
        return lowering.builder.const(board_gap(first.area, second.area))
    for body, board in ((first, second), (second, first)):
        if isinstance(board, RegionValue):
            return _from_board(lowering, _object(lowering, body, "apart"), board.area)
    one, other = _object(lowering, first, "apart"), _object(lowering, second, "apart")
    if max(one, other) >= FIRST:
        raise Depends
    if one == other:
        raise lowering.error(SAME_ARGUMENT_TWICE, node, frame, name="apart")
    assert lowering.heights is not None
    known = lowering.heights[one], lowering.heights[other]
    if known[0] is not None and known[1] is not None:
        return _clearance(lowering, (one, other), (known[0], known[1]), lowering.supports)
    if not any(_is_hollow(lowering, which) for which in (one, other)):
        return _clearance_of_columns(lowering, one, other)

    def in_case(supports: Mapping[int, Support]) -> int:
        lows = height_in(one, supports), height_in(other, supports)
        return _clearance(lowering, (one, other), lows, supports)

    found = by_cases(lowering, (one, other), in_case)
    if found is None:
        raise lowering.error(TOO_MANY_CASES, node, frame, limit=MOST_CASES)
    return found


def _clearance(
    lowering: Context, pair: tuple[int, int], lows: tuple[float, float], supports: Mapping[int, Support]
) -> int:
    """The clearance of two bodies that stand at known heights, on known supports."""
    builder = lowering.builder
    (first, second), (low, other_low) = pair, lows
    inside = [
        room
        for upper, lower, above in ((first, second, low - other_low), (second, first, other_low - low))
        if (room := _inside(lowering, upper, lower, above, supports)) is not None
    ]
    clearances = []
    for one_shape, one_low, one_high in _pieces(lowering, first, low):
        for other_shape, other_bottom, other_high in _pieces(lowering, second, other_low):
            beside = builder.apply("gap", (*_pose(lowering, first), *_pose(lowering, second)), (one_shape, other_shape))
            above = builder.const(max(one_low - other_high, other_bottom - one_high))
            clearances.append(builder.apply("max", (beside, above, *inside)))
    return clearances[0] if len(clearances) == 1 else builder.apply("min", clearances)


def _clearance_of_columns(lowering: Context, first: int, second: int) -> int:
    """The clearance of two bodies without hollows, at heights of which some depend on a choice."""
    builder = lowering.builder
    base, other_base = level(lowering, first), level(lowering, second)

    def raised(number: int, by: float) -> int:
        return builder.apply("add", (number, builder.const(by)))

    clearances = []
    for one_shape, low, high in _pieces(lowering, first, 0.0):
        for other_shape, other_low, other_high in _pieces(lowering, second, 0.0):
            beside = builder.apply("gap", (*_pose(lowering, first), *_pose(lowering, second)), (one_shape, other_shape))
            over = builder.apply("sub", (raised(base, low), raised(other_base, other_high)))
            under = builder.apply("sub", (raised(other_base, other_low), raised(base, high)))
            clearances.append(builder.apply("max", (beside, over, under)))
    return clearances[0] if len(clearances) == 1 else builder.apply("min", clearances)


def _from_board(lowering: Context, which: int, area: Area) -> int:
    """The clearance of a body and the board of a region."""
    builder = lowering.builder
    place = (*map(builder.const, area.center), builder.const(0.0))
    base = level(lowering, which)
    clearances = []
    for shape, low, high in _pieces(lowering, which, 0.0):
        beside = builder.apply("gap", (*_pose(lowering, which), *place), (shape, area.footprint))
        bottom, top = (builder.apply("add", (base, builder.const(one))) for one in (low, high))
        over = builder.apply("sub", (bottom, builder.const(area.z)))
        under = builder.apply("sub", (builder.const(area.z - min(BOARD, area.z)), top))
        clearances.append(builder.apply("max", (beside, over, under)))
    return clearances[0] if len(clearances) == 1 else builder.apply("min", clearances)


def _pose(lowering: Context, which: int) -> tuple[int, ...]:
    return tuple(lowering.coerce.coordinate(which, axis) for axis in FLAT)


def _is_hollow(lowering: Context, which: int) -> bool:
    from scenegen.assets.rooms import rooms_of

    return bool(rooms_of(lowering.shapes[which])) or pocketed(lowering.shapes[which]) is not None


def _pieces(lowering: Context, which: int, low: float) -> list[tuple[Footprint, float, float]]:
    """The footprint of each upright piece of an object at a height, and where it begins and ends above the table."""
    shape = lowering.shapes[which]
    slabs = slabs_of(shape)
    if not slabs:
        return [(shape.footprint, low, low + shape.height)]
    return [(one.footprint, low + one.low, low + one.high) for one in slabs]


def _inside(lowering: Context, upper: int, lower: int, above: float, supports: Mapping[int, Support]) -> int | None:
    """How far one body is from the walls of a hollow one, where it begins above the floor of that; None elsewhere."""
    from scenegen.assets.rooms import rooms_of

    body, vessel = lowering.shapes[upper], lowering.shapes[lower]
    rooms = rooms_of(vessel)
    poses, footprint = (*_pose(lowering, upper), *_pose(lowering, lower)), lowering.coerce.covers(upper)
    under = supports.get(upper)
    if under is not None and under.carrier == lower and under.walled and (under.far or pocketed(vessel)):
        return lowering.builder.apply("room", poses, (footprint, under.outline))
    open_at = [outline for outline, floor in rooms if floor <= above + ROUNDING]
    if not open_at:
        return None
    widest: Footprint = open_at[-1]  # walls lean outwards
    if above < vessel.height - ROUNDING and not fits(footprint, rooms[0][0]):
        free = leeway(vessel, body, max(above, rooms[0][1]))
        if free is not None and free > 0.0:
            widest = Circle(free + reach_of(footprint))
    return lowering.builder.apply("room", poses, (footprint, widest))
