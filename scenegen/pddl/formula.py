"""Formulas over facts, as planners read them: literals joined by `and` and `or`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal as OneOf

import numpy as np
import numpy.typing as npt

Truths = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Literal:
    """A fact by its number, or that it is not there."""

    fact: int
    holds: bool = True


@dataclass(frozen=True, slots=True)
class Joined:
    """Conjunction or disjunction; of nothing it is true, or false."""

    kind: OneOf["and", "or"]
    parts: tuple[Formula, ...]


Formula = Literal | Joined

TRUE = Joined("and", ())


def value(formula: Formula, truths: Truths) -> Truths:
    """Whether it holds in each of n scenes, (n,), where facts hold as in `truths` (F, n)."""
    if isinstance(formula, Literal):
        found: Truths = truths[formula.fact]
        return found if formula.holds else ~found
    start = np.full(truths.shape[1], formula.kind == "and")
    for part in formula.parts:
        found = value(part, truths)
        start = start & found if formula.kind == "and" else start | found
    return start


def asked_for(formula: Formula, truths: Truths) -> Formula:
    """What a formula asks for, as it is in one scene (`truths` (F, 1)): a conjunction of literals that hold there. Of a
    disjunction these are the parts that hold. Where the formula does not hold, what it asks for and the scene has."""
    kept: dict[Literal, None] = {}
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        if isinstance(one, Joined):
            stack += [part for part in reversed(one.parts) if one.kind == "and" or value(part, truths)[0]]
        elif truths[one.fact, 0] == one.holds:
            kept[one] = None
    return Joined("and", tuple(kept))


def facts_of(formula: Formula) -> tuple[int, ...]:
    """The facts that a formula mentions, in its order."""
    found: dict[int, None] = {}
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        if isinstance(one, Joined):
            stack += reversed(one.parts)
        else:
            found[one.fact] = None
    return tuple(found)


def text(formula: Formula, fact: Callable[[int], str], indent: int = 4) -> str:
    """The formula as PDDL; `fact` writes a fact. Long ones stand on several lines."""
    if isinstance(formula, Literal):
        said = fact(formula.fact)
        return said if formula.holds else f"(not {said})"
    parts = [text(part, fact, indent + 2) for part in formula.parts]
    return _joined(formula.kind, parts, indent)


def _joined(kind: str, parts: Sequence[str], indent: int) -> str:
    line = f"({kind} {' '.join(parts)})" if parts else f"({kind})"
    if len(line) <= 100 and "\n" not in line:
        return line
    inner = f"\n{' ' * indent}".join(parts)
    return f"({kind}\n{' ' * indent}{inner})"
