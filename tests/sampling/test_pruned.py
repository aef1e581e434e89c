"""Pruned rejection against analytic answers and plain rejection: the true distribution, and the true probability."""

import math
from functools import partial

import numpy as np
import pytest

from scenegen.lang.checker import check_text
from scenegen.learn.guided import score
from scenegen.learn.refine import draw as base
from scenegen.learn.refine import piece_generator
from scenegen.resources import shipped_specs
from scenegen.sampling.engine.run import draw as run
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.rejection import sampler
from scenegen.sampling.rejection.sampler import make_plan
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.prune import Part

rejection = partial(run, method="rejection")

N = 20_000


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
        phi = score(problem, rows)
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
        need = sampler.SPARE * n / kept
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
