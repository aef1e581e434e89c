"""What the declarations say objects stand on: `object book on shelfunit.shelf[2]`.

A support is a surface of another object, in that object's frame, or a region of the table. It gives the object its own
box of centres and one requirement more, and makes its height a constant of the spec (docs/adr/0011-supports.md).

It can be a choice: `object book on any of [shelf[1], shelf[2], workspace]`. Which surface a scene has is a coordinate
like others, a number in [0, 1] of a further entry of the core's objects, the switch, so that samplers, bounds and
backward rules need to know nothing of choices: the requirement becomes a disjunction over parts of that interval.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, Literal

from scenegen.errors import Diagnostic, Span, SpecError
from scenegen.errors.declarations import (
    DOES_NOT_FIT,
    NO_FLAT_TOP,
    NOT_ON_SURFACE,
    OUTSIDE_WORKSPACE,
    STACKED_AND_APART,
    STANDS_ON_ITSELF,
    WRONG_CHOICE,
    WRONG_NUMBER_OF_PLACES,
)
from scenegen.geometry import MATH, PRIMITIVES
from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, Polygon, clip, standing_area
from scenegen.geometry.primitives import BARE, LENGTH
from scenegen.geometry.workspace import BOARD, Workspace
from scenegen.lang.check.objects import not_open
from scenegen.lang.check.scope import DeclaredObject
from scenegen.lang.check.values import Area, CallFrame, ListValue, ObjectValue, RegionValue, SurfaceValue, Value
from scenegen.lang.check.weights import weights_of
from scenegen.lang.formula.builder import FALSE, TRUE
from scenegen.lang.formula.core import Apply, Atom, Const, Junction
from scenegen.lang.spec import Pose, Support, SurfaceChoice, carriers_first
from scenegen.lang.syntax import ast
from scenegen.pose import FLAT, PLACE, X
from scenegen.things import Shape
from scenegen.things.furniture import SupportSurface
from scenegen.things.surfaces import fits, reach_of, surfaces_of

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering

ROUNDING = 1e-9  # metres: sizes and poses in a text are rounded
SWITCH = (0.0, 1.0)  # the range of a choice's number

Rectangle = tuple[tuple[float, float], tuple[float, float]]  # x, y


Options = tuple[Support, ...]


def supports(lowering: Lowering, thing: DeclaredObject, places: Sequence[int]) -> dict[int, Options]:
    """What a declaration lets its objects stand on, by their places: one surface, or several of which each scene has
    one. Raises SpecError."""
    one = thing.declaration
    if one is None or one.support is None:
        return {}
    here, frame = one.support.span(thing.source), CallFrame(thing.source)
    if one.choice:
        return _choices(lowering, one.support, places, here, frame)
    if thing.is_array and isinstance(one.support, ast.List):
        values: list[Value] = [lowering.evaluate(part, frame) for part in one.support.items]
    else:
        value = lowering.evaluate(one.support, frame)
        values = list(value.items) if isinstance(value, ListValue) and thing.is_array else [value] * len(places)
    if len(values) != len(places):
        raise SpecError(WRONG_NUMBER_OF_PLACES(here, objects=len(places), surfaces=len(values)))
    return {place: (_support(lowering, place, value, here),) for place, value in zip(places, values, strict=True)}


def _choices(
    lowering: Lowering, written: ast.Expr, places: Sequence[int], here: Span, frame: CallFrame
) -> dict[int, Options]:
    """The surfaces of `on any of [...]`, the same for each object."""
    parts: list[tuple[Value, Span]]
    if isinstance(written, ast.List | ast.Weighted):
        parts = [(lowering.evaluate(part, frame), part.span(here.source)) for part in written.items]
    else:
        value = lowering.evaluate(written, frame)
        if not isinstance(value, ListValue):
            raise SpecError(WRONG_CHOICE(here, found=value.kind, written=here.text))
        parts = [(item, here) for item in value.items]
    if not parts:
        raise SpecError(WRONG_CHOICE(here))
    found = {}
    for value, span in parts:
        if isinstance(value, ListValue):
            from scenegen.lang.syntax.foreign import one_list

            surfaces = None if span.text.isidentifier() else one_list(here.text)
            raise SpecError(WRONG_CHOICE(span, surfaces=surfaces, nested=True))
    for place in places:
        options: list[Support] = []
        for value, span in parts:
            option = _support(lowering, place, value, span)
            if any(option.name == other.name for other in options):
                raise SpecError(WRONG_CHOICE(span, surface=option.name))
            whole = cut_off(option, lowering.space)
            if whole is None:
                raise SpecError(OUTSIDE_WORKSPACE(span, name=lowering.builder.objects[place]))
            if not area_of(lowering.shapes[place].footprint, whole) > 0.0:
                name = lowering.builder.objects[place]
                raise SpecError(DOES_NOT_FIT(span, name=name, surface=option.name))
            options.append(whole)
        found[place] = tuple(options)
    return found


def choices(
    lowering: Lowering, found: Mapping[int, Options], things: Sequence[DeclaredObject]
) -> dict[int, SurfaceChoice]:
    """The choices among the supports of several surfaces, whose switches come after the objects."""
    chosen: dict[int, SurfaceChoice] = {}
    count = len(lowering.shapes)
    for thing in things:
        one = thing.declaration
        if one is None or not one.choice:
            continue
        for place in lowering.scope.arrays.get(thing.name.id) or (lowering.scope.objects[thing.name.id],):
            if len(found[place]) > 1:
                upper, by_area = lowering.shapes[place].footprint, one.choice == "area"
                weights = [1.0] * len(found[place])
                if isinstance(one.support, ast.Weighted):
                    weights = [*map(float, weights_of(lowering, one.support, thing.source))]
                chosen[place] = choose(upper, found[place], weights, count + len(chosen), by_area=by_area)
    return chosen


def _support(lowering: Lowering, upper: int, value: Value, here: Span) -> Support:
    name, shape = lowering.builder.objects[upper], lowering.shapes[upper]
    match value:
        case RegionValue(region, area):
            under = Support(region, None, area.footprint, area.z, pose=(*area.center, 0.0), box=area.box)
            _refuse_tall(name, shape.height, region, _free_over(lowering, region, area), here)
            return under
        case ObjectValue(carrier):
            found = surfaces_of(lowering.shapes[carrier], shape)
            if not found:
                raise SpecError(NO_FLAT_TOP(here, name=lowering.builder.objects[carrier]))
            surface = found[0]
        case SurfaceValue(carrier, surface):
            named = {one.name: one for one in surfaces_of(lowering.shapes[carrier], shape)}
            below = lowering.builder.objects[carrier]
            if surface.name not in named and carrier != upper:
                raise SpecError(DOES_NOT_FIT(here, name=name, surface=f"{below}.{surface.name}", carrier=below))
            if surface.name == "rim" and _holds(surfaces_of(lowering.shapes[carrier], shape)[0], shape):
                raise SpecError(DOES_NOT_FIT(here, name=name, surface=f"{below}.rim", carrier=below, rim=True))
            surface = named.get(surface.name, surface)
        case _:
            wanted = "an object, a surface or a region"
            raise lowering.coerce.wrong(value.with_origin(here), wanted, f"what `{name}` stands on")
    label = f"{lowering.builder.objects[carrier]}.{surface.name}"
    if carrier == upper:
        raise SpecError(STANDS_ON_ITSELF(here, name=name))
    if not _holds(surface, shape):
        on_rim = isinstance(value, ObjectValue) and found[-1].name == "rim"
        rim = f"{lowering.builder.objects[carrier]}.rim" if on_rim else None
        problem = DOES_NOT_FIT(here, name=name, surface=label, carrier=rim)
        raise SpecError(not_open(lowering, upper, carrier, surface, here) or problem)
    _refuse_tall(name, shape.height, label, surface.clear, here)
    return Support(label, carrier, surface.outline, surface.height, surface.walled, far=surface.far)


def _holds(surface: SupportSurface, shape: Shape) -> bool:
    return not surface.walled or fits(shape.footprint, surface.outline)


def _refuse_tall(name: str, height: float, surface: str, clear: float, here: Span) -> None:
    if height > clear + ROUNDING:
        sizes = {"height": 100.0 * height, "clear": 100.0 * clear}
        raise SpecError(DOES_NOT_FIT(here, name=name, surface=surface, **sizes))


def _free_over(lowering: Lowering, name: str, area: Area) -> float:
    """The free height over a region: up to the lowest board that covers all of it."""
    room = PRIMITIVES["room"].evaluate
    above = [
        other.z - min(BOARD, other.z) - area.z
        for known, other in lowering.areas.items()
        if known not in (name, "workspace")
        and other.z > area.z
        and room(MATH, area.footprint, other.footprint, *area.center, 0.0, *other.center, 0.0) >= -ROUNDING
    ]
    return min(above, default=math.inf)


def heights(
    count: int, found: Mapping[int, Options], names: Sequence[str], spans: Mapping[int, Span]
) -> tuple[float | None, ...]:
    """How high above the table the lowest point of each object is, None where that depends on a choice. Raises
    SpecError where supports form a circle."""
    refuse_circles(found, names, spans)
    known: dict[int, float | None] = {}
    for one in carriers_first(range(count), lambda one: found.get(one, ())):
        levels = {_level(known, under) for under in found.get(one, ())} or {0.0}
        known[one] = levels.pop() if len(levels) == 1 else None
    return tuple(known[which] for which in range(count))


def _level(known: Mapping[int, float | None], under: Support) -> float | None:
    below = 0.0 if under.carrier is None else known[under.carrier]
    return None if below is None else below + under.height


def refuse_circles(found: Mapping[int, Options], names: Sequence[str], spans: Mapping[int, Span]) -> None:
    """Raises SpecError where an object could come to stand on itself."""
    done = set[int]()
    for start in found:
        path: list[int] = []
        stack = [(start, False)]
        while stack:
            which, left = stack.pop()
            if left:
                done.add(path.pop())
                continue
            if which in path:
                circle = " -> ".join(names[one] for one in (*path[path.index(which) :], which))
                raise SpecError(STANDS_ON_ITSELF(spans[which], name=names[which], circle=circle))
            if which in done:
                continue
            path.append(which)
            stack.append((which, True))
            stack.extend((under.carrier, False) for under in found.get(which, ()) if under.carrier is not None)


def support_boxes(
    space: Workspace, found: Mapping[int, Options], fixed: Mapping[int, Pose], switches: Sequence[int] = ()
) -> Workspace:
    """The workspace with a box of its own for each object that stands on something: the box of what carries it and as
    far around it as the surface reaches, so that what carries stays uniform over its own box. Of several surfaces it is
    one box around all. `switches` are those of choices."""
    boxes: dict[int, Rectangle] = {}
    standing = [which for which in sorted(found) if which not in fixed]
    for one in carriers_first(standing, lambda one: () if one in fixed else found.get(one, ())):
        if one in fixed:  # what it carries moves with it
            boxes[one] = ((fixed[one][0],) * 2, (fixed[one][1],) * 2)
        elif one not in found:
            boxes[one] = (space.x, space.y)
        else:
            ends = [_box(under, space, boxes) for under in found[one]]
            x, y = ((min(end[axis][0] for end in ends), max(end[axis][1] for end in ends)) for axis in PLACE)
            boxes[one] = x, y
    own = tuple((which, *boxes[which]) for which in standing)
    return dataclasses.replace(space, own=(*space.own, *own, *((which, SWITCH, SWITCH) for which in switches)))


def _box(under: Support, space: Workspace, boxes: Mapping[int, Rectangle]) -> Rectangle:
    """The box of the centres on a surface: x, y."""
    if under.carrier is None:
        left, bottom, right, top = under.box
        return (max(left, space.x[0]), min(right, space.x[1])), (max(bottom, space.y[0]), min(top, space.y[1]))
    (x0, x1), (y0, y1) = boxes[under.carrier]
    far = reach_of(under.outline) if under.far is None else under.far
    return (x0 - far, x1 + far), (y0 - far, y1 + far)


def empty_supports(space: Workspace, spans: Mapping[int, Span], names: Sequence[str]) -> list[Diagnostic]:
    """A diagnostic for each object whose surface lies outside of the workspace."""
    return [
        OUTSIDE_WORKSPACE(spans[which], name=names[which])
        for which, x, y in space.own
        if not (x[0] < x[1] and y[0] < y[1])
    ]


def standing_on(lowering: Lowering, found: Mapping[int, Support], spans: Mapping[int, Span]) -> list[int]:
    """The requirements that supports stand for: each object's centre in its surface's outline, or all of its footprint
    where the surface has walls. Raises SpecError where both are held in place elsewhere."""
    builder = lowering.builder
    formulas = []
    for which, under in sorted(found.items()):
        if under.carrier is None and isinstance(under.outline, Box) and which not in lowering.coerce.fixed:
            continue  # its box is the region
        text = f"{builder.objects[which]} on {under.name}"
        part = _support_formula(lowering, which, under, text, spans[which])
        if part == FALSE:
            raise SpecError(NOT_ON_SURFACE(spans[which], name=builder.objects[which], surface=under.name))
        if part != TRUE:
            formulas.append(part)
    for which, choice in sorted(lowering.choices.items()):
        part = _on_one(lowering, which, choice, spans[which])
        if part == FALSE:
            names = " or ".join(one.name for one in choice.options)
            raise SpecError(NOT_ON_SURFACE(spans[which], name=builder.objects[which], surface=names))
        if part != TRUE:
            formulas.append(part)
    return formulas


def _support_formula(lowering: Lowering, which: int, under: Support, text: str, span: Span) -> int:
    """An object's centre is on a surface, or all of it between the walls."""
    builder, coerce = lowering.builder, lowering.coerce
    zero = builder.const(0.0)
    pose = (coerce.coordinate(which, axis) for axis in FLAT)
    if under.carrier is not None:
        below = tuple(coerce.coordinate(under.carrier, axis) for axis in FLAT)
    else:
        below = tuple(map(builder.const, under.pose))
    primitive, shape = ("room", coerce.covers(which)) if under.walled else ("gap", POINT)
    x, y, theta = pose
    value = builder.apply(primitive, (x, y, theta if under.walled else zero, *below), (shape, under.outline))
    sides = (zero, value) if under.walled else (value, zero)
    if isinstance(amount := builder.value(value), float):
        return FALSE if (-amount if under.walled else amount) > ROUNDING else TRUE
    return builder.atom(*sides, text, LENGTH, (span,))


def _on_one(lowering: Lowering, which: int, choice: SurfaceChoice, span: Span) -> int:
    """An object is on the surface that its switch says."""
    builder, name = lowering.builder, lowering.builder.objects[which]
    switch = builder.coord(choice.switch, X)
    parts = []
    for low, high, options in group_options(choice):
        text = f"{name} on {' or '.join(one.name for one in options)}"
        ends = [builder.atom(builder.const(low), switch, text, BARE, (span,))] if low > 0.0 else []
        ends += [builder.atom(switch, builder.const(high), text, BARE, (span,))] if high < 1.0 else []
        parts.append(builder.junction("min", [*ends, _support_formula(lowering, which, options[0], text, span)], text))
    names = ", ".join(one.name for one in choice.options)
    return builder.junction("max", parts, f"{name} on any of [{names}]")


def area_of(upper: Footprint, one: Support) -> float:
    """The area on which an object's centre can be on a surface, in square metres."""
    return standing_area(upper if one.walled else POINT, one.outline)


def choose(
    upper: Footprint, options: Sequence[Support], weights: Sequence[float], switch: int, *, by_area: bool
) -> SurfaceChoice:
    """The choice among some surfaces, as likely as their weights say, or these times the area on which the object can
    stand.

    All share one box of centres, and centres that are not on the surface chosen are left out. That alone makes a
    surface as likely as its area is large; for equal shares, its part of the switch is the larger the smaller it is.
    """
    total, ends = 0.0, []
    for weight, one in zip(weights, options, strict=True):
        total += weight if by_area else weight / area_of(upper, one)
        ends.append(total)
    return SurfaceChoice(switch, tuple(options), (*(end / total for end in ends[:-1]), 1.0))


def cut_off(under: Support, space: Workspace) -> Support | None:
    """A region without what lies outside of the workspace, where no centre is; None where nothing is left of it, or
    where that is no footprint."""
    left, bottom, right, top = under.box
    (x0, x1), (y0, y1) = space.x, space.y
    if under.carrier is not None or (x0 <= left and right <= x1 and y0 <= bottom and top <= y1):
        return under
    left, bottom, right, top = max(left, x0), max(bottom, y0), min(right, x1), min(top, y1)
    if not (left < right and bottom < top) or isinstance(under.outline, Circle):
        return None
    x, y, _ = under.pose
    outline: Footprint
    if isinstance(under.outline, Box):
        outline, (x, y) = Box(right - left, top - bottom), ((left + right) / 2.0, (bottom + top) / 2.0)
    else:
        points = clip(under.outline.vertices, (left - x, bottom - y, right - x, top - y))
        if len(points) < 3:
            return None
        outline = Polygon(points)
    box = (left, bottom, right, top)
    return Support(under.name, None, outline, under.height, pose=(x, y, 0.0), box=box)


def group_options(choice: SurfaceChoice) -> Iterator[tuple[float, float, tuple[Support, ...]]]:
    """Neighbouring options with one outline at one place, such as the boards of a shelf, and where they lie on the
    switch."""
    low = 0.0
    run: list[Support] = []
    for one, end, after in zip(choice.options, choice.ends, (*choice.options[1:], None), strict=True):
        run.append(one)
        if after is None or _place(after) != _place(one):
            yield low, end, tuple(run)
            low, run = end, []


def _place(one: Support) -> tuple[object, ...]:
    return one.carrier, one.outline, one.walled, one.pose


MAX_SPLIT_DEPTH = 4  # of min and max in a margin that is taken apart: apart() has two


def clashing(
    lowering: Lowering, requirement: int, found: Mapping[int, Support], choices: Mapping[int, Sequence[Support]]
) -> Diagnostic | None:
    """What to say where a requirement keeps an object's footprint clear of what it stands on: of all that it can stand
    on, where that is a choice."""
    nodes, coordinate = lowering.builder.nodes, lowering.coerce.coordinate
    pairs = {}
    options = {upper: [under] for upper, under in found.items()} | dict(choices)
    carriers = {upper: [under.carrier for under in unders] for upper, unders in options.items()}
    for upper, all_ in carriers.items():
        for carrier in all_:
            if carrier is not None and None not in all_:
                first, second = (tuple(coordinate(one, axis) for axis in PLACE) for one in (upper, carrier))
                pairs[first, second] = pairs[second, first] = upper, carrier
    apart: dict[int, set[int]] = {}
    stack = [requirement]
    while stack:
        node = nodes[index] if (index := stack.pop()) >= 0 else None
        if isinstance(node, Junction) and node.kind == "min":
            stack.extend(node.args)
        if not isinstance(node, Atom):
            continue
        margin = nodes[node.margin]
        if isinstance(margin, Apply) and margin.primitive == "gap" and len(margin.args) == 6:
            pair = pairs.get((margin.args[:2], margin.args[3:5]))
            if pair is not None:
                apart.setdefault(pair[0], set()).add(pair[1])
                if apart[pair[0]] < set(carriers[pair[0]]):
                    continue
                one, other = (lowering.builder.objects[which] for which in pair)
                return STACKED_AND_APART(node.spans[-1], upper=one, lower=other)
    return None


def without_supports(lowering: Lowering, formula: int, known: AbstractSet[int]) -> int:
    """A requirement that is satisfied by the same scenes, without the constants in it and without the atoms `known` to
    be required already: of what is required only the sign counts, most pairs of `noCollision` are apart by their
    heights, and what stands in a tray is clear of its walls."""
    builder = lowering.builder
    margins = {atom.margin for which in known if isinstance(atom := builder.nodes[which], Atom)}
    needed, stack = set[int](), [formula]
    while stack:
        if (index := stack.pop()) >= 0 and index not in needed:
            needed.add(index)
            node = builder.nodes[index]
            stack.extend(node.args if isinstance(node, Junction) else ())
    made = {TRUE: TRUE, FALSE: FALSE}
    for index in sorted(needed):  # children first
        node = builder.nodes[index]
        if isinstance(node, Junction):
            made[index] = builder.junction(node.kind, [made[part] for part in node.args], node.text)
        elif isinstance(node, Atom):
            made[index] = _split(lowering, node.margin, node, margins, MAX_SPLIT_DEPTH)
    return made[formula]


def _split(lowering: Lowering, margin: int, atom: Atom, known: AbstractSet[int], depth: int) -> int:
    builder = lowering.builder
    node = builder.nodes[margin]
    if isinstance(node, Const):
        return TRUE if node.value >= 0.0 else FALSE
    if margin in known:
        return TRUE
    if depth and isinstance(node, Apply) and node.primitive == "pick":
        switch, end, *sides = node.args
        before, after = (_split(lowering, part, atom, known, depth) for part in sides)
        early, late = (
            builder.atom(*ends, f"{builder.text(ends[0])} <= {builder.text(ends[1])}", BARE, atom.spans)
            for ends in ((switch, end), (end, switch))
        )
        either = [builder.junction("max", [late, before]), builder.junction("max", [early, after])]
        return builder.junction("min", either)
    if depth and isinstance(node, Apply) and node.primitive in ("min", "max"):
        kind: Literal["min", "max"] = "min" if node.primitive == "min" else "max"
        return builder.junction(kind, [_split(lowering, part, atom, known, depth - 1) for part in node.args])
    text = atom.text if margin == atom.margin else f"{builder.text(margin)} >= 0"
    return builder.atom_of(margin, builder.const(0.0), margin, text, atom.unit, atom.spans)
