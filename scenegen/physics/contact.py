"""What touches in a scene before it is simulated, by pairs of objects."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

TABLE = -1  # takes the place of an object's index
NEAR = 1e-4  # metres: what is closer counts as touching


@dataclass(frozen=True, slots=True)
class Contact:
    """Two objects by their indices, `a` before `b`, or the table and an object; `depth` in metres is how deep they are
    in each other: 0 where they only touch."""

    a: int
    b: int
    depth: float


def gathered(points: Iterable[tuple[int, int, float]]) -> tuple[Contact, ...]:
    """The contacts of some points (a, b, clear distance), in the order of their objects; one for each pair, as deep as
    its deepest point."""
    nearest: dict[tuple[int, int], float] = {}
    for a, b, apart in points:
        pair = min(a, b), max(a, b)
        nearest[pair] = min(nearest.get(pair, NEAR), apart)
    return tuple(Contact(*pair, max(0.0, -apart)) for pair, apart in sorted(nearest.items()) if apart < NEAR)
