"""Episodes of three policies on a suite, recorded as outcomes files; a run that was stopped goes on where it was.

    python -m experiments.success.run SUITE OUT --weights WEIGHTS [--until 900] [--policies steady,shaky]

Policies take turns, CHUNK episodes each, so that what there is at any time is balanced.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from scenegen.worlds.suites.adapters.table import make
from scenegen.worlds.suites.outcomes import EpisodeOutcome, OutcomesHeader, line_of, read_outcomes
from scenegen.worlds.suites.suite import Suite, SuiteTask

CHUNK, STEPS = 90, 100  # episodes; actions of an episode, which are enough to carry one thing
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "policies"
STEADY, SHAKY = 0.003, 0.015  # metres: standard deviations of where it sees things, and of where it puts them


def makers(weights: Path = Path("weights")) -> dict[str, Callable[[Any], Any]]:
    """A function of a world for each policy."""
    scripted, cloned = example("scripted"), example("cloned")
    return {
        "steady": lambda world: scripted.Scripted(world, see=STEADY, put=STEADY),
        "shaky": lambda world: scripted.Scripted(world, see=SHAKY, put=SHAKY),
        "cloned": lambda world: cloned.Cloned(world, STEADY, STEADY, weights / f"{world.task.name}.npz"),
    }


def example(name: str) -> Any:
    """A module of examples/policies."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


class Worlds:
    """A world for each task, made when it is first needed."""

    def __init__(self) -> None:
        self.made: dict[str, Any] = {}

    def __getitem__(self, task: SuiteTask) -> Any:
        if task.name not in self.made:
            self.made[task.name] = make(task)
        return self.made[task.name]


def play(world: Any, policy: Any, start: Any) -> EpisodeOutcome:
    """One episode."""
    observation, info = world.reset(seed=start.seed, options={"start": start})
    policy.reset(start.seed)
    steps, over = 0, False
    while not over:
        observation, _, success, late, info = world.step(policy(observation, start.task.instruction))
        steps += 1
        over = success or late or steps >= STEPS
    return EpisodeOutcome(
        episode=start.number, task=start.task.name, band=start.band, success=info["success"], steps=steps
    )


def main() -> None:
    """The command line above."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("suite", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--weights", type=Path, default=Path("weights"))
    parser.add_argument("--until", type=int)
    parser.add_argument("--policies", default="steady,shaky,cloned")
    wanted = parser.parse_args()
    suite, known, worlds = Suite.load(wanted.suite), makers(wanted.weights), Worlds()
    wanted.out.mkdir(parents=True, exist_ok=True)
    files = {name: wanted.out / f"{suite.name}.{name}.jsonl" for name in wanted.policies.split(",")}
    done: dict[str, set[int]] = {}
    for name, file in files.items():
        if not file.exists():
            world = "scenegen.worlds.suites.adapters.table:make"
            header = OutcomesHeader(
                suite=suite.name, digest=suite.digest, world=world, policy=name, episodes=len(suite)
            )
            file.write_bytes(line_of(header))
        done[name] = set(read_outcomes(file, suite).success)
    policies: dict[tuple[str, str], Any] = {}
    for first in range(0, wanted.until or len(suite), CHUNK):
        numbers = range(first, min(first + CHUNK, wanted.until or len(suite)))
        for name, file in files.items():
            began, won, made = time.monotonic(), 0, 0
            with file.open("ab") as out:
                for number in numbers:
                    if number in done[name]:
                        continue
                    start = suite[number]
                    key = name, start.task.name
                    if key not in policies:
                        policies[key] = known[name](worlds[start.task])
                    outcome = play(worlds[start.task], policies[key], start)
                    out.write(line_of(outcome))
                    out.flush()
                    won, made = won + outcome.success, made + 1
            if made:
                print(f"{name} {numbers}: {won} of {made}, {(time.monotonic() - began) / made:.2f} s each", flush=True)


if __name__ == "__main__":
    main()
