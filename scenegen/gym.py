"""Gymnasium environments of any kind start their episodes from scenes of a spec.

    from scenegen.gym import SceneResets
    env = SceneResets(gymnasium.make("PandaPush-v3"), spec, (-0.2, 0), put=put, observe=observe, quaternion="xyzw")

`put(env, name, pose)` puts an object into the environment, and `observe(env)` gives what is then seen.
"""

from scenegen.play.gym import SceneResets, keep_clear
from scenegen.play.starts import phi_space

__all__ = ["SceneResets", "keep_clear", "phi_space"]
