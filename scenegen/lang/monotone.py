"""Margins of a template that grow or fall with one constant: the same expression in every round, but for that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Apply
from scenegen.lang.template import Template
from scenegen.primitives import NUMPY, PRIMITIVES

_EXACT = ("add", "sub", "mul", "div", "neg", "abs", "min", "max")  # rounded alike by every evaluator


@dataclass(frozen=True, slots=True)
class Chain:
    """The constant of a template that a number depends on alone, and whether it grows with it or falls."""

    constant: int
    grows: bool


def chain(template: Template, margin: int) -> Chain | None:
    """How a number hangs on the constants that differ from round to round, where it is one, in one place, and every
    step from there to the number is monotone; rounded, it then is, too."""
    grows = True
    index = margin
    while index not in template.constant:
        node = template.own.get(index)
        if not isinstance(node, Apply):
            return None
        mine = [place for place, arg in enumerate(node.args) if arg in template.own]
        if len(mine) != 1:
            return None
        (place,) = mine
        match node.primitive:
            case "add" | "min" | "max" | "sum" | "mean":
                pass
            case "sub":
                grows ^= place == 1
            case "neg":
                grows = not grows
            case "mul" | "div":
                factor = template.below.value(node.args[1 - place])
                if factor is None or (node.primitive == "div" and place == 1):
                    return None
                grows ^= factor < 0.0
            case _:
                return None
        index = node.args[place]
    return Chain(index, grows)


def evaluate(template: Template, constant: int, given: npt.NDArray[np.float64]) -> Any:
    """A constant of a template in every round, (K,); `given` is (variables, K)."""
    values: dict[int, Any] = dict(zip(template.given, given, strict=True))
    for slot, kind, *rest in template.steps:
        if kind == "constant":
            primitive, args, _ = rest
            numbers = [values[arg] if arg in values else template.below.value(arg) for arg in args]
            values[slot] = PRIMITIVES[primitive].evaluate(NUMPY, *numbers) if primitive in _EXACT else np.nan
    return values[constant]
