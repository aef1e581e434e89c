"""Formulas that repeat share a line, which says what they have in common, and nothing that holds for some only."""

import pytest

from scenegen.api.outline import FormulaTree, Outline
from scenegen.api.spec import parse

CASES = {
    "pairs of an array": (
        "object block[16]\nrequire noOverlap()\ntask: leftOf(block[1], block[2])",
        "require",
        ["120 x gap(block[i], block[j]) >= 0 | gap(block[i], block[j])"],
    ),
    "neighbours": (
        "object block[7]\ntask: forall p, q in consecutive(block): leftOf(p, q)",
        "task",
        ["6 x leftOf(block[i], block[i+1]) | x(block[i+1]) - x(block[i])"],
    ),
    "objects with names of their own": (
        "object cup, mug, plate, fork\ntask: forall a, b in objects: farFrom(a, b, 10 cm)",
        "task",
        ["6 x farFrom(p, q, 0.1) | dist(p, q) - 0.1"],
    ),
    "a variable is no object": (
        "object p, mug, plate, i[3]\ntask: (forall a in [p, mug, plate]: x(a) <= 0.5) & (forall a in i: x(a) <= 0.5)",
        "task",
        [
            "all of: forall a in [p, mug, plate] | ",
            "  3 x x(q) <= 0.5 | 0.5 - x(q)",
            "all of: forall a in i | ",
            "  3 x x(i[j]) <= 0.5 | 0.5 - x(i[j])",
        ],
    ),
    "numbers": (
        "object pawn[8]\ntask: forall k in 1..8: x(pawn[k]) <= k * 10 cm",
        "task",
        ["8 x x(pawn[i]) <= 0.1..0.8 | 0.1..0.8 - x(pawn[i])"],
    ),
    "formulas in formulas": (
        "object a[4], b[4]\ntask: forall k in 1..4: leftOf(a[k], b[k]) | aboveOf(b[k], a[k])",
        "task",
        [
            "4 x one of | ",
            "  leftOf(a[i], b[i]) | x(b[i]) - x(a[i])",
            "  aboveOf(b[i], a[i]) | y(b[i]) - y(a[i])",
        ],
    ),
    "as many as there are left": (
        "object a[4]\ntask: forall k in 1..3: forall m in 1..4: x(a[k]) + y(a[m]) <= k",
        "task",
        ["3 x all of: forall m in 1..4 | ", "  4 x x(a[i]) + y(a[j]) <= 1..3 | 1..3 - (x(a[i]) + y(a[j]))"],
    ),
    "what was written by hand": (
        "object a, b, c, d\ntask: leftOf(a, b) & leftOf(b, c) & leftOf(c, d)",
        "task",
        ["leftOf(a, b) | x(b) - x(a)", "leftOf(b, c) | x(c) - x(b)", "leftOf(c, d) | x(d) - x(c)"],
    ),
    "two are shown as they are": (
        "object a[2]\ntask: forall p in a: x(p) <= 0.5",
        "task",
        ["x(a[1]) <= 0.5 | 0.5 - x(a[1])", "x(a[2]) <= 0.5 | 0.5 - x(a[2])"],
    ),
}


def _told(folded, part, depth=0):
    for child in folded.children(part):
        count = f"{child.count} x " if child.count else ""
        yield f"{'  ' * depth}{count}{child.line.text} | {child.line.margin}"
        yield from _told(folded, child, depth + 1)


@pytest.mark.parametrize("name", CASES)
def test_what_is_told(name):
    text, label, expected = CASES[name]
    folded = FormulaTree(Outline(parse(text)))
    told = list(_told(folded, folded.root(label)))
    assert [line for line in told if not line.startswith(("all of: noOverlap",))] == expected


def test_bounds_hold_for_all_of_them():
    outline = Outline(parse("object pawn[8]\ntask: forall k in 1..8: x(pawn[k]) <= k * 10 cm"))
    folded = FormulaTree(outline)
    (part,) = folded.children(folded.root("task"))
    assert (part.line.low, part.line.high) == pytest.approx((-0.9, 0.8)) and len(part.nodes) == 8


def test_unfolded_every_sub_formula_has_a_line():
    outline = Outline(parse(CASES["pairs of an array"][0]))
    folded = FormulaTree(outline, fold=False)
    found = folded.children(folded.root("require"))
    assert len(found) == 120 and all(len(part.nodes) == 1 and not part.count for part in found)


def test_definitions_used_twice_at_every_level_do_not_grow():
    """2^40 sub-formulas, if each were looked at as often as it is used."""
    text = ["object a[3]", "def f0(p) = leftOf(p, a[1]) & x(p) <= 0.3"]
    text += [f"def f{n}(p) = f{n - 1}(p) | f{n - 1}(p) & y(p) <= 0.{n}" for n in range(1, 13)]
    folded = FormulaTree(Outline(parse("\n".join([*text, "task: forall p in a: f12(p)"]))))
    level = [folded.root("task")]
    for _ in range(12):
        level = [child for part in level for child in folded.children(part)][:50]
        assert all(len(part.nodes) <= 3 for part in level)
