"""Where expansion is, and whom to tell when something is wrong there."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from scenegen.errors import Kind, Source, Span, SpecError
from scenegen.lang import ast
from scenegen.lang.values import Value

MOST_CALLS = 32  # how far outwards the blame goes: definitions may call each other thousands deep
MOST_VARIABLES = 4  # how many variables of quantifiers a note names


@dataclasses.dataclass(frozen=True, slots=True)
class Frame:
    """The source of the text at hand, and the calls that led here, innermost first.

    `text` is the call being expanded, `body` the definition's formula; both are unset outside definitions. `where`
    says what the variables of quantifiers stand for, innermost last; `rounds` is how often the quantifiers around, in
    the same formula, come by here.
    """

    source: Source
    calls: tuple[Span, ...] = ()
    text: str = ""
    body: ast.Expr | None = None
    where: tuple[Mapping[str, Value], ...] = ()
    rounds: int = 1


def spans(node: ast.Node, frame: Frame, prelude: Source) -> tuple[Span, ...]:
    """The user's places for a node, innermost first: the prelude's own lines are of no help to anybody."""
    places = (node.span(frame.source), *frame.calls)
    own = tuple(span for span in places if span.source is not prelude)
    return (own or places)[:MOST_CALLS]


def origin(node: ast.Node, frame: Frame, prelude: Source) -> Span:
    """The user's innermost place for a node."""
    if frame.source is prelude and frame.calls:
        return frame.calls[0]
    return Span(frame.source, node.start, node.end)


def error(
    kind: Kind, node: ast.Node, frame: Frame, prelude: Source, where: Sequence[str], /, **facts: Any
) -> SpecError:
    """A mistake at a node, told at the user's own place, with the way that led there; `where` says what the variables
    of quantifiers stand for: "i = 6"."""
    places = spans(node, frame, prelude)
    called = places[1].place if len(places) > 1 else None
    shown = ", ".join(where[-MOST_VARIABLES:])
    return SpecError(kind(places[0], expansion=frame.text, where=shown, called=called, **facts))
