"""Growth on tables that plain rejection cannot fill: against closed-form laws and the other exact samplers; and what
the same tests say of wrong samplers.

Some CPU minutes. Each test prints the lines of docs/experiments/exactness.md that it measures:

    python -m pytest -m slow tests/slow/test_growth.py -s | grep '^|'
"""

import functools
import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.engine.exact import draw
from scenegen.lang.check import check_text
from scenegen.metrics.chi_square import chi_square
from scenegen.sampling.growth import sampler
from scenegen.sampling.growth.grow import grow
from scenegen.sampling.growth.moves import Settings
from scenegen.sampling.growth.plan import spread_over
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.problem import Budget, pose
from scenegen.sampling.request import Range

from ..sampling.plain import shipped, sorting, square_line
from ..sampling.verdict import judge, row

pytestmark = pytest.mark.slow

N = 2000
SEEDS = range(5)
LEAST_P = 0.01


def drawn(text, ranges, method, n=N, seed=0, spread="base"):
    problem = pose(
        check_text(text), {name: Range(*ends) for name, ends in ranges.items()}, n=n, seed=seed, spread=spread
    )
    found = draw(problem, Budget(600.0), method=method)
    assert found.shortfall is None and found.count == n
    return found


def at_least(value=0.0):
    return {"task": (value, None)}


# ---- where pruned rejection or splitting get there, too

BINS = """object item[4] = cylinder(0.03, 0.05)
workspace [0, 0.6] x [0, 0.5]
region left = rect(0.0, 0.0, 0.2, 0.2)
region right = rect(0.4, 0.0, 0.6, 0.2)
require noOverlap(item)
task: forall i in item: inside(i, left) | inside(i, right)
"""
DINNER = """object plate = cylinder(0.12, 0.02), fork = box(0.18, 0.02, 0.01), knife = box(0.2, 0.02, 0.01)
object glass = cylinder(0.04, 0.1)
workspace [0, 0.8] x [0, 0.6]
require noOverlap()
task: leftOf(fork, plate) & rightOf(knife, plate) & closeTo(fork, plate, 0.2) & closeTo(knife, plate, 0.2)
      & angle(fork, NORTH, 0.3) & angle(knife, NORTH, 0.3) & closeTo(glass, knife, 0.2) & aboveOf(glass, knife)
"""
DISCS = """object disc[8] = cylinder(0.04, 0.02)
workspace [0, 0.4] x [0, 0.4]
require noOverlap() & insideWorkspace()
task: leftOf(disc[1], disc[2])
"""
BOXES = """object box[3] = box(0.2, 0.1, 0.02)
workspace [0, 0.36] x [0, 0.3]
require noOverlap() & insideWorkspace()
task: leftOf(box[1], box[2])
"""
ISLANDS = """object mug, plate, cup, bowl
task: leftOf(mug, plate) & closeTo(mug, plate, 0.2) & leftOf(cup, bowl) & closeTo(cup, bowl, 0.2)
"""
CHAIN = "leftOf(a, b) & leftOf(b, c) & closeTo(a, c, 0.4) | belowOf(a, b) & belowOf(b, c) & closeTo(a, c, 0.4)"
TABLES = {
    "4 items in 2 bins": (BINS, at_least(), ("rejection", "splitting")),
    "dinner for one, noOverlap": (DINNER, at_least(), ("rejection", "splitting")),
    "8 discs, 25 % full": (DISCS, at_least(), ("splitting",)),
    "3 boxes, 56 % full": (BOXES, at_least(), ("rejection", "splitting")),
    "two pairs apart": (ISLANDS, at_least(0.05), ("rejection", "splitting")),
    "one of two chains": (CHAIN, at_least(0.05), ("rejection", "splitting")),
}


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

# name -> spec, range, log10 of the probability of range and requirement where a formula gives it
KNOWN = {
    "two discs in a box": (
        "object a = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1)\nrequire noOverlap() & insideWorkspace()\n"
        "task: closeTo(a, b, 0.5)", {"task": (0.1, 0.4)}, math.log10(0.8**4 * (square_line(0.5) - square_line(0.25)))),
    "exp 3, N = 3": (shipped("sort_3"), {"sorted": (0.05, None)}, None),
    **{f"{n} sorted points, gaps of {gap}": (
        " & ".join(f"leftOf(p{k}, p{k + 1})" for k in range(n - 1)), at_least(gap),
        n * math.log10(1 - (n - 1) * gap) - math.log10(math.factorial(n)))
       for n, gap in ((3, 0.2), (5, 0.0), (6, 0.1), (10, 0.02), (20, 0.0), (30, 0.01))},
    **{f"{n} rods of 4 cm on a line": (
        f"object rod[{n}] = cylinder(0.02, 0.1)\nworkspace [0, 1] x [0, 0.000001]\nrequire noOverlap()\n"
        "task: closeTo(rod[1], (0.5, 0), 1)", at_least(), n * math.log10(1 - (n - 1) * 0.04))
       for n in (4, 10, 15)},
}  # fmt: skip


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


# ---- laws: hard rods on a line (Tonks 1936), orders, exchangeable objects


def rods(n):
    text, ranges, _ = KNOWN[f"{n} rods of 4 cm on a line"]
    return text, ranges


def rod_p(places, length=0.04):
    """p of places (N, B) of rods' middles: with (k - 1) lengths taken off the k-th, they are N sorted uniform points of
    what is left, so the k-th has a beta distribution, and so has the least gap."""
    n = len(places)
    free = 1 - (n - 1) * length
    middle = (np.sort(places, axis=0) - length * np.arange(n)[:, None]) / free
    p = [stats.kstest(middle[k], stats.beta(k + 1, n - k).cdf).pvalue for k in range(n)]
    least = np.diff(middle, axis=0).min(axis=0)
    p.append(stats.kstest(1 - (1 - np.minimum((n - 1) * least, 1.0)) ** n, "uniform").pvalue)
    return min(1.0, min(p) * len(p))


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
        problem = pose(check_text(text), {"task": Range(0.0)}, n=N, seed=seed)
        plan = plan_growth(problem, Budget(600.0))
        assert isinstance(plan, Growth)
        first, last = plan.machine.order[0], plan.machine.order[-1]
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
        problem = pose(check_text(text), {"task": Range(0.0)}, n=N, seed=seed, spread="base")
        plan = plan_growth(problem, Budget(600.0))
        assert isinstance(plan, Growth)
        steps = [type(step)(step.tries, 0) for step in plan.recipe.steps]
        grown = grow(plan.machine, *spread_over((0,), N), steps, Settings({}), sampler.generator(seed, 0))
        p.append(rod_p(grown.particles.scenes[0::3]))
    print(f"\n| 15 rods, growth without moves | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert sum(one > LEAST_P for one in p) <= 1, p  # by chance a seed has ancestors enough


def test_growth_without_weights_is_rejected(monkeypatch):
    """Every scene that is still possible goes on with the same weight."""
    from scenegen.sampling.growth import grow as module

    honest = module.place

    def careless(particles, tries, *, planning=False):
        placed = honest(particles, tries, planning=planning)
        return type(placed)((placed.weights > 0.0) * 1.0, placed.hits, placed.attracted, placed.tries)

    monkeypatch.setattr(module, "place", careless)
    monkeypatch.setattr(module, "sweep", lambda *words: 0.0)
    monkeypatch.setattr(sampler, "sweep", lambda *words: 0.0)
    p = []
    for seed in SEEDS:
        problem = pose(check_text(rods(15)[0]), {"task": Range(0.0)}, n=N, seed=seed, spread="base")
        plan = plan_growth(problem, Budget(600.0))
        steps = [type(step)(max(step.tries, 16), 0) for step in plan.recipe.steps]
        grown = grow(plan.machine, *spread_over((0,), N), steps, Settings({}), sampler.generator(seed, 0))
        p.append(rod_p(grown.particles.scenes[0::3]))
    print(f"\n| 15 rods, growth without weights | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert max(p) < LEAST_P


def test_the_public_call_says_what_it_did():
    scenes = scenegen.sample(scenegen.parse(BINS), {"task": (0.0, None)}, 500, method="growth", workers=1)
    info = scenes.header.sampler
    assert info["method"] == "growth" and info["effective_share"] >= 0.5 and info["log10_error"] > 0.0
