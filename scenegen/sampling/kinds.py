"""The table of the kinds of moves."""

from __future__ import annotations

from collections.abc import Mapping

from scenegen.sampling.frame import Frame
from scenegen.sampling.mirrors import MIRRORS
from scenegen.sampling.moves import Kind
from scenegen.sampling.steps import STEPS

KINDS: Mapping[str, Kind] = {**STEPS, **MIRRORS}
_COUPLED = frozenset(
    {"pair", "shift all", "shift some", "shift run", "turn", "stretch", "flip"}
)  # and all that speaks of a swap or the order


def kinds_for(frame: Frame) -> tuple[str, ...]:
    """The kinds of moves that mean something for a frame: those of two objects need two."""
    kinds = list(KINDS)
    if len(frame.parts) == 1:
        kinds = [kind for kind in kinds if kind not in _COUPLED and "swap" not in kind and kind != "reverse"]
    if frame.dimension == 1:
        kinds.remove("two rows")
        kinds.remove("redraw two rows")
    return tuple(kinds)
