"""What is said to rest on, or to be inside, a thing that no declaration lets it stand on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from scenegen.errors import Span
from scenegen.errors.declarations import STANDS_ELSEWHERE
from scenegen.lang import ast
from scenegen.lang.choices import options_of
from scenegen.lang.provenance import Frame
from scenegen.lang.spec import Support
from scenegen.lang.template import FIRST
from scenegen.lang.values import ObjectValue, RegionValue, SurfaceValue, Value

if TYPE_CHECKING:
    from scenegen.lang.context import Context

OF_SUPPORT = ("restsOn", "insideOf")  # relations of the prelude: a on or in b


def note_elsewhere(lowering: Context, name: str, values: Mapping[str, Value], node: ast.Call, frame: Frame) -> None:
    """Notices a call of one of OF_SUPPORT that holds in no scene, since its first argument stands elsewhere. In
    rounds of quantifiers that is no mistake."""
    upper, lower = values["a"], values["b"]
    if frame.where or lowering.heights is None or not isinstance(upper, ObjectValue) or upper.index >= FIRST:
        return
    options = [*options_of(upper.index, lowering.supports, lowering.choices)]
    stands = [one.name for one in options] or ["workspace"]
    if name == "insideOf":  # what is in a bowl in a drawer is in the drawer
        for one in options:
            more = () if one.carrier is None else options_of(one.carrier, lowering.supports, lowering.choices)
            options.extend(other for other in more if other not in options)
    match lower:
        case ObjectValue(carrier) if carrier < FIRST:
            written, meant = lowering.builder.objects[carrier], any(one.carrier == carrier for one in options)
        case SurfaceValue():
            written = lowering.text(lower)
            meant = any(one.name == written for one in options)
        case RegionValue(written, area):
            levels = [_level(lowering, one) for one in options] or [0.0]
            meant = any(level is None or level == area.z for level in levels)
        case _:
            return
    if meant or (isinstance(lower, ObjectValue) and lower.index == upper.index):
        return
    called = lowering.builder.objects[upper.index]
    spans = lowering.spans(node, frame)
    plain = "[" not in called and called in lowering.scope.objects
    example = f"object {called} on any of [{', '.join((*stands, written))}]" if plain else None
    problem = STANDS_ELSEWHERE(
        spans[0],
        name=called,
        relation=name,
        lower=written,
        stands=["the table" if one == "workspace" else one for one in stands],
        example=example,
    )
    if problem not in lowering.noticed:
        lowering.noticed.append(problem)


def _level(lowering: Context, under: Support) -> float | None:
    assert lowering.heights is not None
    below = 0.0 if under.carrier is None else lowering.heights[under.carrier]
    return None if below is None else below + under.height


def meant(lowering: Context, here: Span) -> str | None:
    """What to do about a requirement at some part of the text that asks for such a thing; None where it does not."""
    for one in lowering.noticed:
        if one.kind is not STANDS_ELSEWHERE or one.span is None or one.facts["example"] is None:
            continue
        if one.span.source is here.source and here.start <= one.span.start and one.span.end <= here.end:
            return f"let it stand there: {one.facts['example']}"
    return None
