"""Counted work: when it is too much."""

import pytest

from scenegen.search.effort import Effort, TooMuchError


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
