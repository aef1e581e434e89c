"""When time is up: how many there are, which label and which atom stood in the way, and what to do."""

import re
from functools import partial

import numpy as np
import pytest

from scenegen.api.sample import sample
from scenegen.api.spec import Spec, parse
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling.engine.run import draw as run
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.report import shortfall, too_early
from scenegen.sampling.request import Range, SampleRequest

rejection = partial(run, method="rejection")

# The sine and the cosine of one angle are as good as independent to bounds: empty, and no box proves it.
HOPELESS = "leftOf(a, b) & sin(theta(a)) * sin(theta(a)) + cos(theta(a)) * cos(theta(a)) <= 0.9999"


@pytest.mark.long
@pytest.mark.parametrize("spread", ["flat", "base"])
def test_a_hopeless_range_names_label_and_atom(spread):
    with pytest.raises(RequestError) as caught:
        sample(parse(HOPELESS), {"task": (0.0, 0.2)}, n=16, timeout=5.0, spread=spread)
    (problem,) = caught.value.diagnostics
    assert problem.title.startswith("found none of 16 scenes in ")
    assert problem.span.text.startswith("sin(theta(a))")
    assert int(re.search(r"decides phi in (\d+)% of those that fail", problem.label)[1]) > 90
    assert problem.note.startswith("phi of `task` was outside `0:0.2` in 100.0% of ")
    assert "`timeout`" in problem.help and "`keep_partial`" not in problem.help


def test_a_range_that_is_provably_empty_names_what_clashes(exp2):
    """Between two borders that are 20 cm apart no margin can exceed 10 cm."""
    with pytest.raises(RequestError, match="no scene can have phi of `task` in 0\\.15:0\\.2") as caught:
        sample(Spec(exp2), {"task": (0.15, 0.2)}, n=16)
    (problem,) = caught.value.diagnostics
    assert problem.note.endswith("bounds prove it")
    assert problem.span.text == "aboveOf(p, BOTTOM)" and problem.note.startswith("`belowOf(")


def test_the_label_that_fails_most_is_the_one_named(exp1):
    with pytest.raises(RequestError) as caught:
        sample(Spec(exp1), {"task": (-0.5, None), "safe": (1.1, None)}, n=4_000_000, timeout=0.3)
    (problem,) = caught.value.diagnostics
    assert "phi of `safe` was outside `1.1:`" in problem.note
    assert problem.span.text == "closeTo(mug, plate, 0.25)"


def test_keep_partial_keeps_what_there_is(exp1):
    wanted = {"task": (0.5, None)}
    with pytest.raises(RequestError, match="save what there is with `keep_partial`"):
        sample(Spec(exp1), wanted, n=4_000_000, timeout=0.3)
    scenes = sample(Spec(exp1), wanted, n=4_000_000, timeout=0.3, keep_partial=True)
    assert 0 < len(scenes) < 4_000_000
    assert scenes.phi["task"].min() >= 0.5
    (warning,) = scenes.warnings
    assert warning.severity == "warning" and warning.title.startswith(f"found {len(scenes):,} of 4,000,000 scenes in ")
    assert scenes.header.request.n == 4_000_000


def test_keep_partial_of_nothing_is_nothing():
    with pytest.raises(RequestError, match=r"found none|time was up after"):
        sample(parse(HOPELESS), {"task": (0.0, 0.2)}, n=16, timeout=0.1, spread="base", keep_partial=True)


def test_time_changes_no_scene(exp1):
    """A run that is cut short hands out scenes that the whole run has as well."""
    whole = rejection(make_problem(exp1, SampleRequest({"task": Range(0.5)}, n=200_000, seed=6)), Budget())
    short = rejection(make_problem(exp1, SampleRequest({"task": Range(0.5)}, n=200_000, seed=6)), Budget(1e-9))
    assert short.shortfall is not None and 0 < short.count < 200_000 == whole.count
    assert {scene.tobytes() for scene in short.rows.T} < {scene.tobytes() for scene in whole.rows.T}


@pytest.mark.long
def test_infeasible_cells_are_reported_and_their_share_goes_to_the_others(exp1):
    """A distance of at most 0.17 cannot leave a coordinate 0.18 short."""
    ranges = {"task": Range(-0.18, -0.16), "safe": Range(-0.1, -0.08)}
    found = rejection(make_problem(exp1, SampleRequest(ranges, n=512, seed=0)), Budget())
    task, safe = np.linspace(-0.18, -0.16, 17), np.linspace(-0.1, -0.08, 17)
    feasible = safe[None, 1:] + 0.25 > -task[1:, None]
    counts, _, _ = np.histogram2d(*found.phi, bins=[task, safe])
    assert found.shortfall is None and found.count == 512 == counts.sum()
    assert 0 < feasible.sum() < 256 and not counts[~feasible].any()
    reached = counts[counts > 0]
    assert reached.max() - reached.min() <= 1
    assert found.info["cells"] == {"asked": 256, "reached": len(reached)}
    (warning,) = found.warnings
    assert warning.title.startswith(f"{256 - len(reached)} of 256 cells of the range were not reached in ")
    assert warning.note.startswith("task -0.18:-0.1787, safe -0.1:-0.09875; ")
    assert warning.help == "the scenes are spread over the others"


def test_a_corner_of_small_probability_is_reached(exp1):
    """phi of the last cell, 0.9969 to 1, has probability 2e-11."""
    found = rejection(make_problem(exp1, SampleRequest({"task": Range(0.9, 1.0)}, n=32, seed=0)), Budget())
    assert np.histogram(found.phi[0], np.linspace(0.9, 1.0, 33))[0].tolist() == [1] * 32 and found.warnings == ()
    assert found.info["cells"]["reached"] == 32


def test_cells_that_bounds_rule_out_are_counted(exp1):
    found = rejection(make_problem(exp1, SampleRequest({"safe": Range(-0.3, 0.0)}, n=64, seed=0)), Budget())
    (warning,) = found.warnings
    assert warning.title.startswith("5 of 32 cells") and "interval bounds rule out 5 of them" in warning.note


def test_too_early_to_tell_is_not_called_a_lack_of_scenes():
    contrary = parse("leftOf(mug, plate) & leftOf(plate, mug)")
    with pytest.raises(RequestError, match="too early to tell which parts of the range can be reached"):
        sample(contrary, {"task": (-1.0, 1.0)}, n=1, timeout=1e-6)
    assert len(sample(contrary, {"task": (-1.0, 1.0)}, n=1)) == 1


ADVICE = "object a, b, c\nrequire noOverlap()\ntask: leftOf(a, b) & sin(40 * theta(c)) >= 0.99"


@pytest.mark.parametrize(
    ("spread", "phi", "spreads"),
    [("base", (0.0, 0.2), False), ("flat", (0.0, None), False), ("flat", (0.0, 0.2), True)],
)
def test_advice_names_what_was_not_asked_for_yet(spread, phi, spreads):
    """`spread="base"` is no help where there is one cell only."""
    problem = make_problem(check_text(ADVICE), SampleRequest({"task": Range(*phi)}, n=100, spread=spread))
    none = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
    for told in (too_early(problem, "2 draws", problem.cells.count), shortfall(problem, 3, "2 draws", *none, rarest=0)):
        assert ("spread=" in told.help) == spreads == ("cells" in told.note or "rarest" in told.note)
        assert "time" in told.help
