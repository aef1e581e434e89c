"""Rejection hands out the true conditional distribution, shared evenly over the cells. Pruned rejection against
analytic answers and plain rejection: the true distribution, and the true probability. Covers of a cell each, made
by several processes: the same plan, and it is given up at the same place.
"""

import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from scenegen.lang.checker import check_text
from scenegen.learn.guided import score
from scenegen.learn.refine import draw as base
from scenegen.learn.refine import piece_generator
from scenegen.learn.robustness import Robustness
from scenegen.resources import shipped_specs
from scenegen.sampling.plans import draw as run
from scenegen.sampling.plans import make_plan as make_plan_covers
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rejection import sampler
from scenegen.sampling.rejection import trial as covers
from scenegen.sampling.rejection.sampler import make_plan
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget, StoppedError, TooMuchError
from scenegen.search.prune import Part

rejection = partial(run, method="rejection")

N = 20_000
RANGE = Range(0.1, 0.3)


@pytest.fixture(scope="module")
def flat(exp1):
    return rejection(make_problem(exp1, SampleRequest({"task": RANGE}, n=N, seed=3)), Budget())


def test_every_scene_is_in_the_range_and_the_workspace(flat, phi1):
    assert flat.rows.shape == (6, N) and flat.shortfall is None and flat.warnings == ()
    phi = phi1(flat.rows)
    np.testing.assert_allclose(phi, flat.phi, rtol=0, atol=1e-14)
    assert phi[0].min() >= 0.1 and phi[0].max() <= 0.3
    assert flat.rows.min() >= 0 and flat.rows[[0, 1, 3, 4]].max() <= 1 and flat.rows[[2, 5]].max() < 2 * np.pi


def test_the_cells_share_exactly(flat):
    counts, _ = np.histogram(flat.phi[0], np.linspace(0.1, 0.3, 33))
    assert counts.tolist() == [N // 32] * 32


@pytest.mark.parametrize("n", [1, 31, 33, 100])
def test_shares_differ_by_at_most_one(exp1, n):
    found = rejection(make_problem(exp1, SampleRequest({"task": RANGE}, n=n, seed=n)), Budget())
    counts, _ = np.histogram(found.phi[0], np.linspace(0.1, 0.3, 33))
    assert counts.sum() == n and counts.max() - counts.min() <= 1


@pytest.mark.long
@pytest.mark.parametrize("cell", [0, 13, 31])
def test_within_a_cell_scenes_follow_the_base_distribution(flat, cell, phi1, direct, same_distribution):
    edges = np.linspace(0.1, 0.3, 33)[cell : cell + 2]
    truth = direct(3_000_000)
    truth = truth[:, _between(phi1(truth)[0], *edges)]
    mine = flat.rows[:, _between(flat.phi[0], *edges)]
    assert mine.shape[1] == N // 32 and truth.shape[1] > 5_000
    for row in range(6):
        assert same_distribution(mine[row], truth[row])
    assert same_distribution(mine[0] - mine[3], truth[0] - truth[3])


def test_spread_over_two_labels(exp1, phi1, direct, same_distribution):
    ranges = {"task": Range(0.0, 0.2), "safe": Range(0.0, 0.2)}
    found = rejection(make_problem(exp1, SampleRequest(ranges, n=2560, seed=8)), Budget())
    counts, _, _ = np.histogram2d(*found.phi, bins=[np.linspace(0, 0.2, 17)] * 2)
    assert found.info["cells"] == {"asked": 256, "reached": int((counts > 0).sum())}
    assert counts[counts > 0].max() - counts[counts > 0].min() <= 1 and counts.sum() == 2560


def test_spread_base_follows_the_base_distribution_over_the_whole_range(exp1, phi1, direct, same_distribution):
    found = rejection(make_problem(exp1, SampleRequest({"task": RANGE}, n=N, seed=4, spread="base")), Budget())
    truth = direct(500_000)
    truth = truth[:, _between(phi1(truth)[0], 0.1, 0.3)]
    assert same_distribution(found.phi[0], phi1(truth)[0])
    assert same_distribution(found.phi[1], phi1(truth)[1])
    for row in range(6):
        assert same_distribution(found.rows[row], truth[row])


def test_the_test_of_distributions_can_fail(flat, phi1, direct, same_distribution):
    truth = direct(500_000)
    truth = truth[:, _between(phi1(truth)[0], 0.1, 0.3)]
    assert not same_distribution(flat.phi[0], phi1(truth)[0])


def test_the_order_has_no_pattern(flat):
    first, second = flat.phi[0][: N // 2], flat.phi[0][N // 2 :]
    assert abs(first.mean() - second.mean()) < 4 * flat.phi[0].std() * np.sqrt(4 / N)
    assert abs(np.corrcoef(flat.phi[0][:-1], flat.phi[0][1:])[0, 1]) < 4 / np.sqrt(N)


def test_nothing_asked_is_the_base_distribution(exp1, direct, same_distribution):
    found = rejection(make_problem(exp1, SampleRequest(n=N, seed=1)), Budget())
    truth = direct(N)
    assert all(same_distribution(found.rows[row], truth[row]) for row in range(6))


def test_a_workspace_of_its_own(same_distribution):
    from scenegen.lang.checker import check_text

    spec = check_text("workspace [-2 m, 30 cm] x [5, 6]\ntask: leftOf(mug, plate)")
    found = rejection(make_problem(spec, SampleRequest({"task": Range(0.0)}, n=2000)), Budget())
    assert found.rows[0::3].min() >= -2 and found.rows[0::3].max() <= 0.3 and found.rows[0::3].min() < -1.9
    assert found.rows[1::3].min() >= 5 and found.rows[1::3].max() <= 6
    assert (found.rows[0] <= found.rows[3]).all()


def _between(values, low, high):
    return (values >= low) & (values <= high)


def draw(text, n=N, seed=0, spread="base", **ranges):
    spec = check_text(text) if isinstance(text, str) else text
    found = rejection(
        make_problem(
            spec, SampleRequest({name: Range(*ends) for name, ends in ranges.items()}, n=n, seed=seed, spread=spread)
        ),
        Budget(),
    )
    assert found.shortfall is None and found.count == n
    assert len({scene.tobytes() for scene in found.rows.T}) == n
    return found


def uniform(values, low=0.0, high=1.0):
    """Kolmogorov-Smirnov against the uniform distribution, p > 0.001."""
    ordered = (np.sort(values) - low) / (high - low)
    steps = np.arange(len(values) + 1) / len(values)
    gap = max(np.abs(ordered - steps[:-1]).max(), np.abs(ordered - steps[1:]).max())
    return gap < math.sqrt(-math.log(0.0005) / 2 / len(values))


def probability(found, expected):
    """Whether the probability in the file agrees within four of its standard errors and rounding."""
    gap = abs(found.info["log10_probability"] - math.log10(expected))
    return gap <= 4 * found.info["log10_error"] / 1.96 + 1e-6


def test_a_ring_around_a_point():
    """closeTo(mug, p, 0.3) in [0.1, 0.2]: the ring between the radii 0.1 and 0.2, uniform in area and angle."""
    found = draw("closeTo(mug, (0.4, 0.5), 0.3)", task=(0.1, 0.2))
    dx, dy = found.rows[0] - 0.4, found.rows[1] - 0.5
    assert uniform(dx * dx + dy * dy, 0.1**2, 0.2**2)
    assert uniform(np.arctan2(dy, dx), -math.pi, math.pi)
    assert uniform(found.rows[2], 0, 2 * math.pi)
    assert probability(found, math.pi * (0.2**2 - 0.1**2))


def test_the_difference_of_two_coordinates():
    """leftOf in [0.3, 0.5]: the difference has density 2 (1 - d), and the left object is uniform in what it leaves."""
    found = draw("leftOf(mug, plate)", task=(0.3, 0.5))
    d = found.rows[3] - found.rows[0]
    assert uniform((1 - d) ** 2, 0.5**2, 0.7**2)
    assert uniform(found.rows[0] / (1 - d))
    assert uniform(found.rows[1]) and uniform(found.rows[4])
    assert probability(found, (0.7**2 - 0.5**2) / 2)


@pytest.mark.parametrize("count", [3, 6])
def test_sorted_objects_with_gaps(count):
    """phi >= p leaves a simplex: the slack, scaled by its root, is uniform."""
    text = " & ".join(f"leftOf(o{i}, o{i + 1})" for i in range(1, count))
    found = draw(text, task=(0.05, None))
    assert probability(found, (1 - (count - 1) * 0.05) ** count / math.factorial(count))
    # the smallest of the gaps: P(gap >= t) = ((1 - (n - 1) t) / (1 - (n - 1) 0.05))^n
    gaps = np.diff(found.rows[0::3], axis=0).min(axis=0)
    assert uniform(((1 - (count - 1) * gaps) / (1 - (count - 1) * 0.05)) ** count)
    # what is left to the left of the first is distributed like any gap
    first = found.rows[0] / (1 - (count - 1) * 0.05)
    assert uniform((1 - first) ** count)


def test_an_angle_on_both_sides_of_zero():
    found = draw("angle(mug, 0, 0.5)", task=(0.1, 0.3))
    turned = np.where(found.rows[2] > math.pi, found.rows[2] - 2 * math.pi, found.rows[2])
    assert uniform(np.abs(turned), 0.2, 0.4) and uniform(found.rows[0])
    assert abs(float((turned > 0).mean()) - 0.5) < 4 * 0.5 / math.sqrt(N)
    assert probability(found, 0.4 / (2 * math.pi))


def test_overlapping_disjuncts_count_once():
    """Two discs that overlap: P is the area of their union, and the overlap is not drawn twice."""
    text = "closeTo(mug, (0.45, 0.5), 0.2) | closeTo(mug, (0.55, 0.5), 0.2)"
    found = draw(text, task=(0.0, None))
    lens = 2 * 0.2**2 * math.acos(0.05 / 0.2) - 0.1 / 2 * math.sqrt(4 * 0.2**2 - 0.1**2)
    union = 2 * math.pi * 0.2**2 - lens
    assert probability(found, union)
    both = (np.hypot(found.rows[0] - 0.45, found.rows[1] - 0.5) <= 0.2) & (
        np.hypot(found.rows[0] - 0.55, found.rows[1] - 0.5) <= 0.2
    )
    share = lens / union
    assert abs(both.mean() - share) < 4 * math.sqrt(share * (1 - share) / N)


def test_a_plateau():
    """phi = min(x, 0.3) - y is flat in x from 0.3 on; ties of the deciding part are no ties of the scenes."""
    found = draw("y(mug) <= min(x(mug), 0.3) | y(mug) <= min(x(mug), 0.3)", task=(0.0, 0.3))
    assert probability(found, 0.3 * 0.7 + 0.3**2 / 2)
    beyond = float((found.rows[0] >= 0.3).mean())
    share = 0.21 / 0.255
    assert abs(beyond - share) < 4 * math.sqrt(share * (1 - share) / N)


# published figures to three digits: from long runs of other code
@pytest.mark.parametrize(("name", "expected"), [("table_setting", 2.95e-6), ("table_setting_published", 2.18e-6)])
def test_the_probability_of_experiment_2(name, expected):
    spec = check_text(shipped_specs()[name].read_text(), name)
    found = draw(spec, task=(0.0175, 0.0425))
    mine = 10 ** found.info["log10_probability"]
    assert abs(mine / expected - 1) < 0.05
    assert found.info["log10_error"] / 1.96 < 0.01
    assert abs(math.log10(mine / expected)) < 3 * found.info["log10_error"] / 1.96 + 0.002  # and their rounding


PIECES = 24
PLAIN = {
    "exp1": (None, {"task": (0.1775, 0.2025), "safe": (0.0675, 0.0925)}),
    "sort_3": ("sort_3", {"sorted": (0.0375, 0.0625)}),
    "either": ("leftOf(a, b) & closeTo(a, c, 0.2) | angle(b, NORTH, 0.3) & !closeTo(b, c, 0.5)", {"task": (0.02, 0.1)}),
    "three": ("closeTo(a, b, 0.3) & closeTo(b, c, 0.3) & farFrom(a, c, 0.3)", {"task": (0.01, 0.08)}),
}


@pytest.mark.long
@pytest.mark.parametrize("case", PLAIN)
def test_against_plain_rejection(case, exp1, same_distribution):
    """Every coordinate, every difference of two along an axis, and phi itself (Kolmogorov-Smirnov, p > 0.001 each), and
    a coarse grid over pairs of coordinates (chi-square at four standard deviations)."""
    text, ranges = PLAIN[case]
    spec = exp1 if text is None else check_text(shipped_specs()[text].read_text() if text in shipped_specs() else text)
    found = draw(spec, n=8000, seed=2, **ranges)
    problem = make_problem(
        spec, SampleRequest({name: Range(*ends) for name, ends in ranges.items()}, n=1, spread="base")
    )
    hits = []
    for piece in range(PIECES):
        rows = base(problem.lowest, problem.highest, problem.piece_size, piece_generator(0, piece, stream=77))
        phi = score(problem, Robustness(problem.core), rows)
        hits.append(rows.numpy()[:, problem.cells.find(phi) == 0])
    truth = np.concatenate(hits, axis=1)
    assert truth.shape[1] > 1000
    expected = 10 ** found.info["log10_probability"] * PIECES * problem.piece_size
    assert abs(expected - truth.shape[1]) < 4 * math.sqrt(expected)
    mine = found.rows
    count = len(mine)
    for a in range(count):
        assert same_distribution(mine[a], truth[a]), a
        for b in range(a % 3, a, 3):
            assert same_distribution(mine[a] - mine[b], truth[a] - truth[b]), (a, b)
    edges = [np.quantile(truth[row], [0.25, 0.5, 0.75]) for row in range(count)]
    for a in range(count):
        for b in range(a):
            tables = [
                np.bincount(4 * np.searchsorted(edges[a], rows[a]) + np.searchsorted(edges[b], rows[b]), minlength=16)
                for rows in (mine, truth)
            ]
            total = tables[0] + tables[1]
            expected = total * mine.shape[1] / total.sum()
            other = total * truth.shape[1] / total.sum()
            used = total > 0
            chi = (
                (tables[0] - expected)[used] ** 2 / expected[used] + (tables[1] - other)[used] ** 2 / other[used]
            ).sum()
            assert chi < 15 + 5 * math.sqrt(30), (a, b)


def test_orderings_come_in_equal_shares():
    spec = check_text(shipped_specs()["sort_7"].read_text())
    found = draw(spec, sorted=(0.0375, 0.0625), seed=1)
    dx, dy = np.diff(found.rows[0::3], axis=0), np.diff(found.rows[1::3], axis=0)
    counts = np.array([(step > 0).all(axis=0).sum() for step in (dx, -dx, dy, -dy)])
    # a few are sorted along both axes: two of 7! orders along the other one
    twice = N * 2 / math.factorial(7)
    assert 0 <= counts.sum() - N <= twice + 4 * math.sqrt(twice)
    assert ((counts - N / 4) ** 2 / (N / 4)).sum() < 16.27  # chi-square, 3 degrees of freedom, p = 0.001


@pytest.mark.long
def test_rare_cells_are_served_like_common_ones():
    """Cells of phi in [0, 0.16] of seven sorted objects differ in probability by more than ten orders of magnitude."""
    spec = check_text(shipped_specs()["sort_7"].read_text())
    found = draw(spec, n=640, spread="flat", sorted=(0.0, 0.16))
    counts, _ = np.histogram(found.phi[0], np.linspace(0.0, 0.16, 33))
    assert counts.tolist() == [20] * 32 and found.warnings == ()


def test_pieces_depend_on_nothing_but_plan_and_number(exp1):
    def plan():
        return make_plan(make_problem(exp1, SampleRequest({"task": Range(0.0, 0.9)}, n=5000, seed=5)), Budget())

    first, second = plan(), plan()
    assert len(first.sources) > 1
    later = second.draw(3)
    for number in range(3):
        first.draw(number)
    again = first.draw(3)
    assert later.rows.tobytes() == again.rows.tobytes() and later.phi.tobytes() == again.phi.tobytes()
    assert first.draw(2).rows.tobytes() != again.rows.tobytes()


@pytest.mark.parametrize("kept", [0.5, 0.1, 1e-4])
@pytest.mark.parametrize("parts", [1, 30, 1000])
def test_pieces_are_larger_where_there_are_many_of_little_use(kept, parts):
    spec = check_text("leftOf(a, b) & closeTo(b, c, 0.2)")
    sizes = []
    for n in (1, 100, 10**5, 10**6, 10**8):
        problem = make_problem(spec, SampleRequest({"task": Range(0.0)}, n=n))
        need = sampler.SPARE_SCENES * n / kept
        size = sampler._size(problem, need, parts)
        full = problem.piece_size
        if size > full:
            assert size <= 4 * full and need >= 32 * size and size * kept * 10 <= 2**21
        sizes.append(size / full)
    assert sizes == sorted(sizes) and sizes[1] <= 1.0
    assert (sizes[-1] > 1.0) == (kept < 0.25 or parts > 100)


def test_a_requirement_belongs_to_the_range(exp1):
    from dataclasses import replace

    core = exp1.core
    labels = {"task": core.labels["task"]}
    spec = replace(exp1, core=replace(core, labels=labels, requirement=core.labels["safe"]))
    found = draw(spec, n=4000, task=(0.0, 0.1))
    assert np.hypot(found.rows[0] - found.rows[3], found.rows[1] - found.rows[4]).min() >= 0.25
    assert found.phi[0].min() >= 0.0 and found.phi[0].max() <= 0.1


def test_an_alternative_that_is_the_same_for_all_scenes():
    """`dist(c, c) >= 1 cm` in `exists d in can`: its value is one number, not one for each scene."""
    part = Part(((0, 0.0, 1.0), (1, -1.0, 0.5)), {}, np.zeros(3), np.ones(3))
    values = [np.float64(0.01), np.array([0.2, 0.4, 0.6])]
    assert part.owns(values, slice(1, 3)).tolist() == [True, False]
    assert part.owns([np.float64(-0.01), values[1]], slice(0, 3)).tolist() == [False] * 3


TEXT = "task: closeTo(a, (0.5, 0.5), 0.2) & closeTo(b, (0.2, 0.2), 0.2)"
BUDGET = Budget(math.inf)  # this module is read long before its tests are run


def posed(workers):
    return make_problem(
        check_text(TEXT), SampleRequest({"task": Range(0.0, 0.2)}, n=1_000_000, seed=3, workers=workers), BUDGET
    )


@pytest.fixture
def pools(monkeypatch):
    """Two cores, and processes from the second cover on; noted is how many processes each pool has."""
    sizes = []

    class Noted(covers.Pool):
        def __init__(self, job, workers, **more):
            sizes.append(workers)
            super().__init__(job, workers, **more)

    monkeypatch.setattr(covers, "Pool", Noted)
    monkeypatch.setattr(covers, "cores", lambda: 2)
    monkeypatch.setattr(covers, "PROCESS_WORK", 1.0)
    return sizes


def planned(workers, *limits):
    problem = posed(workers)
    return sampler.make_plan(problem, BUDGET, make_trial(problem, BUDGET), *limits)


@pytest.mark.long
def test_processes_make_the_same_plan(pools):
    alone = planned(1)
    assert pools == []
    for workers in (2, None):
        shared = planned(workers)
        assert shared.plan_digest == alone.plan_digest
        assert (shared.draws, shared.reachable, shared.empty) == (alone.draws, alone.reachable, alone.empty)
    assert pools == [2, 2]


@pytest.mark.long
def test_too_much_work_is_found_at_the_same_limit(pools):
    """Each cover may take what the first takes; whether the second is already begun by then changes nothing."""
    one, two = posed(1), posed(2)
    rest = sorted(one.possible)[-6:]
    works = [own.work for own in covers.own_covers(one, rest, BUDGET, lambda: 1e18)]
    assert works == [own.work for own in covers.own_covers(two, rest, BUDGET, lambda: 1e18)]
    assert min(works) < max(works)
    for problem in (one, two):
        made = list(covers.own_covers(problem, rest, BUDGET, lambda: min(works)))
        assert [own.cover is None for own in made] == [work > min(works) for work in works]
    assert pools == [2, 2]


@pytest.mark.long
def test_what_is_left_is_what_covers_before_did_not_take(pools, monkeypatch):
    """To the last unit, and though processes begin covers when more is left."""
    plan = planned(1)
    works = []

    def noted(*asked, honest=sampler.own_covers):
        for own in honest(*asked):
            works.append(own.work)
            yield own

    monkeypatch.setattr(sampler, "own_covers", noted)
    planned(1)
    used = sum(works) + 0.5  # rounding apart
    less = planned(1, math.inf, used - 1.0)
    assert less.plan_digest != plan.plan_digest and less.reached_cells == plan.reached_cells
    assert [planned(w, math.inf, used).plan_digest for w in (1, 2)] == [plan.plan_digest] * 2
    assert planned(2, math.inf, used - 1.0).plan_digest == less.plan_digest


@pytest.mark.long
def test_a_cell_that_no_candidate_hit_must_have_its_cover():
    """The others can do without: the common cover reaches them."""
    problem = make_problem(check_text(TEXT), SampleRequest({"task": Range(0.0, 0.1)}, n=1_000_000))
    trial = make_trial(problem, BUDGET)
    assert trial.hits[sorted(problem.possible)].all()
    assert len(sampler.make_plan(problem, BUDGET, trial, math.inf, 0.0).sources) == 1
    trial.hits[sorted(problem.possible)[-1]] = 0
    with pytest.raises(TooMuchError):
        sampler.make_plan(problem, BUDGET, trial, math.inf, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("spec", ["flat", "choices"])
def test_more_scenes_never_cost_more_each(spec):
    """Covers of rare cells were made for large requests, though they were hit more seldom than the common one."""
    text = """workspace [0, 0.9] x [0, 0.6]
object coaster = cylinder(5.5 cm, 0.5 cm)
object mug, can, apple, book
"""
    if spec == "choices":
        text = text.replace("object mug", "object mug on any of [coaster, workspace]\nobject").replace(
            "object,", "object"
        )
    text += "require noCollision() & insideWorkspace()\ntask: on(mug, coaster)"
    each = []
    for n in (10_000, 100_000, 1_000_000, 10_000_000):
        asked = SampleRequest({"task": Range(-0.6, -0.0625)}, n=n, workers=1)
        plan = make_plan_covers(make_problem(check_text(text), asked), BUDGET, method="auto")
        assert plan.method == "rejection" and len(plan.reached_cells) == 32
        each.append((plan.draws + plan.expected) / n)
    assert all(later <= 1.02 * before for before, later in pairwise(each))


@pytest.mark.long
def test_time_that_is_up_reaches_this_process(pools, monkeypatch):
    monkeypatch.setattr(covers, "_sharers", lambda *_: 2)
    with pytest.raises(StoppedError):
        next(covers.own_covers(posed(2), [3, 4], Budget(-1.0), lambda: 1e18))
    assert pools == [2]


def test_little_work_starts_few_processes(pools, monkeypatch):
    monkeypatch.setattr(covers, "PROCESS_WORK", 1e15)
    monkeypatch.setattr(covers, "cores", lambda: 6)
    problem = posed(None)
    next(covers.own_covers(problem, sorted(problem.possible), BUDGET, lambda: 1e18))
    assert pools == []
    assert [covers._sharers(problem, count, 1e14) for count in (8, 19, 20, 35, 200)] == [1, 1, 2, 3, 6]
    assert covers._sharers(problem, 4, 1e16) == 4
    assert covers._sharers(posed(3), 200, 1e14) == 3
    assert covers._sharers(posed(8), 200, 1e14) == 6
