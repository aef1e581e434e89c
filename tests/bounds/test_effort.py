"""Counted work: when it is too much, and when it gets much."""

import pytest

from scenegen.bounds.effort import Effort, TooMuchError


def test_more_than_a_quarter_is_told_once():
    told = []
    effort = Effort(most=100.0, on_quarter=lambda: told.append(effort.used))
    effort.spend(25.0)
    assert not told
    effort.spend(1.0)
    effort.spend(74.0)
    assert told == [26.0]
    with pytest.raises(TooMuchError):
        effort.spend(1.0)


def test_a_step_that_is_too_much_by_itself_tells_nothing():
    told = []
    with pytest.raises(TooMuchError):
        Effort(most=100.0, on_quarter=lambda: told.append(1)).spend(101.0)
    assert not told
