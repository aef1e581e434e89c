"""The range of phi that balanced training data covers, where chains of splitting cannot tell it."""

import math
import time

import pytest

from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.learn.training import balanced
from scenegen.learn.training.gathering import Gathering
from scenegen.sampling import rarity_grown
from scenegen.sampling.rarity import RequirementUnmet

TEXT = "object a, b\nrequire dist(a, b) >= 10 cm\ntask: dist(a, b) <= 30 cm"


@pytest.fixture
def grown(monkeypatch):
    """Chains find nothing; growth takes little time."""
    monkeypatch.setattr(balanced, "measure", lambda *given: RequirementUnmet(-0.1, 1))
    monkeypatch.setattr(rarity_grown, "EFFORT", 2e7)


def test_growth_tells_what_chains_do_not_reach(grown):
    """phi runs from 30 cm less the diagonal of the table to 20 cm."""
    low, high = balanced.reach(check_text(TEXT), 0)["task"]
    assert 0.3 - math.sqrt(2.0) <= low < -0.8 and 0.17 < high <= 0.2


def test_what_nothing_meets_is_an_error(grown):
    nothing = TEXT.replace(">= 10 cm", ">= 10 m")
    with pytest.raises(RequestError):
        balanced.reach(check_text(nothing), 0)


def test_time_is_kept(grown):
    gathering = Gathering(0.0)
    with pytest.raises(RequestError) as caught:
        balanced.reach(check_text(TEXT), 0, gathering.check, time.monotonic() - 1.0)
    assert caught.value.diagnostics[0].code == "no-time-to-train"
