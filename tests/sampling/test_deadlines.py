"""Whatever bounds and planning do, they ask whether to stop, again and again; and the work that they count is bounded.

Calls are counted here instead of seconds: no step between two calls may be large.
"""

import time
from dataclasses import replace

import numpy as np
import pytest

from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, gate
from scenegen.sampling import report
from scenegen.sampling.engine.blocks import run_blocks
from scenegen.sampling.growth.rarity import NoRoom, grow_islands
from scenegen.sampling.plans import make_plan
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rejection.trial import TRIAL_WORK, make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.splitting.chain_state import ChainTape, make_chain_state
from scenegen.sampling.splitting.sampler import Splitting, SplittingStalled, plan_splitting
from scenegen.search import effort as module
from scenegen.search import label_bounds
from scenegen.search.conflict import minimal_conflict
from scenegen.search.effort import Budget, Effort, StoppedError, TooMuchError
from scenegen.search.prune import find_witness, prune
from scenegen.search.tape import Batch, make_tape

BINS = """object item[6] = cylinder(0.03, 0.05)
region left = rect(0.0, 0.0, 0.25, 0.25)
region right = rect(0.4, 0.0, 0.65, 0.25)
require noOverlap(item)
task: forall i in item: inside(i, left) | inside(i, right)
"""
CLUTTER = """object block[30] = box(0.06, 0.06, 0.05)
require noOverlap() & insideWorkspace()
task: closeTo(block[1], block[2], 30 cm)
"""
LARGEST_STEP = 4e6  # units between two calls: a tenth of a second


@pytest.fixture(scope="module", params=[BINS, CLUTTER], ids=["bins", "clutter"])
def spec(request):
    return check_text(request.param)


def wanted(spec):
    return {spec.core.requirement: (0.0, np.inf), spec.core.labels["task"]: (0.0, np.inf)}


class After:
    """Says stop at the k-th call, and notes by how much the count of work grew from call to call."""

    def __init__(self, k):
        self.k, self.calls, self.before, self.largest = k, 0, 0.0, 0.0
        self.effort = Effort(self, most=3e7)

    def __call__(self):
        self.calls += 1
        self.largest = max(self.largest, self.effort.used - self.before)
        self.before = self.effort.used
        return self.calls >= self.k


TASKS = {
    "bounds": lambda spec, effort: label_bounds(spec.core, *spec.box(), effort),
    "tape": lambda spec, effort: make_tape(spec.core, *spec.box(), effort),
    "prune": lambda spec, effort: prune(spec.core, *spec.box(), wanted(spec), effort=effort),
    "search": lambda spec, effort: find_witness(spec.core, *spec.box(), wanted(spec), effort=effort),
    "clash": lambda spec, effort: minimal_conflict(spec.core, *spec.box(), wanted(spec), effort=effort),
}


@pytest.mark.parametrize("task", TASKS)
def test_everything_stops_when_it_is_told_to(task, spec):
    """However late it is told: after the first call, and in the middle of things."""
    for k in (1, 5, 25, 400):
        after = After(k)
        try:
            TASKS[task](spec, after.effort)
        except StoppedError:
            assert after.calls == k
        else:
            assert after.calls < k and k > 5
        assert after.largest < LARGEST_STEP


@pytest.mark.long
def test_work_is_bounded_wherever_planning_is(spec):
    used = []
    for most in (1e4, 1e6, 1e7):
        effort = Effort(most=most)
        with pytest.raises(TooMuchError):
            prune(spec.core, *spec.box(), wanted(spec), effort=effort)
        used.append(effort.used)
        assert most < effort.used < most + LARGEST_STEP
    assert used == sorted(used)


def test_the_same_work_is_counted_each_time():
    problem = make_problem(check_text("leftOf(a, b) & closeTo(b, c, 0.2)"), SampleRequest({"task": Range(0.05)}, n=10))
    one, other = make_trial(problem, Budget()), make_trial(problem, Budget())
    assert one.work == other.work > 0.0
    assert make_trial(problem, Budget(), most=one.work).hits.tolist() == one.hits.tolist()
    with pytest.raises(TooMuchError):
        make_trial(problem, Budget(), most=one.work - 1.0)


def test_a_request_is_not_looked_at_for_longer_than_its_time(monkeypatch, spec):
    monkeypatch.setattr(module, "GRACE_SECONDS", 0.0)
    with pytest.raises(RequestError, match="time was up before"):
        make_problem(spec, SampleRequest({"task": Range(0.0)}, n=1), budget=Budget(1e-9))


def test_a_trial_is_not_made_for_longer_than_its_time(monkeypatch):
    monkeypatch.setattr(module, "GRACE_SECONDS", 0.0)
    problem = make_problem(check_text(CLUTTER), SampleRequest({"task": Range(0.0)}, n=1))
    begin = time.thread_time()
    with pytest.raises(RequestError, match="time was up after no draws at all"):
        make_trial(problem, Budget(0.1))
    assert time.thread_time() - begin < 10.0


class Calls:
    """A time limit, counted in calls instead of seconds: time is up at the k-th."""

    is_spent = overdrawn = False

    def __init__(self, k=None):
        self.k, self.calls = k, 0

    def check(self):
        self.calls += 1
        if self.calls == self.k:
            raise StoppedError


FEW = "require leftOf(a, b)\ntask: closeTo(b, c, 0.2)"


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr("scenegen.sampling.splitting.sampler.MAX_CHAINS", 256)
    monkeypatch.setattr("scenegen.sampling.splitting.sampler.MIN_CHAINS", 256)
    return make_problem(check_text(FEW), SampleRequest({"task": Range(0.0, 0.04)}, n=64))


@pytest.mark.long
def test_a_plan_of_splitting_stops_when_it_is_told_to(few):
    """In the first scenes, on the way down, while cells are evened out and while moves are tuned."""
    whole = Calls()
    assert isinstance(plan_splitting(few, whole), Splitting)
    for k in (1, 3, whole.calls // 8, whole.calls // 2, whole.calls - 1):
        stop = Calls(k)
        end = plan_splitting(few, stop)
        assert isinstance(end, SplittingStalled) and end.why == "time" and stop.calls == k
        assert bool(end.phi) == (k > 3) and len(str(end.error(few))) > 10


def test_every_clearance_of_a_large_table_is_a_chance_to_stop(spec):
    frame = make_chain_state(gate(spec.core), *spec.box())
    stop = Calls()
    ChainTape(frame, stop=stop)(frame.draw(64, np.random.default_rng(0)))
    assert stop.calls == sum(isinstance(node, Apply) for node in frame.core.nodes)


def test_a_large_table_is_scored_some_scenes_at_a_time(monkeypatch, spec):
    frame = make_chain_state(gate(spec.core), *spec.box())
    rows = frame.draw(250, np.random.default_rng(0))
    whole, once, stop = ChainTape(frame)(rows), Calls(), Calls()
    ChainTape(frame, stop=once)([row[:64] for row in rows])
    monkeypatch.setattr("scenegen.sampling.splitting.chain_state.MAX_LIVE_VALUES", 4 * 10 * ChainTape(frame).length)
    parts = ChainTape(frame, stop=stop)(rows)
    assert [one.tolist() for one in parts] == [one.tolist() for one in whole]
    assert stop.calls == 4 * once.calls


@pytest.mark.long
@pytest.mark.parametrize("method", ["splitting", "rejection"])
def test_a_piece_stops_when_it_is_told_to_and_the_run_ends_with_what_is_there(few, method):
    plan = make_plan(few, Budget(), method=method)
    stop = Calls()
    free = replace(plan, stop=stop)
    assert free.plan_digest == plan.plan_digest
    assert free.draw(0).rows.tobytes() == plan.draw(0).rows.tobytes()
    assert stop.calls > 10
    many = replace(few, request=replace(few.request, n=10**6))
    broken = replace(plan, problem=many, stop=Calls(stop.calls + 5))
    run, scenes = run_blocks(broken, 1), 0
    while True:
        try:
            scenes += next(run).count
        except StopIteration as end:
            tally = end.value
            break
    assert tally.pieces == 1 and broken.stop.calls == stop.calls + 5
    assert 0 < scenes == tally.found


def test_what_stood_in_the_way_is_told_of_few_scenes_of_a_large_table(monkeypatch):
    """Time is up then: a look at thousands of scenes with hundreds of clearances would take seconds."""
    problem = make_problem(check_text(CLUTTER), SampleRequest({"task": Range(0.0)}, n=1))
    atom = next(index for index, node in enumerate(problem.core.nodes) if isinstance(node, Atom))
    seen = []
    monkeypatch.setattr(report, "deciding_atoms", lambda core, rows, name: seen.append(rows.shape[1]) or {atom: 1})
    rows = np.random.default_rng(0).random((90, 4096))
    report.shortfall(problem, 0, "no time", rows, problem.phi(rows))
    assert 16 <= seen[0] < 2000


def test_auto_gives_pruning_up_for_having_counted_too_much(monkeypatch):
    monkeypatch.setattr("scenegen.sampling.choice.FIRST_PRUNING_WORK", 1e5)
    monkeypatch.setattr("scenegen.sampling.choice.first_look", lambda problem, budget: None)
    problem = make_problem(check_text("leftOf(a, b) & closeTo(b, c, 0.2)"), SampleRequest({"task": Range(0.05)}, n=10))
    choice = make_plan(problem, Budget(), method="auto")
    assert choice.method == "growth" and choice.why == "pruning takes much work, growth does not"
    assert make_trial(problem, Budget()).work < TRIAL_WORK


CROWD = """object can[3] = cylinder(0.03, 0.05)
object block[8] = box(0.06, 0.06, 0.05)
require noOverlap() & insideWorkspace()
task: (forall p in can: exists q in block: closeTo(p, q, 12 cm)) & leftOf(can[1], can[2])
"""


@pytest.fixture
def clock(monkeypatch):
    """A clock that runs out at a look at it, and counts the rules of contraction that are called between two looks."""

    class Clock:
        looks, until, rules, largest = 0, None, 0, 0

        def now(self):
            self.looks += 1
            self.largest, self.rules = max(self.largest, self.rules), 0
            return 1.0 if self.until is not None and self.looks >= self.until else 0.0

        def revise(self, *args):
            self.rules += 1
            return plain(*args)

    clock, plain = Clock(), Batch.revise
    monkeypatch.setattr("time.monotonic", clock.now)
    monkeypatch.setattr(Batch, "revise", lambda *args: clock.revise(*args))
    return clock


@pytest.mark.long
def test_growth_looks_at_the_clock_from_the_first_step_on(clock):
    """While its graph and its machine are made, and wherever a room is contracted: each rule is a chance to stop."""
    problem = make_problem(check_text(CROWD), SampleRequest({"task": Range(0.0)}, n=1))
    looks = []
    for most in (1.0, 60.0):  # the machine alone, and the first objects
        clock.looks = clock.largest = clock.rules = 0
        nodes = most * len(problem.core.nodes)
        assert isinstance(grow_islands(problem, 2, 8, (0,), nodes, deadline=0.5), NoRoom)
        assert 0 < clock.largest <= 2
        looks.append(clock.looks)
    for k in (1, looks[0] // 3, looks[0], (looks[0] + looks[1]) // 2, looks[1]):
        clock.looks, clock.until, clock.rules = 0, k, 0
        with pytest.raises(StoppedError):
            grow_islands(problem, 2, 8, (0,), nodes, deadline=0.5)
        assert clock.looks == k and clock.rules == 0, "nothing is done after time is up"
