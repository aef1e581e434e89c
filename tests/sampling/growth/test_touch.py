"""Incremental scoring says what an evaluation of the whole formula says, at every stage."""

import numpy as np
import pytest

from scenegen.lang.formula.core import Coord, Junction, children
from scenegen.sampling.growth.insertion import _holds, held_ways
from scenegen.sampling.request import Range
from scenegen.search.contract import push_down

from .made import POSITIVE, anywhere, everything_placed, machine_of, node_values, plain, ways_held

SMALL = "workspace [0, 0.6] x [0, 0.5]\n"
SPECS = {
    "discs": (SMALL + "object a = cylinder(0.05, 0.1), b = cylinder(0.06, 0.1), c = cylinder(0.07, 0.1)\n"
              "require noOverlap()\nrequire insideWorkspace()\ntask: leftOf(a, b) | leftOf(a, c)", POSITIVE, None),
    "boxes": (SMALL + "object a = box(0.1, 0.06, 0.1), b = box(0.12, 0.05, 0.1), c = cylinder(0.05, 0.1)\n"
              "require noOverlap()\ntask: farFrom(a, c, 0.1)", POSITIVE, None),
    "polygons": (SMALL + "object a = prism([(0, 0), (0.12, 0), (0, 0.1)], 0.05), b = box(0.1, 0.06, 0.1)\n"
                 "object c = cylinder(0.04, 0.1)\nrequire noOverlap()\ntask: closeTo(a, b, 0.4)", POSITIVE, None),
    "held": (SMALL + "object a = box(0.1, 0.06, 0.1), b = box(0.12, 0.05, 0.1), c = cylinder(0.05, 0.1)\n"
             "require noOverlap()\ntask: farFrom(a, (0.3, 0.2), 0.1)", POSITIVE, {"b": (0.3, 0.25, 0.7)}),
    "regions": (SMALL + "object a = box(0.1, 0.06, 0.1), b = cylinder(0.04, 0.1)\nregion tray = rect(0, 0, 0.4, 0.35)\n"
                "require noOverlap()\ntask: inside(a, tray) & inside(b, tray)", POSITIVE, None),
    "several pairs": (SMALL + "object a = box(0.1, 0.06, 0.1), b = box(0.12, 0.05, 0.1), c = cylinder(0.03, 0.1)\n"
                      "require noOverlap()\ntask: farFrom(a, b, 0.12) & farFrom(b, a, 0.11) & farFrom(a, c, 0.05)",
                      {"task": Range(0.02)}, None),
    "a range": (SMALL + "object a = cylinder(0.05, 0.1), b = cylinder(0.06, 0.1)\nrequire noOverlap()\n"
                "task: closeTo(a, b, 0.3)", {"task": Range(0.02, 0.1)}, None),
}  # fmt: skip


@pytest.fixture(params=SPECS)
def machine(request):
    text, ranges, fixed = SPECS[request.param]
    return machine_of(text, ranges, fixed=fixed)


def demanded(problem):
    """What the request asks of nodes of the core, pushed down: node -> ends."""
    return push_down(problem.core, problem.wanted())


def free_objects(core, node, held):
    """The objects that a node reads, but those held."""
    found, waiting = set(), [node]
    while waiting:
        at = core.nodes[waiting.pop()]
        if isinstance(at, Coord):
            found.add(at.object)
        waiting += children(at)
    return found - held


def test_stage_by_stage_it_is_the_whole_formula(machine):
    """Scene by scene, against the scalar interpreter, whatever clauses and pairs were made of the formula."""
    problem, core, count = machine.problem, machine.problem.core, 200
    rows = anywhere(problem, count)
    values = node_values(core, rows)
    held = {thing for thing in range(len(core.objects)) if problem.lowest[3 * thing] == problem.highest[3 * thing]}
    wanted = demanded(problem)
    cell = np.zeros(count, dtype=np.intp)
    running = np.ones(count, dtype=bool)
    for stage, thing in enumerate(machine.order):
        touch, placed = machine.touch[thing], set(machine.order[: stage + 1])
        met = touch.meets(list(rows), cell, stage)
        running &= True if met is None else met
        touch.clear((rows[3 * thing], rows[3 * thing + 1], rows[3 * thing + 2]), rows, cell, stage, running)
        whole = np.ones(count, dtype=bool)
        for node, (low, high) in wanted.items():
            if free_objects(core, node, held) <= placed and not _is_choice(machine, node):
                whole &= (values[node] >= low) & (values[node] <= high)
        np.testing.assert_array_equal(running, whole, err_msg=f"stage {stage}")
    for choice in range(len(machine.graph.choices)):
        running &= ways_held(machine, choice, rows).any(axis=0)
    final = problem.cells.find(problem.phi(rows)) >= 0
    np.testing.assert_array_equal(running, final)
    assert 3 <= final.sum() <= count - 20


def _is_choice(machine, node):
    at = machine.problem.core.nodes[node]
    return isinstance(at, Junction) and len(free_objects(machine.problem.core, node, set())) > 1


def test_a_move_is_scored_like_the_whole_scene(machine):
    """One object of a good scene goes anywhere else: what touches it says whether the scene is still good."""
    problem, rng = machine.problem, np.random.default_rng(1)
    good = plain(problem, 120)
    for thing in machine.order:
        new = good.copy()
        for row in machine.touch[thing].rows:
            new[row] = anywhere(problem, new.shape[1], rng.integers(1 << 30))[row]
        truth = problem.cells.find(problem.phi(new)) >= 0
        for some in (slice(None), slice(0, 9)):  # both ways of going about it: all scenes, or the few left
            said = np.zeros(len(truth), dtype=bool)
            said[some] = True
            if machine.graph.choices:
                continue
            _holds(everything_placed(machine, good), (thing,), list(new), good, said)
            np.testing.assert_array_equal(said[some], truth[some])
        assert truth.any() and not truth.all()


def test_cells_have_their_own_ends():
    """Scored for its own cell each, a scene is good where it lies in that cell."""
    machine = machine_of("leftOf(a, b) & farFrom(a, b, 0.1)", {"task": Range(0.1, 0.5)}, spread="flat")
    problem, count = machine.problem, 4000
    rows = anywhere(problem, count)
    cell = np.random.default_rng(2).integers(problem.cells.count, size=count)
    good = np.ones(count, dtype=bool)
    for stage, thing in enumerate(machine.order):
        met = machine.touch[thing].meets(list(rows), cell, stage)
        good &= True if met is None else met
        machine.touch[thing].clear(tuple(rows[3 * thing : 3 * thing + 3]), rows, cell, stage, good)
    for choice in range(len(machine.graph.choices)):
        good &= held_ways(machine, choice, range(2), list(rows), cell, len(machine.order) - 1).any(axis=0)
    np.testing.assert_array_equal(good, problem.cells.find(problem.phi(rows)) == cell)
    assert good.sum() > 10
