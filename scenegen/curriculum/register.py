"""What makes the environment known to gymnasium."""

from __future__ import annotations

ID = "scenegen/TableTop-v0"
MAX_STEPS = 100  # of an episode, unless `gymnasium.make(..., max_episode_steps=)` says otherwise


def register_environments() -> None:
    """Make `scenegen/TableTop-v0` known to gymnasium, once; nothing happens where that is not installed."""
    try:
        import gymnasium
    except ImportError:  # strategies do without
        return
    if ID in gymnasium.registry:
        return
    gymnasium.register(
        id=ID,
        entry_point="scenegen.curriculum.env:TableTop",
        vector_entry_point="scenegen.curriculum.vector:TableTopVector",
        max_episode_steps=MAX_STEPS,
    )
