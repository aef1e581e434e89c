"""Growth against laws: hard rods on a line (Tonks 1936), orders, exchangeable objects, and its own error bars; and what
the same tests say of wrong samplers.

Some CPU minutes. Each test prints the lines of docs/experiments/exactness.md that it measures:

    python -m pytest -m slow tests/slow/test_growth*.py -s | grep '^|'
"""

import numpy as np
import pytest
from scipy import stats

from experiments.metrics import chi_square
from scenegen.lang.checker import check_text
from scenegen.sampling.engine.run import draw
from scenegen.sampling.growth import sampler
from scenegen.sampling.growth.moves import MoveSettings
from scenegen.sampling.growth.population import grow, spread_over
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest

from ..sampling.plain import shipped, sorting
from .growth_tables import BINS, BOXES, DISCS, LEAST_P, SEEDS, N, at_least, drawn, rod_p, rods

pytestmark = pytest.mark.slow


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
        problem = make_problem(check_text(text), SampleRequest({"task": Range(0.0)}, n=N, seed=seed, spread="base"))
        plan = plan_growth(problem, Budget(600.0))
        assert isinstance(plan, Growth)
        steps = [type(step)(step.tries, 0) for step in plan.recipe.steps]
        grown = grow(
            plan.machine, *spread_over(plan.machine, (0,), N), steps, MoveSettings({}), sampler.generator(seed, 0)
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
            plan.machine, *spread_over(plan.machine, (0,), N), steps, MoveSettings({}), sampler.generator(seed, 0)
        )
        p.append(rod_p(grown.particles.scenes[0::3]))
    print(f"\n| 15 rods, growth without weights | {min(p):.2g} - {max(p):.2g} | "
          f"{sum(one > LEAST_P for one in p)} of 5 |")  # fmt: skip
    assert max(p) < LEAST_P
