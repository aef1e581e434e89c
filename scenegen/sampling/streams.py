"""The streams of random numbers: what stands after the seed in every `SeedSequence([seed, STREAM, ...])`.

One seed serves many uses. The number of a use keeps its random numbers apart from those of all others; base draws have
0. They are part of what a seed means: a number is never changed, and a new use gets a new one. Those of `SHARED` were
given twice before this table was made; what follows them, or the kind of generator, tells their uses apart.
"""

from __future__ import annotations

MODEL_PILOT = 2  # proposals of a model that tell how far its errors reach
MODEL_PIECES = 3
REJECTION_PLAN = 4
SPLITTING = 4  # plan and pieces
BLOCK_ORDER = 4  # of scenes in a block, and of the cells that get one more
REJECTION = 5
GROWTH = 6  # plan and pieces
RARITY = 6
PARTS = 7  # of a request: their seeds, and how their scenes are combined
MEMBER_SEEDS = 9  # of specs that draw numbers of things
MOTIONS = 11
BATCHES = 11  # order in which a reader takes scenes
MOTION_RARITY = 12
PAIRS = 12
SET_SPLIT = 12  # which part of a set a scene goes to
STARTS = 12
SHARD_SEEDS = 13  # of data sets
LAYOUTS = 13
EPISODE_STARTS = 14
COMPLETION = 17
SUITES = 17

SHARED = frozenset({4, 6, 11, 12, 13, 17})
