"""Episodes of the scripted policy in tasks of LIBERO, from LIBERO's own init states, judged by LIBERO.

python -m experiments.success.libero [SUITE] [ROWS]    # libero_object, 3
"""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

from experiments.success.policies import EXAMPLES
from scenegen.api.spec import parse
from scenegen.play.libero.files import tasks_of
from scenegen.play.suites.adapters.libero import make
from scenegen.play.suites.loading import load_named

STEPS = 200


def main(suite: str = "libero_object", rows: str = "3") -> None:
    """Prints a line for each task."""
    scripted = load_named("policy", f"{EXAMPLES / 'scripted_libero.py'}:Scripted")
    for task in tasks_of(suite):
        bare: Any = SimpleNamespace(name=task.name, spec=parse("leftOf(a, b)"))  # of no suite: LIBERO's own states
        world = make(bare)
        policy, won = scripted(world), 0
        for row in range(int(rows)):
            observation, info = world.reset(options={"start": SimpleNamespace(row=row)})
            policy.reset(row)
            for _ in range(STEPS):
                observation, _, success, _, info = world.step(policy(observation, ""))
                if success:
                    break
            won += info["success"]
        print(f"{task.name}: {won} of {rows}", flush=True)
        world.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
