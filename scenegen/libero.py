"""LIBERO and robosuite: specs of live environments, and states that have come to rest.

    from scenegen.libero import init_states, spec_of
    made = init_states(env, {"goal": (-0.3, 0)}, 50)

Nothing here imports LIBERO or robosuite: the environment brings its own simulation. Needs mujoco.
"""

from scenegen.play.libero.spec import EnvironmentSpec, spec_of
from scenegen.play.libero.states import SettledStates, init_states, set_scene

__all__ = ["EnvironmentSpec", "SettledStates", "init_states", "set_scene", "spec_of"]
