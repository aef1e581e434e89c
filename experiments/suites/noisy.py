"""The scripted policy of examples/policies/ with three amounts of noise, which follows the start's seed: 8, 11, 14 mm.

    scenegen suite run tabletop --world scenegen.worlds.suites.adapters.table:make \\
        --policy experiments/suites/noisy.py:n08 --episodes 0:400 --out n08.jsonl
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenegen.worlds.suites.run import named

SCRIPTED = Path(__file__).resolve().parents[2] / "examples" / "policies" / "scripted.py"


def n08(env: Any) -> Any:
    return named(f"{SCRIPTED}:Scripted")(env, see=0.008, put=0.008)


def n11(env: Any) -> Any:
    return named(f"{SCRIPTED}:Scripted")(env, see=0.011, put=0.011)


def n14(env: Any) -> Any:
    return named(f"{SCRIPTED}:Scripted")(env, see=0.014, put=0.014)
