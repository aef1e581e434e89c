"""Inputs that other tools drop, misread or crash on, and that are right here. Those that are mistakes are golden pairs:
golden/lang/errors/neighbour_*.spec."""

import math

import numpy as np
import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.learn.robustness import Robustness

from .worth import alike, worth

A, B = (0.25, 0.5, 0.0), (0.75, 0.125, 0.0)


def test_and_binds_tighter_than_or():
    """SpaTiaL gives both one precedence, so that the order of writing decides."""
    for formula in (
        "leftOf(a, b) | belowOf(a, b) & closeTo(a, b, 0)",
        "closeTo(a, b, 0) & belowOf(a, b) | leftOf(a, b)",
    ):
        assert worth(f"object a, b\ntask: {formula}", A, B) == max(0.5, min(-0.375, -0.625))
        words = formula.replace("|", "or").replace("&", "and")
        assert alike(f"object a, b\ntask: {formula}", f"object a, b\ntask: {words}")
    assert worth("object a, b\ntask: (leftOf(a, b) | belowOf(a, b)) & closeTo(a, b, 0)", A, B) == min(0.5, -0.625)


@pytest.mark.long
@pytest.mark.parametrize("depth", [10_000, 19_000])
def test_nested_parentheses(depth):
    """RTAMT and py-metric-temporal-logic end in RecursionError at 10,000."""
    assert alike("(" * depth + "leftOf(a, b)" + ")" * depth, "leftOf(a, b)")


@pytest.mark.parametrize("between", ["\n", "\n\n# a remark\n", "\t", "\r\n", "\u00a0", "  "])
def test_no_conjunct_is_dropped(between):
    """RTAMT drops what follows a character that it does not know."""
    text = f"leftOf(a, b){between}&{between}belowOf(a, b){between}&{between}closeTo(a, b, 0)"
    assert worth(text, A, B) == -0.625
    assert len(check_text(text).core.nodes[-1].args) == 3


def test_a_scene_with_a_number_missing_is_refused():
    """With NaN in a min the order of the conjuncts would decide."""
    phi = Robustness(check_text("leftOf(a, b) & aboveOf(a, b)").core)
    for value in (math.nan, math.inf):
        poses = torch.tensor(np.array([[A, (0.75, value, 0.0)]]))
        with pytest.raises(ValueError, match=r"(?i)nan|finite|infinit"):
            phi(poses)


def test_reversed_ends_that_are_meant():
    """A heading may run through zero: that is no reversed bound."""
    assert worth("angle(a, -10 deg, 20 deg)", (0.0, 0.0, math.radians(355))) == pytest.approx(math.radians(15))
