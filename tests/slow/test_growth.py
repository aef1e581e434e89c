"""Growth on tables that plain rejection cannot fill: against the other exact samplers, formulas and plain draws.
Growth against laws: hard rods on a line (Tonks 1936), orders, exchangeable objects, and its own error bars; and
what the same tests say of wrong samplers.
"""

import functools
import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from experiments.metrics import chi_square
from scenegen.lang.checker import check_text
from scenegen.sampling.growth import sampler
from scenegen.sampling.growth.moves import MoveSettings
from scenegen.sampling.growth.population import grow, spread_scenes
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

from ..sampling.plain import shipped, sorting
from ..sampling.verdict import judge, row
from .growth_tables import (
    BINS,
    BOXES,
    CHAIN,
    DINNER,
    DISCS,
    KNOWN,
    LEAST_P,
    SEEDS,
    TABLES,
    N,
    at_least,
    drawn,
    rod_p,
    rods,
)

pytestmark = pytest.mark.slow


@functools.lru_cache(maxsize=32)
def of_table(name, method, seed):
    text, ranges, _ = TABLES[name]
    return drawn(text, ranges, method, seed=seed)


PAIRS = [(name, other) for name, (_, _, others) in TABLES.items() for other in others]


@pytest.mark.parametrize(("name", "other"), PAIRS)
def test_scenes_are_those_of_the_other_sampler(name, other):
    seeds = range(3)
    verdicts = [
        judge(of_table(name, other, 100 + seed).rows, of_table(name, "growth", seed).rows, np.random.default_rng(seed))
        for seed in seeds
    ]
    print("\n" + row(f"{name}: growth against {other}", verdicts))
    assert sum(one.energy > LEAST_P and one.screen > LEAST_P for one in verdicts) >= 2, verdicts


# ---- probabilities


@pytest.mark.parametrize("name", [name for name in KNOWN if KNOWN[name][2] is not None])
def test_the_probability_is_the_formulas(name):
    text, ranges, truth = KNOWN[name]
    off, inside = [], 0
    for seed in SEEDS:
        info = drawn(text, ranges, "growth", seed=seed).info
        off.append(info["log10_probability"] - truth)
        inside += abs(off[-1]) <= info["log10_error"]
    shown = ", ".join(f"{one:+.3f}" for one in off)
    print(f"\n| {name} | {truth:.4f} | {shown} | {inside} of {len(off)} |")
    assert inside >= 3 and abs(np.mean(off)) < 0.1


@pytest.mark.parametrize("name", TABLES)
def test_the_probability_is_the_other_samplers(name):
    """Growth and pruned rejection say how probable range and requirement are, both with a 95 % interval."""
    if "rejection" not in TABLES[name][2]:
        pytest.skip("rejection does not get there")
    one, other = of_table(name, "growth", 0).info, of_table(name, "rejection", 100).info
    assert one.get("probability_of") == other.get("probability_of")
    off = one["log10_probability"] - other["log10_probability"]
    error = math.hypot(one["log10_error"], other["log10_error"] or 0.0)
    print(f"\n| {name} | {other['log10_probability']:.4f} | {off:+.4f} | {error:.4f} |")
    assert abs(off) < 1.5 * error + 0.005


# requests that plain draws meet often enough to count: choices of all kinds, footprints, headings, narrow ranges
BESIDE = "abs(x(c) - x(d)) + abs(y(c) - y(d)) <= 25 cm"
COUNTED = {
    "each can beside another": (
        "object can[4] = cylinder(0.05, 0.1)\nrequire noOverlap()\n"
        f"task: forall c in can: exists d in can: dist(c, d) >= 1 cm & {BESIDE}", at_least()),
    "one of two chains": (CHAIN, at_least(0.05)),
    "if one is near the edge": (
        "object a, b = box(0.1, 0.05, 0.1)\nrequire noOverlap([a, b])\n"
        "task: nearEdge(a, e = 15 cm) -> abs(x(b) - 0.5) <= 20 cm", {"task": (0.0, 0.02)}),
    "some can far from a box": (
        "object a[2] = box(0.2, 0.1, 0.1), c[2] = cylinder(0.08, 0.1)\nrequire noOverlap()\n"
        "task: (exists p in c: farFrom(p, a[1], 20 cm)) & closeTo(a[1], a[2], 30 cm)", {"task": (-0.1, 0.0)}),
    "each near one of others": (
        "object p[3] = cylinder(0.04, 0.1), q[3] = box(0.1, 0.06, 0.1)\nrequire noOverlap()\n"
        "task: forall a in p: exists b in q: closeTo(a, b, 20 cm)", at_least()),
    "headings and places": (
        "object p[3] = cylinder(0.04, 0.1), q[2] = box(0.1, 0.06, 0.1)\ntask: (exists a in p: facing(q[1], a, 20 deg))"
        " & (leftOf(p[1], q[2]) | sameHeading(q[1], q[2], 20 deg) | angle(q[2], NORTH, 20 deg))", at_least()),
    "an even row": (
        "object c[4] = box(0.1, 0.1, 0.1)\nrequire noOverlap()\ntask: evenlySpaced(c, 8 cm)", at_least()),
    "bins": (BINS.replace("item[4]", "item[2]"), at_least()),
    "dinner for one": (DINNER.replace("0.2)", "0.4)").replace("0.3)", "1.0)"), at_least()),
    "two discs in a box": (KNOWN["two discs in a box"][0], KNOWN["two discs in a box"][1]),
}  # fmt: skip


def counted(text, ranges, least=5000, most=8_000_000):
    """log10 of the share of plain draws in the range that meet the requirement, and half its 95 % interval."""
    asked = SampleRequest({name: Range(*ends) for name, ends in ranges.items()}, n=1, spread="base")
    problem = make_problem(check_text(text), asked)
    low, high = problem.lowest[:, None], problem.highest[:, None]
    rng, hits, drawn_ = np.random.default_rng(99), 0, 0
    while hits < least and drawn_ < most:
        rows = low + rng.random((len(low), 50_000)) * (high - low)
        hits += int((problem.cells.find(problem.phi(rows)) >= 0).sum())
        drawn_ += 50_000
    assert hits > 100
    return math.log10(hits / drawn_), 1.96 * math.log10(math.e) / math.sqrt(hits)


@functools.cache
def count_of(name):
    return counted(*COUNTED[name])


# what a method's runs differ by decides, not what they say of themselves: that is tested apart
RUNS = 6
LEAST_TOGETHER = 0.01 / 30  # of thirty such tests one in a hundred fails by chance


@pytest.mark.parametrize("method", ["growth", "splitting", "rejection"])
@pytest.mark.parametrize("name", COUNTED)
def test_the_probability_is_that_of_plain_draws(name, method):
    """The mean of independent unbiased estimates against the share of plain draws, by the standard error of both:
    Student's t with Welch's degrees of freedom."""
    text, ranges = COUNTED[name]
    truth, error = count_of(name)
    found = [drawn(text, ranges, method, n=500, seed=seed).info["log10_probability"] for seed in range(RUNS)]
    ratio = 10.0 ** (np.array(found) - truth)  # unbiased are the estimates themselves, not their logarithms
    mine, other = float(ratio.var(ddof=1)) / RUNS, (error / 1.96 * math.log(10.0)) ** 2
    degrees = (mine + other) ** 2 / (mine**2 / (RUNS - 1)) if mine else math.inf
    p = 2.0 * stats.t.sf(abs(ratio.mean() - 1.0) / math.sqrt(mine + other), degrees)
    shown = ", ".join(f"{one - truth:+.3f}" for one in found)
    print(f"\n| {name}: {method} | {truth:.4f} | {shown} | {p:.2g} |")
    assert p > LEAST_TOGETHER


SPREAD_OVER = 40


@pytest.mark.parametrize(
    "name", ["4 rods of 4 cm on a line", "3 sorted points, gaps of 0.2", "10 sorted points, gaps of 0.02",
             "15 rods of 4 cm on a line"])  # fmt: skip
def test_the_error_of_the_probability_is_honest(name):
    """The 95 % interval holds the truth in about so many of forty runs; five misses or fewer with p = 0.986."""
    text, ranges, truth = KNOWN[name]
    runs = [drawn(text, ranges, "growth", n=500, seed=1000 + seed).info for seed in range(SPREAD_OVER)]
    inside = sum(abs(info["log10_probability"] - truth) <= info["log10_error"] for info in runs)
    print(f"\n| {name} | {inside} of {SPREAD_OVER} |")
    assert inside >= SPREAD_OVER - 5


def test_the_public_call_says_what_it_did():
    scenes = scenegen.sample(scenegen.parse(BINS), {"task": (0.0, None)}, 500, method="growth", workers=1)
    info = scenes.header.sampler
    assert info["method"] == "growth" and info["effective_share"] >= 0.5 and info["log10_error"] > 0.0


@pytest.mark.parametrize("n", [4, 10, 15])
def test_hard_rods_follow_their_law(n):
    p = [rod_p(drawn(*rods(n), "growth", seed=seed).rows[0::3]) for seed in SEEDS]
    print(f"\n| {n} rods of 4 cm on a line: places and least gap | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert sum(one > LEAST_P for one in p) >= 4, p


def test_the_four_orders_come_in_equal_shares():
    counts = []
    for seed in SEEDS:
        rows = drawn(shipped("sort_7"), {"sorted": (0.0375, 0.0625)}, "growth", seed=seed).rows
        counts.append(np.bincount(sorting(rows).argmax(axis=0), minlength=4))
    p, shares = [chi_square(one).p for one in counts], np.array(counts) / N
    print(f"\n| N = 7: growth | {min(p):.2g} - {max(p):.2g} | {sum(one > LEAST_P for one in p)} of 5 | "
          f"{shares.min():.3f} - {shares.max():.3f} |")  # fmt: skip
    assert abs(np.mean(counts, axis=0) / N - 0.25).max() < 0.03


@pytest.mark.parametrize("text", [DISCS.replace("leftOf(disc[1], disc[2])", "closeTo(disc[1], (0.2, 0.2), 1)"),
                                  BOXES.replace("leftOf(box[1], box[2])", "closeTo(box[1], (0.2, 0.2), 1)")],
                         ids=["8 discs", "3 boxes"])  # fmt: skip
def test_the_order_of_insertion_leaves_no_mark(text, request):
    """Objects that nothing tells apart: the first and the last that is placed have the same law."""
    p = []
    for seed in SEEDS:
        problem = make_problem(check_text(text), SampleRequest({"task": Range(0.0)}, n=N, seed=seed))
        plan = plan_growth(problem, Budget(600.0))
        assert isinstance(plan, Growth)
        first, last = plan.model.order[0], plan.model.order[-1]
        rows = draw(problem, Budget(600.0), method="growth").rows
        p.append(3 * min(stats.ks_2samp(one, two).pvalue for one, two in views(rows, first, last)))
    print(f"\n| {request.node.callspec.id}: first against last object | {min(p):.2g} - {min(1.0, max(p)):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert sum(one > LEAST_P for one in p) >= 4, p


def views(rows, first, last):
    one, two = rows[3 * first : 3 * first + 3], rows[3 * last : 3 * last + 3]
    middle = 0.5 * (rows[0::3].max() + rows[0::3].min()), 0.5 * (rows[1::3].max() + rows[1::3].min())
    return [(one[0], two[0]), (one[1], two[1]),
            tuple(np.hypot(at[0] - middle[0], at[1] - middle[1]) for at in (one, two))]  # fmt: skip


def test_the_effective_share_is_honest():
    """The means of twenty runs scatter as those of that share of independent scenes would."""
    for name, (text, ranges) in {
        "10 rods": rods(10),
        "3 boxes": (BOXES, at_least()),
        "bins": (BINS, at_least()),
    }.items():
        means, spread, shares = [], [], []
        for seed in range(20):
            found = drawn(text, ranges, "growth", n=1000, seed=seed)
            seen = statistics(found.rows)
            means.append(seen.mean(axis=1))
            spread.append(seen.var(axis=1))
            shares.append(found.info["effective_share"])
        excess = np.var(means, axis=0, ddof=1) / (np.mean(spread, axis=0) / 1000)
        claimed = 1 / np.mean(shares)
        print(f"\n| {name} | {np.mean(shares):.2f} | {claimed:.2f} | {excess.mean():.2f} | {excess.max():.2f} |")
        # 19 degrees of freedom: a ratio of 2 comes by chance once in 150 statistics
        assert excess.mean() < 1.5 * claimed and stats.chi2.sf(19 * excess.max() / claimed, 19) * len(excess) > 1e-4


def statistics(rows):
    x, y = rows[0::3], rows[1::3]
    dx, dy = x[1:] - x[:1], y[1:] - y[:1]
    return np.concatenate([x, y, np.abs(dx), np.abs(dy), [x.var(axis=0)], [y.var(axis=0)]])


# ---- wrong samplers, which the same tests reject


def one_after_another(n, count, rng, length=0.04):
    """Rods placed one after another, uniform over what is free, without weights: what a plain placer does."""
    kept = []
    while len(kept) < count:
        places = []
        while len(places) < n:
            x = rng.random(64)
            free = x[(np.abs(x[:, None] - np.array(places)[None, :]) >= length).all(axis=1)] if places else x
            if not len(free):
                break
            places.append(free[0])
        if len(places) == n:
            kept.append(places)
    return np.array(kept).T


def test_sequential_placement_without_weights_is_rejected():
    p = [rod_p(one_after_another(15, N, np.random.default_rng(seed))) for seed in SEEDS]
    print(f"\n| 15 rods, placed one after another | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert max(p) < LEAST_P


def test_growth_without_moves_is_rejected():
    """Copies of a few ancestors, which no moves part, at high fill."""
    text, _ = rods(15)
    p = []
    for seed in SEEDS:
        problem = make_problem(check_text(text), SampleRequest({"task": Range(0.0)}, n=N, seed=seed, spread="base"))
        plan = plan_growth(problem, Budget(600.0))
        assert isinstance(plan, Growth)
        steps = [type(step)(step.tries, 0) for step in plan.recipe.steps]
        grown = grow(
            plan.model, *spread_scenes(plan.model, (0,), N), steps, MoveSettings({}), sampler.generator(seed, 0)
        )
        p.append(rod_p(grown.particles.scenes[0::3]))
    print(f"\n| 15 rods, growth without moves | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert sum(one > LEAST_P for one in p) <= 1, p  # by chance a seed has ancestors enough


def test_growth_without_weights_is_rejected(monkeypatch):
    """Every scene that is still possible goes on with the same weight."""
    from scenegen.sampling.growth import population as module

    honest = module.place

    def careless(particles, tries, *, planning=False):
        placed = honest(particles, tries, planning=planning)
        return type(placed)((placed.weights > 0.0) * 1.0, placed.hits, placed.attracted, placed.tries)

    monkeypatch.setattr(module, "place", careless)
    monkeypatch.setattr(module, "sweep", lambda *words: 0.0)
    monkeypatch.setattr(sampler, "sweep", lambda *words: 0.0)
    p = []
    for seed in SEEDS:
        problem = make_problem(
            check_text(rods(15)[0]), SampleRequest({"task": Range(0.0)}, n=N, seed=seed, spread="base")
        )
        plan = plan_growth(problem, Budget(600.0))
        steps = [type(step)(max(step.tries, 16), 0) for step in plan.recipe.steps]
        grown = grow(
            plan.model, *spread_scenes(plan.model, (0,), N), steps, MoveSettings({}), sampler.generator(seed, 0)
        )
        p.append(rod_p(grown.particles.scenes[0::3]))
    print(f"\n| 15 rods, growth without weights | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert max(p) < LEAST_P
