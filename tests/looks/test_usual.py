"""Where things usually are, as views from above show it, against scenes that the base distribution draws."""

import math

import numpy as np
import pytest

from scenegen.lang.checker import check_text
from scenegen.looks.usual import MOST_DOTS, NormalCircles, usual_places
from scenegen.pose import row_of, rows_of
from scenegen.sampling.prior import pull_back

TWO = "object mug, saucer, cup\nregion left = rect(0, 0, 0.4, 1)\ntask: leftOf(mug, cup)\n"


def of(text, row=None):
    spec = check_text(text)
    return usual_places(spec, np.full(len(spec.box()[0]), 0.5) if row is None else np.array(row))


@pytest.mark.parametrize("middle", [(0.4, 0.5), (0.97, 0.02), (1.1, 0.5)])
def test_half_is_in_the_inner_circle_and_nine_tenths_in_the_outer_one(middle):
    spec = check_text(TWO + f"usually mug ~ normal({middle}, 5 cm)")
    (place,) = usual_places(spec, np.zeros(9))
    lowest, highest = spec.box()
    uniform = np.random.default_rng(0).uniform(lowest[:, None], highest[:, None], (len(lowest), 20_000))
    rows = pull_back(spec, lowest, highest)[1].poses(uniform)
    (disc,) = place.discs
    away = np.hypot(rows[0] - middle[0], rows[1] - middle[1])
    assert disc.middle == middle and place.things == (0,) and place.within == (0.0, 0.0, 1.0, 1.0)
    assert ((away < disc.inner).mean(), (away < disc.outer).mean()) == pytest.approx((0.5, 0.9), abs=0.015)


def test_what_is_relative_is_where_the_other_thing_stands():
    text = TWO + "usually cup ~ normal((x(saucer) + 10 cm, y(saucer)), 3 cm)"
    at = [0.1, 0.1, 0.0, 0.3, 0.6, 0.0, 0.9, 0.9, 0.0]
    (place,) = of(text, at)
    assert place.things == (2,) and place.discs[0].middle == pytest.approx((0.4, 0.6))
    full = math.sqrt(-2.0 * math.log(0.5)) * 0.03, math.sqrt(-2.0 * math.log(0.1)) * 0.03
    assert (place.discs[0].inner, place.discs[0].outer) == pytest.approx(full, rel=0.01)


def test_mixtures_have_a_part_for_each_option_and_regions_end_with_the_table():
    text = TWO + "region round = circle((0.9, 0.5), 30 cm)\n"
    (place,) = of(text + "usually mug ~ [uniform(left): 7, normal((0.8, 0.1), 5 cm): 1, uniform(round): 2]")
    left, round_ = place.areas
    assert [left.share, place.discs[0].share, round_.share] == [0.7, 0.1, 0.2]
    assert sorted(left.corners) == [(0.0, 0.0), (0.0, 1.0), (0.4, 0.0), (0.4, 1.0)]
    assert max(x for x, _ in round_.corners) == 1.0 and min(x for x, _ in round_.corners) == pytest.approx(0.6)


def test_recorded_places_are_dots_of_their_own_thing_without_rows_that_are_never_drawn():
    rows = ", ".join(f"[({0.2 + 0.001 * k}, 0.3, 0), ({0.4 + 0.003 * k}, 0.6, 0)]" for k in range(400))
    mug, cup = of(TWO + f"usually mug, cup ~ poses([{rows}], 1 cm, 5 deg)")
    assert (mug.things, cup.things) == ((0,), (2,)) and not mug.discs
    assert 60 < len(mug.dots) == len(cup.dots) <= MOST_DOTS
    assert max(x for x, _ in cup.dots) < 1.01 and {y for _, y in mug.dots} == {0.3}


def test_things_that_share_a_place_are_one_and_headings_are_none():
    (place,) = of(TWO + "usually mug, cup ~ normal((0.4, 0.3), 5 cm)\nusually theta(saucer) ~ normal(NORTH, 5 deg)")
    assert place.things == (0, 2)
    assert of(TWO) == []


def test_what_stands_on_a_region_is_cut_off_at_its_rectangle():
    text = "region shelf = rect(0.2, 0.6, 0.8, 0.9) at 30 cm\nobject jar on shelf, can\n"
    (place,) = of(text + "usually jar ~ normal((0.75, 0.7), 20 cm)\ntask: leftOf(jar, can)")
    assert place.within == pytest.approx((0.2, 0.6, 0.8, 0.9)) and isinstance(place.discs[0], NormalCircles)
    assert place.discs[0].outer < 0.55


def test_counted_things_have_the_places_of_their_member():
    spec = check_text("object mug, can[1..3]\nusually can ~ normal(mug, 5 cm)\ntask: leftOf(mug, can[1])")
    for member in spec.members:
        row = np.linspace(0.1, 0.9, len(member.box()[0]))
        (place,) = usual_places(member, row)
        assert len(place.things) == len(member.objects) - 1
        assert place.discs[0].middle == (row[row_of(0, 0)], row[rows_of(0)][1])
