"""How rare a phi is among motions: against the shares of plain draws."""

import math

import numpy as np
import pytest

import scenegen
from scenegen.motions import rarity
from scenegen.motions.prepare import make_problem
from scenegen.motions.variables import draw, poses_of
from scenegen.sampling.request import SampleRequest

SPEC = scenegen.parse("""object mug, plate, bowl at (0.5, 0.5)
time 3 steps
require speed(mug) <= 30 cm/s & speed(plate) <= 20 cm/s
require noOverlap()
task: eventually closeTo(mug, plate, 20 cm)
far: always farFrom(plate, bowl, 30 cm)
""")


@pytest.fixture(scope="module")
def plain():
    """phi of both labels of motions that meet what is required, and the share of those: (2, P) and a number."""
    problem, _ = make_problem(SPEC.declared, SampleRequest({}, n=1))
    scores = problem.scores(poses_of(problem, draw(problem, 60_000, np.random.default_rng(3))))
    good = (scores[2:] >= 0.0).all(axis=0)
    return scores[:2, good], good.mean()


@pytest.fixture(scope="module")
def found():
    work, rarity.WORK = rarity.WORK, 300_000_000
    try:
        return rarity.measure(SPEC.declared, SPEC.labels, seed=5)
    finally:
        rarity.WORK = work


def agree(estimate, share, count):
    """log10 of a share within three standard errors of both: the estimate's error is half of a 95 % interval."""
    own = math.sqrt((1.0 - share) / (share * count)) / math.log(10.0)
    return abs(estimate.log10 - math.log10(share)) < 3.0 * math.hypot(estimate.error / 1.96, own)


@pytest.mark.long
def test_it_agrees_with_plain_draws(plain, found):
    scores, met = plain
    assert agree(found.requirement, met, 60_000)
    for phi, reach in zip(scores, found.reaches.values(), strict=True):
        for share in (0.003, 0.03, 0.3):
            high, low = np.quantile(phi, [1.0 - share, share])
            assert agree(reach.up(high), (phi >= high).mean(), len(phi))
            assert agree(reach.down(low), (phi <= low).mean(), len(phi))


@pytest.mark.long
def test_what_is_reached_and_the_same_again(plain, found):
    for phi, reach in zip(plain[0], found.reaches.values(), strict=True):
        assert reach.down.end <= phi.min() + 0.02 and reach.up.end >= phi.max() - 0.02
    small = [rarity.measure(SPEC.declared, ("task",), seed=seed).reaches["task"].up(0.0) for seed in (1, 1, 2)]
    assert small[0] == small[1] != small[2]
