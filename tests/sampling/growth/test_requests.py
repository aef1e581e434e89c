"""Growth for many cells of a range at once. The room of one object under clauses. How rare phi is by growth: against
plain rejection and known answers, and where splitting fails.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.api.rarity import rarity
from scenegen.api.spec import parse
from scenegen.errors import RequestError
from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.resources import shipped_specs
from scenegen.sampling.growth import rarity as module
from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.model import Particles, make_growth_model
from scenegen.sampling.growth.population import AncestorEffect, spread_scenes
from scenegen.sampling.growth.rarity import measure_by_growth
from scenegen.sampling.growth.room import FreePoses
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rarity import measure, needs_growth
from scenegen.sampling.request import Range, SampleRequest


@pytest.mark.slow
def test_choices_in_a_bounded_range():
    """Each way of a choice has ends of its own for every cell."""
    spec = scenegen.parse(
        "object a, b, c\nrequire noOverlap()\n"
        "task: closeTo(a, b, 30 cm) & closeTo(b, c, 30 cm) | farFrom(a, b, 50 cm) & farFrom(b, c, 50 cm)\n"
    )
    scenes = scenegen.sample(spec, {"task": (-0.1, 0.0)}, 64, method="growth", timeout=60.0)
    values = scenes.phi["task"]
    assert ((values >= -0.1) & (values <= 0.0)).all()
    assert np.histogram(values, bins=4, range=(-0.1, 0.0))[0].min() >= 8


CONJUNCTION = "object a[8], b[8]\ntask: forall i in 1..8: leftOf(a[i], b[i]) & closeTo(a[i], b[i], 30 cm)"


@pytest.fixture(scope="module", params=["base", pytest.param("flat", marks=pytest.mark.long)])
def grown(request):
    """Growth and rejection at a range that phi must not leave upwards either; growth drops scenes that do."""
    checked = check_text(CONJUNCTION)
    asked = SampleRequest({"task": Range(-0.25, 0.0)}, n=1600, spread=request.param, workers=1)
    problem = make_problem(checked, asked)
    assert make_growth_model(problem).begin is None
    begin = make_growth_model(problem, loose=True).begin
    assert begin is not None and len(begin) == problem.cells.count
    return problem, *(draw(problem, method=method) for method in ("growth", "rejection"))


def test_scenes_may_leave_an_upper_end_while_they_grow(grown, same_distribution):
    problem, mine, truth = grown
    assert mine.count == truth.count == 1600 and mine.shortfall is None
    assert (
        np.bincount(problem.cells.find(mine.phi), minlength=problem.cells.count) == 1600 / problem.cells.count
    ).all()
    for one, other in zip([*mine.phi, *mine.rows], [*truth.phi, *truth.rows], strict=True):
        assert same_distribution(one, other)


def test_the_probability_is_that_of_the_range_all_the_same(grown):
    _, mine, truth = grown
    error = np.hypot(mine.info["log10_error"], truth.info["log10_error"])
    assert abs(mine.info["log10_probability"] - truth.info["log10_probability"]) < 1.5 * error
    assert mine.info["log10_error"] < 0.1


def test_an_upper_end_that_few_scenes_meet_is_minded():
    """Half a millimetre of one atom: nearly all scenes that meet the lower end are above it."""
    problem = make_problem(
        check_text("leftOf(a, b)"), SampleRequest({"task": Range(0.0, 0.0005)}, n=100, spread="base")
    )
    assert make_growth_model(problem, loose=True).begin is None


def test_cells_that_differ_are_no_kinship():
    """Scenes of one ancestor are of one cell, and cells ask for different margins: independent scenes have no kin."""
    problem = make_problem(check_text(CONJUNCTION), SampleRequest({"task": Range(-0.25, 0.1)}, n=3200))
    model = make_growth_model(problem, loose=True)
    cell, island = spread_scenes(model, range(32), 2048)
    particles = Particles.start(model, cell, island, np.random.default_rng(0))
    low, high = model.graph.low[:, cell], model.graph.high[:, cell]
    particles.scenes[:] = low + np.random.default_rng(1).random(low.shape) * (high - low)
    particles.families[:] = [island * 32 + cell]
    assert AncestorEffect(model)(particles) < 1.3


@pytest.mark.parametrize("branches", [1, 2, 3])
@pytest.mark.parametrize("columns", [slice(None), np.array([0, 2, 3])])
def test_ends_that_differ_by_cell_are_those_of_their_scenes(branches, columns):
    room = SimpleNamespace(places={7: 1}, scale=1.0)
    clause = Clause(7, frozenset({0}), np.array([0.1, 0.2]), np.array([0.6, 0.9]))
    cell = np.array([0, 1, 1, 0])[columns]
    low, high = np.full((2, branches, 4), 0.15), np.full((2, branches, 4), 0.8)
    FreePoses._impose(room, clause, cell, low, high, columns)
    mine = np.arange(4)[columns]
    assert low[1][:, mine] == pytest.approx(np.tile(np.array([0.15, 0.2])[cell], (branches, 1)), abs=1e-6)
    assert high[1][:, mine] == pytest.approx(np.tile(np.array([0.6, 0.8])[cell], (branches, 1)), abs=1e-6)
    assert (low[0] == 0.15).all() and (high[0] == 0.8).all()


SURE = 2.0  # error bars, of 95 % each
TABLE = """object disc[5] = cylinder(0.06, 0.05)
require noOverlap()
task: forall d in disc: closeTo(d, (0.5, 0.5), 45 cm)
"""


@pytest.fixture(scope="module")
def plain():
    """phi of `task` among plain uniform scenes that meet the requirement, and how many there were."""
    spec = check_text(TABLE)
    core, (lowest, highest) = gate(spec.core), spec.box()
    found, rng = [], np.random.default_rng(5)
    for _ in range(4):
        rows = lowest[:, None] + (highest - lowest)[:, None] * rng.random((len(lowest), 200_000))
        values = evaluate(core, list(rows), NUMPY)
        found.append(values["task"][values[REQUIRE] >= 0.0])
    return np.concatenate(found), 800_000


@pytest.mark.long
def test_growth_agrees_with_plain_rejection(plain, monkeypatch):
    """The means of six runs."""
    monkeypatch.setattr(module, "TAIL_EFFORT", 1e8)
    task, drawn = plain
    found = [measure_by_growth(check_text(TABLE), ("task",), seed=seed) for seed in range(6)]

    def agree(ours, share, count):
        known = 0.85 * math.sqrt((1.0 - share) / (share * count))
        error = math.hypot(math.sqrt(sum(one.error**2 for one in ours)) / len(ours), known)
        assert abs(sum(one.log10 for one in ours) / len(ours) - math.log10(share)) < SURE * error

    agree([one.requirement for one in found], len(task) / drawn, drawn)
    reaches = [one.reaches["task"] for one in found]
    for t in (-0.2, -0.1, -0.02, 0.0, 0.05):
        agree([reach.up(t) for reach in reaches], float((task >= t).mean()), len(task))
        agree([reach.down(t) for reach in reaches], float((task <= t).mean()), len(task))
    for reach in reaches:
        assert reach.up.end > task.max() - 0.02 and reach.down.end < -0.24


@pytest.mark.long
def test_growth_and_splitting_agree(monkeypatch):
    monkeypatch.setattr(module, "TAIL_EFFORT", 1e8)
    monkeypatch.setattr("scenegen.sampling.rarity.RARITY_VISITS", 500_000_000)
    spec = check_text(shipped_specs()["sort_5"].read_text(), "sort_5")
    (label,) = spec.labels
    grown = measure_by_growth(spec, (label,)).reaches[label].up
    split = measure(spec.core, *spec.box(), (label,)).reaches[label].up
    for t in (0.0, 0.05, 0.1):
        ours, theirs = grown(t), split(t)
        assert abs(ours.log10 - theirs.log10) < SURE * math.hypot(ours.error, theirs.error)


@pytest.mark.long
def test_what_is_known_in_closed_form(monkeypatch):
    """Twelve objects in order with 2 cm between: (1 - 11 * 2 cm)^12 / 12!, some 10^-10."""
    monkeypatch.setattr(module, "TAIL_EFFORT", 1e8)
    spec = check_text("object b[12]\ntask: forall i in 1..11: x(b[i]) + 2 cm <= x(b[i + 1])")
    found = measure_by_growth(spec, ("task",), up_only=True)
    estimate = found.reaches["task"].up(0.0)
    truth = 12 * math.log10(1.0 - 0.22) - math.log10(math.factorial(12))
    assert found.requirement is None
    assert abs(estimate.log10 - truth) < SURE * estimate.error and estimate.error < 0.4


def test_a_label_that_most_scenes_share():
    """phi is -0.01 in 91 % of the scenes: levels begin above that."""
    found = measure_by_growth(
        check_text("task: leftOf(a, b) & x(a) <= 0.3 & x(b) >= 0.7 | 0 * x(a) - 0.01 >= 0"), ("task",)
    )
    estimate = found.reaches["task"].up(0.0)
    assert abs(estimate.log10 - math.log10(0.09)) < SURE * estimate.error


def test_the_same_seed_gives_the_same_numbers(monkeypatch):
    monkeypatch.setattr(module, "TAIL_EFFORT", 1e7)
    spec = check_text(TABLE)
    first, again, other = (measure_by_growth(spec, ("task",), seed, up_only=True) for seed in (2, 2, 3))
    assert first.requirement == again.requirement != other.requirement
    assert first.reaches["task"].up(0.0) == again.reaches["task"].up(0.0)
    assert first.evaluations == again.evaluations


def test_who_takes_whose_place():
    """Splitting serves small tables, growth those on which it would get nowhere."""
    large = check_text(
        "object block[20] = box(0.06, 0.06, 0.05)\nrequire noOverlap()\ntask: leftOf(block[1], block[2])"
    )
    assert needs_growth(large, large.labels)
    for name in ("dinner_for_two", "table_setting", "office_desk", "sort_7"):
        spec = check_text(shipped_specs()[name].read_text(), name)
        assert not needs_growth(spec, spec.labels)


def test_who_chooses_surfaces_is_grown():
    """Chains hardly ever change surfaces."""
    text = "region near = rect(0, 0, 1, 0.4)\nregion far = rect(0, 0.6, 1, 1)\n"
    text += "object can on any of [near, far], cup\ntask: leftOf(can, cup)"
    chosen, plain = check_text(text), check_text(text.replace("any of [near, far]", "far"))
    assert needs_growth(chosen, chosen.labels)
    assert not needs_growth(plain, plain.labels)


@pytest.mark.long
def test_what_is_satisfied_is_told_however_little_the_tail_may_take(monkeypatch):
    """P(phi >= 0) is (pi 0.02^2 * 0.02)^3, less what lies beyond the border; a single run level by level, which is
    all that the effort allows, stays far away."""
    monkeypatch.setattr(module, "TAIL_EFFORT", 0.0)
    monkeypatch.setattr(module, "MIN_RUNS", 1)
    close = " & ".join(
        f"dist(a[{k}], b[{k}]) <= 2 cm & abs(wrap(theta(a[{k}]) - theta(b[{k}]))) <= 3.6 deg" for k in (1, 2, 3)
    )
    spec = check_text(f"object a[3], b[3]\ntask: {close}")
    at_zero = measure_by_growth(spec, spec.labels, up_only=True).reaches["task"].up(0.0)
    truth = 3.0 * math.log10(math.pi * 0.02**2 * 0.02)
    assert at_zero is not None and abs(at_zero.log10 - truth) < SURE * at_zero.error + 0.03


@pytest.mark.long
def test_what_splitting_cannot_tell_growth_does(monkeypatch):
    """P(phi >= 0) is pi * (0.2 mm)^2 times 0.001 / pi, less what lies beyond the border."""
    monkeypatch.setattr(module, "TAIL_EFFORT", 1e8)
    found = rarity(parse("task: dist(a, b) <= 0.2 mm & abs(wrap(theta(a) - theta(b))) <= 0.001"))
    (label,) = found.labels
    at_zero = next(level.above for level in label.levels if level.phi == 0.0)
    truth = math.log10(math.pi * 0.0002**2 * 0.001 / math.pi)
    assert abs(at_zero.log10 - truth) < SURE * at_zero.error + 0.01


@pytest.mark.long
def test_a_table_that_is_too_full(monkeypatch):
    monkeypatch.setattr(module, "TAIL_EFFORT", 1e7)
    monkeypatch.setattr(module, "FIRST_EFFORT", 1e8)
    full = "workspace [0, 0.5] x [0, 0.5]\nobject d[12] = cylinder(0.1, 0.1)\nrequire noOverlap() & insideWorkspace()\n"
    with pytest.raises(RequestError):
        rarity(parse(full + "task: leftOf(d[1], d[2])"))
