"""Cameras, and functions of what they see.

A camera does not move and neither do heights, so what a camera pictures is a cone with flat sides, and what one body
hides from it is a cone, too, cut off at constant heights: on the table both are sums, minima and the primitives
`shadowGap` and `visibleShare` over footprints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.declarations import (
    BLIND_CAMERA,
    MEASURED_TOO_EARLY,
    SIZE_OUT_OF_RANGE,
    TOO_MANY_CASES,
    WRONG_CAMERA,
    WRONG_SHARES,
)
from scenegen.errors.language import NOT_CONSTANT, SAME_ARGUMENT_TWICE, WRONG_UNIT
from scenegen.geometry import MATH, POINT, PRIMITIVES, Footprint
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH, SHARE, Unit
from scenegen.geometry.workspace import MAX_COORDINATE
from scenegen.lang.check.heights import MOST_CASES, boards_of, by_cases, height_in, level, pose_of
from scenegen.lang.check.scope import Declared
from scenegen.lang.check.values import (
    AnyValue,
    CallFrame,
    CameraValue,
    ListValue,
    NumberValue,
    ObjectValue,
    RegionValue,
    Value,
)
from scenegen.lang.spec import LEVEL, Pose, Space, SpecCamera, Support
from scenegen.lang.syntax import ast
from scenegen.things.surfaces import reach_of

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering

MOST_ASPECT = 100.0  # of a picture: its longer side over its shorter one
BESIDE = 10.0  # metres: the clearance from what an object stands on, which is around it, not before it
Body = int | str  # an object, or the board of a region
FURTHEST_COPY = 1000.0  # how often a shadow is as large as what casts it; beyond, it is longer than any table


def camera(lowering: Lowering, declared: Declared) -> SpecCamera:
    """What a `camera` statement says. Raises SpecError."""
    statement, source = declared.statement, declared.source
    assert isinstance(statement, ast.CameraDeclaration)
    eye = _place(lowering, statement.eye, source, "the place")
    target = _place(lowering, statement.target, source, "the target")
    if eye[2] <= 0.0:
        raise SpecError(WRONG_CAMERA(statement.eye.span(source), below=True))
    if math.dist(eye, target) < LEVEL:
        raise SpecError(WRONG_CAMERA(statement.target.span(source)))
    field = _number(lowering, statement.field, source, "the field of view of a camera", ANGLE)
    if not LEVEL < field < math.pi - LEVEL:
        raise SpecError(WRONG_CAMERA(statement.field.span(source), angle=math.degrees(field)))
    width, height = (
        _number(lowering, one, source, "a side of a picture") for one in (statement.width, statement.height)
    )
    ratio = width / height if height > 0.0 else math.inf
    if not 1.0 / MOST_ASPECT <= ratio <= MOST_ASPECT:
        here = Span(source, statement.width.start, statement.height.end)
        raise SpecError(WRONG_CAMERA(here, width=width, height=height, most=MOST_ASPECT))
    return SpecCamera(declared.name.id, eye, target, field, ratio)


def _number(lowering: Lowering, node: ast.Expr, source: Source, what: str, *units: Unit) -> float:
    value = lowering.evaluate(node, CallFrame(source))
    return lowering.constant(value, node, CallFrame(source), what, BARE, *units)


def _place(lowering: Lowering, node: ast.Expr, source: Source, what: str) -> Space:
    """A constant point in space. Raises SpecError."""
    if not isinstance(node, ast.Point) or len(node.coordinates) != 3:
        raise SpecError(WRONG_CAMERA(node.span(source), place=what))
    x, y, z = (_number(lowering, one, source, "a coordinate of a camera", LENGTH) for one in node.coordinates)
    if max(abs(x), abs(y), abs(z)) > MAX_COORDINATE:
        raise SpecError(SIZE_OUT_OF_RANGE(node.span(source), what=f"{what} of this camera", limit=MAX_COORDINATE))
    return x, y, z


def camera_clash(lowering: Lowering, fixed: Mapping[int, Pose]) -> list[Diagnostic]:
    """A diagnostic for each camera inside of an object that does not move, or of a board."""
    if not lowering.cameras:
        return []
    solid: list[tuple[str, Footprint, Pose, float, float]] = []
    for which, pose in fixed.items():
        low, shape = lowering.heights[which] if lowering.heights else 0.0, lowering.shapes[which]
        if low is not None:
            solid.append((lowering.builder.objects[which], shape.footprint, pose, low, low + shape.height))
    for board, area in boards_of(lowering).items():
        solid.append((board, area.footprint, (*area.center, 0.0), area.underside, area.z))
    problems = []
    for name, declared in lowering.scope.cameras.items():
        x, y, z = lowering.cameras[name].eye
        for thing, footprint, pose, low, high in solid:
            if low < z < high and PRIMITIVES["gap"].evaluate(MATH, footprint, POINT, *pose, x, y, 0.0) < 0.0:
                assert isinstance(declared.statement, ast.CameraDeclaration)
                problems.append(WRONG_CAMERA(declared.statement.eye.span(declared.source), thing=thing))
                break
    return problems


def blind_cameras(lowering: Lowering, fixed: Mapping[int, Pose]) -> list[Diagnostic]:
    """A warning for each camera whose picture can have none of the objects: a box around all places that they can take
    is behind it, or beyond a side of its picture."""
    reach = max((reach_of(shape.footprint) for shape in lowering.shapes), default=0.0)
    places = [*zip(lowering.space.x, lowering.space.y, strict=True), *((x, y) for x, y, _ in fixed.values())]
    ends = [(min(values) - reach, max(values) + reach) for values in zip(*places, strict=True)]
    # as high as all things and boards on each other
    tall = sum(shape.height for shape in lowering.shapes) + sum(area.z for area in lowering.areas.values())
    corners = [(x, y, z) for x in ends[0] for y in ends[1] for z in (0.0, tall)]
    problems = []
    for name, seer in lowering.cameras.items():
        for way in (seer.forward, *seer.sides):
            if all(_dot(way, corner) < _dot(way, seer.eye) for corner in corners):
                declared = lowering.scope.cameras[name]
                assert isinstance(declared.statement, ast.CameraDeclaration)
                here = declared.statement.target.span(declared.source)
                problems.append(BLIND_CAMERA(here, name=name))
                break
    return problems


def _dot(way: Space, point: Space) -> float:
    return sum(one * place for one, place in zip(way, point, strict=True))


def check_shares(lowering: Lowering, least: Value, most: Value, node: ast.Call, frame: CallFrame) -> None:
    """Raises SpecError for shares that are none, or that cross."""
    ends = []
    for value in (least, most):
        if isinstance(value, AnyValue):
            return
        number = lowering.coerce.number(value, "a share")
        share = lowering.builder.value(number.node)
        if number.unit not in (BARE, SHARE):
            raise SpecError(WRONG_UNIT(value.origin, what="a share", found=number.unit.words))
        if share is None:
            raise SpecError(NOT_CONSTANT(value.origin, what="a share"))
        if not 0.0 <= share <= 1.0:
            raise SpecError(WRONG_SHARES(value.origin, share=share))
        ends.append(share)
    if ends[0] > ends[1]:
        raise lowering.error(WRONG_SHARES, node, frame, least=100.0 * ends[0], most=100.0 * ends[1])


def sight_function(lowering: Lowering, name: str, values: list[Value], node: ast.Call, frame: CallFrame) -> Value:
    """A call of one of SIGHT. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if any(isinstance(value, AnyValue) for value in values):
        return AnyValue(origin=origin)
    if lowering.heights is None:
        raise lowering.error(MEASURED_TOO_EARLY, node, frame)
    if name == "hiders":
        if not isinstance(values[0], ObjectValue):
            raise lowering.coerce.wrong(values[0], "an object", "the argument of `hiders`")
        things = [ObjectValue(one, origin=origin) for one in _hiders(lowering, values[0].index)]
        boards = [RegionValue(one, area, origin=origin) for one, area in boards_of(lowering).items()]
        return ListValue((*things, *boards), origin=origin)
    *bodies, seer = values
    which: list[Body] = []
    for place, value in enumerate(bodies):
        if isinstance(value, ObjectValue):
            which.append(value.index)
        elif isinstance(value, RegionValue) and value.area.z > 0.0 and place == 1:
            which.append(value.name)
        else:
            wanted = "an object, or a region at a height" if place == 1 else "an object"
            raise lowering.coerce.wrong(value, wanted, f"an argument of `{name}`")
    thing = which[0]
    assert isinstance(thing, int)
    if not isinstance(seer, CameraValue):
        raise lowering.coerce.wrong(seer, "a camera", f"the last argument of `{name}`")
    if name == "viewRoom":
        return NumberValue(room_of(lowering, thing, seer.camera), LENGTH, origin=origin)
    if name == "shadowGap":
        if thing == which[1]:
            raise lowering.error(SAME_ARGUMENT_TWICE, node, frame, name=name)
        number = _shadow(lowering, thing, which[1], seer.camera)
    else:
        lowering.seen[thing, seer.camera.name] = None
        number = share_of(lowering, thing, seer.camera)
        if number is not None and not _hiders(lowering, thing) and lowering.builder.value(number) == 1.0:
            lowering.alone[lowering.builder.objects[thing]] = None
    if number is None:
        raise lowering.error(TOO_MANY_CASES, node, frame, limit=MOST_CASES)
    if lowering.builder.value(number) is None:
        lowering.builder.called.setdefault(number, f"{name}({', '.join(map(lowering.text, values))})")
    return NumberValue(number, SHARE if name == "visibleShare" else LENGTH, origin=origin)


def room_of(lowering: Lowering, which: int, seer: SpecCamera, *, farthest: bool = False) -> int:
    """The distance of an object's body from the four planes through the eye and a side of the picture, the least of
    them: of its corner that is nearest to each, or `farthest` from it, and negative beyond it."""
    builder = lowering.builder
    x, y, theta = pose_of(lowering, which)
    low, own = level(lowering, which), lowering.shapes[which].height
    sign, end = (1.0, max) if farthest else (-1.0, min)
    rooms = []
    for nx, ny, nz in seer.sides:
        base = end(nz * own, 0.0) - sum(one * place for one, place in zip((nx, ny, nz), seer.eye, strict=True))
        parts = [(nx, x), (ny, y), (nz, low)]
        flat = math.hypot(nx, ny)
        if flat > LEVEL:
            heading = builder.const(math.atan2(sign * ny, sign * nx))
            reach = builder.apply("reach", (x, y, theta, heading), (lowering.coerce.covers(which),))
            parts.append((sign * flat, reach))
        room = builder.const(base)
        for factor, number in parts:
            room = builder.apply("add", (builder.apply("mul", (builder.const(factor), number)), room))
        rooms.append(room)
    return builder.apply("min", rooms)


def _copies(body: tuple[float, float], hiding: tuple[float, float], eye: float) -> tuple[float, float] | None:
    """What a body hides from an eye, of another body, is within copies of its footprint, enlarged from the eye: how
    often the first and the last of them are as large. Bodies are from a height to a height. None where no ray of sight
    meets both at the heights at which they are.

    A ray that meets the hiding body at height z meets height h of the other one at (eye - h) / (eye - z) of its way,
    which is 1 or more where the hiding body is nearer.
    """
    (low, top), (other_low, other_top) = body, hiding
    if other_low < eye and low < eye and other_top > low:  # looking down
        first, last = (eye - top) / (eye - other_low), (eye - low) / max(eye - other_top, (eye - low) / FURTHEST_COPY)
        return max(1.0, first), max(1.0, last)
    if other_top > eye and top > eye and other_low < top:  # looking up
        first, last = (low - eye) / (other_top - eye), (top - eye) / max(other_low - eye, (top - eye) / FURTHEST_COPY)
        return max(1.0, first), max(1.0, last)
    return None


def _shadow(lowering: Lowering, which: int, other: Body, seer: SpecCamera) -> int | None:
    """The clearance of an object and what another body hides; where heights alone keep that off, by how much they do.
    None where choices of supports allow too many cases."""
    builder = lowering.builder
    poses = (*pose_of(lowering, which), *_pose(lowering, other))
    outline = lowering.areas[other].footprint if isinstance(other, str) else lowering.coerce.covers(other)
    shapes = (lowering.coerce.covers(which), outline)
    x, y, eye = seer.eye

    def in_case(supports: Mapping[int, Support]) -> int:
        (low, top), (below, above) = (_levels(lowering, one, supports) for one in (which, other))
        # of what stands on it, a board hides what is seen from below
        if _stands_on(which, other, supports) and (isinstance(other, int) or eye >= above):
            return builder.const(BESIDE)
        found = _copies((low, top), (below, above), eye)
        first, last = found or (1.0, 1.0)
        args = (*poses, *map(builder.const, (x, y, first, last)))
        beside = builder.apply("shadowGap", args, shapes)
        return beside if found else builder.apply("max", (beside, builder.const(max(low - above, below - top))))

    return by_cases(lowering, [one for one in (which, other) if isinstance(one, int)], in_case)


def _pose(lowering: Lowering, body: Body) -> tuple[int, ...]:
    if isinstance(body, int):
        return pose_of(lowering, body)
    return tuple(map(lowering.builder.const, (*lowering.areas[body].center, 0.0)))


def _levels(lowering: Lowering, body: Body, supports: Mapping[int, Support]) -> tuple[float, float]:
    """How high the lowest and the highest point of a body are where every support is known."""
    if isinstance(body, str):
        return lowering.areas[body].underside, lowering.areas[body].z
    low = height_in(body, supports)
    return low, low + lowering.shapes[body].height


def _stands_on(which: int, other: Body, supports: Mapping[int, Support]) -> bool:
    """Whether an object stands on another body, or on what stands on that, where every support is known."""
    under = supports.get(which)
    while under is not None and under.carrier is not None:
        if under.carrier == other:
            return True
        under = supports.get(under.carrier)
    return under is not None and under.name == other


def _hiders(lowering: Lowering, which: int) -> list[int]:
    """All other objects, without what an object always stands on: that is around it, not before it."""
    others = range(len(lowering.shapes))
    return [one for one in others if one != which and not _stands_on(which, one, lowering.supports)]


def share_of(lowering: Lowering, which: int, seer: SpecCamera) -> int | None:
    """The share of a body's silhouette that nothing hides."""
    builder, boards = lowering.builder, boards_of(lowering)
    others: list[Body] = [*_hiders(lowering, which), *boards]
    if not others:
        return builder.const(1.0)

    def body(one: Body) -> Sequence[int]:
        if isinstance(one, str):
            return (*_pose(lowering, one), builder.const(boards[one].underside), builder.const(boards[one].z))
        low = level(lowering, one)
        return (*pose_of(lowering, one), low, builder.apply("add", (low, builder.const(lowering.shapes[one].height))))

    from scenegen.things.sight import visible_body  # meshes, for the few specs that look

    args = [*body(which), *map(builder.const, (*seer.eye, *seer.ahead, *seer.slope))]
    bodies = [visible_body(lowering.shapes[which])]
    for one in others:
        gap = _shadow(lowering, which, one, seer)
        if gap is None:
            return None
        if isinstance(one, str) and builder.value(gap) == BESIDE:  # it stands on this board
            continue
        args += [*body(one), gap]
        bodies.append(boards[one].footprint if isinstance(one, str) else visible_body(lowering.shapes[one]))
    return builder.apply("visibleShare", args, tuple(bodies)) if len(bodies) > 1 else builder.const(1.0)
