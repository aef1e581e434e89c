"""What phi of a motion costs."""

from __future__ import annotations

from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.rarity import cost as state_cost

SHARED = 6  # shapes cost less than in single scenes: a batch has all moments of a motion


def cost(spec: CheckedSpec) -> int:
    """About the cost of phi of one motion, in visits of nodes."""
    timed = spec.timed
    assert timed is not None
    plain = len(timed.state.nodes)
    shaped = (state_cost(timed.state) - plain) // SHARED
    return (plain + shaped + len(timed.nodes) + 8 * len(timed.objects)) * timed.horizon.moments
