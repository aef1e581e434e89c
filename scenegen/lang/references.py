"""What a name stands for: a bound value, objects, a region, a constant or a label."""

from __future__ import annotations

from collections.abc import Mapping

from scenegen.errors import Span
from scenegen.errors.declarations import NO_OBJECTS, WORKSPACE_OF_ITSELF
from scenegen.errors.language import NOT_A_CONSTANT
from scenegen.lang import ast, traversal
from scenegen.lang.context import Context
from scenegen.lang.provenance import Frame
from scenegen.lang.trampoline import Call
from scenegen.lang.values import ListValue, ObjectValue, RegionValue, Row, Value


def refer(lowering: Context, node: ast.Name, env: Mapping[str, Value], frame: Frame) -> Call[Value]:
    if node.id in env:
        return env[node.id]
    origin = lowering.origin(node, frame)
    if node.id in lowering.scope.things or node.id == "objects":
        return objects(lowering, node, frame, origin)
    if node.id == "workspace" or node.id in lowering.scope.regions:
        if node.id not in lowering.areas and node.id not in lowering.levels:
            (yield _region(lowering, node, frame))
        lowering.used.add(node.id)
        if node.id in lowering.levels:
            names = [f"{node.id}[{which}]" for which in range(1, lowering.levels[node.id] + 1)]
            return ListValue(
                tuple(RegionValue(name, lowering.areas[name], origin=origin) for name in names), origin=origin
            )
        return RegionValue(node.id, lowering.areas[node.id], origin=origin)
    if node.id not in lowering.values:
        declared = lowering.scope.constants.get(node.id) or lowering.scope.labels[node.id]
        (expr,) = traversal.expressions(declared.statement)
        value: Value = yield lowering.lower(expr, {}, Frame(declared.source))
        if isinstance(declared.statement, ast.Label):
            lowering.coerce.formula(value, f"`{node.id}`")
        lowering.values[node.id] = value
    lowering.used.add(node.id)
    # The value is the constant's, the place to blame is where the name was used.
    return lowering.values[node.id].moved(origin)


def _region(lowering: Context, node: ast.Name, frame: Frame) -> Call[None]:
    from scenegen.lang.regions import areas

    if node.id == "workspace":
        raise lowering.error(WORKSPACE_OF_ITSELF, node, frame)
    yield areas(lowering, lowering.scope.regions[node.id])


def objects(lowering: Context, node: ast.Name, frame: Frame, origin: Span) -> Value:
    """An object, an array or all objects. Raises SpecError while the objects are still being declared."""
    if not lowering.scope.things:
        raise lowering.error(NO_OBJECTS, node, frame)
    if not lowering.scope.objects:
        raise lowering.error(NOT_A_CONSTANT, node, frame, name=node.id)
    if node.id in lowering.scope.objects:
        return ObjectValue(lowering.scope.objects[node.id], origin=origin)
    places = range(len(lowering.scope.objects)) if node.id == "objects" else lowering.scope.arrays[node.id]
    return ListValue(Row(places, origin), origin=origin)
