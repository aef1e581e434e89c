"""Many nodes at a time give the bounds that each gives alone, bit for bit, and contraction that is as good."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Coord
from scenegen.search import node_bounds
from scenegen.search.contract import contract, forward, push_down, start
from scenegen.search.effort import Effort
from scenegen.search.tape import FEWEST, make_batches, make_tape

from ..laws import examples

made = runpy.run_path(str(Path(__file__).parents[1] / "robustness" / "formulas.py"))
specs, seeds = made["specs"], made["seeds"]

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
    assert len(tape.nodes) < FEWEST and alone(tape.batches)


def test_chains_of_nodes_are_walked_one_by_one():
    """Nodes that hang from one another cannot be taken together."""
    deep = check_text("task: " + "abs(" * 600 + "x(a)" + " - 0.1)" * 600 + " <= 0.5")
    assert len(deep.core.nodes) > FEWEST and alone(make_batches(deep.core.nodes))
