"""The learner: Stable-Baselines3's PPO with a small network, on many tables at once."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING, Any

from experiments.errors import needs
from scenegen.errors import RequestError

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv
    from stable_baselines3 import PPO

SETTINGS: dict[str, Any] = {
    "n_steps": 32,
    "batch_size": 1024,
    "n_epochs": 6,
    "learning_rate": 1e-3,
    "gamma": 0.95,
    "gae_lambda": 0.95,
    "ent_coef": 0.0,
}
NETWORK: dict[str, Any] = {"net_arch": [64, 64], "log_std_init": -1.0}


def check_learner() -> None:
    """Refuse, before any work is done, to go on without the libraries. Raises RequestError."""
    for module, library in (("gymnasium", "gymnasium"), ("stable_baselines3", "stable-baselines3")):
        if importlib.util.find_spec(module) is None:
            raise RequestError(needs(library, "for this experiment"))


def make_learner(env: VectorEnv[Any, Any, Any], seed: int) -> PPO:
    """A learner that knows nothing yet. `env` begins episodes anew in the step that ends them."""
    from stable_baselines3 import PPO

    from scenegen.play.environments.sb3 import SB3Vector

    settings = {**SETTINGS, "batch_size": min(SETTINGS["batch_size"], SETTINGS["n_steps"] * env.num_envs)}
    return PPO("MlpPolicy", SB3Vector(env), policy_kwargs=NETWORK, device="cpu", seed=seed, **settings)
