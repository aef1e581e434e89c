"""`on any of [...]` and regions at heights, in the language."""

import math
from itertools import product

import numpy as np
import pytest

from scenegen.errors import Source, SpecError
from scenegen.geometry import NUMPY, Box, Circle, Polygon
from scenegen.geometry.footprint import standing_area
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, gated, part_of
from scenegen.lang.formula.interpret import phi
from scenegen.lang.syntax.printer import format_source

TEXT = """region shelf[2] = rect(0.1, 0.6, 0.9, 0.95) at 30 cm, 60 cm
object book[2] on any of shelf, tray on any of [shelf[1], workspace] by area, can on tray
task: z(can) >= 20 cm & restsOn(book[1], shelf[2])
"""


def test_switches_come_after_the_objects_and_stay_out_of_sight():
    spec = check_text(TEXT)
    assert spec.objects == ("book[1]", "book[2]", "tray", "can")
    assert spec.core.objects[4:] == ("book[1].on", "book[2].on", "tray.on")
    assert spec.heights == (None, None, None, None) and set(spec.choices) == {0, 1, 2}
    assert spec.choices[0].ends == (0.5, 1.0)  # the same area
    assert [region.height for region in spec.regions] == [0.3, 0.6]


def test_equal_shares_take_more_of_the_switch_for_smaller_surfaces():
    text = "region small = rect(0, 0, 0.1, 0.1)\nobject can on any of [small, workspace]{}\ntask: x(can) <= 0.5"
    equal, area = (check_text(text.format(words)).choices[0].ends for words in ("", " by area"))
    assert equal == pytest.approx((100.0 / 101.0, 1.0)) and area == (0.5, 1.0)


def test_the_canonical_text_means_the_same_and_formatting_keeps_it():
    spec = check_text(TEXT)
    again = check_text(spec.source)
    assert (again.core, again.choices, again.heights) == (spec.core, spec.choices, spec.heights)
    assert format_source(Source("spec", TEXT)) == TEXT
    wide = "region  shelf[ 2 ]=rect(0,0,1,1)  at 30 cm ,60 cm # two\nobject a on any   of[shelf[1],workspace]by  area\n"
    assert format_source(Source("spec", wide + "task: x(a) <= 0.5")).splitlines()[:2] == [
        "region shelf[2] = rect(0, 0, 1, 1) at 30 cm, 60 cm  # two",
        "object a on any of [shelf[1], workspace] by area",
    ]


def test_the_words_of_choices_are_names_elsewhere():
    text = "object any, of, by, area on any\ntask: leftOf(any, of) & leftOf(by, area)"
    assert check_text(text).objects == ("any", "of", "by", "area")


def test_a_choice_of_one_is_a_support():
    spec = check_text("object tray, can on any of [tray], mug\ntask: leftOf(can, mug)")
    assert (spec.choices, spec.supports[1].name) == ({}, "tray.inside")


@pytest.mark.parametrize(
    ("upper", "outline", "area"),
    [
        (Circle(0.0), Circle(0.2), math.pi * 0.04),
        (Circle(0.05), Circle(0.2), math.pi * 0.0225),
        (Circle(0.05), Box(0.4, 0.2), 0.3 * 0.1),
        (Circle(0.05), Polygon(((0, 0), (0.4, 0), (0.4, 0.2), (0, 0.2))), 0.3 * 0.1),
        (Box(0.5, 0.01), Box(0.4, 0.2), 0.0),
        (Circle(0.0), Polygon(((0, 0), (1, 0), (0, 1))), 0.5),
    ],
)
def test_the_area_on_which_a_footprint_can_stand(upper, outline, area):
    assert standing_area(upper, outline) == pytest.approx(area, abs=1e-12)


@pytest.mark.parametrize("outline", [Box(0.4, 0.25), Circle(0.17)])
def test_the_area_is_that_of_random_places(outline):
    upper, rng = Box(0.2, 0.1), np.random.default_rng(0)
    x, y, turn = rng.uniform(-0.2, 0.2, 40_000), rng.uniform(-0.2, 0.2, 40_000), rng.uniform(0, math.tau, 40_000)
    inside = np.ones(40_000, dtype=bool)
    for u, v in ((0.1, 0.05), (0.1, -0.05), (-0.1, 0.05), (-0.1, -0.05)):
        px, py = x + np.cos(turn) * u - np.sin(turn) * v, y + np.sin(turn) * u + np.cos(turn) * v
        if isinstance(outline, Circle):
            inside &= np.hypot(px, py) <= outline.radius
        else:
            inside &= (np.abs(px) <= outline.length / 2) & (np.abs(py) <= outline.width / 2)
    assert standing_area(upper, outline) == pytest.approx(0.16 * inside.mean(), abs=5 * 0.16 * 0.5 / 200)


def test_names_of_heights_can_be_defined_by_a_spec():
    text = """object tray, can on tray, mug
    def z(a) = y(a)
    def stable(a, b) = leftOf(a, b)
    def restsOn(a) = z(a) >= 0.2
    task: stable(can, mug) & restsOn(can)
    mine: stackedOn(can, tray)
    """
    plain = check_text("object tray, can on tray, mug\nmine: stackedOn(can, tray)")
    mine = [
        [node.text for node in part_of(one.core, ["mine"]).nodes if isinstance(node, Atom)]
        for one in (check_text(text), plain)
    ]
    assert mine[0] == mine[1] and "y(can)" not in str(mine)  # the prelude goes on with its own z
    assert check_text(text).core.objects == plain.core.objects


CARRIERS = {"book": ("shelf[1]", "tray", "workspace"), "mug": ("tray", "shelf[2]"), "can": ("book", "workspace")}
CASES = """region shelf[2] = rect(0.1, 0.6, 0.9, 0.95) at 30 cm, 60 cm
object tray, {}, shelfunit at (0.25, 0.25, SOUTH)
require noCollision()
free: noCollision()
rests: restsOn(can, book) | insideOf(mug, tray) | underneath(book, shelfunit)
high: z(can) + top(mug) + x(can) <= 60 cm
"""


@pytest.mark.long
def test_phi_and_requirement_are_those_of_the_spec_with_the_surfaces_chosen():
    """Of every combination: hollow and solid bodies, furniture, boards, and what stands on what chooses."""
    choice = check_text(CASES.format(", ".join(f"{n} on any of [{', '.join(s)}]" for n, s in CARRIERS.items())))
    assert choice.objects == ("tray", "book", "mug", "can", "shelfunit")
    rng, count, met = np.random.default_rng(0), 2000, 0
    rows = np.zeros((3 * len(choice.core.objects), count))
    rows[:15] = rng.uniform(0.3, 0.9, (15, count))
    rows[12:15] = np.array(choice.fixed[4])[:, None]
    for on in product(*map(enumerate, CARRIERS.values())):
        plain = check_text(CASES.format(", ".join(f"{n} on {s}" for n, (_, s) in zip(CARRIERS, on, strict=True))))
        for one, (which, _) in zip(choice.choices.values(), on, strict=True):
            rows[3 * one.switch] = one.middles[which]
        mine, wanted = (phi(gated(one.core), list(some), NUMPY) for one, some in ((choice, rows), (plain, rows[:15])))
        for label in plain.core.labels:
            assert mine[label] == pytest.approx(wanted[label], abs=1e-12), (label, on)
        held = (wanted["require"] >= 0.0) & plain.workspace.contains(rows[:15])  # some supports are boxes alone
        assert ((mine["require"] >= 0.0) & choice.workspace.contains(rows) == held).all(), on
        met += int(held.sum())
    assert met > 20


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("object a, b, c on any of [a, b], by volume", "volume", "without `by area` all are equally likely"),
        ("object a, b, c on any of [a, b] by volume", "by", "write `any of [...] by area`"),
        ("object a, b, c on any of [a, b], by area", "area", "leave out the `,`"),
        ("object can, mug\ntask: above(can, 20 cm)", "above", "write z(can) >= 20 cm"),
        ("object can, mug\ntask: under(can, 20 cm)", "under", "write top(can) <= 20 cm"),
        ("object can, mug\ntask: restsOn(can, 20 cm)", "20 cm", "cabinet.top; a height is compared: z(mug) >= 20 cm"),
        ("object mug, can on 20 cm\ntask: leftOf(can, mug)", "20 cm", "an object or a surface, such as workspace"),
        (
            "object tray, plate, can on any of [tray, plate]\nrequire noOverlap()\ntask: leftOf(can, tray)",
            "noOverlap()",
            "require noCollision() instead",
        ),
    ],
)
def test_mistakes_of_heights_say_what_to_write(text, place, words):
    with pytest.raises(SpecError) as caught:
        check_text(text if "task" in text else f"{text}\ntask: leftOf(a, b)")
    (one,) = caught.value.diagnostics
    assert one.span.text == place and words in one.help


def test_a_choice_that_leaves_the_table_can_be_clear_of_all():
    text = "object tray, plate, can on any of [tray, workspace]\nrequire noOverlap()\ntask: leftOf(can, tray)"
    assert check_text(text).choices
