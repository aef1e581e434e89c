"""Lifting objects off the table: how often it is worth it, and that copies part by it."""

import numpy as np
import pytest

from scenegen.sampling.growth.moves import MoveSettings, sweep
from scenegen.sampling.growth.population import MOST_TRIES, REDRAWN, RELOCATED, AncestorEffect, lifted

from .made import POSITIVE, everything_placed, machine_of, plain

TWO_SETTINGS = """
object plate[2] = cylinder(0.13, 0.02), fork[2] = box(0.02, 0.2, 0.01)
require noOverlap()
task: forall i in 1..2: leftOf(fork[i], plate[i]) & closeTo(fork[i], plate[i], 0.2)
"""


def test_many_places_are_tried_where_few_are_free():
    often, tries = zip(*(lifted(free, RELOCATED) for free in (1.0, 0.3, 0.05, 0.01)), strict=True)
    assert tries[0] == 1 and list(tries) == sorted(tries) and tries[-1] <= MOST_TRIES
    assert often == (RELOCATED,) * 4
    assert 0.0 < lifted(0.001, RELOCATED)[0] < RELOCATED  # seldom
    assert lifted(1e-5, RELOCATED)[0] == 0.0  # not at all


@pytest.mark.long
def test_copies_part_by_lifts_and_stay_alike_without():
    """800 copies of 20 scenes: what ten sweeps leave of a design effect of 40."""
    machine = machine_of(TWO_SETTINGS, POSITIVE)
    few = plain(machine.problem, 20, 1)
    redraws, relocations = (dict.fromkeys(machine.order, lifted(0.15, often)) for often in (REDRAWN, RELOCATED))
    effects = []
    for kinds in (("redraw", "shift", "turn", "relocate"), ("shift", "turn")):
        particles = everything_placed(machine, few[:, np.arange(800) % 20])
        particles.families = [np.arange(800) % 20]
        for _ in range(10):
            sweep(particles, MoveSettings({}, kinds, redraws, relocations))
        effects.append(AncestorEffect(machine)(particles))
    assert effects[0] < 3.0 < 12.0 < effects[1]
