"""How many scenes a piece of a run has."""

from __future__ import annotations

from scenegen.pose import row_count

PIECE = 65_536  # scenes of one piece; piece k of a run draws from SeedSequence(seed, k) in any process
LARGEST_PIECE = 1 << 22  # numbers of one piece: specs with very many objects get fewer scenes


def piece_size(objects: int) -> int:
    """How many scenes of that many objects a piece has."""
    return max(16, min(PIECE, LARGEST_PIECE // row_count(objects)))
