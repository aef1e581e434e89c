"""How rare phi is, against plain numpy, known answers and pruned rejection."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from scenegen.api.rarity import rarity
from scenegen.api.spec import parse
from scenegen.lang.checker import check_text
from scenegen.learn.guided import score
from scenegen.learn.refine import draw as base
from scenegen.learn.refine import piece_generator
from scenegen.resources import shipped_specs
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rarity import RequirementUnmet, measure
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

SURE = 2.0  # error bars, of 95 % each: of a few dozen comparisons none should be further off


def measured(text_or_spec, seed=0):
    spec = check_text(text_or_spec, "test") if isinstance(text_or_spec, str) else text_or_spec
    return measure(spec.core, *spec.box(), spec.labels, seed)


def off(estimate, truth):
    """By how many of its error bars an estimate misses a known probability."""
    return abs(estimate.log10 - math.log10(truth)) / estimate.error


@pytest.fixture(scope="module")
def difference():
    """phi is the difference of two uniform places: P(phi >= t) = (1 - t)^2 / 2 for t >= 0."""
    return measured("leftOf(a, b)")


@pytest.mark.parametrize("t", [0.0, 0.1, 0.5, 0.9, 0.99])
def test_both_tails_of_a_difference(difference, t):
    reach = difference.reaches["task"]
    truth = (1.0 - t) ** 2 / 2.0
    assert off(reach.up(t), truth) < SURE and off(reach.down(-t), truth) < SURE
    assert reach.up(t).error < 0.1


def test_the_ends_are_reached_and_nothing_lies_beyond(difference):
    reach = difference.reaches["task"]
    assert 0.999 < reach.up.end < 1.0 and -1.0 < reach.down.end < -0.999
    assert reach.up.whole and reach.down.whole
    assert reach.up(1.0) is None and reach.up(1.5) is None and reach.down(-1.0) is None


def test_what_all_scenes_meet_is_as_certain_as_their_number_tells(difference):
    """Of n scenes none is below: at 95 % at most 3 in n are (the rule of three)."""
    tail = difference.reaches["task"].up
    count = tail.values[0].size
    estimate = tail(-2.0)
    assert estimate.log10 == 0.0 and estimate.error == pytest.approx(-math.log10(1.0 - 3.0 / count))


@pytest.mark.long
def test_the_interval_holds_where_nearly_all_scenes_are():
    """P(phi <= t) of a difference is 1 - (1 - t)^2 / 2: at the end no scene of a run misses it, and `0 +- 0` would be
    wrong."""
    spec = check_text("leftOf(a, b)")
    tails = [
        measure(spec.core, *spec.box(), spec.labels, seed, work=400_000).reaches["task"].down for seed in range(25)
    ]
    for t in (0.9, 0.95, 0.98, 0.99):
        truth = math.log10(1.0 - (1.0 - t) ** 2 / 2.0)
        found = [tail(t) for tail in tails]
        assert min(one.error for one in found) > 0.0
        assert np.mean([abs(one.log10 - truth) <= one.error for one in found]) >= 0.84


# A board of 20 x 20 cm inside of the workspace with something on it. Of uniform places of its centre, 1 - 4 E h +
# 4 E h^2 are inside, h = 0.1 (|cos| + |sin|) of a uniform heading; of the other's places, 0.2 * 0.2 are on it.
BOARD = """object board = box(20 cm, 20 cm, 2 cm)
object cup = cylinder(2 cm, 8 cm) on board
require insideWorkspace([board])
task: leftOf(board, cup)
"""
ON_BOARD = 0.04 * (1.0 - 1.6 / math.pi + 0.04 * (1.0 + 2.0 / math.pi))


@pytest.mark.long
def test_what_stands_counts_over_the_workspace():
    """Its own box reaches as far around the workspace as what carries it."""
    found = rarity(parse(BOARD))
    assert abs(found.requirement.log10 - math.log10(ON_BOARD)) < SURE * found.requirement.error < 0.2
    (task,) = found.labels
    at_zero = next(level for level in task.levels if level.phi == 0.0)
    assert abs(at_zero.above.log10 - math.log10(0.5)) < SURE * at_zero.above.error


@pytest.mark.parametrize("method", ["rejection", "growth", "splitting"])
def test_so_it_does_in_the_probability_of_a_request(method):
    found = draw(make_problem(check_text(BOARD), SampleRequest({"task": Range(0.0)}, n=4000)), method=method)
    truth = math.log10(0.5 * ON_BOARD)
    assert abs(found.info["log10_probability"] - truth) < SURE * found.info["log10_error"] < 0.3


def test_what_stands_and_is_held_counts_for_nothing():
    """Its place is given, and so is no part of the probability."""
    request = SampleRequest({"task": Range(0.0)}, n=400, fix={"cup": (0.5, 0.5)})
    found = draw(make_problem(check_text(BOARD), request), method="rejection")
    free = draw(make_problem(check_text(BOARD), replace(request, fix={})), method="rejection")
    # the board is as likely round the cup as the cup on the board, but for where it would reach over the edge
    assert found.info["log10_probability"] == pytest.approx(math.log10(0.5 * 0.04), abs=0.05)
    assert free.info["log10_probability"] == pytest.approx(math.log10(0.5 * ON_BOARD), abs=0.05)


def test_rarer_is_never_more_probable(difference):
    values = [difference.reaches["task"].up(t).log10 for t in np.linspace(-0.9, 0.99, 60)]
    # between two levels the counts cannot rise; across one, the estimates of two stages may differ by their errors
    assert all(later < earlier + 0.02 for earlier, later in pairwise(values))


@pytest.mark.long
def test_a_requirement_conditions_and_is_measured_itself():
    text = "require leftOf(a, b)\ntask: rightOf(c, b)"
    found = measured(text)
    assert off(found.requirement, 0.5) < SURE
    # a < b: b has density 2 b, and c >= b + t with probability 1 - t - b: the integral up to 1 - t is (1 - t)^3 / 3
    truth = (1.0 - 0.3) ** 3 / 3.0
    assert off(found.reaches["task"].up(0.3), truth) < SURE


@pytest.mark.long
def test_a_rare_requirement(direct):
    text = "object mug, plate\nrequire closeTo(mug, plate, 2 cm)\ntask: leftOf(mug, plate) & aboveOf(mug, plate)"
    found = measured(text)
    rows = direct(4_000_000)
    dx, dy = rows[3] - rows[0], rows[1] - rows[4]
    near = np.hypot(dx, dy) <= 0.02
    # within plain numpy's own error, whose standard error is about 0.7 %
    assert abs(found.requirement.log10 - math.log10(near.mean())) < SURE * found.requirement.error + 0.01
    task = np.minimum(dx, dy)[near]
    for t in (-0.01, 0.0, 0.005):
        ours, truth = found.reaches["task"].up(t), (task >= t).mean()
        assert abs(ours.log10 - math.log10(truth)) < SURE * ours.error + 3.0 * 0.43 / math.sqrt(truth * len(task))


@pytest.mark.long
@pytest.mark.parametrize(("name", "truth"), [("table_setting", 9.8e-6), ("table_setting_published", 7.3e-6)])
def test_experiment_2_by_the_numbers_of_the_reference(name, truth):
    """The published figure has two digits: half of the last one, 0.7 %, is within a tenth of the error bar."""
    spec = check_text(shipped_specs()[name].read_text(), name)
    reach = measured(spec).reaches["task"]
    assert off(reach.up(0.0), truth) < 1.5 and reach.up(0.0).error < 0.12
    assert 0.0997 < reach.up.end <= 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "label", "t"),
    [("mug_left_of_plate", "task", 0.8), pytest.param("sort_7", "sorted", 0.05, marks=pytest.mark.slow)],
)
def test_pruned_rejection_agrees(name, label, t):
    spec = check_text(shipped_specs()[name].read_text(), name)
    problem = make_problem(spec, SampleRequest({label: Range(t, None)}, n=20_000, seed=1, spread="base"))
    info = draw(problem, Budget(), method="rejection").info
    ours = measured(spec, seed=1).reaches[label].up(t)
    error = math.hypot(ours.error, info["log10_error"])
    assert abs(ours.log10 - info["log10_probability"]) < SURE * error


@pytest.mark.long
def test_the_same_seed_gives_the_same_numbers(difference):
    again, other = (measured("leftOf(a, b)", seed).reaches["task"].up(0.7) for seed in (0, 1))
    assert difference.reaches["task"].up(0.7) == again != other


def test_a_top_that_many_scenes_share():
    """phi is at most 0.1, and that in 40.5 % of the scenes."""
    reach = measured("leftOf(a, b) & 0.1 + 0 * x(a) >= 0").reaches["task"]
    assert reach.up.end == 0.1 and off(reach.up(0.1), 0.9**2 / 2.0) < SURE
    assert reach.up(0.1 + 1e-9) is None


def test_a_label_that_cannot_move():
    spec = check_text("object a, b\ntask: leftOf(a, b)\nother: leftOf(b, a)", "test")
    spec = replace(spec, fixed={0: (0.2, 0.5, 0.0), 1: (0.6, 0.5, 0.0)})
    reach = measured(spec).reaches["other"]
    assert (reach.up.end, reach.down.end) == (pytest.approx(-0.4), pytest.approx(-0.4))
    assert reach.up(-0.5).log10 == 0.0 and reach.up(0.0) is None


@pytest.mark.long
def test_a_requirement_out_of_reach():
    found = measured("require leftOf(a, b) & leftOf(b, a) & x(a) >= x(b) + 0.1\ntask: aboveOf(a, b)")
    assert isinstance(found, RequirementUnmet) and -0.06 < found.best < 0.0


RUNS = 150


def shares(held):
    """The share of bars that hold the truth over all runs (runs, places), and its standard error. The places of one run
    share their levels and are off together, so runs are what is independent."""
    each = np.mean(held, axis=1)
    return float(each.mean()), float(each.std(ddof=1)) / math.sqrt(len(each))


@pytest.mark.slow
@pytest.mark.parametrize(("text", "power"), [("leftOf(a, b)", 1), ("leftOf(a, b) & aboveOf(a, b)", 2)])
def test_error_bars_are_honest(text, power):
    """Bars are 95 % intervals: so many of them hold the truth, but for 2.3 standard errors. Bars that are a quarter
    narrower hold less than that."""
    places = [0.2, 0.4, 0.6, 0.8, 0.9]
    misses = []
    for seed in range(RUNS):
        reach = measured(text, seed).reaches["task"]
        misses.append([off(reach.up(t), ((1.0 - t) ** 2 / 2.0) ** power) for t in places])
    share, error = shares(np.array(misses) < 1.0)
    assert share + 2.3 * error > 0.95
    share, error = shares(np.array(misses) < 0.75)
    assert share + 2.3 * error < 0.95


@pytest.mark.slow
def test_error_bars_are_honest_where_something_is_required():
    spec = check_text(shipped_specs()["dinner_for_two"].read_text(), "dinner_for_two")
    problem = make_problem(spec, SampleRequest(n=16, spread="base"))
    scenes = (
        base(problem.lowest, problem.highest, problem.piece_size, piece_generator(0, piece)) for piece in range(40)
    )
    margins = [score(problem, rows) for rows in scenes]
    phi = np.concatenate(margins, axis=1)
    total = phi.shape[1]
    phi = phi[:, phi[-1] >= 0.0]
    held = []
    for seed in range(20):
        found = measured(spec, seed)
        run = [off(found.requirement, phi.shape[1] / total) < 1.0]
        for label, values in zip(spec.labels, phi, strict=False):
            for share in (0.3, 0.1, 0.01):
                t = float(np.quantile(values, 1.0 - share))
                run.append(off(found.reaches[label].up(t), (values >= t).mean()) < 1.0)
        held.append(run)
    share, error = shares(held)
    assert share + 2.3 * error > 0.95
