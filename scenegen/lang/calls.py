"""Calls: definitions expanded once for each set of arguments, primitives, and functions of lists and heights."""

from __future__ import annotations

from collections.abc import Mapping

from scenegen.lang import ast
from scenegen.lang.context import Context
from scenegen.lang.elsewhere import OF_SUPPORT, note_elsewhere
from scenegen.lang.functions import function, key_of, list_function
from scenegen.lang.heights import height_function
from scenegen.lang.motion import step_function
from scenegen.lang.provenance import Frame
from scenegen.lang.resolve import bind
from scenegen.lang.scope import HEIGHTS, LIST_FUNCTIONS, STEPS, Declared
from scenegen.lang.trampoline import Call
from scenegen.lang.values import ListValue, Value


def call(lowering: Context, node: ast.Call, env: Mapping[str, Value], frame: Frame) -> Call[Value]:
    name = node.function.id
    values: dict[str, Value] = {}
    for parameter, argument, role in _arguments(lowering, node, frame):
        value = lowering.at_once(argument, env, frame) or (yield lowering.lower(argument, env, frame))
        values[parameter] = value if value.role else value.moved(value.origin, role)
    declared = lowering.scope.definition(name, frame.source)
    if declared is not None:
        expanded: Value = yield _expand(lowering, declared, values, node, frame)
        return expanded
    if name in HEIGHTS:
        return height_function(lowering, name, list(values.values()), node, frame)
    if name in STEPS:
        return step_function(lowering, name, values, node, frame)
    if name in LIST_FUNCTIONS:
        return list_function(lowering, name, values["items"], node, frame)
    given = list(values.values())
    if len(given) > 1 or not isinstance(given[0], ListValue):
        return function(lowering, name, given, node, frame)
    key = (name, key_of(given[0]))
    if key not in lowering.expansions:  # mean(gaps(items)), in each round
        lowering.expansions[key] = (function(lowering, name, given, node, frame), given)
    return lowering.expansions[key][0].moved(lowering.origin(node, frame))


def _arguments(lowering: Context, node: ast.Call, frame: Frame) -> list[tuple[str, ast.Expr, str]]:
    """Parameter, argument and the argument's role, for each argument of a call; worked out once per call."""
    known = lowering.calls.get(id(node))
    if known is None:
        name = node.function.id
        signature = lowering.scope.called(name, frame.source)
        assert signature is not None
        given = bind(node, signature, frame.source)
        assert isinstance(given, dict)
        several = len(signature.parameters) > 1 and not signature.variadic
        known = lowering.calls[id(node)] = [
            (parameter, argument, f"the argument{f' `{parameter}`' if several else ''} of `{name}`")
            for parameter, argument in given.items()
        ]
    return known


def _expand(
    lowering: Context, declared: Declared, values: dict[str, Value], node: ast.Call, frame: Frame
) -> Call[Value]:
    definition = declared.statement
    assert isinstance(definition, ast.Definition)
    if declared is lowering.scope.definitions.get(definition.name.id):
        lowering.used.add(definition.name.id)
    places = lowering.spans(node, frame)
    for parameter in definition.parameters:
        if parameter.name.id not in values:
            assert parameter.default is not None
            value = yield lowering.lower(parameter.default, {}, Frame(declared.source, places))
            values[parameter.name.id] = value.moved(value.origin)
    if definition.name.id in OF_SUPPORT and declared.source is lowering.scope.prelude:
        note_elsewhere(lowering, definition.name.id, values, node, frame)
    ordered = [values[parameter.name.id] for parameter in definition.parameters]
    key = (declared, *map(key_of, ordered))
    if key not in lowering.expansions:
        text = f"{definition.name.id}({', '.join(map(lowering.text, ordered))})"
        inside = Frame(declared.source, places, text, definition.body, frame.where)
        expanded: Value = yield lowering.lower(definition.body, values, inside)
        lowering.expansions[key] = (expanded, ordered)
    return lowering.expansions[key][0].moved(places[0])
