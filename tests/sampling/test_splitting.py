"""Splitting hands out the true conditional distribution, and knows how probable the range is. Every kind of move
leaves the wanted distribution as it is; mirrors undo themselves.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy import stats

from scenegen.lang.checker import check_text
from scenegen.resources import shipped_specs
from scenegen.sampling.plans import draw as run
from scenegen.sampling.problem import make_problem
from scenegen.sampling.report import probability_info
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.resampling import resample
from scenegen.sampling.splitting.chain_state import ChainTape, chain_state_of
from scenegen.sampling.splitting.chains import Chains, Statistics, correlation, design_effect
from scenegen.sampling.splitting.levels import Region
from scenegen.sampling.splitting.moves import (
    COMPOSED_MIRRORS,
    MIRROR_PROPOSALS,
    MOVE_PROPOSALS,
    STEP_PROPOSALS,
    Deck,
    MoveInputs,
    Tuning,
    bring_home,
    moves_for,
)
from scenegen.sampling.splitting.sampler import Splitting, SplittingStalled, make_schedule
from scenegen.search.effort import Budget

rejection = partial(run, method="rejection")
splitting = partial(run, method="splitting")

N = 20_000


def drawn(text_or_spec, ranges, n=N, seed=0, spread="base"):
    spec = check_text(text_or_spec, "test") if isinstance(text_or_spec, str) else text_or_spec
    found = splitting(make_problem(spec, SampleRequest(ranges, n=n, seed=seed, spread=spread)), Budget())
    assert found.shortfall is None and found.count == n
    return found


def within_error(info, truth):
    """Whether a known probability lies in twice the 95 % interval: one run in thousands falls outside."""
    return abs(info["log10_probability"] - math.log10(truth)) < 2 * info["log10_error"]


def uniform(values, low, high):
    return stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 1e-3


@pytest.fixture(scope="module")
def ring():
    """phi from 0.2 to 0.23 is a ring around a point, 2 to 5 cm away from it: 0.66 % of the table."""
    return drawn("closeTo(mug, (0.3, 0.6), 0.25)", {"task": Range(0.2, 0.23)})


def test_a_ring_around_a_point_is_filled_evenly(ring):
    dx, dy = ring.rows[0] - 0.3, ring.rows[1] - 0.6
    assert uniform(dx**2 + dy**2, 0.02**2, 0.05**2)
    assert uniform(np.arctan2(dy, dx), -math.pi, math.pi)
    assert uniform(ring.rows[2], 0, 2 * math.pi)
    assert within_error(ring.info, math.pi * (0.05**2 - 0.02**2))


def test_every_scene_is_in_the_range_and_there_once(ring):
    assert ring.phi.min() >= 0.2 and ring.phi.max() <= 0.23
    assert len(np.unique(ring.rows[:2], axis=1).T) == N
    np.testing.assert_allclose(0.25 - np.hypot(ring.rows[0] - 0.3, ring.rows[1] - 0.6), ring.phi[0], atol=1e-14)


def test_a_band_of_differences_has_its_triangular_density():
    found = drawn("leftOf(a, b)", {"task": Range(0.9, 0.98)}, seed=1)
    apart = found.phi[0]
    # the density of a difference d of two uniform places is 1 - d; the left one is uniform on [0, 1 - d]
    cdf = lambda d: ((1 - 0.9) ** 2 - (1 - d) ** 2) / ((1 - 0.9) ** 2 - (1 - 0.98) ** 2)  # noqa: E731
    assert stats.kstest(apart, cdf).pvalue > 1e-3
    assert uniform(found.rows[0] / (1 - apart), 0, 1)
    assert uniform(found.rows[1], 0, 1) and uniform(found.rows[4], 0, 1)
    assert within_error(found.info, ((1 - 0.9) ** 2 - (1 - 0.98) ** 2) / 2)


@pytest.mark.long
def test_both_sides_of_an_angle_get_equal_shares():
    found = drawn("angle(knife, 0, 0.01)", {"task": Range(0.002, 0.004)}, seed=2)
    off = (found.rows[2] + math.pi) % (2 * math.pi) - math.pi
    assert uniform(np.abs(off), 0.006, 0.008)
    assert abs((off > 0).sum() - N / 2) < 4 * math.sqrt(N / 4)
    assert within_error(found.info, 2 * 0.002 / (2 * math.pi))


@pytest.fixture(scope="module")
def flat(exp1):
    return drawn(exp1, {"task": Range(0.1, 0.3)}, seed=3, spread="flat")


@pytest.mark.long
def test_the_cells_share_exactly(flat):
    counts, _ = np.histogram(flat.phi[0], np.linspace(0.1, 0.3, 33))
    assert counts.tolist() == [N // 32] * 32


@pytest.mark.long
@pytest.mark.parametrize("cell", [0, 13, 31])
def test_within_a_cell_scenes_follow_the_base_distribution(flat, cell, phi1, direct, same_distribution):
    low, high = np.linspace(0.1, 0.3, 33)[cell : cell + 2]
    truth = direct(2_000_000)
    phi = phi1(truth)[0]
    truth = truth[:, (phi >= low) & (phi <= high)]
    mine = flat.rows[:, (flat.phi[0] >= low) & (flat.phi[0] <= high)]
    for row in range(6):
        assert same_distribution(mine[row], truth[row])
    assert same_distribution(mine[0] - mine[3], truth[0] - truth[3])
    assert same_distribution(phi1(mine)[1], phi1(truth)[1])


@pytest.mark.long
def test_a_rare_end_of_the_range_gets_its_share_too():
    """The last of the 32 cells is a 600th as likely as the first."""
    found = drawn("leftOf(a, b) & leftOf(c, d)", {"task": Range(0.6, 0.98)}, n=3200, seed=4, spread="flat")
    counts, _ = np.histogram(found.phi[0], np.linspace(0.6, 0.98, 33))
    assert counts.tolist() == [100] * 32


@pytest.mark.long
def test_cells_out_of_reach_are_reported(exp1):
    found = drawn(exp1, {"task": Range(0.0, 0.2), "safe": Range(0.0, 0.2)}, n=2550, seed=5, spread="flat")
    # with mug and plate 0.1875 apart along x and y their distance is at least 0.265, and safe is over 0.0125
    assert found.info["cells"] == {"asked": 256, "reached": 255}
    assert "1 of 256 cells" in found.warnings[0].title and "task 0.1875:0.2, safe 0:0.0125" in found.warnings[0].note
    counts, _, _ = np.histogram2d(*found.phi, bins=[np.linspace(0, 0.2, 17)] * 2)
    assert sorted(set(counts.ravel())) == [0.0, 10.0]


@pytest.mark.long
def test_two_labels_and_two_modes_against_plain_draws(exp1, phi1, direct, same_distribution):
    """Experiment 1's query has two modes, one with the mug further left and one with it further up."""
    low, high = np.array([0.15, 0.05]), np.array([0.23, 0.11])
    found = drawn(exp1, {"task": Range(0.15, 0.23), "safe": Range(0.05, 0.11)}, seed=6)
    truth = direct(3_000_000)
    phi = phi1(truth)
    truth = truth[:, ((phi >= low[:, None]) & (phi <= high[:, None])).all(axis=0)]
    for row in range(6):
        assert same_distribution(found.rows[row], truth[row])
    for first, second in ((0, 3), (1, 4)):
        assert same_distribution(found.rows[first] - found.rows[second], truth[first] - truth[second])
    assert within_error(found.info, truth.shape[1] / 3_000_000)


@pytest.mark.long
def test_what_is_required_shapes_the_base_distribution(exp1, phi1, direct, same_distribution):
    core = replace(exp1.core, labels={"task": exp1.core.labels["task"]}, requirement=exp1.core.labels["safe"])
    found = drawn(replace(exp1, core=core), {"task": Range(0.02, 0.04)}, seed=7)
    truth = direct(1_000_000)
    task, safe = phi1(truth)
    wanted = (task >= 0.02) & (task <= 0.04) & (safe >= 0)
    truth = truth[:, wanted]
    assert phi1(found.rows)[1].min() >= 0
    for row in range(6):
        assert same_distribution(found.rows[row], truth[row])
    assert within_error(found.info, wanted.mean())  # of the range and what is required together


def test_objects_held_in_place_stay_there(exp1, same_distribution):
    found = drawn(replace(exp1, fixed={1: (0.5, 0.25, 1.0)}), {"task": Range(0.2, 0.25)}, n=5000, seed=8)
    assert (found.rows[3:] == np.array([[0.5], [0.25], [1.0]])).all()
    mug = np.random.default_rng(1).random((2, 400_000))
    phi = np.minimum(0.5 - mug[0], mug[1] - 0.25)
    mug = mug[:, (phi >= 0.2) & (phi <= 0.25)]
    assert same_distribution(found.rows[0], mug[0]) and same_distribution(found.rows[1], mug[1])


def test_a_table_of_its_own_size():
    found = drawn("workspace [-2 m, 30 cm] x [5, 6]\ntask: leftOf(mug, plate)", {"task": Range(2.2)}, n=2000)
    assert found.rows[0::3].min() >= -2 and found.rows[0::3].max() <= 0.3
    assert found.rows[1::3].min() >= 5 and found.rows[1::3].max() <= 6
    assert within_error(found.info, 0.5 * (0.1 / 2.3) ** 2)


@pytest.mark.long
@pytest.mark.parametrize("name", ["sort_3"])
def test_the_four_orderings_get_equal_shares(name):
    assert orderings(name, seed=0) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_four_orderings_of_seven_get_equal_shares(seed):
    assert orderings("sort_7", seed) > 1e-3


def orderings(name, seed):
    """p of the chi-square test that left to right, right to left, up and down are equally frequent."""
    spec = check_text(shipped_specs()[name].read_text(), name)
    rows = drawn(spec, {"sorted": Range(0.0375, 0.0625)}, seed=seed).rows
    x, y = np.diff(rows[0::3], axis=0), np.diff(rows[1::3], axis=0)
    counts = [int((way > 0).all(axis=0).sum()) for way in (x, -x, y, -y)]
    return stats.chisquare(counts).pvalue


@pytest.mark.long
def test_pieces_are_unbiased_about_the_probability():
    """Fixed levels make the product of the shares an unbiased estimate (Cerou et al. 2012), whatever the moves."""
    problem = make_problem(
        check_text("leftOf(a, b) & belowOf(a, b)"), SampleRequest({"task": Range(0.8, 0.82)}, n=16, spread="base")
    )
    plan = make_schedule(problem, Budget())
    assert not isinstance(plan, SplittingStalled) and plan.levels >= 8
    estimates = np.array([Splitting(problem, plan).draw(k).facts[1] for k in range(40)])
    truth = (0.2**2 / 2) ** 2 - (0.18**2 / 2) ** 2
    error = estimates.std(ddof=1) / math.sqrt(len(estimates))
    assert abs(estimates.mean() - truth) < 4 * error
    # the ideal: every level as if drawn anew, (1 - p) / p / chains for each
    ideal = math.sqrt(plan.levels / plan.chains)
    assert 0.7 * ideal < estimates.std(ddof=1) / truth < 2 * ideal


def test_the_error_bar_is_students():
    def of(*estimates):
        return probability_info(len(estimates), sum(estimates), sum(one**2 for one in estimates))

    bar = of(1e-6, 2e-6, 3e-6, 2e-6)
    assert bar["log10_probability"] == round(math.log10(2e-6), 5)
    low, high = stats.t.interval(0.95, 3, loc=2e-6, scale=stats.sem([1e-6, 2e-6, 3e-6, 2e-6]))
    assert bar["log10_error"] == pytest.approx((high - low) / 2 / 2e-6 / math.log(10), rel=0.01)
    assert of(0.0, 0.0) == {"log10_probability": None, "log10_error": None}
    assert of(0.5)["log10_error"] is None


@pytest.mark.slow
@pytest.mark.parametrize(("name", "truth"), [("table_setting_published", 2.18e-6), ("table_setting", 2.95e-6)])
def test_how_rare_the_band_of_experiment_2_is(name, truth):
    spec = check_text(shipped_specs()[name].read_text(), name)
    info = drawn(spec, {"task": Range(0.0175, 0.0425)}, n=200_000, seed=0).info
    assert abs(10 ** info["log10_probability"] / truth - 1) < 0.05
    assert abs(info["log10_probability"] - math.log10(truth)) < info["log10_error"] + 0.003  # the reference is rounded


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "ranges"),
    [
        ("mug_left_of_plate", {"task": Range(0.1775, 0.2025), "safe": Range(0.0675, 0.0925)}),
        ("sort_3", {"sorted": Range(0.0375, 0.0625)}),
    ],
)
def test_coordinates_and_differences_pass_kolmogorov_and_smirnov(name, ranges):
    """n = 20,000 against plain rejection, five seeds: p > 0.01 after Bonferroni on at least four of them."""
    spec = check_text(shipped_specs()[name].read_text(), name)
    passed = 0
    for seed in range(5):
        mine = views(drawn(spec, ranges, seed=seed).rows)
        truth = views(
            rejection(make_problem(spec, SampleRequest(ranges, n=N, seed=100 + seed, spread="base")), Budget(300)).rows
        )
        least = min(stats.ks_2samp(one, two).pvalue for one, two in zip(mine, truth, strict=True))
        passed += least * len(mine) > 0.01
    assert passed >= 4


def views(rows):
    """All coordinates, and the differences of all pairs of objects along x and y."""
    pairs = [(a, b) for a in range(0, len(rows), 3) for b in range(0, a, 3)]
    return [*rows, *(rows[a + axis] - rows[b + axis] for a, b in pairs for axis in (0, 1))]


@pytest.mark.slow
def test_pieces_vary_no_more_than_independent_scenes_would():
    """Survivors of one ancestor that are alike would make means differ from piece to piece (experiment 3, N = 7)."""
    spec = check_text(shipped_specs()["sort_7"].read_text(), "sort_7")
    problem = make_problem(spec, SampleRequest({"sorted": Range(0.0375, 0.0625)}, n=N, spread="base"))
    plan = make_schedule(problem, Budget())
    pieces = [Splitting(problem, plan).draw(k) for k in range(30)]
    means = np.array([[view.mean() for view in seen(piece.rows)] for piece in pieces])
    spread = np.array([view.std() for view in seen(np.concatenate([piece.rows for piece in pieces], axis=1))])
    excess = means.var(axis=0, ddof=1) / (spread**2 / np.mean([piece.rows.shape[1] for piece in pieces]))
    # 29 degrees of freedom each; the statistics hang together, so their mean scatters like that of a few of them
    assert excess.mean() < 1.25 and stats.chi2.sf(29 * excess.max(), 29) * len(excess) > 1e-3


def seen(rows):
    x, y = np.diff(rows[0::3], axis=0), np.diff(rows[1::3], axis=0)
    orders = [(way > 0).all(axis=0).astype(float) for way in (x, -x, y, -y)]
    spans = [np.where(orders[0] + orders[1] > 0, np.abs(x.sum(axis=0)), np.abs(y.sum(axis=0)))]
    return [*rows, *orders, *spans]


SPEC = """
workspace [0, 2] x [0, 1]
task: (leftOf(a, b) | closeTo(a, b, 0.3)) & angle(a, 1, 2) & belowOf(c, b)
"""

# y and theta of book and pen have the same limits, x has not
TRAYS = """
object left = box(0.3, 0.3, 0.02) at (0.25, 0.5, 0), right = box(0.3, 0.3, 0.02) at (0.75, 0.5, 0)
object book = box(0.1, 0.06, 0.02) on left, pen = box(0.1, 0.06, 0.02) on right
task: angle(book, 1, 2) & angle(pen, 1, 2) & y(book) <= y(pen) & x(pen) - x(book) >= 0.3
"""


@pytest.fixture(scope="module")
def problem():
    return make_problem(check_text(SPEC), SampleRequest(n=16))


def chains_at_truth(problem, seed, low=0.05):
    """Chains that are exactly where they should be, by plain rejection."""
    chain_state, rng = chain_state_of(problem), np.random.Generator(np.random.SFC64(seed))
    tape = ChainTape(chain_state)
    rows = chain_state.draw(120_000, rng)
    good = tape(rows)[0] >= low
    rows = [row[good] for row in rows]
    chains = Chains.start(chain_state, tape, problem.cells, len(rows[0]), rng)
    chains.rows, chains.scores = rows, tape(rows)
    chains.pool = [row[:500] for row in rows]
    chains.region = Region(np.array([low]), np.array([np.inf]))
    return chains


def tuning(chain_state, length=0.3):
    width = chain_state.high - chain_state.low
    # part of the box alone, so that redraws have to tell who may take part
    return Tuning(
        dict.fromkeys(MOVE_PROPOSALS, 1.0),
        dict.fromkeys(MOVE_PROPOSALS, 1.0),
        length * width,
        chain_state.low,
        chain_state.low + 0.8 * width,
    )


def distances(chains, before, same_distribution):
    """Statistics, by number, whose distribution is no longer what it was."""
    chain_state = chains.chain_state
    now = [*chains.rows, chains.scores[0], chains.rows[0] - chains.rows[3], chains.rows[1] - chains.rows[4]]
    assert chain_state.dimension == 6
    return [index for index, (one, two) in enumerate(zip(before, now, strict=True)) if not same_distribution(one, two)]


def statistics(chains):
    return [*chains.rows, chains.scores[0], chains.rows[0] - chains.rows[3], chains.rows[1] - chains.rows[4]]


@pytest.mark.long
@pytest.mark.parametrize("kind", MOVE_PROPOSALS)
def test_a_kind_keeps_the_distribution(problem, kind, same_distribution):
    chains, fresh = chains_at_truth(problem, 1), chains_at_truth(problem, 2)
    start = [row.copy() for row in chains.rows]
    shares = [chains.move(kind, tuning(chains.chain_state))[0] for _ in range(12)]
    assert distances(chains, statistics(fresh), same_distribution) == []
    assert chains.region.holds(chains.scores).all()
    for row, low, high in zip(chains.rows, chains.chain_state.low, chains.chain_state.high, strict=True):
        assert row.min() >= low and row.max() <= high
    moved = np.mean([(a != b) for a, b in zip(start, chains.rows, strict=True)])
    assert (max(shares) > 0) == (moved > 0)
    assert moved > 0 or kind in MIRROR_PROPOSALS
    np.testing.assert_array_equal(chains.scores[0], chains.tape(chains.rows)[0])


def test_a_move_that_leans_is_found_out(problem, same_distribution, monkeypatch):
    chains, fresh = chains_at_truth(problem, 1), chains_at_truth(problem, 2)
    noise = MoveInputs.noise
    monkeypatch.setattr(MoveInputs, "noise", lambda self, half: noise(self, half) + 0.2 * half)
    for _ in range(12):
        chains.move("row", tuning(chains.chain_state))
    assert distances(chains, statistics(fresh), same_distribution)


@pytest.mark.parametrize("kind", MIRROR_PROPOSALS)
@pytest.mark.parametrize("text", [SPEC, TRAYS], ids=["table", "trays"])
def test_a_mirror_undoes_itself(text, kind, monkeypatch):
    monkeypatch.setattr(MoveInputs, "coin", lambda self: np.ones(self.count, dtype=bool))
    chain_state = chain_state_of(make_problem(check_text(text), SampleRequest(n=16)))
    rows = chain_state.draw(100, np.random.default_rng(0))

    def apply(rows, seed):
        rng = np.random.Generator(np.random.SFC64(seed))
        decks = Deck(chain_state.dimension, rng), Deck(len(chain_state.parts), rng)
        proposal = MOVE_PROPOSALS[kind](MoveInputs(chain_state, *decks, rows, rows, tuning(chain_state), 1.0, rng))
        values, _ = bring_home(chain_state, proposal)
        out = list(rows)
        for row, value in zip(proposal.rows, values, strict=True):
            out[row] = value
        return out, proposal

    moved = 0
    for seed in range(12):
        once, proposal = apply(rows, seed)
        moved += any((a != b).any() for a, b in zip(rows, once, strict=True))
        assert not proposal.parting
        twice, _ = apply(once, seed)
        for row, (a, b) in enumerate(zip(rows, twice, strict=True)):
            off = np.abs(a - b)
            off = np.minimum(off, 2 * np.pi - off) if chain_state.circular[row] else off
            assert off.max() < 1e-12
    assert moved or (text == TRAYS and kind.startswith("swap, "))


def test_the_table_of_compositions_names_mirrors():
    assert set(COMPOSED_MIRRORS) <= set(MIRROR_PROPOSALS)
    assert all(part in MIRROR_PROPOSALS for ways in COMPOSED_MIRRORS.values() for way in ways for part in way)
    assert not set(STEP_PROPOSALS) & set(MIRROR_PROPOSALS)


def test_one_object_has_no_moves_of_two():
    chain_state = chain_state_of(make_problem(check_text("closeTo(mug, (0.5, 0.5), 0.1)"), SampleRequest(n=1)))
    assert chain_state.dimension == 2 and len(chain_state.parts) == 1
    assert not {"pair", "shift run", "turn", "flip", "swap", "reverse", "swap, mirror x"} & set(moves_for(chain_state))
    line = chain_state_of(make_problem(check_text("x(mug) >= 0.5"), SampleRequest(n=1)))
    assert not {"two rows", "redraw two rows"} & set(moves_for(line))


def test_a_deck_deals_everyone_in_turn():
    deck = Deck(7, np.random.default_rng(0))
    for _ in range(5):
        assert sorted(card for _ in range(7) for card in deck.deal()) == list(range(7))
    hands = [deck.deal(3) for _ in range(100)]
    assert all(len(set(hand)) == 3 for hand in hands)
    assert deck.deal(9) and len(Deck(2, np.random.default_rng(0)).deal(9)) == 2


def test_systematic_resampling_rounds_each_share():
    rng = np.random.default_rng(1)
    share = rng.random(200)
    share /= share.sum()
    counts = np.bincount(resample(share, 5000, rng), minlength=200)
    assert counts.sum() == 5000 and (np.abs(counts - 5000 * share) < 1).all()


def test_copies_are_not_taken_until_they_have_parted(problem):
    chains = chains_at_truth(problem, 3)
    chains.narrow(Region(np.array([0.15]), np.array([np.inf])))
    taken = chains.take()
    assert len(np.unique(np.array([row[taken] for row in chains.rows]), axis=1).T) == len(taken) < chains.count
    chains.move("mirror y", tuning(chains.chain_state))
    assert len(chains.take()) == 0
    chains.move("redraw row", tuning(chains.chain_state))
    assert len(chains.take()) > 0


@pytest.mark.long
def test_families_show_in_the_design_effect(problem):
    chains = chains_at_truth(problem, 4)
    watch = Statistics(chains.chain_state)
    assert design_effect(chains, watch(chains)).max() == 1.0  # nobody has been copied yet
    chains.narrow(Region(np.array([0.6]), np.array([np.inf])))
    copies = chains.count / len(np.unique(chains.families[0]))
    assert copies > 3
    effect = design_effect(chains, watch(chains))
    assert abs(np.median(effect[effect > 1]) / copies - 1) < 0.3
    now = watch(chains)
    for _ in range(400):
        chains.move("redraw row", tuning(chains.chain_state))
        chains.move("object", tuning(chains.chain_state))
    assert np.median(design_effect(chains, watch(chains))) < 1.3
    assert np.median(np.abs(correlation(now, watch(chains)))) < 0.1
