"""The table of the kinds of moves."""

from __future__ import annotations

from collections.abc import Mapping

from scenegen.sampling.splitting.chain_state import ChainState
from scenegen.sampling.splitting.involutions import MIRRORS
from scenegen.sampling.splitting.local_moves import STEPS
from scenegen.sampling.splitting.moves import Kind

MOVES: Mapping[str, Kind] = {**STEPS, **MIRRORS}
_COUPLED = frozenset(
    {"pair", "shift all", "shift some", "shift run", "turn", "stretch", "flip"}
)  # and all moves that are swaps or reversals of the order


def moves_for(chain_state: ChainState) -> tuple[str, ...]:
    """The kinds of moves that apply to a chain_state: those of two objects need two."""
    kinds = list(MOVES)
    if len(chain_state.parts) == 1:
        kinds = [kind for kind in kinds if kind not in _COUPLED and "swap" not in kind and kind != "reverse"]
    if chain_state.dimension == 1:
        kinds.remove("two rows")
        kinds.remove("redraw two rows")
    return tuple(kinds)
