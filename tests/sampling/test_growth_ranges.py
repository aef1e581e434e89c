"""Growth for many cells of a range at once."""

import numpy as np
import pytest

import scenegen
from scenegen.lang.checker import check_text
from scenegen.sampling.engine.run import draw
from scenegen.sampling.growth.machine import Particles, make_machine
from scenegen.sampling.growth.population import AncestorEffect, spread_over
from scenegen.sampling.problem import make_problem
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


@pytest.fixture(scope="module", params=["base", "flat"])
def grown(request):
    """Growth and rejection at a range that phi must not leave upwards either; growth drops scenes that do."""
    checked = check_text(CONJUNCTION)
    asked = SampleRequest({"task": Range(-0.25, 0.1)}, n=3200, spread=request.param, workers=1)
    problem = make_problem(checked, asked)
    assert make_machine(problem).begin is None
    begin = make_machine(problem, loose=True).begin
    assert begin is not None and len(begin) == problem.cells.count
    return problem, *(draw(problem, method=method) for method in ("growth", "rejection"))


def test_scenes_may_leave_an_upper_end_while_they_grow(grown, same_distribution):
    problem, mine, truth = grown
    assert mine.count == truth.count == 3200 and mine.shortfall is None
    assert (
        np.bincount(problem.cells.find(mine.phi), minlength=problem.cells.count) == 3200 / problem.cells.count
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
    assert make_machine(problem, loose=True).begin is None


def test_cells_that_differ_are_no_kinship():
    """Scenes of one ancestor are of one cell, and cells ask for different margins: independent scenes have no kin."""
    problem = make_problem(check_text(CONJUNCTION), SampleRequest({"task": Range(-0.25, 0.1)}, n=3200))
    machine = make_machine(problem, loose=True)
    cell, island = spread_over(machine, range(32), 2048)
    particles = Particles.start(machine, cell, island, np.random.default_rng(0))
    low, high = machine.graph.low[:, cell], machine.graph.high[:, cell]
    particles.scenes[:] = low + np.random.default_rng(1).random(low.shape) * (high - low)
    particles.families[:] = [island * 32 + cell]
    assert AncestorEffect(machine)(particles) < 1.3
