"""Functions of heights: z, height, top, what things stand on, and the clearance of bodies in space.

Supports are declared, so heights are constants; only footprints depend on the scene. Where a support is a choice,
`object book on any of [shelf[1], shelf[2], workspace]`, heights are numbers that its switch picks (`pick`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from math import prod
from typing import TYPE_CHECKING

from scenegen.errors import Span
from scenegen.errors.declarations import MAY_BE_MISSING, MEASURED_TOO_EARLY, TOO_MANY_CASES
from scenegen.errors.diagnostic import nearest
from scenegen.errors.language import (
    INDEX_OUT_OF_RANGE,
    NO_SUCH_PART,
    NOT_AN_ARRAY,
    SAME_ARGUMENT_TWICE,
    TOO_FEW_ELEMENTS,
)
from scenegen.geometry import Circle, Footprint
from scenegen.geometry.primitives import BARE, LENGTH
from scenegen.lang.check.values import (
    CORNERS,
    MEMBERS,
    SIDES,
    SIZES,
    AnyValue,
    Area,
    CallFrame,
    ChosenValue,
    ListValue,
    NumberValue,
    ObjectValue,
    Point,
    PointValue,
    RegionValue,
    SurfaceValue,
    Value,
    board_gap,
    key_of,
)
from scenegen.lang.spec import Support, SurfaceChoice, carriers_first, options_of
from scenegen.lang.syntax import ast
from scenegen.pose import FLAT, PLACE, X
from scenegen.things.furniture import SupportSurface
from scenegen.things.surfaces import fits, leeway, pocket_furniture, reach_of, sizes_of, slabs_of, surfaces_of

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering


# `base` and `load`: what an object was declared to stand on, and the centre of mass of it and all that it carries.
#
# Where a support is a choice, both are numbers that the switches pick.


def base(lowering: Lowering, which: int, origin: Span) -> Value:
    """What an object was declared to stand on: a surface, a region at a height, or on the table its own footprint."""

    def value(under: Support) -> Value:
        if under.carrier is not None:
            surface = SupportSurface(under.name.partition(".")[2], under.outline, under.height, walled=under.walled)
            return SurfaceValue(under.carrier, surface, origin=origin)
        if under.height:
            return RegionValue(under.name, lowering.areas[under.name], origin=origin)
        return ObjectValue(which, origin=origin)

    if which in lowering.choices:
        return ChosenValue(which, tuple(map(value, lowering.choices[which].options)), origin=origin)
    under = lowering.supports.get(which)
    return ObjectValue(which, origin=origin) if under is None else value(under)


def load(lowering: Lowering, which: int, value: Value) -> PointValue | None:
    """The centre of mass of an object and all that stands on it. None where choices allow too many cases."""
    above = _above(lowering, which)
    free: dict[int, list[int]] = {}  # for each choice: options on one carrier, or on none of these, are one case
    for one in sorted(above):
        if one in lowering.choices:
            first: dict[int | None, int] = {}
            free[one] = [
                first.setdefault(under.carrier if under.carrier in above else None, at)
                for at, under in enumerate(lowering.choices[one].options)
            ]
    found: list[int] = []
    for axis in PLACE:
        number = of_cases(lowering, free, lambda supports, axis=axis: _centre(lowering, which, supports, axis))  # type: ignore[misc]
        if number is None:
            return None
        found.append(number)
    return PointValue(*found, origin=value.origin)


def _above(lowering: Lowering, which: int) -> set[int]:
    """An object, and all that can come to stand on it."""
    above, larger = {which}, True
    while larger:
        more = {
            one
            for one in (*lowering.supports, *lowering.choices)
            if any(under.carrier in above for under in options_of(one, lowering.supports, lowering.choices))
        }
        larger = not more <= above
        above |= more
    return above


def _centre(lowering: Lowering, which: int, supports: Mapping[int, Support], axis: int) -> int:
    """A coordinate of the centre of mass of an object with all that stands on it, where every support is known."""
    from scenegen.things.bodies import mass_of

    builder, coerce = lowering.builder, lowering.coerce
    carried = [which]
    for one in carried:
        carried.extend(upper for upper, under in supports.items() if under.carrier == one)
    masses: Sequence[float] = [mass_of(lowering.shapes[one]) for one in carried]
    parts = [
        builder.apply("mul", (builder.const(mass / sum(masses)), coerce.coordinate(one, axis)))
        for one, mass in zip(carried, masses, strict=True)
    ]
    return parts[0] if len(parts) == 1 else builder.apply("sum", parts)


ROUNDING = 1e-9  # metres: heights are sums along a chain of supports


def height_function(lowering: Lowering, name: str, values: list[Value], node: ast.Call, frame: CallFrame) -> Value:
    """A call of one of HEIGHTS. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if any(isinstance(value, AnyValue) for value in values):
        return AnyValue(origin=origin)
    if lowering.heights is None:
        named = "name the surfaces: on any of [a, b]" if name == "surfaces" else None
        raise lowering.error(MEASURED_TOO_EARLY, node, frame, instead=named)
    value = values[0]
    if name in ("z", "height", "top"):
        return NumberValue(_height(lowering, name, value), LENGTH, origin=origin)
    if name == "apart":
        return NumberValue(_body_clearance(lowering, values, node, frame), LENGTH, origin=origin)
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
            return ListValue(tuple(one for one in items if one != value), origin=origin)
        rest = [one for one in range(len(lowering.heights)) if one != which]
        return ListValue(tuple(ObjectValue(one, origin=origin) for one in rest), origin=origin)
    if name == "base":
        return base(lowering, which, origin)
    found = load(lowering, which, value)
    if found is None:
        raise lowering.error(TOO_MANY_CASES, node, frame, limit=MOST_CASES)
    return found


def _bodies(lowering: Lowering, value: Value) -> Value:
    """A list of objects and, as boards, the regions at a height; where there are none, the very list."""
    items = lowering.coerce.items(value, "the argument of `bodies`")
    boards = [RegionValue(name, area, origin=value.origin) for name, area in boards_of(lowering).items()]
    key = ("bodies", key_of(value))
    if boards and key not in lowering.expansions:
        lowering.expansions[key] = (ListValue((*items, *boards), origin=value.origin), [value])
    return lowering.expansions[key][0] if boards else value


def boards_of(lowering: Lowering) -> dict[str, Area]:
    """The regions at a height."""
    return {name: area for name, area in lowering.areas.items() if area.z > 0.0}


def surface_values(
    lowering: Lowering, which: int, value: Value, upper: Value | None = None
) -> tuple[SurfaceValue, ...]:
    """The surfaces of an object; where walls slope, as deep as what stands on it fits."""
    shape = lowering.shapes[upper.index] if isinstance(upper, ObjectValue) else None
    found = surfaces_of(lowering.shapes[which], shape)
    return tuple(SurfaceValue(which, one, origin=value.origin) for one in found)


def _object(lowering: Lowering, value: Value, name: str) -> int:
    if isinstance(value, ObjectValue):
        return value.index
    raise lowering.coerce.wrong(value, "an object", f"the argument of `{name}`")


def _height(lowering: Lowering, name: str, value: Value) -> int:
    assert lowering.heights is not None
    builder = lowering.builder
    match value:
        case ChosenValue(chooser, options):
            return pick_number(lowering, lowering.choices[chooser], [_height(lowering, name, one) for one in options])
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


def _body_clearance(lowering: Lowering, values: list[Value], node: ast.Call, frame: CallFrame) -> int:
    """min over the upright pieces of both bodies of the larger of their clearances, in the plane and along z."""
    first, second = values
    if isinstance(first, RegionValue) and isinstance(second, RegionValue):
        return lowering.builder.const(board_gap(first.area, second.area))
    for body, board in ((first, second), (second, first)):
        if isinstance(board, RegionValue):
            return _from_board(lowering, _object(lowering, body, "apart"), board.area)
    one, other = _object(lowering, first, "apart"), _object(lowering, second, "apart")
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
    lowering: Lowering, pair: tuple[int, int], lows: tuple[float, float], supports: Mapping[int, Support]
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
    for one_shape, one_low, one_high in pieces_of(lowering, first, low):
        for other_shape, other_bottom, other_high in pieces_of(lowering, second, other_low):
            beside = builder.apply(
                "gap", (*pose_of(lowering, first), *pose_of(lowering, second)), (one_shape, other_shape)
            )
            above = builder.const(max(one_low - other_high, other_bottom - one_high))
            clearances.append(builder.apply("max", (beside, above, *inside)))
    return clearances[0] if len(clearances) == 1 else builder.apply("min", clearances)


def _clearance_of_columns(lowering: Lowering, first: int, second: int) -> int:
    """The clearance of two bodies without hollows, at heights of which some depend on a choice."""
    builder = lowering.builder
    base, other_base = level(lowering, first), level(lowering, second)

    def lift(number: int, by: float) -> int:
        return builder.apply("add", (number, builder.const(by)))

    clearances = []
    for one_shape, low, high in pieces_of(lowering, first, 0.0):
        for other_shape, other_low, other_high in pieces_of(lowering, second, 0.0):
            beside = builder.apply(
                "gap", (*pose_of(lowering, first), *pose_of(lowering, second)), (one_shape, other_shape)
            )
            over = builder.apply("sub", (lift(base, low), lift(other_base, other_high)))
            under = builder.apply("sub", (lift(other_base, other_low), lift(base, high)))
            clearances.append(builder.apply("max", (beside, over, under)))
    return clearances[0] if len(clearances) == 1 else builder.apply("min", clearances)


def _from_board(lowering: Lowering, which: int, area: Area) -> int:
    """The clearance of a body and the board of a region."""
    builder = lowering.builder
    place = (*map(builder.const, area.center), builder.const(0.0))
    base = level(lowering, which)
    clearances = []
    for shape, low, high in pieces_of(lowering, which, 0.0):
        beside = builder.apply("gap", (*pose_of(lowering, which), *place), (shape, area.footprint))
        bottom, top = (builder.apply("add", (base, builder.const(one))) for one in (low, high))
        over = builder.apply("sub", (bottom, builder.const(area.z)))
        under = builder.apply("sub", (builder.const(area.underside), top))
        clearances.append(builder.apply("max", (beside, over, under)))
    return clearances[0] if len(clearances) == 1 else builder.apply("min", clearances)


def pose_of(lowering: Lowering, which: int) -> tuple[int, ...]:
    return tuple(lowering.coerce.coordinate(which, axis) for axis in FLAT)


def _is_hollow(lowering: Lowering, which: int) -> bool:
    from scenegen.things.surfaces import rooms_of

    return bool(rooms_of(lowering.shapes[which])) or pocket_furniture(lowering.shapes[which]) is not None


def pieces_of(lowering: Lowering, which: int, low: float) -> list[tuple[Footprint, float, float]]:
    """The footprint of each upright piece of an object at a height, and where it begins and ends above the table."""
    shape = lowering.shapes[which]
    slabs = slabs_of(shape)
    if not slabs:
        return [(shape.footprint, low, low + shape.height)]
    return [(one.footprint, low + one.low, low + one.high) for one in slabs]


def _inside(lowering: Lowering, upper: int, lower: int, above: float, supports: Mapping[int, Support]) -> int | None:
    """How far one body is from the walls of a hollow one, where it begins above the floor of that; None elsewhere."""
    from scenegen.things.surfaces import rooms_of

    body, vessel = lowering.shapes[upper], lowering.shapes[lower]
    rooms = rooms_of(vessel)
    poses, footprint = (*pose_of(lowering, upper), *pose_of(lowering, lower)), lowering.coerce.covers(upper)
    under = supports.get(upper)
    if under is not None and under.carrier == lower and under.walled and (under.far or pocket_furniture(vessel)):
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


LIST_MEMBERS = ("first", "last", "count")
SURFACE_SIZES = ("length", "depth")  # of a surface, beside `width` and `height`, which regions have, too


def member(lowering: Lowering, base: Value, node: ast.Member, name: str, frame: CallFrame) -> Value:
    """`base.name`. Raises SpecError."""
    origin = lowering.origin(node, frame)
    match base:
        case AnyValue():
            return AnyValue(origin=origin)
        case RegionValue():
            return _of_region(lowering, base, node, name, frame)
        case ListValue(items) if name in LIST_MEMBERS:
            if name == "count":
                lowering.numbered = True
                return NumberValue(lowering.builder.const(float(len(items))), BARE, origin=origin)
            if not items:
                raise lowering.error(TOO_FEW_ELEMENTS, node.base, frame, needs=f"it has no `.{name}`")
            return items[0 if name == "first" else -1]
        case ListValue():
            raise lowering.error(NO_SUCH_PART, node, frame, what="a list", name=name, known=LIST_MEMBERS)
        case SurfaceValue(carrier, surface):
            sizes = sizes_of(lowering.shapes[carrier], surface)
            sizes |= {"height": sizes["depth"]} if "depth" in sizes else {}  # as the third of box(...)
            if name in sizes:
                return NumberValue(lowering.builder.const(sizes[name]), LENGTH, origin=origin)
            raise lowering.error(NO_SUCH_PART, node, frame, what="this surface", name=name, parts=tuple(sizes))
        case ObjectValue(index):
            written = lowering.builder.objects[index]
            if lowering.shapes:
                found = _surface(lowering, base, index, name, origin)
                if found is not None:
                    return found
            if lowering.scope.inferred:
                raise lowering.error(NO_SUCH_PART, node, frame, name=written, part=name, inferred=written)
            known = [one.surface.name for one in surface_values(lowering, index, base)] if lowering.shapes else []
            edge = name if name in SIDES[:4] else None
            facts = {"meant": nearest(name, {one.partition("[")[0] for one in known}), "surfaces": known}
            raise lowering.error(NO_SUCH_PART, node, frame, name=written, part=name, edge=edge, **facts)
        case _:
            raise lowering.error(NO_SUCH_PART, node, frame, what=base.kind, name=name)


def _surface(lowering: Lowering, base: ObjectValue, index: int, name: str, origin: Span) -> Value | None:
    """The surface of that name of an object, or the list of those that are numbered; None where it has none."""
    named = [one for one in surface_values(lowering, index, base) if one.surface.name.partition("[")[0] == name]
    if len(named) == 1 and named[0].surface.name == name:
        return named[0].with_origin(origin)
    return ListValue(tuple(named), origin=origin) if named else None


def _of_region(lowering: Lowering, region: RegionValue, node: ast.Member, name: str, frame: CallFrame) -> Value:
    area, origin = region.area, lowering.origin(node, frame)

    def point(place: Point) -> PointValue:
        return PointValue(*map(lowering.builder.const, place), origin=origin)

    if name in SIDES:
        return point(area.side(name))
    if name in SIZES:
        left, bottom, right, top = area.box
        size = right - left if name == "width" else top - bottom
        return NumberValue(lowering.builder.const(size), LENGTH, origin=origin)
    if name == "corners" and area.corners:
        return ListValue(tuple(map(point, area.corners)), origin=origin)
    if name in CORNERS and area.kind in ("rect", "workspace"):
        return point(area.corner(name))
    if name in MEMBERS:
        kind = "circle" if area.kind == "circle" else "polygon"
        parts = (*SIDES, *SIZES)
        raise lowering.error(NO_SUCH_PART, node, frame, what=f"a {kind}", name=name, parts=parts, region=region.name)
    raise lowering.error(NO_SUCH_PART, node, frame, what=f"`{region.name}`", name=name, known=MEMBERS)


def index(lowering: Lowering, base: Value, place: NumberValue, node: ast.Index, frame: CallFrame) -> Value:
    """`base[place]`, counted from 1. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if isinstance(base, AnyValue):
        return AnyValue(origin=origin)
    if isinstance(base, ObjectValue):
        name = lowering.builder.objects[base.index]
        raise lowering.error(NOT_AN_ARRAY, node, frame, name=name)
    items = lowering.coerce.items(base, "what `[` counts in")
    which = lowering.count(place, node.index, frame, "an index")
    drawn = lowering.scope.counts.get(node.base.id) if isinstance(node.base, ast.Name) else None
    if drawn is not None and drawn.least < which <= drawn.most:
        facts = {"name": drawn.name, "index": which, "least": drawn.least, "most": drawn.most}
        raise lowering.error(MAY_BE_MISSING, node, frame, **facts)
    if not 1 <= which <= len(items):
        raise lowering.error(
            INDEX_OUT_OF_RANGE, node.index, frame, index=which, count=len(items), last=len(items) or None
        )
    return items[which - 1]


MOST_CASES = 512  # combinations of choices that are distinguished for one pair of objects


def pick_number(lowering: Lowering, choice: SurfaceChoice, numbers: Sequence[int]) -> int:
    """The number among some that the switch of a choice picks."""
    builder = lowering.builder
    switch = builder.coord(choice.switch, X)
    found = numbers[-1]
    for number, end in zip(reversed(numbers[:-1]), reversed(choice.ends[:-1]), strict=True):
        if number != found:
            found = builder.apply("pick", (switch, builder.const(end), number, found))
    return found


def of_options(lowering: Lowering, value: ChosenValue, number: Callable[[Value], NumberValue]) -> NumberValue:
    """A number of what a choice picks: `number` gives it for each of the options."""
    made = [number(one) for one in value.options]
    choice = lowering.choices[value.chooser]
    return NumberValue(pick_number(lowering, choice, [one.node for one in made]), made[0].unit, origin=made[0].origin)


def level(lowering: Lowering, which: int) -> int:
    """How high an object's lowest point is above the table: a number of the core."""
    builder, heights = lowering.builder, lowering.heights
    assert heights is not None

    def options(one: int) -> Sequence[Support]:
        return () if heights[one] is not None else options_of(one, lowering.supports, lowering.choices)

    made: dict[int, int] = {}
    for one in carriers_first([which], options):
        known = heights[one]
        if known is not None:
            made[one] = builder.const(known)
            continue
        numbers = []
        for under in options(one):
            rise = builder.const(under.height)
            numbers.append(rise if under.carrier is None else builder.apply("add", (made[under.carrier], rise)))
        made[one] = pick_number(lowering, lowering.choices[one], numbers) if one in lowering.choices else numbers[0]
    return made[which]


def choosers(lowering: Lowering, things: Sequence[int]) -> list[int]:
    """The objects whose choices decide how high some objects stand."""
    found, stack, seen = list[int](), list(things), set[int]()
    while stack:
        one = stack.pop()
        if one in seen:
            continue
        seen.add(one)
        if one in lowering.choices:
            found.append(one)
        options = options_of(one, lowering.supports, lowering.choices)
        stack.extend(under.carrier for under in options if under.carrier is not None)
    return sorted(found)


def by_cases(lowering: Lowering, things: Sequence[int], number: Callable[[Mapping[int, Support]], int]) -> int | None:
    """A number of the core that depends on what some objects stand on: `number` gives it for the supports of each case.
    None where there are too many cases."""
    free = choosers(lowering, things)
    return of_cases(lowering, {one: range(len(lowering.choices[one].options)) for one in free}, number)


def of_cases(
    lowering: Lowering, free: Mapping[int, Sequence[int]], number: Callable[[Mapping[int, Support]], int]
) -> int | None:
    """A number that depends on the choices of some objects: `free` says for each of a chooser's options which option
    stands for it, one with the same number. `number` gives it for the supports of each case. None where there are too
    many cases."""
    apart = {one: sorted(set(classes)) for one, classes in free.items()}
    if prod(map(len, apart.values())) > MOST_CASES:
        return None
    fixed = dict(lowering.supports)
    values = [
        number({**fixed, **{one: lowering.choices[one].options[at] for one, at in zip(apart, case, strict=True)}})
        for case in product(*apart.values())
    ]
    for one in reversed(apart):  # the last object's options lie side by side
        size = len(apart[one])
        chunks = [
            dict(zip(apart[one], values[start : start + size], strict=True)) for start in range(0, len(values), size)
        ]
        values = [pick_number(lowering, lowering.choices[one], [chunk[at] for at in free[one]]) for chunk in chunks]
    return values[0]


def height_in(which: int, supports: Mapping[int, Support]) -> float:
    """How high an object stands where every support is known."""
    total: list[float] = []
    while which in supports:
        under = supports[which]
        total.append(under.height)
        if under.carrier is None:
            break
        which = under.carrier
    height = 0.0
    for rise in reversed(total):  # added up as `heights` does, from the table
        height += rise
    return height
