"""Registers the environments with gymnasium."""

from __future__ import annotations

ID = "scenegen/TableTop-v0"
MOTION_ID = "scenegen/Motion-v0"
MAX_STEPS = 100  # of an episode, unless given as `gymnasium.make(..., max_episode_steps=)`


def register_environments() -> None:
    """Register `scenegen/TableTop-v0` and `scenegen/Motion-v0` with gymnasium, once; does nothing if it is
    not installed."""
    try:
        import gymnasium
    except ImportError:  # strategies do not need gymnasium
        return
    if ID in gymnasium.registry:
        return
    gymnasium.register(
        id=ID,
        entry_point="scenegen.learn.curriculum.env:TableTop",
        vector_entry_point="scenegen.learn.curriculum.vector:TableTopVector",
        max_episode_steps=MAX_STEPS,
    )
    # its episodes end with the spec's horizon, so there is no limit of steps
    gymnasium.register(
        id=MOTION_ID,
        entry_point="scenegen.learn.curriculum.motion_env:MotionTable",
        vector_entry_point="scenegen.learn.curriculum.motion_vector:MotionVector",
    )
