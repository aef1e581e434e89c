"""Constants: each has a value that no scene decides; those of the prelude only values that its relations can use."""

from __future__ import annotations

from scenegen.errors import Diagnostic, SpecError
from scenegen.errors.language import CONSTANT_FROM_SCENE, WRONG_OVERRIDE
from scenegen.lang import ast, traversal
from scenegen.lang.lower import Lowering
from scenegen.lang.print import print_expr
from scenegen.lang.provenance import Frame
from scenegen.lang.scope import Declared, Scope, prelude
from scenegen.lang.stage import Stage
from scenegen.lang.trampoline import run
from scenegen.lang.values import NumberValue, Value
from scenegen.primitives.units import ANGLE, BARE, LENGTH


def check_constants(scope: Scope, lowering: Lowering, stage: Stage) -> None:
    """Constants that no formula uses are checked all the same."""
    for declared in scope.constants.values():
        if declared.source is not scope.prelude and not stage.full:
            (expr,) = traversal.expressions(declared.statement)
            with stage:
                value = run(lowering.lower(expr, {}, Frame(declared.source)))
                if isinstance(value, NumberValue) and lowering.builder.value(value.node) is None:
                    here, formula = expr.span(declared.source), print_expr(expr)
                    raise SpecError(CONSTANT_FROM_SCENE(here, name=declared.name.id, formula=formula))
                stage.problems.extend(_bad_override(declared, value, lowering))


def _bad_override(declared: Declared, value: Value, lowering: Lowering) -> list[Diagnostic]:
    """A constant of the prelude may be given another value, but not one that turns its relations upside down."""
    name = declared.name.id
    standard = next(
        (one for one in prelude().statements if isinstance(one, ast.Constant) and one.name.id == name), None
    )
    if standard is None or name in ("NORTH", "EAST", "SOUTH", "WEST"):
        return []
    wanted = BARE if name == "ANGLE_SCALE" else ANGLE if "ANGLE" in name else LENGTH
    (expr,) = traversal.expressions(declared.statement)
    here, usual = expr.span(declared.source), print_expr(standard.value)
    if not isinstance(value, NumberValue) or value.unit not in (BARE, wanted):
        what = value.unit.words if isinstance(value, NumberValue) else value.kind
        return [WRONG_OVERRIDE(here, name=name, wanted=wanted.words, found=what, usual=usual)]
    amount = lowering.builder.value(value.node)
    if amount is not None and (amount < 0.0 or (amount == 0.0 and name == "ANGLE_SCALE")):
        return [WRONG_OVERRIDE(here, name=name, wanted="positive", usual=usual)]
    return []
