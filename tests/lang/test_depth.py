"""Formulas that are very deep, very long or very large: all the way through, or refused; never a RecursionError."""

import functools
import time

import pytest
import torch

from scenegen.errors import Source, SpecError, render
from scenegen.lang.checker import check_text
from scenegen.lang.formula import builder
from scenegen.lang.formula.interpret import phi
from scenegen.lang.syntax import parse
from scenegen.lang.syntax.parse import MOST_ERRORS
from scenegen.learn.robustness import Robustness

N = 10_000
FEW = 1_200  # Python's recursion ends at 1,000
BAR = 4.0 * 5.0  # seconds: the bar, and room for a busy machine


def through(n):
    """name -> formula of depth, length or size n; all in range of the limits for n = N."""
    return {
        "parentheses": "(" * n + "leftOf(a, b)" + ")" * n,
        "parentheses around a number": "(" * n + "x(a)" + ")" * n + " <= 1",
        "negations": "!" * n + "leftOf(a, b)",
        "an odd number of negations": "not " * (n + 1) + "leftOf(a, b)",
        "one atom often": " & ".join(["leftOf(a, b)"] * n),
        "flat conjunction": " & ".join(f"leftOf(o{i}, o{i + 1})" for i in range(n)),
        "one tolerance each": " & ".join(f"closeTo(a, b, {i + 1} mm)" for i in range(n)),
        "sum, nested to the left": "(" * n + "x(a)" + " + y(b))" * n + " <= 1",
        "difference, nested to the right": "(x(a) - " * n + "y(b)" + ")" * n + " <= 1",
        "unary minus": "-" * n + "x(a) <= 1",
        "calls": "abs(" * (n - 2) + "x(a)" + ")" * (n - 2) + " <= 1",
        "and and or in turn": "(leftOf(a, b) | (leftOf(b, c) & " * (n // 2) + "leftOf(c, a)" + "))" * (n // 2),
        "implications to the left": "(" * n + "leftOf(a, b)" + " -> leftOf(b, c))" * n,
        "a long comparison": " <= ".join(f"x(o{i})" for i in range(n)),
    }


THROUGH = through(1)
SIZES = [FEW, pytest.param(N, marks=pytest.mark.slow)]

REFUSED = {
    "calls": "abs(" * N + "x(a)" + ")" * N + " <= 1",
    "negated conjunctions": "!(leftOf(a, b) & " * N + "leftOf(c, a)" + ")" * N,
    "too many negations": "!" * 20_001 + "leftOf(a, b)",
    "lists": "[" * N + "a" + "]" * N,
    "indices": "a" + "[1]" * N,
    "members": "a" + ".b" * N,
    "quantifiers": "forall p in a: " * N + "p",
    "brackets that never close": "(" * N,
    "brackets that were never opened": "a" + ")" * N,
    "a missing operator": "(" * N + "a b" + ")" * N,
}


@functools.cache
def checked(name, n=FEW):
    return check_text(through(n)[name])


@pytest.mark.long
@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("name", THROUGH)
def test_all_the_way_through(name, n):
    began = time.process_time()
    spec = checked(name, n)
    generator = torch.Generator().manual_seed(0)
    poses = torch.rand(1, len(spec.objects), 3, dtype=torch.float64, generator=generator)
    value = Robustness(spec.core)(poses)
    assert time.process_time() - began < BAR
    expected = phi(spec.core, poses.reshape(-1).tolist())["task"]
    assert value.shape == (1, 1) and float(value) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.long
def test_what_the_deep_ones_are_worth():
    def worth(name, *poses):
        spec = checked(name)
        rows = dict(zip(spec.objects, poses, strict=True))
        return phi(spec.core, [value for one in spec.objects for value in rows[one]])["task"]

    a, b = (0.25, 0.5, 0.0), (0.75, 0.125, 0.0)
    assert worth("parentheses", a, b) == worth("negations", a, b) == worth("one atom often", a, b) == 0.5
    assert worth("an odd number of negations", a, b) == -0.5
    assert worth("sum, nested to the left", a, b) == 1 - (0.25 + FEW * 0.125)
    assert worth("difference, nested to the right", a, b) == 1 - 0.125  # x - (x - (... - y)), FEW even
    assert worth("unary minus", a) == 1 - 0.25


@pytest.mark.long
@pytest.mark.parametrize("name", ["flat conjunction", "negations"])
def test_the_canonical_text_of_the_deep_means_the_same(name):
    spec = checked(name)
    again = check_text(spec.source)
    assert again.source == spec.source and len(again.core.nodes) == len(spec.core.nodes)


@pytest.mark.long
@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_a_diagnostic(name):
    began = time.process_time()
    with pytest.raises(SpecError) as refused:
        check_text(REFUSED[name])
    assert time.process_time() - began < BAR
    problem = refused.value.diagnostics[0]
    assert problem.title and problem.span is not None
    assert len(refused.value.diagnostics) <= MOST_ERRORS
    assert len(render(problem)) < 1000, "however long the line, the message is short"


@pytest.mark.long
def test_the_nesting_limit_is_said(golden):
    with pytest.raises(SpecError) as refused:
        check_text("!" * (parse.MAX_NESTING + 1) + "leftOf(a, b)")
    golden("lang/too_deep.txt", f"{refused.value}\n")
    check_text("!" * (parse.MAX_NESTING - 3) + "leftOf(a, b)")


def test_too_many_characters(monkeypatch):
    monkeypatch.setattr(parse, "MAX_CHARACTERS", 30)
    check_text("leftOf(a, b)".ljust(30))
    with pytest.raises(SpecError, match=r"long.spec is too long: 31 characters; the limit is 30"):
        parse.parse(Source("long.spec", "leftOf(a, b)".ljust(31)))


def test_definitions_that_double_at_every_level(monkeypatch):
    monkeypatch.setattr(builder, "MAX_NODES", 5_000)
    steps = "".join(f"def f{i + 1}(a) = f{i}(a + {2**i}) & f{i}(a - {2**i})\n" for i in range(40))
    with pytest.raises(SpecError, match=r"expands to more than [\d,]+ parts"):
        check_text(f"def f0(a) = x(m) <= a\n{steps}task: f40(0)")


@pytest.mark.long
def test_definitions_that_call_each_other_a_thousand_deep():
    steps = "".join(f"def f{i + 1}(a) = f{i}(a) | closeTo(a, b, {i + 1} mm)\n" for i in range(1000))
    spec = check_text(f"def f0(a) = leftOf(a, b)\n{steps}task: f1000(m)")
    # b is named first; x(b) - x(m) = -0.5, and closeTo is worth most at 1000 mm: 1 - 0.5
    assert phi(spec.core, [0.0, 0.0, 0.0, 0.5, 0.0, 0.0])["task"] == 0.5
