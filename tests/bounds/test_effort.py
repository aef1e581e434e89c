"""Counted work: when it is too much, and when it gets much."""

import pytest

from scenegen.search.effort import Effort, TooMuchError


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


def test_who_is_asked_for_more_is_asked_once():
    asked = []

    def more():
        asked.append(effort.used)
        return 200.0

    effort = Effort(most=100.0, further=more)
    effort.spend(100.0)
    assert not asked
    effort.spend(60.0)
    effort.spend(40.0)
    with pytest.raises(TooMuchError):
        effort.spend(1.0)
    assert asked == [160.0]


def test_what_is_allowed_further_may_be_too_little():
    with pytest.raises(TooMuchError):
        Effort(most=100.0, further=lambda: 150.0).spend(151.0)
    with pytest.raises(TooMuchError):
        Effort(most=100.0, further=lambda: 0.0).spend(101.0)
