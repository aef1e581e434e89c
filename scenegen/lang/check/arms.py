"""Functions of robot arms: how far inside of an arm's reach something is, and how much room its hand has around it.

All become numbers of the core. What an arm can do depends on heights, which are constants, or numbers that switches
pick; sizes of the hand are constants, so at each yaw its fingers and palm are polygons in the frame of what they grasp.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.errors.declarations import (
    MEASURED_TOO_EARLY,
    SIZE_OUT_OF_RANGE,
    TOO_MANY_CASES,
    UNKNOWN_ARM,
    UNUSABLE_ARM,
)
from scenegen.errors.language import SAME_ARGUMENT_TWICE
from scenegen.geometry import MATH, Footprint
from scenegen.geometry.clearance import reach
from scenegen.geometry.footprint import Box, PlacedBox, place_box
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH
from scenegen.lang.check.heights import MOST_CASES, ROUNDING, boards_of, by_cases, height_in, level, pieces_of, pose_of
from scenegen.lang.check.names import bind
from scenegen.lang.check.regions import SIGNATURES
from scenegen.lang.check.values import (
    AnyValue,
    CallFrame,
    ListValue,
    NumberValue,
    ObjectValue,
    RegionValue,
    SurfaceValue,
    Value,
)
from scenegen.lang.spec import Support
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr
from scenegen.pose import PLACE, THETA, TWO_PI
from scenegen.things import Shape
from scenegen.things.arms import (
    ALL_ROUND,
    LARGEST_ARM,
    Arm,
    ArmError,
    ReachRing,
    make_arm,
    read_arm,
    shipped_arm,
    shipped_arms,
)

if TYPE_CHECKING:
    from scenegen.lang.check.imports import Project
    from scenegen.lang.check.lowering import Lowering

BEHIND_PREFIX = "behind_"  # before the names of what the ring behind the base has, in canonical text
QUARTERS = 0.0, math.pi, math.pi / 2.0, -math.pi / 2.0  # directions from that away from the base
HeightCases = Callable[[Callable[[float], float]], int]
"""A function of the height above the base at which the fingers close -> a number of the core."""
GRASPED = "an object that a hand can grasp"
YAWS = 12  # at which a hand is tried, evenly over half a turn: turned by half a turn it is the same


def arm_shape(lowering: Lowering, expr: ast.Expr, source: Source, project: Project) -> Shape:
    """What `robot NAME = ...` names: the base of an arm, with the arm. Raises SpecError."""
    here = expr.span(source)
    if not isinstance(expr, ast.Call) or expr.function.id != "arm":
        name = expr.id if isinstance(expr, ast.Name) else print_expr(expr)
        if name not in shipped_arms():
            raise SpecError(UNKNOWN_ARM(here, name=name, known=shipped_arms()))
        return _base_of(shipped_arm(name), "")
    given = bind(expr, SIGNATURES["arm"], source)
    if isinstance(given, Diagnostic):
        raise SpecError(given)
    path = given.pop("path")
    if not isinstance(path, ast.Text):
        raise SpecError(UNKNOWN_ARM(path.span(source), name=print_expr(path), known=shipped_arms()))
    try:
        if given:
            return _base_of(_inline_arm(lowering, path.value, given, source), path.value)
        return _base_of(read_arm(project.read(path.value.replace("\\", "/"), path.span(source), "an arm")), path.value)
    except ArmError as error:
        reason = "; ".join(error.reasons)
        raise SpecError(UNUSABLE_ARM(path.span(source), path=path.value, reason=reason)) from None


def _base_of(arm: Arm, path: str) -> Shape:
    return Shape("box", arm.base.footprint, arm.base.height, path=path, arm=arm)


def _inline_arm(lowering: Lowering, name: str, given: Mapping[str, ast.Expr], source: Source) -> Arm:
    """The arm whose numbers stand beside the name of its file, as in canonical text."""
    lists: dict[str, list[float]] = {}
    behind: dict[str, list[float]] = {}
    for field, expr in given.items():
        frame = CallFrame(source)
        items = lowering.coerce.items(lowering.evaluate(expr, frame), f"the argument `{field}` of `arm`")
        what = f"a number of `{field}`"
        found = [lowering.constant(item, expr, frame, what, BARE, LENGTH, ANGLE) for item in items]
        (behind if field.startswith(BEHIND_PREFIX) else lists)[field.removeprefix(BEHIND_PREFIX)] = found
    base, hand = (lists.pop(table, []) for table in ("base", "hand"))
    if len(hand) == 7:
        sizes = {"opening": hand[0], "finger": hand[1:3], "finger_length": hand[3], "palm": hand[4:]}
    else:
        raise ArmError("`hand` must be a list of 7 numbers")
    named = dict(zip(("width", "depth", "height"), base, strict=False))
    tables = {"base": named, "hand": sizes, **({"behind": behind} if behind else {})}
    return make_arm({"name": name, **lists, **tables})


def arm_call(shape: Shape) -> ast.Call:
    """`arm("FILE", ...)` with all that the file says, for canonical text."""
    arm = shape.arm
    assert arm is not None
    base, hand = arm.base, arm.hand
    lists: dict[str, tuple[float, ...]] = {}
    for prefix, ring in (("", arm.ring), (BEHIND_PREFIX, arm.behind)):
        if ring is not None:
            named = {one.name: getattr(ring, one.name) for one in fields(ring)}
            lists |= {f"{prefix}{name}": each for name, each in named.items() if name != "turn" or each != ALL_ROUND}
    lists |= {"offset": arm.offset} if any(arm.offset) else {}
    lists |= {
        "base": (base.width, base.depth, base.height),
        "hand": (hand.opening, *hand.finger, hand.finger_length, *hand.palm),
    }
    path = ast.Argument(None, ast.Text(shape.path))
    rest = (ast.Argument(ast.Name(name), ast.List(tuple(map(_number, each)))) for name, each in lists.items())
    return ast.Call(ast.Name("arm"), (path, *rest))


def _number(value: float) -> ast.Expr:
    number = ast.Quantity(repr(abs(value)), "")
    return ast.Negative(number) if value < 0.0 else number


def arm_function(lowering: Lowering, name: str, values: Mapping[str, Value], node: ast.Call, frame: CallFrame) -> Value:
    """A call of one of ARMS. Raises SpecError."""
    origin = lowering.origin(node, frame)
    thing, robot = values["a"], values["arm"]
    if any(isinstance(value, AnyValue) for value in values.values()):
        return AnyValue(origin=origin)
    if lowering.heights is None:
        raise lowering.error(MEASURED_TOO_EARLY, node, frame)
    base = robot.index if isinstance(robot, ObjectValue) else -1
    arm = lowering.shapes[base].arm if base >= 0 else None
    if arm is None:
        raise lowering.coerce.wrong(robot, "a robot", f"the argument `arm` of `{name}`")
    if thing == robot:
        called = frame.text.partition("(")[0] or name
        raise lowering.error(SAME_ARGUMENT_TWICE, node, frame, name=called)
    grasped = name != "armReach" or thing.role.endswith("`graspable`")  # which asks for its reach first
    if grasped and not isinstance(thing, ObjectValue):
        raise lowering.coerce.wrong(thing, GRASPED, f"the argument `a` of `{name}`")
    if grasped and isinstance(thing, ObjectValue) and lowering.shapes[thing.index].arm is not None:
        (problem,) = lowering.coerce.wrong(thing, GRASPED, f"the argument `a` of `{name}`").diagnostics
        raise SpecError(problem.but(found="a robot"))
    if name == "armReach":
        depth = _depth(lowering, values["depth"], node, frame)
        return NumberValue(_room_to_reach(lowering, thing, base, arm, depth, node, frame), LENGTH, origin=origin)
    assert isinstance(thing, ObjectValue)
    if name == "yaws":
        numbers = (lowering.builder.const(yaw) for yaw in _fitting_yaws(lowering.coerce.covers(thing.index), arm))
        return ListValue(tuple(NumberValue(one, ANGLE, origin=origin) for one in numbers), origin=origin)
    depth = _depth(lowering, values["depth"], node, frame)
    if name == "armRoom":
        return NumberValue(_room_for_arm(lowering, thing.index, base, arm, depth), LENGTH, origin=origin)
    given = lowering.coerce.number(values["yaw"], "a yaw")
    yaw = lowering.constant(given, node, frame, "a yaw", BARE, ANGLE)
    lowering.refuse_degrees([given, NumberValue(given.node, ANGLE, origin=given.origin)])
    number = _room_for_hand(lowering, thing.index, base, arm, yaw, depth)
    if any(arm.offset):
        at = _height_cases(lowering, thing, base, depth, node, frame)
        reach_there = _room_at_yaw(lowering, thing.index, base, arm, yaw, at)
        number = lowering.builder.apply("min", (number, reach_there))
    lowering.hands[thing.index, base, yaw, depth] = number
    shown = f"handRoom({lowering.text(thing)}, {lowering.text(robot)}, {math.degrees(yaw):.4g} deg)"
    if lowering.builder.value(number) is None:
        lowering.builder.called.setdefault(number, shown)
    return NumberValue(number, LENGTH, origin=origin)


def _depth(lowering: Lowering, value: Value, node: ast.Call, frame: CallFrame) -> float:
    """How far below the top of a thing the fingers close, in metres."""
    what = "how deep the fingers close"
    depth = lowering.constant(value, node, frame, what, BARE, LENGTH)
    if depth < 0.0:
        raise lowering.error(SIZE_OUT_OF_RANGE, node, frame, what=what, size=depth, least=0.0, most=LARGEST_ARM)
    return depth


def _grip(lowering: Lowering, thing: Value, depth: float, supports: Mapping[int, Support]) -> float:
    """How high above the table the fingers close, where all supports are known: so far below the top, but not below the
    thing itself."""
    match thing:
        case ObjectValue(which):
            return height_in(which, supports) + max(0.0, lowering.shapes[which].height - depth)
        case SurfaceValue(which, surface):
            return height_in(which, supports) + surface.height
        case RegionValue(_, area):
            return area.z
        case _:
            return 0.0


def _room_to_reach(
    lowering: Lowering, thing: Value, base: int, arm: Arm, depth: float, node: ast.Call, frame: CallFrame
) -> int:
    """How far inside of what the fingertips reach a thing is, the hand turned as is best for that."""
    at = _height_cases(lowering, thing, base, depth, node, frame)
    place = lowering.coerce.place(thing, "the argument `a` of `armReach`")
    rooms = []
    for ring in arm.rings:
        ahead, back, left, right = (ring.tip_distance(arm.offset, away) for away in QUARTERS)
        rooms.append(_room_in_ring(lowering, ring, place, base, at, slack=(back, ahead, min(left, right))))
    return _most(lowering, rooms)


def _height_cases(
    lowering: Lowering, thing: Value, base: int, depth: float, node: ast.Call, frame: CallFrame
) -> HeightCases:
    """What makes a number of how high above the base the fingers close on a thing, whatever stands where."""
    moving = [base, *([thing.index] if isinstance(thing, ObjectValue) else [])]
    moving += [thing.carrier] if isinstance(thing, SurfaceValue) else []

    def case_number(of_height: Callable[[float], float]) -> int:
        def number(supports: Mapping[int, Support]) -> int:
            height = _grip(lowering, thing, depth, supports) - height_in(base, supports)
            return lowering.builder.const(of_height(height))

        found = by_cases(lowering, moving, number)
        if found is None:
            raise lowering.error(TOO_MANY_CASES, node, frame, limit=MOST_CASES)
        return found

    return case_number


def _room_in_ring(
    lowering: Lowering,
    ring: ReachRing,
    place: Sequence[int],
    base: int,
    at: HeightCases,
    *,
    slack: tuple[float, float, float] = (0.0, 0.0, 0.0),
    heading: int | None = None,
) -> int:
    """The least of: how far a place is from the nearest and from the farthest that a ring has at this height, and from
    the limits of its bearing, along the circle around the base, each `slack` metres beyond it; and, of a hand that
    closes along a `heading`, how far along that circle from where it turns so far."""
    builder = lowering.builder
    centre = tuple(lowering.coerce.coordinate(base, axis) for axis in PLACE)

    def overrun(height: float) -> float:
        """How far a height is beyond those that the hand reaches, negative; elsewhere what decides nothing."""
        left = min(height - ring.heights[0], ring.heights[-1] - height)
        return left if left < 0.0 else LARGEST_ARM

    radius = builder.apply("dist", (*place, *centre))
    parts = [
        builder.apply("sub", (radius, at(lambda height: ring.reach_at(height)[0] - slack[0]))),
        builder.apply("sub", (at(lambda height: ring.reach_at(height)[1] + slack[1]), radius)),
    ]
    over = at(overrun)
    if builder.value(over) != LARGEST_ARM:
        parts.append(over)

    def bearing() -> int:
        return builder.apply("bearing", (*centre, *place))

    def add_limits(limits: tuple[float, float], turned: int, zero: int, slack: float) -> None:
        middle, half = (limits[0] + limits[1]) / 2.0, (limits[1] - limits[0]) / 2.0
        ahead = builder.apply("add", (zero, builder.const(middle)))
        aside = builder.apply("abs", (builder.apply("wrap", (builder.apply("sub", (turned, ahead)),)),))
        left = builder.apply("mul", (radius, builder.apply("sub", (builder.const(half), aside))))
        parts.append(builder.apply("add", (left, builder.const(slack))) if slack else left)

    if not ring.turns_freely:
        add_limits(ring.bearing, bearing(), lowering.coerce.coordinate(base, THETA), slack[2])
    if heading is not None and ring.turn[1] - ring.turn[0] < TWO_PI:
        add_limits(ring.turn, heading, bearing(), 0.0)
    return builder.apply("min", parts)


def _room_at_yaw(lowering: Lowering, which: int, base: int, arm: Arm, yaw: float, at: HeightCases) -> int:
    """How far inside of what it reaches the last axis is where the hand holds a thing at this yaw, either way round."""
    builder, rooms = lowering.builder, []
    x, y, theta = pose_of(lowering, which)
    heading = builder.apply("add", (theta, builder.const(yaw)))
    toward = builder.apply("add", (heading, builder.const(math.atan2(arm.offset[1], arm.offset[0]))))
    length = builder.const(math.hypot(*arm.offset))
    dx, dy = (builder.apply("mul", (length, builder.apply(name, (toward,)))) for name in ("cos", "sin"))
    for way, turned in (("sub", 0.0), ("add", math.pi)):
        place = builder.apply(way, (x, dx)), builder.apply(way, (y, dy))
        along = builder.apply("add", (heading, builder.const(turned))) if turned else heading
        rooms += [_room_in_ring(lowering, ring, place, base, at, heading=along) for ring in arm.rings]
    return _most(lowering, rooms)


def _most(lowering: Lowering, rooms: Sequence[int]) -> int:
    return rooms[0] if len(rooms) == 1 else lowering.builder.apply("max", rooms)


def _fitting_yaws(footprint: Footprint, arm: Arm) -> list[float]:
    """Those of YAWS at which a thing is no wider than the hand opens; if there is none, the one at which it is
    narrowest."""
    yaws = [step * math.pi / YAWS for step in range(YAWS)]
    width = {yaw: _extent(footprint, yaw)[1] - _extent(footprint, yaw)[0] for yaw in yaws}
    return [yaw for yaw in yaws if width[yaw] <= arm.hand.opening] or [min(yaws, key=width.__getitem__)]


def _extent(footprint: Footprint, heading: float) -> tuple[float, float]:
    """From where to where a footprint reaches along a heading of its own frame."""
    return -reach(MATH, footprint, 0.0, 0.0, 0.0, heading + math.pi), reach(MATH, footprint, 0.0, 0.0, 0.0, heading)


def hand_boxes(footprint: Footprint, arm: Arm, yaw: float) -> tuple[PlacedBox, PlacedBox, PlacedBox]:
    """Both open fingers and the palm in the frame of a thing. At this yaw, the direction in which the fingers close,
    the hand stands over the middle of the thing."""
    hand, cos, sin = arm.hand, math.cos(yaw), math.sin(yaw)
    along, across = (sum(_extent(footprint, heading)) / 2.0 for heading in (yaw, yaw + math.pi / 2.0))

    def box(middle: float, length: float, width: float) -> PlacedBox:
        u, v = along + middle, across
        return place_box(Box(length, width), (cos * u - sin * v, sin * u + cos * v), yaw)

    aside = (hand.opening + hand.finger[0]) / 2.0
    return box(-aside, *hand.finger), box(aside, *hand.finger), box(0.0, *hand.palm[:2])


def _room_for_hand(lowering: Lowering, which: int, base: int, arm: Arm, yaw: float, depth: float) -> int:
    """The least of: the room between each open finger and the thing, and how far fingers and palm are from everything
    else, beside it or above it."""
    builder = lowering.builder
    footprint = lowering.coerce.covers(which)
    left, right, palm = hand_boxes(footprint, arm, yaw)
    low, high = _extent(footprint, yaw)
    spare = (arm.hand.opening - (high - low)) / 2.0
    foot = level(lowering, which)
    grip = _sum(lowering, foot, max(0.0, lowering.shapes[which].height - depth))
    parts = [builder.const(spare)]
    for outline, place, top in _obstacles(lowering, which, base):
        under = builder.value(builder.apply("sub", (foot, top)))
        if under is not None and under >= -ROUNDING:  # what it stands on, and what is lower still
            continue
        for part, rise in ((left, 0.0), (right, 0.0), (palm, arm.hand.finger_length)):
            above = builder.apply("sub", (_sum(lowering, grip, rise), top))
            known = builder.value(above)
            if known is None or known < spare:  # else the room between the fingers is less, whatever the scene
                beside = builder.apply("gap", (*pose_of(lowering, which), *place), (part, outline))
                parts.append(builder.apply("max", (beside, above)))
    return builder.apply("min", parts)


def _room_for_arm(lowering: Lowering, which: int, base: int, arm: Arm, depth: float) -> int:
    """The least of: how far everything else is from the segment between the base and the hand, or how much lower than
    the top of the hand, where the arm begins."""
    builder, coerce = lowering.builder, lowering.coerce
    grip = _sum(lowering, level(lowering, which), max(0.0, lowering.shapes[which].height - depth))
    wrist = _sum(lowering, grip, arm.hand.finger_length + arm.hand.palm[2])
    way = tuple(coerce.coordinate(one, axis) for one in (base, which) for axis in PLACE)
    parts = []
    for outline, place, top in _obstacles(lowering, which, base):
        beside = builder.apply("pathGap", (*place, *way), (outline,))
        parts.append(builder.apply("max", (beside, builder.apply("sub", (wrist, top)))))
    return builder.apply("min", parts) if parts else builder.const(LARGEST_ARM)


def _sum(lowering: Lowering, number: int, rise: float) -> int:
    return lowering.builder.apply("add", (number, lowering.builder.const(rise)))


def _obstacles(lowering: Lowering, which: int, base: int) -> Iterator[tuple[Footprint, tuple[int, ...], int]]:
    """The upright pieces of all other objects, and the boards of regions: what each covers, where it is, and its top.
    The hand comes from above, so it is in the way of nothing how low a piece begins."""
    assert lowering.heights is not None
    builder = lowering.builder
    for other in range(len(lowering.heights)):
        if other not in (which, base):
            for outline, _, high in pieces_of(lowering, other, 0.0):
                yield outline, pose_of(lowering, other), _sum(lowering, level(lowering, other), high)
    for area in boards_of(lowering).values():
        place = (*map(builder.const, area.center), builder.const(0.0))
        yield area.footprint, place, builder.const(area.z)
