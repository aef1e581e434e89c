"""The streams of random numbers: what stands after the seed in every `SeedSequence([seed, STREAM, ...])`.

One seed serves many uses. The number of a use keeps its random numbers apart from those of all others; base draws have
0. They are part of what a seed means: a number is never changed, and a new use gets a new one. `SHARED_NUMBERS` were
given twice before this table was made; what follows them, or the kind of generator, tells most of their uses apart.
"""

from __future__ import annotations

MODEL_PILOT_STREAM = 2  # proposals of a model that tell how far its errors reach
MODEL_PIECES_STREAM = 3
REJECTION_PLAN_STREAM = 4
SPLITTING_STREAM = 4  # plan and pieces
BLOCK_ORDER_STREAM = 4  # of scenes in a block, and of the cells that get one more
REJECTION_STREAM = 5
GROWTH_STREAM = 6  # plan and pieces
RARITY_STREAM = 6
GROWTH_RARITY_STREAM = 7
PARTS_STREAM = 7  # of a request: their seeds, and how their scenes are combined
MEMBER_SEEDS_STREAM = 9  # of specs that draw numbers of things
MOTIONS_STREAM = 11
BATCHES_STREAM = 11  # order in which a reader takes scenes
MOTION_RARITY_STREAM = 12
PAIRS_STREAM = 12
SET_SPLIT_STREAM = 12  # which part of a set a scene goes to
STARTS_STREAM = 12
SHARD_SEEDS_STREAM = 13  # of data sets
LAYOUTS_STREAM = 13
EPISODE_STARTS_STREAM = 14
COMPLETION_STREAM = 17
SUITES_STREAM = 17

SHARED_NUMBERS = frozenset({4, 6, 7, 11, 12, 13, 17})
