"""Weights, `[tray: 7, workspace: 3]`: how often each of several things is taken, compared with the others."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from scenegen.errors import Source, Span, SpecError
from scenegen.errors.declarations import WRONG_WEIGHT
from scenegen.geometry.primitives import BARE
from scenegen.lang.check.values import CallFrame
from scenegen.lang.spec import Count
from scenegen.lang.syntax import ast

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering

LEAST_WEIGHT, MOST_WEIGHT = 1e-100, 1e100  # so that sums and shares of them are numbers
MAX_ROUND = 10_000  # scenes after which shares of numbers come round again: weights as whole numbers sum to no more


def weights_of(lowering: Lowering, written: ast.Weighted, source: Source) -> tuple[Fraction, ...]:
    """The weights, as the decimals that were written: numbers above 0 without a unit that can be compared with
    one another. Raises SpecError."""
    found = []
    for expr in written.weights:
        frame = CallFrame(source)
        amount = lowering.constant(lowering.evaluate(expr, frame), expr, frame, "a weight", BARE)
        if not LEAST_WEIGHT <= amount <= MOST_WEIGHT:
            facts = {"low": LEAST_WEIGHT, "high": MOST_WEIGHT} if 0.0 < amount < math.inf else {}
            raise SpecError(WRONG_WEIGHT(expr.span(source), weight=amount, **facts))
        found.append(Fraction(repr(amount)))
    return tuple(found)


def whole_weights(weights: Sequence[Fraction]) -> tuple[int, ...]:
    """The smallest whole numbers that stand in the same proportion: (7, 3) of (0.7, 0.3)."""
    scale = math.lcm(*(one.denominator for one in weights))
    numbers = [int(one * scale) for one in weights]
    common = math.gcd(*numbers)
    return tuple(one // common for one in numbers)


def refuse_fine_weights(counts: Iterable[Count], here: Span) -> None:
    """Raises SpecError where the shares of all combinations of numbers come round again after too many scenes."""
    scenes = math.prod(sum(one.weights) or len(one.numbers) for one in counts)
    if scenes > MAX_ROUND:
        raise SpecError(WRONG_WEIGHT(here, rounds=scenes, limit=MAX_ROUND))
