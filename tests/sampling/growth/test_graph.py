"""Clauses, pairs, choices and parts of specs that are small enough to say them by hand."""

import numpy as np
import pytest

from scenegen.geometry.footprint import POINT, Circle
from scenegen.sampling.growth.graph import components, make_graph
from scenegen.sampling.request import Range

from .made import machine_of, posed

DISCS = "object a = cylinder(0.05, 0.1), b = cylinder(0.06, 0.1), c = cylinder(0.07, 0.1)\n"


def graph_of(text, ranges=None, **words):
    return make_graph(posed(text, {"task": Range(0.0)} if ranges is None else ranges, **words))


def test_a_conjunction_is_its_atoms():
    graph = graph_of("leftOf(a, b) & leftOf(b, c) & farFrom(a, c, 0.2)", {"task": Range(0.1)})
    assert [sorted(clause.objects) for clause in graph.clauses] == [[0, 1], [1, 2]]
    assert all(clause.low.tolist() == [0.1] and clause.high.tolist() == [np.inf] for clause in graph.clauses)
    (pair,) = graph.pairs
    assert (pair.first, pair.second, pair.shapes) == (0, 2, (POINT, POINT))
    assert pair.low == pytest.approx([0.3])  # dist - 0.2 >= 0.1
    assert graph.choices == ()
    # leftOf and dist read no heading, leftOf no y: those of b are free of everything
    assert graph.rows == {0, 1, 3, 6, 7}


def test_a_range_with_two_ends_is_a_choice_of_the_deciding_atom():
    graph = graph_of("leftOf(a, b) & leftOf(b, c)", {"task": Range(0.1, 0.2)})
    assert sorted(clause.low[0] for clause in graph.clauses) == [0.1, 0.1]
    (choice,) = graph.choices
    assert choice.objects == {0, 1, 2}
    assert [(sorted(way.whole.objects), way.whole.high[0]) for way in choice.ways] == [([0, 1], 0.2), ([1, 2], 0.2)]


def test_a_disjunction_over_two_objects_is_a_clause_and_over_three_a_choice():
    assert len(graph_of("leftOf(a, b) | rightOf(a, b)").choices) == 0
    (choice,) = graph_of("leftOf(a, b) & belowOf(b, c) | rightOf(a, b)").choices
    assert [len(way.clauses) for way in choice.ways] == [2, 1]
    assert [sorted(way.whole.objects) for way in choice.ways] == [[0, 1, 2], [0, 1]]


def test_nested_disjunctions_are_one_choice_and_impossible_ways_are_left_out():
    text = "(leftOf(a, b) | (leftOf(b, c) | leftOf(c, a))) & leftOf(a, b) & farFrom(b, c, 0.1)"
    (choice,) = graph_of(text).choices
    assert len(choice.ways) == 3
    (choice,) = graph_of("leftOf(a, b) | leftOf(b, c) | closeTo(c, (3, 3), 0.1) & leftOf(a, c)").choices
    assert len(choice.ways) == 2


def test_footprints_keep_clear_in_pairs_and_discs_have_no_heading():
    graph = graph_of(DISCS + "require noOverlap()\ntask: leftOf(a, b)")
    assert sorted((pair.first, pair.second) for pair in graph.pairs) == [(0, 1), (0, 2), (1, 2)]
    assert all(isinstance(shape, Circle) for pair in graph.pairs for shape in pair.shapes)
    assert all(pair.low.tolist() == [0.0] for pair in graph.pairs)
    assert graph.rows == {0, 1, 3, 4, 6, 7}


def test_what_is_held_is_no_object_of_a_pair():
    graph = graph_of(DISCS + "require noOverlap()\ntask: farFrom(a, (0.5, 0.5), 0.2)", fixed={"b": (0.2, 0.3, 1.0)})
    ends = {(pair.first, pair.second) for pair in graph.pairs}
    assert ends == {(0, (0.2, 0.3, 0.0)), (0, 2), ((0.2, 0.3, 0.0), 2), (0, (0.5, 0.5, 0.0))}
    assert graph.objects == {0, 2}


def test_an_upper_end_of_a_clearance_is_no_pair():
    graph = graph_of(DISCS + "task: touching(a, b)")
    assert not graph.pairs or all(np.isfinite(pair.low).all() for pair in graph.pairs)
    assert graph.clauses
    assert graph_of("closeTo(a, b, 0.2)").pairs == ()


def test_parts_that_have_nothing_to_do_with_each_other():
    graph = graph_of("leftOf(a, b) & leftOf(c, d) & leftOf(e, c) & closeTo(f, (0.5, 0.5), 0.2)")
    groups = [one.objects for one in (*graph.clauses, *graph.pairs)]
    assert components(groups) == (frozenset({2, 3, 4}), frozenset({0, 1}), frozenset({5}))


def test_contraction_leaves_each_cell_its_box():
    graph = graph_of("leftOf(a, b)", {"task": Range(0.5, 0.9)}, spread="flat")
    edges = np.linspace(0.5, 0.9, 33)
    np.testing.assert_allclose(graph.low[3], edges[:-1], atol=1e-6)
    np.testing.assert_allclose(graph.high[0], 1.0 - edges[:-1], atol=1e-6)
    (clause,) = graph.clauses
    np.testing.assert_allclose([clause.low, clause.high], [edges[:-1], edges[1:]])


def test_every_object_that_phi_depends_on_is_placed_once():
    machine = machine_of("leftOf(a, b) & leftOf(c, d) & leftOf(e, c) & farFrom(f, (0.5, 0.5), 0.1)")
    assert sorted(machine.order) == list(range(6))
    assert [machine.at[thing] for thing in machine.order] == list(range(6))
    # a group is finished before the next begins
    places = [machine.at[thing] for thing in (2, 3, 4)]
    assert max(places) - min(places) == 2


def test_a_disc_held_in_place_is_held_whatever_its_heading():
    """Its heading is free, and nothing reads it."""
    graph = graph_of(DISCS + "require noOverlap()\ntask: leftOf(b, c)", fixed={"a": (0.2, 0.3)})
    assert {(pair.first, pair.second) for pair in graph.pairs} == {((0.2, 0.3, 0.0), 1), ((0.2, 0.3, 0.0), 2), (1, 2)}
    assert graph.objects == {1, 2}
    turned = graph_of(DISCS.replace("cylinder(0.05, 0.1)", "box(0.1, 0.1, 0.1)") + "require noOverlap()\n"
                      "task: leftOf(b, c)", fixed={"a": (0.2, 0.3)})  # fmt: skip
    assert turned.objects == {0, 1, 2} and 2 in turned.rows and 0 not in turned.rows
