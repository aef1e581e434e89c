"""What the checker lets pass, but not without a word; and where words would be out of place."""

import pytest

from .worth import warnings

TASK = "task: leftOf(mug, plate)"

HEADING = "a heading is compared as a number: it jumps from 2 pi to 0 at EAST"

NOTICED = [
    (f"const A = 1\n{TASK}", [("the constant `A` is never used", "A")]),
    (f"region r = rect(0, 0, 1, 1)\n{TASK}", [("the region `r` is never used", "r")]),
    (f"def f(a) = leftOf(a, plate)\n{TASK}", [("the definition `f` is never used", "f")]),
    (
        f"def f(a) = g(a)\ndef g(a) = leftOf(a, plate)\n{TASK}",
        [("the definition `f` is never used", "f"), ("the definition `g` is never used", "g")],
    ),
    ("def f(a, b) = leftOf(a, plate)\ntask: f(mug, mug)", [("the parameter `b` is never used", "b")]),
    (
        "object mug, plate\ndef f(mug) = leftOf(mug, plate)\ntask: f(mug)",
        [("the parameter `mug` hides an object of that name", "mug")],
    ),
    (
        "object mug, box[2]\ndef f(box) = leftOf(box, mug)\ntask: f(box[1])",
        [("the parameter `box` hides an array of that name", "box")],
    ),
    (
        "def f(EPS_CLOSE) = leftOf(EPS_CLOSE, mug)\ntask: f(plate)",
        [("the parameter `EPS_CLOSE` hides a constant of that name", "EPS_CLOSE")],
    ),
    (
        "def f(safe) = leftOf(safe, mug)\ntask: f(plate)\nsafe: leftOf(mug, plate)",
        [("the parameter `safe` hides a label of that name", "safe")],
    ),
    (
        "region r = rect(0, 0, 1, 1)\nobject a[2]\ntask: inside(a[1], r) & forall r in a: leftOf(r, (1, 1))",
        [("the variable `r` hides a region of that name", "r")],
    ),
    ("object a[2]\ntask: forall i in 1..2: leftOf(a[1], a[2])", [("the variable `i` is never used", "i")]),
    ("theta(mug) <= 0.5 rad & leftOf(mug, cup)", [(HEADING, "theta(mug) <= 0.5 rad")]),
    ("abs(theta(mug) - theta(cup)) <= 20 deg", [(HEADING, "abs(theta(mug) - theta(cup)) <= 20 deg")]),
    ("abs(wrap(theta(mug) / 2)) <= 20 deg", [(HEADING, "abs(wrap(theta(mug) / 2)) <= 20 deg")]),
    (
        "def h(a) = mean(theta(a), NORTH)\ntask: !(0 deg <= h(mug) <= 90 deg) | leftOf(mug, cup)",
        [(HEADING, "(0 deg <= h(mug) <= 90 deg)")],
    ),
    ("forall p, q in [mug, plate]: leftOf(p, cup)", [("the variable `q` is never used", "q")]),
    (
        "object crackrbox, plat\ntask: leftOf(crackrbox, plat)",
        [
            ("the library has no `crackrbox`: a block of 5 cm stands in for it", "crackrbox"),
            ("the library has no `plat`: a block of 5 cm stands in for it", "plat"),
        ],
    ),
    ("leftOf(mug, plat)", [("the library has no `plat`: a block of 5 cm stands in for it", "plat")]),
    (
        "object red_mug, b\n" + TASK.replace("mug, plate", "red_mug, b"),
        [("the library has no `red_mug`: a block of 5 cm stands in for it", "red_mug")],
    ),
]

QUIET = [
    "const EPS_CLOSE = 1\ntask: closeTo(mug, plate)",
    "const EPS_CLOSE = 2 * HALF\nconst HALF = 5 cm\ntask: closeTo(mug, plate)",
    "const N = 3\nobject block[N]\ntask: leftOf(block[1], block[2])",
    "region r = rect(0, 0, W, 1)\nconst W = 1\ntask: inside(mug, r)",
    "const HOME = (0.5, 0.5)\nobject tray at HOME, mug\ntask: leftOf(mug, tray)",
    "def f(a, e = SLACK) = closeTo(a, plate, e)\nconst SLACK = 1\nrequire f(mug)\ntask: leftOf(mug, plate)",
    "def f(p) = leftOf(p, plate)\ntask: f(p)",  # the only p is the object that the label names: nothing is hidden
    "object a, spare\ntask: x(a) <= 1",
    "object house, plant, pan, jug, knife_block, block_tower, coaster, lamp\ntask: leftOf(house, plant)",
    "object plat = box(5 cm, 5 cm, 5 cm), Mug2, fork_2, can3\ntask: leftOf(plat, Mug2)",
    "import_: leftOf(a, b)",
    "angle(a, theta(b)) & facing(a, b) & sameHeading(a, b) & mirrored(a, b) & noOverlap([a, b]) & fullyLeftOf(a, b)",
    "abs(wrap(theta(a) - 2 * theta(b) + NORTH)) <= 1 rad & sin(3 * theta(a)) <= cos(-theta(b))",
    "reach(a, theta(b) - NORTH) <= reach(b, theta(a)) & sum(theta(a), -theta(a)) <= x(b) * 1 rad / 1 m",
    "object tray at (0.5, 0.5, 20 deg), mug\ntask: theta(tray) * x(mug) <= 1 m * 1 rad",
]


@pytest.mark.parametrize(("text", "expected"), NOTICED)
def test_noticed(text, expected):
    assert warnings(text) == expected


@pytest.mark.parametrize("text", QUIET)
def test_quiet(text):
    assert warnings(text) == []
