"""Contraction, alternatives and covers lose no scene that meets the demand, and count none twice. Many nodes at a time
give the bounds that each gives alone, bit for bit, and contraction that is as good. No scene that hypothesis finds
lies outside the interval bounds, and where no coordinate repeats they are exact.
"""

import math
import pickle
import runpy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Coord, Junction
from scenegen.lang.formula.interpret import evaluate
from scenegen.search import contract as contraction
from scenegen.search import grid as grids
from scenegen.search import label_bounds, node_bounds, spec_bounds
from scenegen.search.contract import alternatives, contract, contract_box, forward, push_down, start
from scenegen.search.effort import Effort, TooMuchError
from scenegen.search.prune import prune
from scenegen.search.tape import BATCHED_NODES, make_batches, make_tape

from ..laws import examples

made = runpy.run_path(str(Path(__file__).parents[1] / "learn" / "robustness" / "formulas.py"))
specs, seeds = made["specs"], made["seeds"]
WIDTHS = st.sampled_from([1.0, 0.1, 1e-3, 1e-7, 0.0])


def scenes_of(spec, seed, count):
    """Uniform scenes, half of them on a coarse grid, (3N, count)."""
    rng = np.random.default_rng(seed)
    lowest, highest = spec.box()
    rows = lowest[:, None] + (highest - lowest)[:, None] * rng.random((len(lowest), count))
    rows[:, count // 2 :] = np.clip(np.round(rows[:, count // 2 :], 1), lowest[:, None], highest[:, None])
    return rows


def demands(spec, rows, width, rng):
    """For every scene a demand that it meets: each label's value and some room, open at one end now and then."""
    values = np.stack([np.broadcast_to(value, rows.shape[1]) for value in evaluate(spec.core, list(rows), NUMPY)])
    found = []
    for scene in range(rows.shape[1]):
        ends = {}
        for node in spec.core.labels.values():
            low, high = values[node, scene] - width * rng.random(), values[node, scene] + width * rng.random()
            ends[node] = [(low, high), (low, math.inf), (-math.inf, high)][rng.integers(3)]
        found.append(ends)
    return found, values


@pytest.mark.long
@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds, WIDTHS, st.booleans())
def test_contraction_keeps_every_scene_that_meets_the_demand(spec, seed, width, batched):
    rng = np.random.default_rng(seed)
    rows = scenes_of(spec, seed, 12)
    wanted, values = demands(spec, rows, width, rng)
    lowest, highest = (ends[:, None] for ends in spec.box())
    # boxes around the scenes, of any size, within the workspace
    size = rng.random(rows.shape) * (highest - lowest) * rng.choice([1.0, 1e-3, 0.0], rows.shape)
    low, high = np.maximum(rows - size, lowest), np.minimum(rows + size, highest)
    tape = make_tape(spec.core, *spec.box())
    lo, hi = start(tape, [push_down(spec.core, ends) for ends in wanted], low, high)
    batches = make_batches(tape.nodes, fewest=1, worth=0) if batched else None
    assert contract(tape.nodes, lo, hi, batches=batches).all()
    for row, node in tape.rows.items():
        assert ((lo[node] <= rows[row]) & (rows[row] <= hi[node])).all()
    for node, (a, b) in tape.differences.items():
        assert ((lo[node] - 1e-12 <= rows[a] - rows[b]) & (rows[a] - rows[b] <= hi[node] + 1e-12)).all()
    for core_node, node in enumerate(tape.where):
        if node >= 0:
            room = 1e-9 * (1 + np.abs(values[core_node]))
            assert (lo[node] - room <= values[core_node]).all() and (values[core_node] <= hi[node] + room).all()


@pytest.mark.long
@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(specs(labels=("task",)), seeds, WIDTHS)
def test_a_scene_meets_exactly_one_alternative(spec, seed, width):
    """Also where margins tie: half of the scenes lie on a grid."""
    rng = np.random.default_rng(seed)
    rows = scenes_of(spec, seed, 12)
    wanted, values = demands(spec, rows, width, rng)
    for scene, ends in enumerate(wanted):
        demand = push_down(spec.core, ends)
        assert all(low <= values[node, scene] <= high for node, (low, high) in demand.items())
        for node in [node for node in demand if isinstance(spec.core.nodes[node], Junction)]:
            held = [
                all(low <= values[key, scene] <= high for key, (low, high) in apart.items())
                for _, apart in alternatives(spec.core, demand, node)
            ]
            assert sum(held) == 1


def inside(proposal, tape, rows):
    """How many products of boxes and bins of a proposal hold each scene, (B,)."""
    count = np.ones(rows.shape[1], dtype=int)
    for row, low, width in proposal.spans:
        count *= (rows[row] >= low - 1e-12) & (rows[row] <= low + width + 1e-12)
    for grid in proposal.grids:
        values = np.stack(
            [
                rows[tape.differences[dim][0]] - rows[tape.differences[dim][1]]
                if dim in tape.differences
                else rows[tape.nodes[dim].row]
                for dim in grid.dims
            ]
        )
        near = (values[:, None] >= grid.lo[:, :, None] - 1e-12) & (values[:, None] <= grid.hi[:, :, None] + 1e-12)
        count *= near.all(axis=0).sum(axis=0)
    for chain in proposal.chains:
        bins = []
        for row, low, width in zip(chain.rows, chain.low, chain.width, strict=True):
            place = (rows[row] - low) / width
            count *= (place >= -1e-6) & (place <= 256 + 1e-6)
            bins.append(np.clip(place.astype(int), 0, 255))
        for link in chain.links:
            low, high = link.offset[bins[link.parent]], (link.offset + link.weight)[bins[link.parent]]
            if link.leaf:
                value = rows[chain.rows[link.child]]
                count *= (value >= low - 1e-12) & (value <= high + 1e-12)
            else:
                total = chain.sums[link.child]
                count *= (total[bins[link.child]] >= low - 1e-15) & (total[bins[link.child] + 1] <= high * (1 + 1e-12))
    for order in proposal.orders:
        slack = np.stack([rows[row] - low for row, low in zip(order.rows, order.offset, strict=True)])
        count *= (slack[0] >= -1e-12) & (slack[-1] <= order.room + 1e-12)
        gaps = np.diff(slack, axis=0)
        count *= (gaps >= -1e-12).all(axis=0)
        if order.narrow >= 0:
            count *= gaps[order.narrow] <= order.most + 1e-12
    return count


FORMULAS = {
    "leftOf(a, b) & leftOf(b, c) & aboveOf(a, c)": (0.05, 0.15),
    "leftOf(a, b) | closeTo(a, c, 0.3) | angle(b, NORTH, 0.4)": (0.02, 0.2),
    "closeTo(a, b, 0.2) & closeTo(b, c, 0.2) & farFrom(a, c, 0.25)": (0.0, 0.1),
    "(closeTo(a, (0.2, 0.2), 0.2) | closeTo(a, (0.8, 0.8), 0.2)) & !closeTo(a, b, 0.1)": (0.0, 0.05),
    "min(x(a), 0.5) <= x(b) & max(y(a), 0.3) <= 0.6 & abs(theta(a) - theta(b)) <= 0.5": (0.0, 0.2),
    "dist(a, b) <= dist(b, c) & sin(theta(a)) * x(a) <= y(b)": (0.0, 0.02),
    "leftOf(a, b) & (leftOf(a, b) | aboveOf(a, b)) & !leftOf(c, b)": (-0.1, 0.1),
}


@pytest.mark.long
@pytest.mark.parametrize("text", FORMULAS)
def test_a_cover_holds_every_scene_of_the_range_once(text):
    low, high = FORMULAS[text]
    spec = check_text(text)
    lowest, highest = spec.box()
    node = spec.core.labels["task"]
    cover = prune(spec.core, lowest, highest, {node: (low, high)})
    rows = lowest[:, None] + (highest - lowest)[:, None] * np.random.default_rng(3).random((len(lowest), 400_000))
    values = [np.broadcast_to(value, rows.shape[1]) for value in evaluate(spec.core, list(rows), NUMPY)]
    hits = np.flatnonzero((values[node] >= low) & (values[node] <= high))
    assert len(hits) > 100
    rows, values = rows[:, hits], [value[hits] for value in values]
    tape = make_tape(spec.core, lowest, highest)
    owners = np.zeros(len(hits), dtype=int)
    for part in cover.parts:
        owned = part.owns(values, slice(None))
        owned = np.ones(len(hits), dtype=bool) if owned is None else owned
        owners += owned
        assert (inside(part.proposal, tape, rows[:, owned]) == 1).all()
    assert (owners == 1).all()
    # and the probability that follows from volume and acceptance is the share of plain hits
    share = math.exp(cover.log_share) * cover.acceptance
    assert share == pytest.approx(len(hits) / 400_000, rel=0.25)


@pytest.mark.parametrize("text", [*FORMULAS, "closeTo(a, b, 0.1) & closeTo(c, d, 0.1) & farFrom(a, c, 0.5)"])
def test_grids_that_are_kept_change_neither_covers_nor_counts(text, monkeypatch):
    made = []
    make = grids.make_grid
    monkeypatch.setattr(grids, "make_grid", lambda *args: made.append(1) or make(*args))
    spec = check_text(text)

    def covered(most=math.inf):
        made.clear()
        effort = Effort(most=most)
        try:
            cover = prune(spec.core, *spec.box(), {spec.core.labels["task"]: (0.0, 0.02)}, effort=effort)
        except TooMuchError:
            cover = None
        return pickle.dumps(cover), effort.used, len(made)

    kept = [covered(), *(covered(most) for most in (1e6, 1e7))]
    monkeypatch.setattr(grids, "MAX_CACHED_GRIDS", 0)
    plain = [covered(), *(covered(most) for most in (1e6, 1e7))]
    assert [one[:2] for one in kept] == [one[:2] for one in plain]
    assert kept[0][2] <= plain[0][2]
    if "d" in spec.objects:
        assert kept[0][2] < plain[0][2]


def test_the_budgets_of_a_grid_are_those_that_give_the_same(monkeypatch):
    spec = check_text("closeTo(a, b, 0.2) & closeTo(b, c, 0.2) & farFrom(a, c, 0.25)")
    asked, make = [], grids.make_grid
    monkeypatch.setattr(grids, "make_grid", lambda what, *rest: asked.append(what) or make(what, *rest))
    prune(spec.core, *spec.box(), {spec.core.labels["task"]: (0.0, 0.1)})
    for what in asked[::3]:
        for small, large in ((1, 2), (1, 40), (16, 100), (100, 700)):
            one, other = make(what, small, Effort()), make(what, large, Effort())
            if large in one.budgets:
                assert pickle.dumps((one.grid, one.work)) == pickle.dumps((other.grid, other.work))
            with pytest.raises(TooMuchError):
                make(what, large, Effort(most=other.work - 1.0))


def test_a_box_is_contracted_once(monkeypatch):
    spec = check_text("closeTo(a, b, 0.2) & leftOf(a, c) & closeTo(b, c, 0.2)")
    tape, (lowest, highest) = make_tape(spec.core, *spec.box()), spec.box()
    calls = []
    monkeypatch.setattr(contraction, "contract", lambda *args, **more: calls.append(1) or contract(*args, **more))
    demand = push_down(spec.core, {spec.core.labels["task"]: (0.05, 0.1)})
    first, again, less = Effort(), Effort(), Effort()
    box = contract_box(tape, lowest, highest, demand, first)
    assert contract_box(tape, lowest, highest, demand, again) is box and box.alive
    assert first.used == again.used == box.work > 0.0 and len(calls) == 1
    lo, hi = start(tape, [demand], lowest[:, None], highest[:, None])
    assert contract(tape.nodes, lo, hi).all() and (lo[:, 0] == box.lo).all() and (hi[:, 0] == box.hi).all()
    part = prune(spec.core, lowest, highest, {spec.core.labels["task"]: (0.05, 0.1)}, tape=tape).parts[0]
    assert not np.shares_memory(part.lo, box.lo) and not np.shares_memory(part.hi, box.hi)
    with pytest.raises(TooMuchError):
        contract_box(tape, lowest, highest, demand, Effort(most=first.used - 1.0))
    for number, box in enumerate((spec.box(), (lowest, 0.5 * (lowest + highest)), (lowest, highest - 0.1))):
        for rounds in (1, 2):
            contract_box(tape, *box, demand, less, rounds)
            assert len(calls) == 3 + 2 * number + rounds - 1
    assert len(tape.contracted) == contraction.MAX_CACHED_BOXES


# every primitive over footprints, with pairs that share objects
SHAPES = """object a, b = box(0.2, 0.1, 0.1)
object c, d = cylinder(0.05, 0.1)
region tray = polygon([(0.2, 0.2), (0.8, 0.2), (0.8, 0.7), (0.5, 0.8)])
require noOverlap() & insideWorkspace()
task: inside(a, tray) & inside(c, tray) & clearOf(b, tray) & angle(a, NORTH) & closeTo(a, b, 0.4)
"""
CLUTTER = """object block[{}] = box(0.06, 0.05, 0.05)
require noOverlap() & insideWorkspace()
task: closeTo(block[1], block[2], 30 cm)
"""


def boxes_in(spec, seed, count):
    rng = np.random.default_rng(seed)
    lowest, highest = (ends[:, None] for ends in spec.box())
    ends = lowest + rng.random((2, len(lowest), count)) * (highest - lowest)
    return ends.min(axis=0), ends.max(axis=0)


def alone(batches):
    return all(isinstance(batch.at, int) for batch in batches.batches)


def same_bounds(spec, seed):
    low, high = boxes_in(spec, seed, 5)
    alone = node_bounds(spec.core, low, high)
    batches = make_batches(spec.core.nodes, fewest=1, worth=0)
    lo, hi = (np.full((len(spec.core.nodes), 5), np.nan) for _ in range(2))
    for index, node in enumerate(spec.core.nodes):
        if isinstance(node, Coord):
            lo[index], hi[index] = low[node.row], high[node.row]
    batches.bounds(lo, hi, Effort())
    assert np.array_equal(lo, np.stack([np.broadcast_to(one.lo, 5) for one in alone]))
    assert np.array_equal(hi, np.stack([np.broadcast_to(one.hi, 5) for one in alone]))


def same_tape(spec, seed):
    """Bounds from coordinates and known differences; and contraction only narrows."""
    low, high = boxes_in(spec, seed, 5)
    tape = make_tape(spec.core, *spec.box())
    batches = make_batches(tape.nodes, fewest=1, worth=0)
    wanted = [push_down(spec.core, dict.fromkeys(spec.core.labels.values(), (-0.1, 0.1)))] * 5
    lo, hi = start(tape, wanted, low, high)
    alone = lo.copy(), hi.copy()
    contract(tape.nodes, *alone)
    given = tuple(tape.differences)
    one, other = (forward(tape.nodes, *alone, given, batches=how) for how in (None, batches))
    assert np.array_equal(one, other, equal_nan=True)
    before = lo.copy(), hi.copy()
    contract(tape.nodes, lo, hi, batches=batches)
    assert (before[0] <= lo).all() and (hi <= before[1]).all()


@pytest.mark.long
@settings(max_examples=examples(25), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_batches_give_the_bounds_of_each_node(spec, seed):
    same_bounds(spec, seed)
    same_tape(spec, seed)


def test_batches_of_footprints_give_the_bounds_of_each_node():
    spec = check_text(SHAPES)
    for seed in range(5):
        same_bounds(spec, seed)
        same_tape(spec, seed)


def test_large_tapes_are_walked_in_few_calls():
    """Forty boxes: 780 gaps, each of which took a millisecond or two on its own."""
    spec = check_text(CLUTTER.format(40))
    tape = make_tape(spec.core, *spec.box())
    assert len(tape.batches.batches) < 16
    lo, hi = start(tape, [push_down(spec.core, {spec.core.requirement: (0.0, np.inf)})], *boxes_in(spec, 0, 1))
    calls = []
    contract(tape.nodes, lo, hi, rounds=1, batches=tape.batches, effort=Effort(lambda: bool(calls.append(1))))
    assert len(calls) < 2 * 2 * len(tape.batches.batches)
    assert np.array_equal(*(forward(tape.nodes, lo, hi, (), batches=how) for how in (None, tape.batches)))


def test_contraction_in_batches_comes_to_the_same_boxes():
    """Sweep by sweep it may lag, for gaps of one batch do not see what the others have narrowed."""
    spec = check_text(SHAPES)
    tape = make_tape(spec.core, *spec.box())
    ends = [dict.fromkeys(spec.core.labels.values(), (-0.02, 0.02)) | {spec.core.requirement: (0.0, np.inf)}] * 8
    lo, hi = start(tape, [push_down(spec.core, one) for one in ends], *boxes_in(spec, 4, 8))
    found = []
    for batches in (None, make_batches(tape.nodes, fewest=1, worth=0)):
        one = lo.copy(), hi.copy()
        alive = contract(tape.nodes, *one, rounds=40, batches=batches)
        coords = list(tape.rows.values())
        found.append((alive, np.where(alive, one[1][coords] - one[0][coords], 0.0)))
    assert found[0][0].any() and np.array_equal(found[0][0], found[1][0])
    assert found[0][1] == pytest.approx(found[1][1], rel=0.05)


def test_small_tapes_are_walked_node_by_node():
    """So that the plans of small specs stay what they were, bit for bit."""
    spec = check_text(CLUTTER.format(8))
    tape = make_tape(spec.core, *spec.box())
    assert len(tape.nodes) < BATCHED_NODES and alone(tape.batches)


def test_chains_of_nodes_are_walked_one_by_one():
    """Nodes that hang from one another cannot be taken together."""
    deep = check_text("task: " + "abs(" * 600 + "x(a)" + " - 0.1)" * 600 + " <= 0.5")
    assert len(deep.core.nodes) > BATCHED_NODES and alone(make_batches(deep.core.nodes))


EVERYWHERE = Workspace((-0.2, 1.2), (-0.2, 1.2))


def sub_boxes(rng, count, boxes, width):
    lowest, highest = EVERYWHERE.box(count)
    ends = rng.uniform(size=(2, 3 * count, boxes))
    low, high = ends.min(0), ends.max(0)
    high = np.minimum(low + width * (high - low), 1.0)
    span = (highest - lowest)[:, None]
    return lowest[:, None] + low * span, lowest[:, None] + high * span


def inside_bounds(rng, lowest, highest, scenes):
    """(3N, K, scenes): corners first, then uniform scenes, then the middle."""
    where = rng.uniform(size=(*lowest.shape, scenes))
    corners = scenes // 2
    where[..., :corners] = where[..., :corners].round()
    where[..., -1] = 0.5
    rows = lowest[..., None] + where * (highest - lowest)[..., None]
    return np.clip(rows, lowest[..., None], highest[..., None])


@pytest.mark.long
@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds, st.sampled_from([1.0, 0.3, 1e-3, 1e-9, 0.0]))
def test_no_scene_of_a_box_lies_outside_its_bounds(spec, seed, width):
    rng = np.random.default_rng(seed)
    lowest, highest = sub_boxes(rng, len(spec.objects), 4, width)
    rows = inside_bounds(rng, lowest, highest, 32)
    values = evaluate(spec.core, list(rows), NUMPY)
    for node, value, bound in zip(spec.core.nodes, values, node_bounds(spec.core, lowest, highest), strict=True):
        low, high = np.broadcast_to(bound.lo, 4)[:, None], np.broadcast_to(bound.hi, 4)[:, None]
        assert ((low <= value) & (value <= high)).all(), node


@pytest.mark.long
@settings(max_examples=examples(50), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_many_boxes_are_as_one_by_one(spec, seed):
    lowest, highest = sub_boxes(np.random.default_rng(seed), len(spec.objects), 3, 1.0)
    low, high = label_bounds(spec.core, lowest, highest)
    assert low.shape == high.shape == (2, 3)
    for box in range(3):
        one = label_bounds(spec.core, lowest[:, box], highest[:, box])
        assert np.array_equal(one[0], low[:, box]) and np.array_equal(one[1], high[:, box])


# in the unit square; the diagonal is 1.41421356...
EXACT = {
    "leftOf(mug, plate)": (-1.0, 1.0),
    "leftOf(mug, plate) & !closeTo(mug, plate, 0.25)": (-1.0, 1.0),
    "closeTo(mug, plate, 0.25)": (0.25 - math.sqrt(2.0), 0.25),
    "farFrom(mug, (0.5, 0.5), 0)": (0.0, math.sqrt(0.5)),
    "closeTo(mug, (2, 0.5), 0)": (-math.sqrt(4.25), -1.0),
    "abs(x(mug) - 0.25) <= 0.5": (-0.25, 0.5),
    "x(mug) * y(mug) <= 2": (1.0, 2.0),
    "-x(mug) / 4 <= 0": (0.0, 0.25),
    "min(x(mug), y(plate)) <= 0.5": (-0.5, 0.5),
    "max(x(mug), 0.5) <= y(plate)": (-1.0, 0.5),
    "leftOf(mug, plate) | belowOf(mug, plate)": (-1.0, 1.0),
    "x(mug) + y(plate) <= x(mug)": (-2.0, 1.0),  # wide, since x occurs twice: phi is -y(plate)
}


@pytest.mark.parametrize("text", EXACT)
def test_bounds_worked_by_hand(text):
    low, high = spec_bounds(check_text(text))["task"]
    assert (low, high) == EXACT[text]


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("angle(mug, NORTH)", 0.2 - math.pi, 0.2),
        ("sin(theta(mug)) <= 0", -1.0, 1.0),
        ("cos(theta(mug)) <= 0.5", -0.5, 1.5),
    ],
)
def test_the_whole_circle_is_covered_to_a_hair(text, low, high):
    bounds = spec_bounds(check_text(text))["task"]
    assert bounds == pytest.approx((low, high), abs=1e-12)
    assert bounds[0] <= low and bounds[1] >= high
