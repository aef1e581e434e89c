"""The second look finds every kind of scene that must not be handed out. The same seed gives the same bytes, in
another process and on other threads. The bars of issue C at a size for every day: one spec per sampler, and the
wrong samplers seen. The whole of it, with n = 20,000 and nine specs, is tests/slow/test_exactness.py. When time is
up: how many there are, which label and which atom stood in the way, and what to do.
"""

import dataclasses
import math
import os
import re
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.api.sample import sample
from scenegen.api.spec import Spec, load, parse
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Core
from scenegen.lang.formula.interpret import evaluate
from scenegen.resources import shipped_specs
from scenegen.sampling.plan import verify
from scenegen.sampling.plans import draw
from scenegen.sampling.plans import draw as run
from scenegen.sampling.problem import SCENES_IN_CACHE, make_problem
from scenegen.sampling.report import shortfall, too_early
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.formats.scenes_json import dump
from scenegen.search.effort import Budget

from .doubles import DOUBLES
from .plain import CASES, fits, setting_probability, truth, uniform
from .verdict import judge, uniform_p


@pytest.fixture(scope="module")
def made(exp1):
    core = dataclasses.replace(exp1.core, labels={"task": exp1.core.labels["task"]})
    spec = dataclasses.replace(exp1, core=dataclasses.replace(core, requirement=exp1.core.labels["safe"]))
    problem = make_problem(
        spec, SampleRequest({"task": Range(0.1, 0.2)}, n=SCENES_IN_CACHE + 100, fix={"plate": (0.6, 0.3)})
    )
    return problem, draw(problem)


LAST = SCENES_IN_CACHE + 7  # a scene of the second chunk


def off(row, value):
    def change(rows, phi):
        rows[row, LAST] = value

    return change


def phi_off(rows, phi):
    phi[0, LAST] += 1e-8


def nan(rows, phi):
    rows[2, LAST] = np.nan


def swapped(rows, phi):
    rows[:, LAST] = rows[:, 0]


def too_close(rows, phi):
    """The requirement fails, where the label is as wanted: 0.11 to the left and above is closer than 0.25."""
    rows[:2, LAST] = 0.6 - 0.11, 0.3 + 0.11
    phi[0, LAST] = 0.11


def too_far(rows, phi):
    rows[:2, LAST] = 0.2, 0.9
    phi[0, LAST] = 0.6 - 0.2


WRONG = {
    "phi": (phi_off, "disagree"),
    "another scene": (swapped, "disagree"),
    "range": (too_far, "outside the requested range"),
    "requirement": (too_close, "outside the requested range"),
    "heading": (off(2, 7.0), "outside the workspace"),
    "no number": (nan, "outside the workspace"),
    "held": (off(3, 0.6 + 1e-12), "held in place"),
}


def test_what_comes_out_passes(made):
    problem, found = made
    verify(problem, found.rows, found.phi)


@pytest.mark.parametrize("name", WRONG)
def test_what_must_not_come_out(name, made):
    problem, found = made
    change, said = WRONG[name]
    rows, phi = found.rows.copy(), found.phi.copy()
    change(rows, phi)
    with pytest.raises(AssertionError, match=said):
        verify(problem, rows, phi)


def test_out_of_the_workspace(exp1):
    problem = make_problem(exp1, SampleRequest(n=10))
    rows = draw(problem).rows
    rows[1, 3] = 1.0 + 1e-12
    with pytest.raises(AssertionError, match="outside the workspace"):
        verify(problem, rows, problem.phi(rows))


SPEC = shipped_specs()["mug_left_of_plate"]
WORDS = ["sample", str(SPEC), "--phi", "task=0.05:0.2", "--phi", "safe=0:", "-n", "200", "--seed", "11"]


def in_a_process(threads, *more):
    environment = os.environ | {"OMP_NUM_THREADS": str(threads), "PYTHONHASHSEED": str(threads)}
    command = [sys.executable, "-m", "scenegen", *WORDS, *more]
    return subprocess.run(command, capture_output=True, env=environment, check=True, timeout=60).stdout


@pytest.mark.long
def test_bytes():
    one = in_a_process(1)
    assert in_a_process(2, "--timeout", "33") == one
    here = sample(load(SPEC), {"task": (0.05, 0.2), "safe": (0.0, None)}, n=200, seed=11)
    assert dump(here.file()) == one


def test_another_seed_and_another_count():
    spec = load(SPEC)
    runs = [sample(spec, {"task": (0.05, 0.2)}, n=100, seed=seed).poses for seed in (0, 1, 2**63 - 1)]
    scenes = {scene.tobytes() for poses in runs for scene in poses}
    assert len(scenes) == 300


N = 4000
SEEDS = range(3)


@pytest.mark.parametrize("name", CASES)
def test_phi_by_hand_is_the_interpreters(name):
    """Scene by scene in plain floats, in the range, near it and anywhere; requirements alike."""
    case, core = CASES[name], check_text(CASES[name].text, name).core
    rng = np.random.default_rng(0)
    near = truth(case, 100, rng)
    rows = np.concatenate([near, near + 0.02 * rng.standard_normal(near.shape), uniform(case, 100, rng)], axis=1)
    rows = rows[:, ((rows[2::3] >= 0) & (rows[2::3] < 2 * math.pi)).all(axis=0)]
    compared = 0
    for scene, mine in zip(rows.T, case.phi(rows).T, strict=True):
        values = evaluate(core, scene.tolist())
        theirs = [values[node] for node in core.labels.values()]
        if case.box is None or min(theirs) > 0:  # the published reading is written out for phi > 0 alone
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-14)
            compared += 1
        if case.required is not None:
            assert case.required(scene[:, None])[0] == (_requirement(core, values) >= 0)
    assert compared >= 100


def _requirement(core: Core, values):
    assert core.requirement is not None
    margin = values[core.requirement]
    assert abs(margin) > 1e-9  # two ways of rounding must not decide
    return margin


@pytest.fixture(scope="module")
def true():
    return [truth(CASES["exp1"], N, np.random.default_rng([seed, 77])) for seed in SEEDS]


@pytest.mark.long
@pytest.mark.parametrize("method", ["rejection", "splitting"])
def test_scenes_are_the_truth(method, true):
    case = CASES["exp1"]
    verdicts = []
    for seed in SEEDS:
        scenes = scenegen.sample(
            scenegen.parse(case.text), case.ranges, N, seed=seed, method=method, spread="base", workers=1
        )
        assert scenes.header.sampler["method"] == method
        rows = scenes.poses.reshape(N, -1).T
        assert fits(case, rows).all() and len(np.unique(rows, axis=1).T) == N
        verdicts.append(judge(true[seed], rows, np.random.default_rng([seed, 78])))
    assert sum(verdict.alike for verdict in verdicts) >= 2, verdicts


@pytest.mark.long
@pytest.mark.parametrize("double", DOUBLES)
def test_wrong_samplers_are_seen(double, true):
    case = CASES["exp1"]
    for seed in SEEDS[:1]:  # the slow tests take them all, more scenes and more specs
        wrong = DOUBLES[double](case, N, np.random.default_rng([seed, 79]))
        assert fits(case, wrong).all()
        assert not judge(true[seed], wrong, np.random.default_rng([seed, 80])).alike


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.answers])
def test_plain_rejection_is_what_the_formula_says(name):
    """The truth and the analytic answers, which the samplers are held against, agree with each other."""
    p = [uniform_p(CASES[name].answers(truth(CASES[name], N, np.random.default_rng([seed, 81])))) for seed in SEEDS]
    assert sum(one > 0.01 for one in p) >= 2, p


@pytest.mark.parametrize("published", [False, True])
def test_the_integral_of_experiment_2_is_what_plain_rejection_counts(published):
    case = CASES["setting, published" if published else "setting"]
    low, high = np.array(case.box).T
    rows = low[:, None] + (high - low)[:, None] * np.random.default_rng(5).random((len(low), 400_000))
    size = np.tile([1.0, 1.0, 2 * math.pi], 4)
    expected = setting_probability(*case.ranges["task"], published) / float(np.prod((high - low) / size))
    counted = int(fits(case, rows).sum())
    assert stats.binomtest(counted, rows.shape[1], expected).pvalue > 0.001


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
        sample(Spec(exp1), {"task": (-0.5, None), "safe": (1.1, None)}, n=4_000_000, timeout=1.0)
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
