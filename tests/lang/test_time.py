"""Texts that are made to take long are refused, or checked in time that grows with their length (processor time). Each
of these once took minutes, or would have."""

import time

import pytest

from scenegen.errors import Source, SpecError
from scenegen.lang.check import lowering
from scenegen.lang.checker import check_text
from scenegen.lang.syntax.parse import parse_tolerant

LONG = "a" * 100_000
DIGITS = "1" * 100_000
MANY = 1000
THINGS = "object " + ", ".join(f"thing{k}" for k in range(MANY)) + "\n"

RUNS = {
    "a name before a colon": f"f({LONG}) : b",
    "a name before a bracket": f"leftOf({LONG}) (b",
    "a name before the end": f"leftOf({LONG}!",
    "a name before a number": f"leftOf({LONG} 1",
    "blanks before a colon": f"object a{' ' * 100_000}) : b",
    "lines before a colon": "a," + "\n" * 100_000 + ") : b",
    "digits before a dot": f"x(a) <= {DIGITS}.",
    "digits before digits": f"x(a) <= {DIGITS} {DIGITS}",
    "a name before `=`": f"{LONG}(a{' ' * 1000}) = b",
    "objects before a bracket": "object a[1]" + " " * 100_000 + "[2]",
}

OTHERS = {
    "many unknown names": THINGS + "".join(f"l{k}: leftOf(thin{k}x, thing1)\n" for k in range(MANY)),
    "many unknown names in one formula": THINGS + "l: " + " & ".join(f"leftOf(thin{k}x, a)" for k in range(MANY)),
    "many unknown relations": "".join(f"def fun{k}(a) = leftOf(a, b)\nl{k}: funn{k}x(b)\n" for k in range(MANY)),
    "many wrong kinds": "".join(f"const C{k} = 1\nl{k}: x(a) <= CC{k}x\n" for k in range(MANY)),
    "elements of a long array": f"object o[{MANY}]\n"
    + "".join(f"l{k}: leftOf(o[{k + 1}], o[{k + 2}])\n" for k in range(MANY - 2)),
    "neighbours of a long array": f"object o[{MANY}]\nl: forall i in 1..{MANY - 1}: leftOf(o[i], o[i + 1])",
    "gaps of a long array": f"object o[{MANY}]\nl: evenlySpaced(o)",
    "one list in many calls": f"const L = [{'(0, 0), ' * MANY}(1, 1)]"
    f" def f(l, i) = closeTo(m, l[i]) l: forall i in 1..{MANY}: f(L, i)",
    "quantifiers inside each other": "object o[2]\nl: "
    + "".join(f"forall p{k} in o: " for k in range(9000))
    + "leftOf(p0, p1)",
    "rounds of rounds": "l: forall i in 1..10000: forall j in 1..10000: x(m) <= i * j",
    "pairs of thousands": f"object o[{MANY}]\nrequire noOverlap()\nl: leftOf(o[1], o[2])",
    "parameters": f"def f({', '.join(f'p{k}' for k in range(10_000))}) = leftOf(p0, p1)\n"
    f"l: f({', '.join('m' * 10_000)})",
    "definitions": "".join(f"def f{k}(a) = leftOf(a, b)\n" for k in range(MANY)) + "l: f0(a)",
}


@pytest.mark.long
@pytest.mark.parametrize("name", [*RUNS, *OTHERS])
def test_in_good_time(name):
    text = RUNS.get(name) or OTHERS[name]
    began = time.process_time()
    try:
        check_text(text)
    except SpecError as refused:
        assert all(one.title for one in refused.diagnostics)
    if name in RUNS:
        parse_tolerant(Source("a.spec", text))
    assert time.process_time() - began < 10.0


NESTED = "".join(f"forall p{k} in [m]: " for k in range(101))
PARAMETERS = ", ".join(f"p{k}" for k in range(101))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            f"l: forall i in 1..200: closeTo(m, [{'(0, 0), ' * 400}(1, 1)][i], i)",
            "takes more than 6[0-9],[0-9]+ steps to expand",
        ),
        ("l: forall i in 1..300000: x(m) <= i", "quantifiers take more than 200,000 rounds in all"),
        ("object o[20001]\nl: leftOf(o[1], o[2])", "more than 20,000 objects"),
        (f"l: {NESTED}leftOf(p0, p1)", "more than 100 quantifiers stand inside each other"),
        (f"def f({PARAMETERS}) = leftOf(p0, p1)\nl: leftOf(a, b)", "`f` has more than 100 parameters"),
    ],
)
def test_a_spec_that_is_too_large_is_told_so(text, said, monkeypatch):
    monkeypatch.setattr(lowering, "MAX_INSIDE", 50_000)
    with pytest.raises(SpecError, match=said):
        check_text(text)
