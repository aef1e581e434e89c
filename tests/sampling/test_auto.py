"""Which sampler `auto` takes: counted, never timed, and told in a few words."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.resources import shipped_specs
from scenegen.sampling.choice import DESCENT_CHAINS, DESCENT_MOVES, SPLITTING_SHARE, MethodChoice, try_rejection
from scenegen.sampling.growth.failure import GrowthFailed
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.plan import NoPlan, digest
from scenegen.sampling.plans import draw, make_plan
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rejection.trial import make_trial, search_longer
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.splitting.levels import Schedule
from scenegen.sampling.splitting.sampler import Splitting, SplittingStalled
from scenegen.search import effort as module
from scenegen.search.effort import Budget, moving_seconds

# Waves of independent headings: no box of poses tells where their product is large.
WAVES = " * ".join(f"sin(20 * theta({name}))" for name in "abcde")
RARE = f"task: {WAVES} >= 0.99"
SPREAD = f"task: {WAVES} >= 0"
NEVER = "leftOf(a, b) & sin(theta(a)) * sin(theta(a)) + cos(theta(a)) * cos(theta(a)) <= 0.9999"


def chosen(text, low, high, n=200, method="auto"):
    return make_plan(
        make_problem(check_text(text), SampleRequest({"task": Range(low, high)}, n=n)), Budget(), method=method
    )


def test_a_common_range_is_rejection_and_says_how_common(exp1):
    choice = make_plan(make_problem(exp1, SampleRequest({"task": Range(0.1, 0.3)}, n=1000)), Budget(), method="auto")
    assert choice.method == "rejection"
    share = int(re.fullmatch(r"(\d+)% of the candidates from 1 box are in range", choice.why)[1])
    found = draw(choice.problem)
    assert abs(100 * found.info["acceptance"] - share) < 2 and found.info["reason"] == choice.why


@pytest.mark.long
def test_a_rare_one_is_splitting():
    problem = make_problem(check_text(RARE), SampleRequest({"task": Range(0.0)}, n=200))
    found = draw(problem)
    assert found.info["method"] == "splitting" and found.info["auto"] is True
    assert found.info["reason"] == "none of 65,536 candidates of rejection is in range"
    assert found.count == 200 and found.shortfall is None
    assert np.prod(np.sin(20 * found.rows[2::3]), axis=0).min() >= 0.99


@pytest.mark.slow
def test_more_cells_are_worth_splitting():
    choice = chosen(SPREAD, 0.9, 1.0, n=3200)
    assert choice.method == "splitting" and choice.reached_cells == tuple(range(32))
    assert choice.why.startswith("it reaches 32 of 32 cells, rejection ")


def test_the_choice_is_a_matter_of_the_request():
    one, two = chosen("leftOf(a, b)", 0.97, None), chosen("leftOf(a, b)", 0.97, None)
    assert one.plan_digest == two.plan_digest and one.why == two.why
    assert chosen("leftOf(a, b)", 0.971, None).plan_digest != one.plan_digest


@pytest.mark.long
def test_a_method_that_is_named_is_not_put_in_question():
    assert chosen(RARE, 0.0, None, method="rejection").method == "rejection"
    assert chosen("leftOf(a, b)", 0.0, None, method="splitting").method == "splitting"
    assert chosen("leftOf(a, b)", 0.0, None, method="splitting").why is None


@pytest.mark.long
def test_neither_gets_there():
    with pytest.raises(RequestError, match="found none of 200 scenes in 2,097,152 draws") as caught:
        chosen(NEVER, 0.0, 0.2)
    assert caught.value.diagnostics[0].span.text.startswith("sin(theta(a))")


def test_no_time_for_a_plan():
    with pytest.raises(RequestError, match="time was up after "):
        make_plan(
            make_problem(check_text(RARE), SampleRequest({"task": Range(0.0)}, n=200)), Budget(1e-9), method="auto"
        )


def test_a_search_that_time_cuts_short_is_no_plan():
    """How many candidates it had would depend on the machine."""
    problem = make_problem(check_text("leftOf(a, b)"), SampleRequest({"task": Range(0.0)}, n=20))
    trial = make_trial(problem, Budget())
    with pytest.raises(RequestError, match=r"time was up after .* draws, too early"):
        search_longer(problem, trial, Budget(0.0))


def test_a_method_that_time_cuts_short_leaves_the_choice_to_none(monkeypatch):
    problem = make_problem(check_text("leftOf(a, b)"), SampleRequest({"task": Range(0.0)}, n=20))
    cut = SplittingStalled("time", (), (), 0, 0)
    quick = plan_growth(problem, Budget())
    assert isinstance(quick, Growth)
    quick = replace(quick, recipe=replace(quick.recipe, effect=np.inf))
    dear = GrowthFailed(None, None, 0.0, dear=True)
    monkeypatch.setattr("scenegen.sampling.splitting.sampler.plan_splitting", lambda *words, **named: cut)
    monkeypatch.setattr("scenegen.sampling.growth.sampler.plan_growth", lambda *words, **named: dear)
    assert MethodChoice(problem, Budget())._rival(quick) is cut


TIGHT = """object a, b, c, d
task: abs(dist(a, b) - 0.3) <= 0.0001 & abs(dist(b, c) - 0.3) <= 0.0001 & abs(dist(c, d) - 0.3) <= 0.0001
    & abs(dist(a, d) - 0.3) <= 0.0001 & abs(dist(a, c) - 0.4) <= 0.0001
"""


@pytest.mark.parametrize(
    ("growth", "splitting", "left", "taken"),
    [
        (75.0, 7.0, 0.7, "splitting"),
        (75.0, 60.0, 0.0, "growth"),  # not worth the plan
        (7.0, 1.0, 0.0, "growth"),  # not worth a look
        (None, 70.0, 0.7, "splitting"),  # cut off
    ],
)
def test_growth_of_large_populations_and_splitting_are_compared(growth, splitting, left, taken, monkeypatch):
    """Where few ancestors are left of a small population: larger ones may take as long as a plan of splitting."""
    problem = make_problem(check_text(TIGHT), SampleRequest({"task": Range(0.0)}, n=16, workers=1))
    easy = plan_growth(make_problem(check_text("leftOf(a, b)"), SampleRequest({"task": Range(0.0)}, n=16)), Budget())
    split = Splitting(problem, Schedule((), 0, frozenset({0}), 1024, left, 0))
    given = {}

    def grown(*words, patient, longest, larger):
        if not patient:
            return replace(easy, recipe=replace(easy.recipe, effect=np.inf))
        given["growth"] = longest, larger
        return GrowthFailed(None, None, 0.0, dear=True) if growth is None else easy

    def splits(*words, longest):
        given["splitting"] = longest
        return split

    monkeypatch.setattr(Growth, "seconds", growth)
    monkeypatch.setattr(Splitting, "seconds", splitting)
    monkeypatch.setattr("scenegen.sampling.growth.sampler.plan_growth", grown)
    monkeypatch.setattr("scenegen.sampling.splitting.sampler.plan_splitting", splits)
    assert MethodChoice(problem, Budget())._rival() is (split if taken == "splitting" else easy)
    assert given["growth"] == (moving_seconds(problem.core.nodes, DESCENT_MOVES * DESCENT_CHAINS, DESCENT_MOVES), True)
    assert given.get("splitting") == {None: math.inf, 75.0: 75.0 / SPLITTING_SHARE, 7.0: None}[growth]


@pytest.mark.slow
def test_distances_held_to_a_tenth_of_a_millimetre_are_splitting():
    """Growth finds no place for the last object; the scenes are those of splitting alone."""
    problem = make_problem(check_text(TIGHT), SampleRequest({"task": Range(0.0)}, n=16, workers=1))
    choice, split = (make_plan(problem, Budget(math.inf), method=method) for method in ("auto", "splitting"))
    assert choice.method == "splitting" and choice.plan_digest == split.plan_digest


@pytest.mark.parametrize("ends", [(0.0, None), (0.0, 0.3)])
@pytest.mark.parametrize("method", ["auto", "rejection"])
def test_planning_ends_soon_after_time_is_up(ends, method, exp1, monkeypatch):
    """A cover of many objects with footprints takes tens of seconds."""
    monkeypatch.setattr(module, "GRACE_SECONDS", 0.0)
    with pytest.raises(RequestError, match="time was up after no draws at all") as caught:
        make_plan(make_problem(exp1, SampleRequest({"task": Range(*ends)}, n=200)), Budget(1e-9), method=method)
    assert "`timeout`" in caught.value.diagnostics[0].help


def test_what_phi_does_not_depend_on_is_left_to_rejection():
    problem = make_problem(check_text("object a, b\ntask: x(a) >= 0.2"), SampleRequest(n=5, fix={"a": (0.5, 0.5)}))
    assert make_plan(problem, Budget(), method="splitting").method == "rejection"


@pytest.mark.long
def test_where_pruning_takes_much_work_plain_candidates_may_do():
    """One in five candidates is of use; to find a better cover took longer than to draw a hundred scenes."""
    text = (
        "object disc[4] = cylinder(0.045, 0.05), box[4] = box(0.11, 0.09, 0.05)\n"
        "require noOverlap() & insideWorkspace()\ntask: leftOf(disc[1], workspace.center)\n"
    )
    choice = chosen(text, 0.0, 0.02)
    assert choice.method == "rejection" and choice.why.endswith("of the candidates from 1 box are in range")
    found = draw(choice.problem)
    assert found.count == 200 and found.shortfall is None


def test_pruning_that_may_take_more_goes_on_where_it_is():
    """It comes to what it would with the larger limit from the start, and takes no more work."""
    spec = check_text("leftOf(a, b) & closeTo(b, c, 0.2)")
    problem, times = make_problem(spec, SampleRequest({"task": Range(0.05)}, n=2000, workers=1)), []

    def further():
        times.append(1)
        return math.inf

    whole = make_trial(problem, Budget())
    found = try_rejection(problem, Budget(), whole.work / 3, further=further)
    assert times == [1] and found.trial is None and found.longer is not None
    assert found.longer.work == whole.work and (found.longer.hits == whole.hits).all()
    assert digest(found.longer.cover) == digest(whole.cover)
    assert try_rejection(problem, Budget(), whole.work / 3, further=lambda: whole.work / 2).longer is None


@pytest.mark.long
def test_shipped_specs_that_pruning_takes_a_moment_for_stay_with_rejection():
    """Half a second of pruning, where growth took ten."""
    spec = check_text(shipped_specs()["sushi_plate"].read_text(encoding="utf-8"))
    assert (
        make_plan(make_problem(spec, SampleRequest({"task": Range(0.0)}, n=1000)), Budget(), method="auto").method
        == "rejection"
    )


@pytest.mark.long
def test_covers_of_many_cells_do_not_take_longer_than_growth():
    """Two thirds of the cells are too rare for the common cover. One for each of them takes ten seconds, and leaves
    three without scenes."""
    text = """object can[2] = box(0.118, 0.118, 0.05)
object block[4] = prism([(0, 0), (0.137, 0), (0.069, 0.124)], 0.05)
object item[3] = cylinder(0.064, 0.05)
object part[3] = prism([(0, 0), (0.170, 0), (0.085, 0.153)], 0.05)
require noOverlap()
task: (exists p in block: farFrom(p, part[1], 24.7 cm)) | (forall i in 1..2: sameHeading(can[i], part[i], 10 deg))
safe: (forall p in block: abs(x(p) - 0.5) <= 37.7 cm) & (forall p, q in part: farFrom(p, q, 5.6 cm))
  & (farFrom(block[2], (0.76, 0.15), 20.0 cm) | nearEdge(block[2], e = 5.6 cm))
"""
    ranges = {"task": Range(-0.2, 0.1), "safe": Range(0.0)}
    choice = make_plan(make_problem(check_text(text), SampleRequest(ranges, n=100)), Budget(), method="auto")
    assert choice.method == "growth" and choice.why == "pruning each cell takes too much work"
    assert len(choice.reached_cells) == 32


@pytest.mark.long
def test_calls_for_few_candidates_are_counted():
    """One candidate in ten thousand meets this: most cost little, but each chunk is scored in full to its end."""
    text = """object can[8]
object robot = box(0.2, 0.2, 0.1) at (0.1, 0.5, 0)
object goal = cylinder(0.05, 0.01) at (0.9, 0.5, 0)
require noOverlap()
free: forall c in can: !between(c, robot, goal, 10 cm)
clutter: forall c in can: exists d in can: dist(c, d) >= 1 cm & abs(x(c) - x(d)) + abs(y(c) - y(d)) <= 20 cm
"""
    ranges = {"free": Range(0.0), "clutter": Range(0.0)}
    choice = make_plan(make_problem(check_text(text), SampleRequest(ranges, n=1000)), Budget(), method="auto")
    assert choice.method == "growth"


COUNTER = """workspace [0, 1.2] x [0, 0.6]
object cutting_board, knife, bowl
object tomato[3] = cylinder(3.5 cm, 6 cm) on cutting_board
object sponge = box(11 cm, 7 cm, 3 cm)
require noCollision() & insideWorkspace()
task: fullyLeftOf(knife, cutting_board) & angle(knife, NORTH, 20 deg)
    & (forall t in tomato: inside(t, cutting_board)) & (forall a, b in tomato: clearOf(a, b, 1 cm))
    & closeTo(bowl, cutting_board, 25 cm) & (forall t in tomato: farFrom(sponge, t, 30 cm))
"""


@pytest.mark.long
def test_methods_are_compared_by_seconds():
    """Growth needs a sixth of the evaluations of rejection, but each takes longer; so the times are told."""
    asked = SampleRequest({"task": Range(0.0, 0.02)}, n=4000, spread="base", workers=1)
    problem = make_problem(check_text(COUNTER), asked)
    choice, rejection = (make_plan(problem, Budget(), method=method) for method in ("auto", "rejection"))
    assert choice.method == "growth" and 2.0 * choice.seconds < rejection.seconds
    mine, other = (float(one) for one in re.fullmatch(r"about (.+) s against (.+) s of rejection", choice.why).groups())
    assert mine == pytest.approx(choice.seconds, rel=0.05) and other == pytest.approx(rejection.seconds, rel=0.2)
    assert rejection.seconds / choice.seconds < rejection.evaluations / choice.evaluations


@pytest.mark.long
def test_a_look_at_another_method_takes_no_longer_than_it_can_save():
    """A plan of growth is given up; rejection, which has one, is taken."""
    problem = make_problem(check_text(COUNTER), SampleRequest({"task": Range(0.0)}, n=1000, workers=1))
    looked = plan_growth(problem, Budget(), patient=False, longest=0.01)
    assert isinstance(looked, NoPlan) and looked.too_dear and looked.evaluations < 1e5
    mine = make_plan(problem, Budget(), method="rejection")
    cheap = replace(mine, expected=mine.expected / 1000)
    choice = MethodChoice(problem, Budget(), ())._against(cheap, None)
    assert choice.method == "rejection"
