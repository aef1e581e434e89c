"""Clauses, pairs, choices and parts of specs that are small enough to say them by hand. What formulas imply: no value
of phi changes, and rows are scored before their last object comes. Flat spread and several labels: equal shares of
the cells, and the right scenes within each. Resampling: unbiased, as even as it can be, within groups.
"""

import math

import numpy as np
import pytest
from scipy import stats

from scenegen.geometry import NUMPY
from scenegen.geometry.footprint import POINT, Circle
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.sampling.growth.graph import add_implied_atoms, components, make_graph
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.resampling import resample_groups
from scenegen.search.effort import Budget

from .made import anywhere, everything_placed, machine_of, posed

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
    model = machine_of("leftOf(a, b) & leftOf(c, d) & leftOf(e, c) & farFrom(f, (0.5, 0.5), 0.1)")
    assert sorted(model.order) == list(range(6))
    assert [model.at[thing] for thing in model.order] == list(range(6))
    # a group is finished before the next begins
    places = [model.at[thing] for thing in (2, 3, 4)]
    assert max(places) - min(places) == 2


def test_a_disc_held_in_place_is_held_whatever_its_heading():
    """Its heading is free, and nothing reads it."""
    graph = graph_of(DISCS + "require noOverlap()\ntask: leftOf(b, c)", fixed={"a": (0.2, 0.3)})
    assert {(pair.first, pair.second) for pair in graph.pairs} == {((0.2, 0.3, 0.0), 1), ((0.2, 0.3, 0.0), 2), (1, 2)}
    assert graph.objects == {1, 2}
    turned = graph_of(DISCS.replace("cylinder(0.05, 0.1)", "box(0.1, 0.1, 0.1)") + "require noOverlap()\n"
                      "task: leftOf(b, c)", fixed={"a": (0.2, 0.3)})  # fmt: skip
    assert turned.objects == {0, 1, 2} and 2 in turned.rows and 0 not in turned.rows


ROW = "object c[5] = box(0.1, 0.1, 0.1)\ntask: evenlySpaced(c, 2 cm) & leftOf(c[1], c[2])\n"


def test_phi_stays_and_there_is_more_to_meet():
    core = check_text(ROW).core
    more = add_implied_atoms(core)
    assert len(more.nodes) > len(core.nodes)
    rows = list(anywhere(posed(ROW, {}), 2000))
    one, two = (phi(part, rows, NUMPY)["task"] for part in (core, more))
    np.testing.assert_allclose(one, two, atol=1e-15)


def test_a_core_without_means_stays_itself():
    core = check_text("leftOf(a, b) & closeTo(b, c, 0.2)").core
    assert add_implied_atoms(core) is core


@pytest.mark.parametrize("size", [4, 6])
def test_rows_are_scored_from_the_third_object_on(size):
    model = machine_of(f"object c[{size}] = box(0.1, 0.1, 0.1)\ntask: evenlySpaced(c, 2 cm)\n")
    sizes = {len(clause.objects) for clause in model.graph.clauses}
    assert min(sizes) == 3 and max(sizes) == size


def planned(text, ranges, n, seed=0, spread="flat"):
    plan = plan_growth(make_problem(check_text(text), SampleRequest(ranges, n=n, seed=seed, spread=spread)), Budget())
    assert isinstance(plan, Growth)
    return plan


def test_all_cells_get_equal_shares_and_the_probability_adds_up():
    plan = planned("leftOf(a, b)", {"task": Range(0.1, 0.9)}, 3200)
    made = plan.draw(0)
    counts = np.bincount(made.cell, minlength=32)
    assert made.cell.min() >= 0 and len(counts) == 32 and np.ptp(counts) <= 8
    islands, total, square = made.facts[:3]
    truth = (0.9**2 - 0.1**2) / 2
    error = math.sqrt((square / islands - (total / islands) ** 2) / (islands - 1)) + 1e-3
    assert abs(total / islands - truth) < 5 * error
    # the density of a difference d of two uniform places is 1 - d; the left one is uniform in what it leaves
    apart = made.rows[3] - made.rows[0]
    low = 0.1 + 0.025 * made.cell
    within = ((1 - low) ** 2 - (1 - apart) ** 2) / ((1 - low) ** 2 - (1 - low - 0.025) ** 2)
    assert stats.kstest(within, "uniform").pvalue > 1e-3
    assert stats.kstest(made.rows[0] / (1 - apart), "uniform").pvalue > 1e-3
    for row in (1, 2, 4, 5):  # rows that nothing reads
        assert stats.kstest(made.rows[row] / (2 * math.pi if row % 3 == 2 else 1), "uniform").pvalue > 1e-3


def test_several_labels_have_a_product_of_cells():
    text = "left: leftOf(a, b)\nbelow: belowOf(a, b)\nfree: closeTo(a, b, 0.3)"
    plan = planned(text, {"left": Range(0.1, 0.5), "below": Range(0.2, 0.6)}, 256 * 4)
    made = plan.draw(0)
    counts = np.bincount(made.cell, minlength=256)
    assert (counts >= 4).all()
    phi = made.phi
    assert ((phi[0] >= 0.1) & (phi[0] <= 0.5) & (phi[1] >= 0.2) & (phi[1] <= 0.6)).all()
    np.testing.assert_allclose(phi[0], made.rows[3] - made.rows[0])
    assert abs(made.facts[1] / made.facts[0] / ((0.9**2 - 0.5**2) / 2 * (0.8**2 - 0.4**2) / 2) - 1) < 0.1


def test_cells_that_no_scene_reaches_are_left_out():
    """With both differences over 0.1875, mug and plate are over 0.265 apart."""
    text = "task: leftOf(mug, plate) & aboveOf(mug, plate)\nsafe: !closeTo(mug, plate, 0.25)"
    plan = planned(text, {"task": Range(0.0, 0.2), "safe": Range(0.0, 0.2)}, 1000)
    assert set(plan.reached_cells) >= set(range(240)) - {cell for cell in range(256) if cell % 16 == 0}
    assert len(plan.reached_cells) == 255


def test_the_deciding_atom_is_one_more_choice():
    """min(d1, d2) in a band: which of the two is the smaller one comes in equal shares."""
    plan = planned("leftOf(a, b) & leftOf(b, c)", {"task": Range(0.1, 0.12)}, 2000, spread="base")
    assert len(plan.model.graph.choices) == 1
    made = plan.draw(1)  # larger than the first
    x = made.rows[0::3]
    first = x[1] - x[0] < x[2] - x[1]
    assert abs(first.mean() - 0.5) < 4 * 0.5 / math.sqrt(len(first) / plan.recipe.effect)
    # P(min >= t) of the gaps of three ordered points is (1 - 2 t)^3 / 6
    truth = ((1 - 0.2) ** 3 - (1 - 0.24) ** 3) / 6
    assert abs(made.facts[1] / made.facts[0] / truth - 1) < 0.2


def test_copies_are_as_many_as_weights_say_on_average_and_nearly_so_always():
    weights = np.array([0.0, 0.3, 1.2, 0.1, 2.4, 1.0, 0.5, 0.5])
    group, rng, runs = np.zeros(8, dtype=np.intp), np.random.default_rng(0), 4000
    wanted = weights / weights.mean()
    counts = np.zeros((runs, 8))
    for run in range(runs):
        keep, mean = resample_groups(weights, group, rng)
        counts[run] = np.bincount(keep, minlength=8)
        assert len(keep) == 8 and (mean == weights.mean()).all()
    assert (np.abs(counts - wanted) < 1.0 + 1e-9).all()
    error = counts.std(axis=0) / np.sqrt(runs)
    assert (np.abs(counts.mean(axis=0) - wanted) < 4 * error + 1e-12).all()


def test_groups_keep_to_themselves_and_the_dead_are_left_out():
    weights = np.array([1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 2.0, 2.0])
    group = np.array([0, 0, 1, 1, 2, 2, 3, 3])
    keep, mean = resample_groups(weights, group, np.random.default_rng(1))
    assert keep[:2].tolist() == [0, 0] and (group[keep] == [0, 0, 2, 2, 3, 3]).all()
    assert keep[4:].tolist() == [6, 7]  # equal weights: everyone goes on as they are
    assert mean.tolist() == [0.5, 0.5, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0]


def test_copies_know_their_ancestors():
    model = machine_of("leftOf(a, b) & leftOf(b, c)")
    particles = everything_placed(model, anywhere(model.problem, 5))
    before = particles.scenes.copy()
    particles.take(np.array([1, 1, 3, 1, 4]))
    assert (particles.scenes == before[:, [1, 1, 3, 1, 4]]).all()
    assert particles.families[0].tolist() == [1, 1, 3, 1, 4]
