"""The policies of examples/policies/ with errors of eye and hand, in metres, that follow the start's seed.

    scenegen suite run graded/ --world table --steps 100 \\
        --policy experiments/success/policies.py:steady --out graded.steady.jsonl

`cloned` finds its weights where the environment variable CLONED says.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenegen.play.suites.loading import load_named

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "policies"
STEADY, SHAKY = 0.003, 0.015


def scripted(env: Any, error: float, follow: bool = True) -> Any:
    return load_named("policy", f"{EXAMPLES / 'scripted.py'}:Scripted")(env, see=error, put=error, follow=follow)


def steady(env: Any) -> Any:
    return scripted(env, STEADY)


def planning(env: Any) -> Any:
    """The same hand, which plans goal and grasp itself where the start comes with them."""
    return scripted(env, STEADY, follow=False)


def exact(env: Any) -> Any:
    """Without errors of eye and hand."""
    return scripted(env, 0.0)


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
