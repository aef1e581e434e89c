"""Growth changes what things stand on, and moves what carries together with what it carries, without a bias."""

import numpy as np
import pytest

import scenegen

RACK = """object rack at (0.5, 0.7, SOUTH)
object bottle[3] on any of [rack.slot[1], rack.slot[2], rack.slot[3], rack.slot[4], rack.slot[5], rack.slot[6]]
require noCollision()
task: leftOf(bottle[1], bottle[2])"""
CARRIED = """workspace [0, 0.8] x [0, 0.8]
object tray, plate on any of [tray, workspace], apple on any of [plate, tray, workspace]
require noCollision()
task: restsOn(apple, plate)"""


def drawn(text, method, n, **options):
    return scenegen.sample(scenegen.parse(text), n=n, seed=5, method=method, **options)


def shares(scenes, chooser, surfaces):
    """How often an object with a choice stands on each of its surfaces."""
    return np.bincount(scenes.on[:, chooser].astype(int) - 1, minlength=surfaces) / len(scenes)


@pytest.mark.long
def test_slots_of_a_rack_are_equally_likely_and_bottles_anywhere_in_them():
    scenes = drawn(RACK, "growth", 1200)
    for bottle in range(3):
        np.testing.assert_allclose(shares(scenes, bottle, 6), 1.0 / 6.0, atol=0.055)  # 5 standard errors


@pytest.mark.long
def test_what_is_carried_by_choice_is_as_rejection_has_it():
    grown, drawn_alone = (drawn(CARRIED, method, 1000) for method in ("growth", "rejection"))
    for chooser, surfaces in ((0, 2), (1, 3)):
        one, other = (shares(scenes, chooser, surfaces) for scenes in (grown, drawn_alone))
        assert (other > 0.01).sum() >= 2  # some stand elsewhere
        np.testing.assert_allclose(one, other, atol=0.1)  # 4 standard errors, if a scene of growth is worth half of one
    tray = [scenes.poses[:, list(scenes.objects).index("tray")] for scenes in (grown, drawn_alone)]
    for axis in range(2):
        quarters = [np.quantile(poses[:, axis], (0.25, 0.5, 0.75)) for poses in tray]
        np.testing.assert_allclose(*quarters, atol=0.06)
