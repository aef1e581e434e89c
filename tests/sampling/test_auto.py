"""Which sampler `auto` takes: counted, never timed, and told in a few words."""

import re

import numpy as np
import pytest

from scenegen.engine.exact import draw
from scenegen.errors import RequestError
from scenegen.lang.check import check_text
from scenegen.resources import shipped_specs
from scenegen.sampling import problem as module
from scenegen.sampling.auto import choose
from scenegen.sampling.problem import Budget, pose
from scenegen.sampling.request import Range

# Waves of independent headings: no box of poses tells where their product is large.
WAVES = " * ".join(f"sin(20 * theta({name}))" for name in "abcde")
RARE = f"task: {WAVES} >= 0.99"
SPREAD = f"task: {WAVES} >= 0"
NEVER = "leftOf(a, b) & sin(theta(a)) * sin(theta(a)) + cos(theta(a)) * cos(theta(a)) <= 0.9999"


def chosen(text, low, high, n=200, method="auto"):
    return choose(pose(check_text(text), {"task": Range(low, high)}, n=n), method, Budget())


def test_a_common_range_is_rejection_and_says_how_common(exp1):
    choice = choose(pose(exp1, {"task": Range(0.1, 0.3)}, n=1000), "auto", Budget())
    assert choice.plan.name == "rejection"
    share = int(re.fullmatch(r"(\d+)% of the candidates from 1 box are in range", choice.reason)[1])
    found = draw(choice.plan.problem)
    assert abs(100 * found.info["acceptance"] - share) < 2 and found.info["reason"] == choice.reason


def test_a_rare_one_is_splitting():
    problem = pose(check_text(RARE), {"task": Range(0.0)}, n=200)
    found = draw(problem)
    assert found.info["method"] == "splitting" and found.info["auto"] is True
    assert found.info["reason"] == "none of 65,536 candidates of rejection is in range"
    assert found.count == 200 and found.shortfall is None
    assert np.prod(np.sin(20 * found.rows[2::3]), axis=0).min() >= 0.99


@pytest.mark.slow
def test_more_cells_are_worth_splitting():
    choice = chosen(SPREAD, 0.9, 1.0, n=3200)
    assert choice.plan.name == "splitting" and choice.plan.reached == tuple(range(32))
    assert choice.reason.startswith("it reaches 32 of 32 cells, rejection ")


def test_the_choice_is_a_matter_of_the_request():
    one, two = chosen("leftOf(a, b)", 0.97, None), chosen("leftOf(a, b)", 0.97, None)
    assert one.plan.plan_digest == two.plan.plan_digest and one.reason == two.reason
    assert chosen("leftOf(a, b)", 0.971, None).plan.plan_digest != one.plan.plan_digest


def test_a_method_that_is_named_is_not_put_in_question():
    assert chosen(RARE, 0.0, None, method="rejection").plan.name == "rejection"
    assert chosen("leftOf(a, b)", 0.0, None, method="splitting").plan.name == "splitting"
    assert chosen("leftOf(a, b)", 0.0, None, method="splitting").reason is None


def test_neither_gets_there():
    with pytest.raises(RequestError, match="found none of 200 scenes in 2,097,152 draws") as caught:
        chosen(NEVER, 0.0, 0.2)
    assert caught.value.diagnostics[0].span.text.startswith("sin(theta(a))")


def test_no_time_for_a_plan():
    with pytest.raises(RequestError, match="time was up after "):
        choose(pose(check_text(RARE), {"task": Range(0.0)}, n=200), "auto", Budget(1e-9))


@pytest.mark.parametrize("ends", [(0.0, None), (0.0, 0.3)])
@pytest.mark.parametrize("method", ["auto", "rejection"])
def test_planning_ends_soon_after_time_is_up(ends, method, exp1, monkeypatch):
    """A cover of many objects with footprints takes tens of seconds."""
    monkeypatch.setattr(module, "GRACE", 0.0)
    with pytest.raises(RequestError, match="time was up after no draws at all") as caught:
        choose(pose(exp1, {"task": Range(*ends)}, n=200), method, Budget(1e-9))
    assert "--timeout" in caught.value.diagnostics[0].help


def test_what_phi_does_not_depend_on_is_left_to_rejection():
    problem = pose(check_text("object a, b\ntask: x(a) >= 0.2"), {}, n=5, fixed={"a": (0.5, 0.5)})
    assert choose(problem, "splitting", Budget()).plan.name == "rejection"


def test_where_pruning_takes_much_work_plain_candidates_may_do():
    """One in five candidates is of use; to find a better cover took longer than to draw a hundred scenes."""
    text = (
        "object disc[4] = cylinder(0.045, 0.05), box[4] = box(0.11, 0.09, 0.05)\n"
        "require noOverlap() & insideWorkspace()\ntask: leftOf(disc[1], workspace.center)\n"
    )
    choice = chosen(text, 0.0, 0.02)
    assert choice.plan.name == "rejection" and choice.reason.endswith("of the candidates from 1 box are in range")
    found = draw(choice.plan.problem)
    assert found.count == 200 and found.shortfall is None


def test_shipped_specs_that_pruning_takes_a_moment_for_stay_with_rejection():
    """Half a second of pruning, where growth took ten."""
    spec = check_text(shipped_specs()["sushi_plate"].read_text(encoding="utf-8"))
    assert choose(pose(spec, {"task": Range(0.0)}, n=1000), "auto", Budget()).plan.name == "rejection"
