"""Alias tables, orders, chains and grids draw uniformly from what they say, and know its volume. What stands is drawn
uniformly where it stands: volumes, what the slices of headings hold, and where things come to be. Counted work:
when it is too much.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import scenegen
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import Box
from scenegen.lang.check.supports import area_of
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate
from scenegen.pose import TWO_PI, row_of
from scenegen.search.effort import Effort, TooMuchError
from scenegen.search.grid import PATH_BINS, DifferenceBound, empty, make_alias, make_chain
from scenegen.search.proposal import make_order
from scenegen.search.prune import prune
from scenegen.search.surfaces import HEADING_SLICES, stands_of, step_for

from ..laws import examples

N = 40_000


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.one_of(st.just(0.0), st.floats(1e-6, 1.0)), min_size=1, max_size=40).filter(any))
def test_alias_tables_hold_the_weights(weights):
    weights = np.array(weights)
    tables = make_alias(weights)
    assert ((tables.keep >= -1e-12) & (tables.keep <= 1 + 1e-12)).all()
    held = tables.keep.copy()
    np.add.at(held, tables.other, 1 - tables.keep)
    np.testing.assert_allclose(held / len(weights), weights / weights.sum(), atol=1e-12)
    drawn = tables.draw(200, np.random.default_rng(0))
    assert (weights[drawn] > 0).all()


def plain(edges, intervals, count=400_000, seed=1):
    """Uniform points of the box that meet the edges, by plain rejection, and their share."""
    rows = sorted(intervals)
    rng = np.random.default_rng(seed)
    points = {row: rng.uniform(*intervals[row], count) for row in rows}
    kept = np.ones(count, dtype=bool)
    for edge in edges:
        gap = points[edge.child] - points[edge.parent]
        kept &= (gap >= edge.low) & (gap <= edge.high)
    return {row: points[row][kept] for row in rows}, kept.mean()


def box(intervals):
    return math.prod(high - low for low, high in intervals.values())


UNIT = (0.0, 1.0)
FAR = math.inf
# edges, intervals
PATHS = {
    "sorted": ([DifferenceBound(0, 1, 0.0, FAR), DifferenceBound(1, 2, 0.0, FAR)], {0: UNIT, 1: UNIT, 2: UNIT}),
    "gaps": (
        [DifferenceBound(0, 1, 0.1, FAR), DifferenceBound(1, 2, 0.2, FAR)],
        {0: (0.0, 0.7), 1: (0.1, 0.8), 2: (0.3, 1.0)},
    ),
    "rooms that meet": ([DifferenceBound(0, 1, 0.0, FAR)], {0: (0.3, 0.7), 1: (0.0, 0.6)}),
    "wide intervals": (
        [DifferenceBound(0, 1, 0.1, FAR), DifferenceBound(1, 2, 0.2, FAR)],
        {0: (0.0, 1.0), 1: (0.1, 1.0), 2: (0.3, 1.0)},
    ),
    "from the middle": (
        [DifferenceBound(1, 0, -FAR, -0.1), DifferenceBound(1, 2, 0.1, FAR)],
        {0: UNIT, 1: UNIT, 2: UNIT},
    ),
    "downwards": ([DifferenceBound(0, 1, -FAR, -0.1), DifferenceBound(1, 2, -FAR, 0.0)], {0: UNIT, 1: UNIT, 2: UNIT}),
    "a narrow gap": (
        [DifferenceBound(0, 1, 0.1, FAR), DifferenceBound(1, 2, 0.05, 0.15), DifferenceBound(2, 3, 0.0, FAR)],
        dict.fromkeys(range(4), UNIT),
    ),
    "a narrow first gap": (
        [DifferenceBound(0, 1, 0.1, 0.2), DifferenceBound(1, 2, 0.05, FAR)],
        dict.fromkeys(range(3), UNIT),
    ),
    "a narrow last gap": (
        [DifferenceBound(0, 1, 0.1, FAR), DifferenceBound(1, 2, 0.05, 0.3)],
        dict.fromkeys(range(3), UNIT),
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_orders(name, same):
    edges, intervals = PATHS[name]
    order = make_order(edges, intervals)
    assert order is not None
    truth, share = plain(edges, intervals)
    drawn = dict(zip(order.rows, order.draw(N, np.random.default_rng(2)), strict=True))
    for edge in edges:
        gap = drawn[edge.child] - drawn[edge.parent]
        assert gap.min() >= edge.low - 1e-12 and gap.max() <= edge.high + 1e-12
        assert same(gap, truth[edge.child] - truth[edge.parent])
    for row in intervals:
        assert drawn[row].min() >= intervals[row][0] - 1e-12 and drawn[row].max() <= intervals[row][1] + 1e-12
        assert same(drawn[row], truth[row])
    error = math.sqrt(share * (1 - share) / 400_000)
    assert abs(math.exp(order.log_volume) / box(intervals) - share) < 4 * error


NO_ORDERS = {
    "a star": (
        [DifferenceBound(0, 1, 0.0, FAR), DifferenceBound(0, 2, 0.0, FAR), DifferenceBound(0, 3, 0.0, FAR)],
        dict.fromkeys(range(4), UNIT),
    ),
    "two narrow gaps": (
        [DifferenceBound(0, 1, 0.1, 0.2), DifferenceBound(1, 2, 0.05, 0.3)],
        dict.fromkeys(range(3), UNIT),
    ),
    "other rooms": ([DifferenceBound(0, 1, 0.0, FAR)], {0: (0.1, 0.3), 1: (0.0, 0.6)}),
}
TREES = {
    **NO_ORDERS,
    "sorted": PATHS["sorted"],
    "downwards": PATHS["downwards"],
    "a tree": (
        [
            DifferenceBound(0, 1, 0.1, FAR),
            DifferenceBound(0, 2, -FAR, 0.1),
            DifferenceBound(1, 3, -0.1, 0.1),
            DifferenceBound(1, 4, 0.0, FAR),
        ],
        {0: UNIT, 1: (0.2, 0.9), 2: (0.1, 0.4), 3: UNIT, 4: (0.5, 1.0)},
    ),
}


@pytest.mark.parametrize("name", NO_ORDERS)
def test_what_is_no_order(name):
    assert make_order(*NO_ORDERS[name]) is None


@pytest.mark.parametrize("name", TREES)
def test_chains(name, same):
    """Uniform on a set that holds every point and is larger by less than a bin along each edge."""
    edges, intervals = TREES[name]
    chain = make_chain(edges, intervals)
    truth, share = plain(edges, intervals)
    drawn = dict(zip(chain.rows, chain.draw(N, np.random.default_rng(2)), strict=True))
    kept = np.ones(N, dtype=bool)
    for edge in edges:
        gap = drawn[edge.child] - drawn[edge.parent]
        kept &= (gap >= edge.low) & (gap <= edge.high)
        assert gap.min() >= edge.low - 3 / PATH_BINS and gap.max() <= edge.high + 3 / PATH_BINS
    acceptance = kept.mean()
    assert acceptance > 0.85
    volume = chain.volume / box(intervals) * acceptance
    assert abs(volume / share - 1) < 4 * math.sqrt((1 - share) / share / 400_000 + (1 - acceptance) / acceptance / N)
    for row in intervals:
        assert same(drawn[row][kept], truth[row])
    for edge in edges:
        assert same((drawn[edge.child] - drawn[edge.parent])[kept], truth[edge.child] - truth[edge.parent])


@pytest.fixture
def same():
    """The two-sample Kolmogorov-Smirnov test at p > 0.001."""

    def test(one, two):
        one, two = np.sort(one), np.sort(two)
        both = np.concatenate([one, two])
        gap = np.searchsorted(one, both, side="right") / len(one) - np.searchsorted(two, both, side="right") / len(two)
        return np.abs(gap).max() < math.sqrt(-math.log(0.0005) / 2 * (1 / len(one) + 1 / len(two)))

    return test


def test_a_volume_too_small_for_a_number_proves_nothing():
    edges = [DifferenceBound(row, row + 1, -1e-9, 1e-9) for row in range(60)]
    inside = dict.fromkeys(range(61), (0.0, 1e-4))
    assert make_chain(edges, inside).volume == 0.0 and not empty(edges, inside)
    inside = dict.fromkeys(range(12), (0.0, 1.0))
    apart = [DifferenceBound(row, row + 1, 0.1, math.inf) for row in range(10)]
    assert not empty(apart, inside) and empty([*apart, DifferenceBound(10, 11, 1e-6, math.inf)], inside)
    table = "workspace [0, 1 cm] x [0, 1 cm]\nobject a[130] = cylinder(0.1 mm, 1 mm)\n"
    text = table + "task: forall p, q in consecutive(a): abs(x(p) - x(q)) <= 1e-9"
    spec = check_text(text)
    assert prune(spec.core, *spec.box(), {spec.core.labels["task"]: (0.0, math.inf)}).parts


CANS = "object tray, can[2] on any of [tray, workspace], mug\ntask: leftOf(can[1], can[2])"
FORKS = "object tray, fork on any of [tray, workspace], mug\ntask: leftOf(fork, mug)"
NESTED = """object tray, plate on any of [tray, workspace], apple on any of [plate, tray, workspace]
require noCollision()
task: restsOn(apple, plate)"""


def steps(text):
    spec = scenegen.parse(text).checked
    lowest, highest = spec.box()

    def ends(row):
        return float(lowest[row]), float(highest[row])

    stands = stands_of(spec, lowest, highest)
    return spec, stands, [step_for(stand, ends) for stand in stands]


def test_the_volume_is_that_of_the_surfaces():
    _, stands, found = steps(CANS)
    assert [stand.thing for stand in stands] == [1, 2]
    for stand, step in zip(stands, found, strict=True):
        lengths = np.diff([0.0, *stand.ends])
        areas = [area_of(stand.upper, one) for one in stand.options]
        assert math.exp(step.log_volume) == pytest.approx(float(np.dot(lengths, areas)))


@pytest.mark.parametrize("text", [CANS, FORKS, NESTED])
def test_what_is_drawn_stands(text):
    spec, stands, found = steps(text)
    lowest, highest = spec.box()
    rng = np.random.default_rng(4)
    rows = lowest[:, None] + rng.random((len(lowest), 4000)) * (highest - lowest)[:, None]
    for step in found:
        step.draw(rows, rng)
    on = [index for index, node in enumerate(spec.core.nodes) if " on any of " in getattr(node, "text", "")]
    values = evaluate(spec.core, list(rows), NUMPY, None, on)
    assert len(on) == len(stands)
    # slices are a little wider than what fits, and so are the boxes of round rims
    assert min(float((values[node] >= 0.0).mean()) for node in on) > 0.85
    if text is CANS:
        assert min(float((values[node] >= -1e-12).mean()) for node in on) == 1.0


def test_carriers_come_before_what_they_carry():
    _, stands, _ = steps(NESTED)
    assert [stand.thing for stand in stands] == [1, 2]


def test_the_slices_hold_every_place_where_a_fork_fits():
    _, (stand,), (step,) = steps(FORKS)
    tray = stand.options[0]
    assert tray.walled and isinstance(tray.outline, Box)
    rng = np.random.default_rng(1)
    u, v = ((rng.random(40_000) - 0.5) * size for size in tray.outline.extent)
    theta = rng.random(40_000) * TWO_PI
    zero = np.zeros(40_000)
    room = PRIMITIVES["room"].evaluate(NUMPY, stand.upper, tray.outline, u, v, theta, zero, zero, zero)
    fits = np.flatnonzero(room >= 0.0)
    assert len(fits) > 1000
    mine = step.number == step.frames.index(row_of(0, 0))
    number = np.round(step.heading[mine] / (TWO_PI / HEADING_SLICES)).astype(int)
    where = {int(one): place for place, one in enumerate(number)}
    middle, half = step.middle[:, mine], step.half[:, mine]
    for place in fits:
        at = where[int(theta[place] / (TWO_PI / HEADING_SLICES))]  # a slice that is left out would be a KeyError
        assert abs(u[place] - middle[0, at]) <= half[0, at] + 1e-12
        assert abs(v[place] - middle[1, at]) <= half[1, at] + 1e-12
    inside = step.half[0][mine] * step.half[1][mine]
    assert inside.max() > 1.5 * inside.min()  # aslant there is less room


@pytest.mark.long
def test_growth_and_rejection_find_the_same_probability():
    found = {}
    for method in ("rejection", "growth"):
        scenes = scenegen.sample(scenegen.parse(NESTED), {"task": (0.0, None)}, 600, seed=2, method=method, workers=1)
        found[method] = scenes.header.sampler
    one, other = (found[method]["log10_probability"] for method in ("rejection", "growth"))
    error = math.hypot(*(found[method]["log10_error"] for method in ("rejection", "growth")))
    assert abs(one - other) < max(2.0 * error, 0.02) and error < 0.15


def test_who_is_asked_for_more_is_asked_once():
    asked = []

    def more():
        asked.append(effort.used)
        return 200.0

    effort = Effort(most=100.0, further=more)
    effort.spend(100.0)
    assert not asked
    effort.spend(60.0)
    effort.spend(40.0)
    with pytest.raises(TooMuchError):
        effort.spend(1.0)
    assert asked == [160.0]


def test_what_is_allowed_further_may_be_too_little():
    with pytest.raises(TooMuchError):
        Effort(most=100.0, further=lambda: 150.0).spend(151.0)
    with pytest.raises(TooMuchError):
        Effort(most=100.0, further=lambda: 0.0).spend(101.0)
