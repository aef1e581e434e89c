"""Quantifiers, lists and relations over lists are worth what they are worth written out by hand, everywhere. Rounds
that a harder one stands for mean what rounds expanded one by one mean.
"""

import time

import pytest

from scenegen.errors import SpecError
from scenegen.lang.check import quantifiers
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import phi

from .worth import alike, problems, scenes

BLOCKS = "object block[4], lid\n"
b1, b2, b3, b4 = (f"block[{i}]" for i in range(1, 5))
PAIRS = [(b1, b2), (b1, b3), (b1, b4), (b2, b3), (b2, b4), (b3, b4)]
TRIPLES = [(b1, b2, b3), (b1, b2, b4), (b1, b3, b4), (b2, b3, b4)]


def every(shape, of, sign=" & "):
    return sign.join(f"({shape.format(*one)})" for one in of)


WRITTEN_OUT = [
    ("forall i in 1..3: leftOf(block[i], block[i + 1])", every("leftOf({}, {})", [(b1, b2), (b2, b3), (b3, b4)])),
    (
        "exists i in 2..4: leftOf(block[i], block[i - 1])",
        every("leftOf({}, {})", [(b2, b1), (b3, b2), (b4, b3)], " | "),
    ),
    ("forall i in -1..1: x(lid) <= i + 2", "x(lid) <= 1 & x(lid) <= 2 & x(lid) <= 3"),
    ("forall i in 2..2: closeTo(block[i], lid, i)", "closeTo(block[2], lid, 2)"),
    ("forall i, j in 1..3: leftOf(block[i], block[j])", every("leftOf({}, {})", [(b1, b2), (b1, b3), (b2, b3)])),
    ("forall p in block: aboveOf(p, lid)", every("aboveOf({}, lid)", [(b1,), (b2,), (b3,), (b4,)])),
    ("exists p in block: on(lid, p)", every("on(lid, {})", [(b1,), (b2,), (b3,), (b4,)], " | ")),
    ("forall p, q in block: clearOf(p, q)", every("gap({}, {}) >= 0 m", PAIRS)),
    ("exists p, q in block: leftOf(p, q)", every("leftOf({}, {})", PAIRS, " | ")),
    ("forall p, q, r in block: between(p, q, r)", every("between({}, {}, {})", TRIPLES)),
    ("forall p, q in consecutive(block): leftOf(p, q)", every("leftOf({}, {})", [(b1, b2), (b2, b3), (b3, b4)])),
    (
        "exists p, q, r in consecutive(block): between(q, p, r)",
        every("between({1}, {0}, {2})", [(b1, b2, b3), (b2, b3, b4)], " | "),
    ),
    ("forall p in [lid, block[2]]: leftOf(p, (1, 0))", "leftOf(lid, (1, 0)) & leftOf(block[2], (1, 0))"),
    (
        "forall p in [lid, (0.5, 0.5), workspace]: farFrom(p, block[1])",
        every("farFrom({}, block[1])", [("lid",), ("(0.5, 0.5)",), ("workspace",)]),
    ),
    (
        "exists c in workspace.corners: closeTo(lid, c)",
        every("closeTo(lid, {})", [("(0, 0)",), ("(1, 0)",), ("(1, 1)",), ("(0, 1)",)], " | "),
    ),
    ("forall p in objects: x(p) <= 1", every("x({}) <= 1", [(b1,), (b2,), (b3,), (b4,), ("lid",)])),
    (
        "forall p in block: exists q in [lid, block[1]]: leftOf(p, q) | p1(p)",
        every("(leftOf({0}, lid) | p1({0})) | (leftOf({0}, block[1]) | p1({0}))", [(b1,), (b2,), (b3,), (b4,)]),
    ),
    (
        "forall i in 1..2: forall j in i..2: closeTo(block[i], block[j + 2], i + j)",
        every("closeTo({}, {}, {})", [(b1, b3, 2), (b1, b4, 3), (b2, b4, 4)]),
    ),
    ("!(forall p in block: leftOf(p, lid))", "exists p in block: !leftOf(p, lid)"),
    ("!(exists p, q in block: leftOf(p, q))", "forall p, q in block: !leftOf(p, q)"),
    (
        "(forall p in block: leftOf(p, lid)) -> leftOf(lid, block[1])",
        "(exists p in block: !leftOf(p, lid)) | leftOf(lid, block[1])",
    ),
    ("forall p in block: leftOf(p, lid) -> aboveOf(p, lid)", "forall p in block: (leftOf(p, lid) -> aboveOf(p, lid))"),
    ("noOverlap(block)", every("gap({}, {}) >= 0", PAIRS)),
    (
        "noOverlap([lid] + block)",
        every("gap({}, {}) >= 0", [("lid", b1), ("lid", b2), ("lid", b3), ("lid", b4), *PAIRS]),
    ),
    ("forall p in [lid] + [block[2]] + [block[1]]: x(p) <= 1", every("x({}) <= 1", [("lid",), (b2,), (b1,)])),
    ("insideWorkspace([lid])", "room(lid, workspace) >= 0"),
    ("ordered(block, EAST)", every("rightOf({}, {})", [(b2, b1), (b3, b2), (b4, b3)])),
    ("forall g in gaps(block): g >= 2 cm", every("gap({}, {}) >= 2 cm", [(b1, b2), (b2, b3), (b3, b4)])),
    ("max(gaps(block)) <= 0.2", every("gap({}, {}) <= 0.2", [(b1, b2), (b2, b3), (b3, b4)])),
]


@pytest.mark.parametrize(("short", "long"), WRITTEN_OUT)
def test_written_out_by_hand(short, long):
    head = f"{BLOCKS}def p1(p) = y(p) <= 0.5\n"
    assert alike(f"{head}task: {short}", f"{head}task: {long}")


def test_a_quantifier_in_a_definition_sees_its_parameters():
    text = "def row(items, e) = forall p, q in consecutive(items): closeTo(p, q, e)\n"
    near = every("closeTo({}, {}, 0.5)", [(b1, b2), (b2, b3), (b3, b4)])
    assert alike(
        f"{BLOCKS}{text}task: row(block, 0.5)",
        f"{BLOCKS}{text}task: {near}",
    )
    # the inner p is another p than the caller's
    twice = "def any(items, p) = exists q in items: leftOf(q, p)\n"
    assert alike(
        f"{BLOCKS}{twice}task: forall p in block: any([lid, p], (0.5, p1()))\ndef p1() = y(lid)",
        f"{BLOCKS}{twice}def p1() = y(lid)\n"
        "task: forall q in block: leftOf(lid, (0.5, y(lid))) | leftOf(q, (0.5, y(lid)))",
    )


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("forall i in 4..1: leftOf(block[i], lid)", "the range 4..1 is empty"),
        ("forall i in 1..4: leftOf(block[i], block[i + 1])", "there is no element 5 of 4"),
        ("forall i in 0..1: leftOf(block[i], lid)", "there is no element 0 of 4"),
        ("forall i in 1..2.5: leftOf(block[i], lid)", "an end of a range is a whole number"),
        ("forall i in 1..2 cm: leftOf(block[1], lid)", "an end of a range is a plain number, not a length"),
        ("forall i in 1..x(lid): leftOf(block[1], lid)", "an end of a range must be a constant"),
        ("forall p in lid: leftOf(p, lid)", "what `forall` ranges over must be a list, not an object"),
        ("forall p in []: leftOf(p, lid)", "this list is empty"),
        ("forall p, q in [lid]: leftOf(p, q)", "there are no 2 to choose from 1 element"),
        ("forall p in consecutive(block): leftOf(p, lid)", "neighbours come in twos or more"),
        ("forall p, p in block: leftOf(p, lid)", "`p` is named twice"),
        ("forall p in block: forall p in block: leftOf(p, lid)", "`p` would hide another `p`"),
        ("forall p in block: p", "the formula of `forall` must be a formula, not an object"),
        ("(forall p in block: leftOf(p, lid)) & leftOf(p, lid)", "unknown name `p`"),
        ("forall p in p: leftOf(p, lid)", "unknown name `p`"),
        ("forall objects in block: leftOf(lid, block[1])", "`objects` is built in"),
        ("block[1] & leftOf(lid, block[1])", "each side of `&` must be a formula, not an object"),
        ("lid[1] -> true", "`lid` is one object, not an array"),
        ("noOverlap(block + lid)", "`+` joins a list to another list, not to an object"),
        ("noOverlap(2 + block)", "`+` joins a list to another list, not to a number"),
        ("noOverlap(block - block)", "what `-` works on must be a number, not a list"),
        ("leftOf(block, lid)", "the argument `a` of `leftOf` must be an object, a point or a region, not a list"),
    ],
)
def test_what_makes_no_sense(formula, said):
    assert problems(f"{BLOCKS}task: {formula}") == [said]


SAME = [  # two ways to say one thing
    (
        "object o[3], mug\ntask: forall p in objects: p != mug -> gap(p, mug) >= 3 cm",
        "object o[3], mug\ntask: forall p in o: gap(p, mug) >= 3 cm",
    ),
    (
        "object o[30], mug\ndef clear(p) = forall q in objects: p != q -> gap(p, q) >= 3 cm\n"
        "task: forall p in o: clear(p)",
        "object o[30], mug\ntask: (forall p, q in o: gap(p, q) >= 3 cm) & (forall p in o: gap(p, mug) >= 3 cm)",
    ),
    (
        "object o[3], mug\ntask: exists p in objects: !(p != o[2]) & closeTo(p, mug)",
        "object o[3], mug\ntask: closeTo(o[2], mug)",
    ),
    (
        "object o[3], mug\ntask: forall i in 1..3: forall j in 1..3: i != j -> x(o[i]) <= x(mug) + j * 1 cm",
        "object o[3], mug\ntask: x(o[1]) <= x(mug) + 2 cm & x(o[2]) <= x(mug) + 1 cm & x(o[3]) <= x(mug) + 1 cm",
    ),
    (
        "object o[4], mug\ntask: forall p in o: forall q in others(p, o): gap(p, q) >= 3 cm",
        "object o[4], mug\ntask: forall p, q in o: gap(p, q) >= 3 cm",
    ),
    (
        "object o[20], mug\ntask: forall p in objects: forall q in others(mug, [p, o[1]]): leftOf(q, mug)",
        "object o[20], mug\ntask: forall p in o: leftOf(p, mug)",
    ),
    (
        "object o[3], mug\ntask: forall p in others(mug, objects): leftOf(p, mug)",
        "object o[3], mug\ntask: forall p in others(mug): leftOf(p, mug)",
    ),
]


@pytest.mark.parametrize(("text", "plain"), SAME)
def test_things_are_told_apart_by_name(text, plain):
    assert alike(text, plain)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("x(a) != x(b)", "equality"),
        ("a != b != c", "equality"),
        ("object a, b\ntask: a != 3 & leftOf(a, b)", "wrong-type"),
        ("object a, b\ntask: a != 3 cm & leftOf(a, b)", "wrong-type"),
        ("object a, b\ntask: 3 cm != 4 deg & leftOf(a, b)", "unit-mismatch"),
        ("object a, b\ntask: a != b", "constant-label"),
        ("!= b", "nothing-beside"),
        ("object a, b\ntask: others(a, b).count >= 1 & leftOf(a, b)", "wrong-type"),
    ],
)
def test_what_cannot_be_told_apart(text, code):
    with pytest.raises(SpecError) as caught:
        check_text(text)
    assert caught.value.diagnostics[0].code == code


WRONG = [
    ("task: forall i in 1..99: theta(a) <= i", "7 radians are more than a turn"),
    ("task: forall i in -50..50: x(a) / i <= 1 cm", "division by zero"),
    ("object o[50]\ntask: forall i in 1..50: leftOf(o[i], o[i + 1])", "there is no element 51 of 50"),
    ("object o[30]\ntask: forall p in o: exists q in o: gap(p, q) >= 0", "`gap` of a thing and itself"),
    ("task: forall i in 1..400: x(a) * 10 * i <= 1e305 * 10 * i", "this number is too large"),
    ("task: forall i in 1..400: x(a) <= 1 / (i * 1e306)", "this number is too large"),
    ("task: forall i in 1..400: theta(a) <= i & x(a) <= i", "7 radians are more than a turn"),
    ("task: forall i in -200..200: x(a) <= 1 / i", "division by zero"),
]


@pytest.mark.parametrize(("text", "title"), WRONG)
def test_what_is_wrong_in_some_round_is_found(text, title):
    assert problems(text) == [title]


FOLDED = [
    ("forall i in 1..300: x(a) <= x(b) + i * 1 cm", 1),
    ("exists i in 1..300: x(a) <= x(b) + i * 1 cm", 1),
    ("!(forall i in -150..150: 3 * x(a) >= (x(b) - i * 1 cm) * -2)", 1),
    ("forall i in 1..300: x(a) <= x(b) + i * 1 cm & dist(a, b) >= i * 1 mm - 1 m", 2),
    ("forall i, j in 1..30: i * 1 mm - j * 1 cm <= min(y(a), y(b) + 0.1)", 1),
    ("forall i in 0..299: x(a) <= x(b) + i * 1 cm", 1),
    ("forall i in 1..300: !(x(a) <= 1 / i)", 1),
    ("forall i in 1..300: x(a) <= i * 1 cm & (forall j in 1..2: y(a) <= j * i * 1 cm)", 750),
    ("forall i in 1..300: abs(x(a) - i * 1 mm) <= 1 m", 300),  # neither grows nor falls
    ("forall i in 1..300: x(a) * i <= 1 m", 300),
]


@pytest.mark.parametrize(("formula", "atoms"), FOLDED)
def test_the_hardest_round_stands_for_all(formula, atoms, monkeypatch):
    few = check_text(f"task: {formula}")
    monkeypatch.setattr(quantifiers, "MIN_FOLDED_ROUNDS", 1 << 60)
    many = check_text(f"task: {formula}")
    assert sum(isinstance(node, Atom) for node in few.core.nodes) == atoms
    for rows in scenes(few):
        assert phi(few.core, rows) == phi(many.core, rows)


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
    from scenegen.lang.check import lowering

    monkeypatch.setattr(lowering, "MAX_INSIDE", 10_000)
    began = time.process_time()
    problems(text)
    assert time.process_time() - began < 6.0
