"""What the figures say, in words that follow the figures."""

from __future__ import annotations

from scenegen.experiments.curricula.tables import Found, grouped, mean, ratio


def summary(found: Found, largest: int, bound: int) -> list[str]:
    return []


def notes(largest: int) -> list[str]:
    return []


def bars(found: Found, largest: int) -> list[str]:
    return []
