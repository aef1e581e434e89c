"""Which relations become predicates: those of the prelude and of the spec, those of a map, and calls in a goal."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.lang import ast
from scenegen.lang.lower import Lowering
from scenegen.lang.print import print_expr
from scenegen.lang.scope import Declared, Scope, signature_of
from scenegen.lang.values import FormulaValue, NumberValue, ObjectValue, RegionValue, Value
from scenegen.pddl.tables import relation as meaning
from scenegen.primitives.units import ANGLE, LENGTH

THING, PLACE = "thing", "region"
MOST_ARGUMENTS = 3  # of relations that are asked for by name
OVER_PLACES = ("on", "inside", "restsOn", "insideOf")  # their second argument is a region, too, by default
LONGEST = 100  # characters of a definition in a comment


@dataclass(frozen=True, slots=True)
class Relation:
    """A formula over `_slot0`, `_slot1`, ...: things and regions by `kinds`, then numbers, which `numbers` holds.
    `required`: some call of it has to mean something."""

    name: str
    text: str
    kinds: tuple[str, ...]
    comment: str = ""
    numbers: Mapping[str, Value] = field(default_factory=dict)
    required: bool = False


def chosen(scope: Scope, wanted: Sequence[str] | None, own: Mapping[str, str] | None) -> tuple[Relation, ...]:
    """The relations whose facts are written. Raises RequestError for an unknown name."""
    if own is not None:
        known = [name for name, written in own.items() if _formula(written)]
        _refuse_unknown(wanted, known)
        return tuple(one for name in known if wanted is None or name in wanted for one in _of_map(name, own[name]))
    known = [name for name, one in scope.definitions.items() if _needed(one) <= MOST_ARGUMENTS]
    _refuse_unknown(wanted, known)
    if wanted is None:
        wanted = [name for name in known if 1 <= _needed(scope.definitions[name]) <= 2]
        wanted.sort(key=lambda name: scope.definitions[name].source is scope.prelude)
    found: list[Relation] = []
    for name in dict.fromkeys(wanted):
        declared = scope.definitions[name]
        needed, comment = _needed(declared), _comment(declared, scope)
        found.append(Relation(name, _call(name, needed), (THING,) * needed, comment))
        if name in OVER_PLACES and declared.source is scope.prelude:
            found.append(Relation(name, _call(name, 2), (THING, PLACE), comment))
    return tuple(found)


def _refuse_unknown(wanted: Sequence[str] | None, known: Sequence[str]) -> None:
    for name in wanted or ():
        if name not in known:
            raise RequestError(UNKNOWN_CHOICE(what="relation", name=name, known=known))


def _needed(declared: Declared) -> int:
    assert isinstance(declared.statement, ast.Definition)
    return signature_of(declared.statement).needed


def _call(name: str, count: int) -> str:
    return f"{name}({', '.join(f'_slot{place}' for place in range(count))})"


def _comment(declared: Declared, scope: Scope) -> str:
    """The comment above a definition of the prelude; of another one what it says."""
    assert isinstance(declared.statement, ast.Definition)
    if declared.source is scope.prelude:
        above = declared.source.text[: declared.statement.start].rstrip().splitlines()
        lines: list[str] = []
        while above and above[-1].startswith("# "):
            lines.insert(0, above.pop()[2:])
        return " ".join(lines)
    text = print_expr(declared.statement.body)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _formula(written: str) -> str:
    """The formula of a map's predicate; empty where it has no geometry."""
    found = meaning(written)
    return {"on": "restsOn($1, $2)", "in": "insideOf($1, $2)"}.get(found.holds, found.formula)


def _of_map(name: str, written: str) -> Iterator[Relation]:
    text = _formula(written)
    count = max((int(one) for one in re.findall(r"\$(\d)", text)), default=0)
    text = re.sub(r"\$(\d)", lambda one: f"_slot{int(one[1]) - 1}", text)
    required = not meaning(written).holds
    yield Relation(name, text, (THING,) * count, written, required=required)
    if count == 2:
        yield Relation(name, text, (THING, PLACE), written)


def of_calls(
    lowering: Lowering, node: Callable[[str, Mapping[str, Value]], int | None]
) -> dict[int, tuple[Relation, tuple[str, ...]]]:
    """The calls of definitions that were expanded so far and whose arguments are things, regions and fixed numbers: the
    node of each, with its relation and the names of its things and regions. Numbers are part of a predicate's name:
    `closeTo-30cm`. Where several calls share a node, the outermost one counts."""
    found: dict[int, tuple[Relation, tuple[str, ...]]] = {}
    made: dict[tuple[str, tuple[str, ...]], Relation] = {}
    for key, (value, given) in list(lowering.expansions.items()):
        declared = key[0] if isinstance(key, tuple) else None
        if not isinstance(declared, Declared) or not isinstance(value, FormulaValue) or value.node < 0:
            continue
        assert isinstance(declared.statement, ast.Definition)
        name = declared.statement.name.id
        if declared is not lowering.scope.definitions.get(name):
            continue  # the prelude's own of a name that the spec gave another meaning
        arguments = [_name(lowering, one) for one in given]
        texts = [_number(lowering, one) for one in given]
        count = next((place for place, one in enumerate(arguments) if not one), len(given))
        if not count or any(not one for one in texts[count:]):
            continue
        needed = _needed(declared)
        env = {f"_slot{place}": one for place, one in enumerate(given)}
        last = next(
            (last for last in range(max(count, needed), len(given)) if node(_call(name, last), env) == value.node),
            len(given),
        )  # numbers that are the default are left out
        kinds = tuple(THING if isinstance(one, ObjectValue) else PLACE for one in given[:count])
        title = "-".join((name, *texts[count:last]))
        if (title, kinds) not in made:
            numbers = {f"_slot{place}": given[place] for place in range(count, last)}
            comment = f"{name}({', '.join(['...'] * count + texts[count:last])})" if texts[count:last] else ""
            comment = comment or _comment(declared, lowering.scope)
            made[title, kinds] = Relation(title, _call(name, last), kinds, comment, numbers)
        found[value.node] = made[title, kinds], tuple(arguments[:count])
    return found


def _name(lowering: Lowering, value: Value) -> str:
    if isinstance(value, ObjectValue):
        return lowering.builder.objects[value.index]
    return value.name if isinstance(value, RegionValue) else ""


def _number(lowering: Lowering, value: Value) -> str:
    """A fixed number as a part of a name; empty for what is none."""
    amount = lowering.builder.value(value.node) if isinstance(value, NumberValue) else None
    if amount is None:
        return ""
    assert isinstance(value, NumberValue)
    scale, unit = {LENGTH: (100.0, "cm"), ANGLE: (180.0 / math.pi, "deg")}.get(value.unit, (1.0, ""))
    said = f"{amount * scale:.6g}{unit}".replace("+", "")
    return f"minus{said[1:]}" if said.startswith("-") else said
