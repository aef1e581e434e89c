"""Plan and pieces: the same scenes however they are run, and an end where there is nothing to be found."""

import time
from functools import partial

import numpy as np
import pytest

from scenegen.api.sample import sample
from scenegen.api.spec import Spec, parse
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling.plans import draw as run
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.splitting.sampler import Splitting, SplittingStalled, _SceneDescent, make_schedule
from scenegen.search.effort import Budget

splitting = partial(run, method="splitting")

RARE = {"task": Range(0.05, 0.06)}


@pytest.fixture(scope="module", autouse=True)
def few_chains():
    """An eighth of the usual chains; tests/slow and tests/sampling/test_verify.py take all of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenegen.sampling.splitting.sampler.MAX_CHAINS", 1024)
        yield


@pytest.fixture(scope="module")
def problem(exp2):
    return make_problem(exp2, SampleRequest(RARE, n=1000, seed=3, spread="base"))


@pytest.fixture(scope="module")
def plan(problem):
    plan = make_schedule(problem, Budget())
    assert not isinstance(plan, SplittingStalled)
    return plan


@pytest.mark.long
def test_a_piece_is_the_same_whenever_it_is_run(problem, plan):
    first = Splitting(problem, plan).draw(2)
    other = Splitting(problem, plan).draw(0)
    again = Splitting(problem, plan).draw(2)
    assert first.rows.tobytes() == again.rows.tobytes() and first.phi.tobytes() == again.phi.tobytes()
    assert first.facts.tobytes() == again.facts.tobytes()
    assert not set(first.rows[0].tolist()) & set(other.rows[0].tolist())


@pytest.mark.long
def test_a_plan_made_again_is_the_same(problem, plan):
    again = make_schedule(problem, Budget())
    assert Splitting(problem, again).draw(0).rows.tobytes() == Splitting(problem, plan).draw(0).rows.tobytes()


@pytest.mark.long
def test_what_the_scene_file_says(exp2):
    """That its bytes are the same again, test_reproducible.py says."""
    info = sample(Spec(exp2), {"task": (0.05, 0.06)}, n=100, seed=4, method="splitting", spread="base").header.sampler
    assert info["method"] == "splitting" and info["levels"] > 15 and info["pieces"] >= 4
    assert -7 < info["log10_probability"] < -5.5 and 0 < info["log10_error"] < 0.3
    assert 0 < info["acceptance"] < 1 and 0 < info["effective_share"] <= 1 and info["stuck"] < 0.01


@pytest.mark.long
def test_another_seed_is_another_set(exp1):
    wanted = {"task": Range(0.4, 0.45)}
    runs = [
        splitting(make_problem(exp1, SampleRequest(wanted, n=50, seed=seed)), Budget()).rows for seed in (0, 2**63 - 1)
    ]
    assert not set(runs[0][0].tolist()) & set(runs[1][0].tolist())


@pytest.mark.long
def test_time_cuts_short_and_changes_no_scene(exp1):
    problem = make_problem(exp1, SampleRequest({"task": Range(0.3, 0.35)}, n=8_000, seed=1, spread="base"))
    whole = splitting(problem, Budget())

    class OnePiece(Budget):
        """Time is up with the first piece, whenever that is."""

        left = True

        @property
        def is_spent(self):
            return not OnePiece.left

    def stop(*_):
        OnePiece.left = False

    short = splitting(problem, OnePiece(), stop)
    assert whole.count == 8_000 > short.count > 0 and short.shortfall is not None
    assert set(short.rows[0].tolist()) < set(whole.rows[0].tolist())


def test_an_infeasible_query_ends_and_names_the_atom():
    """Sine and cosine of one angle are as good as independent to bounds, so nothing proves this empty."""
    started = time.process_time()
    never = "leftOf(a, b) & sin(theta(a)) * sin(theta(a)) + cos(theta(a)) * cos(theta(a)) <= 0.9999"
    with pytest.raises(RequestError) as caught:
        sample(parse(never), {"task": (0.0, 0.2)}, n=16, method="splitting", timeout=600)
    (problem,) = caught.value.diagnostics
    assert problem.title.startswith("found none of 16 scenes in ") and "levels" in problem.title
    assert problem.span is not None and "decides phi" in problem.label
    assert time.process_time() - started < 30


def test_no_time_no_scenes(exp2):
    with pytest.raises(RequestError, match="found none of 16 scenes in "):
        splitting(make_problem(exp2, SampleRequest(RARE, n=16)), Budget(1e-9))


def test_what_cannot_be_held_apart_from_the_rest_does_not_stall():
    """phi is the same on a whole part of the table: levels cannot part the scenes there."""
    spec = check_text("min(x(a) - 0.9, 0 * x(a)) <= 0 & x(b) >= 0.999")
    found = splitting(make_problem(spec, SampleRequest({"task": Range(-0.0005, 0.1)}, n=100, spread="base")), Budget())
    assert found.count == 100 and found.rows[3].min() >= 0.9985


def test_what_is_required_is_met_level_by_level():
    """One scene in 720: taken at one leap, a piece of 1,024 chains would begin with one ancestor, or none."""
    spec = check_text(
        "require leftOf(a, b) & leftOf(b, c) & leftOf(c, d) & leftOf(d, e) & leftOf(e, f)\ntask: closeTo(a, b, 0.9)"
    )
    planner = _SceneDescent(make_problem(spec, SampleRequest({"task": Range(0.0)}, n=16)), Budget())
    low, free = np.array([-np.inf, 0.0]), np.full(2, np.inf)
    assert planner._descend(low, free, -free) and len(planner.stages) > 6


def test_a_value_that_most_scenes_share_is_left_behind():
    """A few scenes: all others have the phi of the constant alternative."""
    spec = check_text("object a, b, c, d, e\ntask: dist(a, a) >= 1 cm | leftOf(a, b) & leftOf(b, c) & leftOf(d, e)")
    planner = _SceneDescent(make_problem(spec, SampleRequest({"task": Range(0.2)}, n=16)), Budget())
    assert planner._descend(np.array([0.2]), np.array([np.inf]), np.array([-np.inf]))


def test_nothing_that_moves():
    spec = check_text("object a, b\ntask: x(a) >= 0.2")
    held = splitting(make_problem(_held(spec), SampleRequest({"task": Range(0.0)}, n=10)), Budget())
    assert held.count == 10 and (held.rows[0] == 0.5).all()


def _held(spec):
    from dataclasses import replace

    return replace(spec, fixed={0: (0.5, 0.5, 0.0)})


def test_phi_free_of_all_limits(exp1):
    found = splitting(make_problem(exp1, SampleRequest(n=500)), Budget())
    assert found.count == 500 and np.ptp(found.rows[0]) > 0.9
