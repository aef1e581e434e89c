"""The policies of examples/policies/ with errors of eye and hand, in metres, that follow the start's seed.

    scenegen suite run graded/ --world table --steps 100 \\
        --policy experiments/success/policies.py:steady --out graded.steady.jsonl

`cloned` finds its weights where the environment variable CLONED says.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from scenegen.play.suites.loading import load_named

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "policies"
STEADY, SHAKY = 0.003, 0.015
PATIENCE = 60  # actions
PRIME = 2_147_483_659  # above all seeds of starts


def scripted(env: Any, error: float, **given: Any) -> Any:
    return load_named("policy", f"{EXAMPLES / 'scripted.py'}:Scripted")(env, see=error, put=error, **given)


def steady(env: Any) -> Any:
    return scripted(env, STEADY)


class Again:
    """Another policy with other errors on the same starts: those of the start's seed and the number in AGAIN."""

    def __init__(self, policy: Any) -> None:
        self.policy = policy

    def reset(self, seed: int) -> None:
        self.policy.reset(seed + int(os.environ["AGAIN"]) * PRIME)

    def __call__(self, observation: Any, instruction: str) -> Any:
        return self.policy(observation, instruction)


def again(env: Any) -> Any:
    return Again(steady(env))


def patient(env: Any) -> Any:
    """The same hand, which waits until it is above a place."""
    return scripted(env, STEADY, steps=PATIENCE)


def planning(env: Any) -> Any:
    """That hand, which plans goal and grasp itself, also where the start comes with them."""
    return scripted(env, STEADY, steps=PATIENCE, follow=False)


def shaky(env: Any) -> Any:
    return scripted(env, SHAKY)


def cloned(env: Any) -> Any:
    return load_named("policy", f"{EXAMPLES / 'cloned.py'}:Cloned")(env, see=STEADY, put=STEADY)


def n08(env: Any) -> Any:
    return scripted(env, 0.008)


def n11(env: Any) -> Any:
    return scripted(env, 0.011)


def n14(env: Any) -> Any:
    return scripted(env, 0.014)


def n17(env: Any) -> Any:
    return scripted(env, 0.017)
