"""Rounds that a template makes, and rounds that a harder one stands for, mean what rounds expanded one by one mean."""

import time

import pytest

from scenegen.lang.check import quantifiers, template
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import phi

from .worth import problems, scenes

ALIKE = [
    "object b[9], lid\ntask: forall p, q in b: clearOf(p, q, 2 cm) & closeTo(p, lid, 0.3)",
    "object b[9], lid\ndef f(p, q, e) = closeTo(p, q, e) | !leftOf(p, lid)\n"
    "task: forall p in b: exists q in b: f(p, lid, 0.1) -> f(q, lid, 0.2) | mirrored(p, lid)",
    "object b[9]\ntask: forall i in 1..8: leftOf(b[i], b[i + 1]) & x(b[1]) <= i * 1 cm",
    "def g(a, i) = leftOf(a, plate)\ntask: exists i in 1..9: g(mug, i) & x(mug) <= i * 1 cm - 5 * 1 cm",
    "task: forall i, j in 1..9: x(a) * (i - 3) <= x(b) / j + j * 1 cm",
    "task: forall i in 1..9: forall j in i..9: x(a) <= (i * j - 6) * 1 cm",
    "task: forall i in 1..9: exists j in 1..9: x(a) / (i + j) <= y(a) * (i - j)",
    "object o[8], p[7]\nrequire noOverlap()\n"
    "task: ordered(o) & evenlySpaced(p) & insideWorkspace(p) & forall a in o: exists b in p: facing(a, b)",
    "object o[9]\ntask: !(forall p in o: forall q in o: x(p) <= x(q) + 1 cm)",
    "object o[3] at [(0.1, 0.5), (0.2, 0.5), (0.3, 0.5)], m[9]\n"
    "task: forall p in objects: exists q in m: closeTo(p, q, 0.1) | true & leftOf(p, q)",
    "object fork[6], mug[6], cup[3]\ntask: noOverlap() & forall p, q in consecutive(objects): partlyLeftOf(p, q)",
    f"object {'a' * 70}[5], b\ntask: forall p, q in {'a' * 70}: x(p) + x(q) <= x(b)",
]
WRONG = [
    ("task: forall i in 1..99: theta(a) <= i", "7 radians are more than a turn"),
    ("task: forall i in -50..50: x(a) / i <= 1 cm", "division by zero"),
    ("object o[50]\ntask: forall i in 1..50: leftOf(o[i], o[i + 1])", "there is no element 51 of 50"),
    ("object o[30]\ntask: forall p in o: exists q in o: gap(p, q) >= 0", "`gap` of a thing and itself"),
    ("task: forall i in 1..400: x(a) * 10 * i <= 1e305 * 10 * i", "this number is too large"),
]


def both(text, monkeypatch, name, one, other):
    found = []
    for value in (one, other):
        monkeypatch.setattr(quantifiers, name, value)
        found.append(check_text(text))
    return found


@pytest.mark.parametrize("text", ALIKE)
def test_a_template_makes_the_same_core(text, monkeypatch):
    made = []
    make = template.Template.make
    monkeypatch.setattr(template.Template, "make", lambda *given: made.append(make(*given)) or made[-1])
    quick, slow = both(text, monkeypatch, "FEW", 1, 1 << 60)
    assert (quick.core, quick.source, quick.warnings) == (slow.core, slow.source, slow.warnings)
    assert any(one is not None for one in made) or "b[i]" in text or "a" * 70 in text


@pytest.mark.parametrize(("text", "title"), WRONG)
def test_what_is_wrong_in_some_round_is_found(text, title, monkeypatch):
    assert problems(text) == [title]
    monkeypatch.setattr(quantifiers, "FEW", 1)
    assert problems(text) == [title]


FOLDED = [
    ("forall i in 1..300: x(a) <= x(b) + i * 1 cm", 1),
    ("exists i in 1..300: x(a) <= x(b) + i * 1 cm", 1),
    ("!(forall i in -150..150: 3 * x(a) >= (x(b) - i * 1 cm) * -2)", 1),
    ("forall i in 1..300: x(a) <= x(b) + i * 1 cm & dist(a, b) >= i * 1 mm - 1 m", 2),
    ("forall i, j in 1..30: i * 1 mm - j * 1 cm <= min(y(a), y(b) + 0.1)", 1),
    ("forall i in 1..300: abs(x(a) - i * 1 mm) <= 1 m", 300),  # neither grows nor falls
    ("forall i in 1..300: x(a) * i <= 1 m", 300),
]


@pytest.mark.parametrize(("formula", "atoms"), FOLDED)
def test_the_hardest_round_stands_for_all(formula, atoms, monkeypatch):
    few, many = both(f"task: {formula}", monkeypatch, "MANY", 256, 1 << 60)
    assert sum(isinstance(node, Atom) for node in few.core.nodes) == atoms
    for rows in scenes(few):
        assert phi(few.core, rows) == phi(many.core, rows)


def test_rounds_that_are_not_made_cost_nothing(monkeypatch):
    monkeypatch.setattr(quantifiers, "MAX_MADE", 1_000)
    assert problems("def f(i) = closeTo(a, b, i * 1 cm) & x(a) <= i * 1 mm\ntask: forall i in 1..300: f(i)") == []


def test_the_text_says_how_many_rounds_it_stands_for():
    spec = check_text("task: forall i in 1..99999: x(a) <= x(b) + i * 1 cm")
    (atom,) = (node for node in spec.core.nodes if isinstance(node, Atom))
    assert atom.text == "x(a) <= x(b) + 0.01 (the tightest of 99,999)"


@pytest.mark.long
@pytest.mark.parametrize(
    "text",
    [
        "task: forall i in 1..199999: x(a) <= x(b) + i * 1 cm",
        "task: forall i in 1..199999: x(a) <= x(b) + i * 1 cm & y(a) + i",
        "def f(a, i) = closeTo(a, b, i * 1 cm) & x(a) >= -i * 1 mm\ntask: forall i in 1..99999: f(a, i) | f(c, i)",
        "task: forall i in 1..100: exists j in 1..100: x(a) <= x(b) + i * 1 cm - j * 1 mm",
        "object o[100]\ntask: forall p, q in o: x(p) <= x(q) + 1 cm",
        "".join(f"def g{n}(p, k) = g{n - 1}(p, 2 * k) & g{n - 1}(p, 2 * k + 1)\n" for n in range(1, 40))
        + "def g0(p, k) = x(p) <= k * 1 cm\ntask: g39(a, 1)",
    ],
)
def test_small_texts_with_many_rounds(text, monkeypatch):
    """Two hundred thousand rounds in five seconds, so these here in less than one."""
    from scenegen.lang.check import expressions

    monkeypatch.setattr(expressions, "MAX_INSIDE", 10_000)
    began = time.process_time()
    problems(text)
    assert time.process_time() - began < 6.0
