"""Every kind of move leaves the wanted distribution as it is; mirrors undo themselves."""

import numpy as np
import pytest

from scenegen.lang.checker import check_text
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import SampleRequest
from scenegen.sampling.splitting.chain_state import ChainTape, frame_of
from scenegen.sampling.splitting.chains import Chains, Statistics, _systematic, correlation, design_effect
from scenegen.sampling.splitting.levels import Region
from scenegen.sampling.splitting.moves import (
    COMPOSED,
    MIRRORS,
    MOVES,
    STEPS,
    Deck,
    MoveInputs,
    Tuning,
    bring_home,
    moves_for,
)

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
    chain_state, rng = frame_of(problem), np.random.Generator(np.random.SFC64(seed))
    tape = ChainTape(chain_state)
    rows = chain_state.draw(120_000, rng)
    good = tape(rows)[0] >= low
    rows = [row[good] for row in rows]
    chains = Chains.start(chain_state, tape, problem.cells, len(rows[0]), rng)
    chains.rows, chains.phi = rows, tape(rows)
    chains.pool = [row[:500] for row in rows]
    chains.region = Region(np.array([low]), np.array([np.inf]))
    return chains


def tuning(chain_state, length=0.3):
    width = chain_state.high - chain_state.low
    # part of the box alone, so that redraws have to tell who may take part
    return Tuning(
        dict.fromkeys(MOVES, 1.0),
        dict.fromkeys(MOVES, 1.0),
        length * width,
        chain_state.low,
        chain_state.low + 0.8 * width,
    )


def distances(chains, before, same_distribution):
    """Statistics, by number, whose distribution is no longer what it was."""
    chain_state = chains.chain_state
    now = [*chains.rows, chains.phi[0], chains.rows[0] - chains.rows[3], chains.rows[1] - chains.rows[4]]
    assert chain_state.dimension == 6
    return [index for index, (one, two) in enumerate(zip(before, now, strict=True)) if not same_distribution(one, two)]


def statistics(chains):
    return [*chains.rows, chains.phi[0], chains.rows[0] - chains.rows[3], chains.rows[1] - chains.rows[4]]


@pytest.mark.long
@pytest.mark.parametrize("kind", MOVES)
def test_a_kind_keeps_the_distribution(problem, kind, same_distribution):
    chains, fresh = chains_at_truth(problem, 1), chains_at_truth(problem, 2)
    start = [row.copy() for row in chains.rows]
    shares = [chains.move(kind, tuning(chains.chain_state))[0] for _ in range(12)]
    assert distances(chains, statistics(fresh), same_distribution) == []
    assert chains.region.holds(chains.phi).all()
    for row, low, high in zip(chains.rows, chains.chain_state.low, chains.chain_state.high, strict=True):
        assert row.min() >= low and row.max() <= high
    moved = np.mean([(a != b) for a, b in zip(start, chains.rows, strict=True)])
    assert (max(shares) > 0) == (moved > 0)
    assert moved > 0 or kind in MIRRORS
    np.testing.assert_array_equal(chains.phi[0], chains.tape(chains.rows)[0])


def test_a_move_that_leans_is_found_out(problem, same_distribution, monkeypatch):
    chains, fresh = chains_at_truth(problem, 1), chains_at_truth(problem, 2)
    noise = MoveInputs.noise
    monkeypatch.setattr(MoveInputs, "noise", lambda self, half: noise(self, half) + 0.2 * half)
    for _ in range(12):
        chains.move("row", tuning(chains.chain_state))
    assert distances(chains, statistics(fresh), same_distribution)


@pytest.mark.parametrize("kind", MIRRORS)
@pytest.mark.parametrize("text", [SPEC, TRAYS], ids=["table", "trays"])
def test_a_mirror_undoes_itself(text, kind, monkeypatch):
    monkeypatch.setattr(MoveInputs, "coin", lambda self: np.ones(self.count, dtype=bool))
    chain_state = frame_of(make_problem(check_text(text), SampleRequest(n=16)))
    rows = chain_state.draw(100, np.random.default_rng(0))

    def apply(rows, seed):
        rng = np.random.Generator(np.random.SFC64(seed))
        decks = Deck(chain_state.dimension, rng), Deck(len(chain_state.parts), rng)
        proposal = MOVES[kind](MoveInputs(chain_state, *decks, rows, rows, tuning(chain_state), 1.0, rng))
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
    assert set(COMPOSED) <= set(MIRRORS)
    assert all(part in MIRRORS for ways in COMPOSED.values() for way in ways for part in way)
    assert not set(STEPS) & set(MIRRORS)


def test_one_object_has_no_moves_of_two():
    chain_state = frame_of(make_problem(check_text("closeTo(mug, (0.5, 0.5), 0.1)"), SampleRequest(n=1)))
    assert chain_state.dimension == 2 and len(chain_state.parts) == 1
    assert not {"pair", "shift run", "turn", "flip", "swap", "reverse", "swap, mirror x"} & set(moves_for(chain_state))
    line = frame_of(make_problem(check_text("x(mug) >= 0.5"), SampleRequest(n=1)))
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
    counts = np.bincount(_systematic(share, rng, 5000), minlength=200)
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
