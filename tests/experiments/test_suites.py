"""What pairing saves, on outcomes whose answer is known."""

import numpy as np
import pytest

from experiments.suites import power


@pytest.mark.long
def test_pairing_saves_what_the_start_explains():
    """Where one policy fails one start in ten more and agrees on the others, as many episodes do as it takes to see six
    such starts at 80 %; where they are independent, pairing saves nothing."""
    rng, weights, bands = np.random.default_rng(0), np.full(1000, 1e-3), np.arange(1000) % 5
    one = rng.random(1000) < 0.5
    nested = np.stack([one, one & (rng.random(1000) < 0.8)])
    facts = [cell.strip() for cell in power.line("nested", nested, weights, bands).split("|")]
    unpaired, paired = (int(cell.replace(",", "")) for cell in facts[5:7])
    assert 60 <= paired <= 100 and paired <= unpaired / 3
    alone = np.stack([one, rng.random(1000) < 0.38])
    share = [
        power.paired(alone, 120, np.random.default_rng(1)),
        power.unpaired(alone, weights, 120, np.random.default_rng(1)),
    ]
    assert share[0] == pytest.approx(share[1], abs=0.15)


def test_choosing_bands_finds_no_difference_where_there_is_none():
    """At most 5 % of the repeats, and a little for their number: the test stays exact."""
    rng, bands = np.random.default_rng(2), np.arange(1000) % 5
    chance = np.array([0.02, 0.2, 0.5, 0.9, 1.0])[bands]
    same = rng.random((2, 1000)) < chance
    same[1, bands == 2] = rng.permutation(same[0, bands == 2])
    same = np.concatenate([same, same[::-1]], axis=1)  # the same share of each
    assert np.mean([power.chosen(same, np.tile(bands, 2), 120, np.random.default_rng(k)) for k in range(5)]) <= 0.07
