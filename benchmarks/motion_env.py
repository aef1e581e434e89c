"""Steps a second of `scenegen/Motion-v0` with random actions on the specs of examples/motions, on one core.

`python benchmarks/motion_env.py [seconds]`: CPU time, resets from a source included; how much of a step of a single
environment the monitor takes; and the vector environment with 1, 16 and 128 tables, beside as many single ones that
gymnasium steps one after another (`vectorization_mode="sync"`). Steps of tables that are reset (autoreset in the next
step) count in neither.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import scenegen
from scenegen.curriculum import MotionTable
from scenegen.sampling.motions.monitor import BatchMonitor

SPECS = Path(__file__).resolve().parents[1] / "examples" / "motions"
NAME = "scenegen.curriculum:scenegen/Motion-v0"
TABLES = (1, 16, 128)


def single(spec: scenegen.Spec, motions: Any, seconds: float) -> tuple[float, float]:
    """Seconds a step of one environment, and seconds of its monitor alone."""
    env = MotionTable(spec, source=motions, phi=(None, None))
    env.action_space.seed(0)
    env.reset(seed=0)
    steps, began = 0, time.process_time()
    while time.process_time() - began < seconds:
        steps += 1
        if env.step(env.action_space.sample())[2]:
            env.reset()
    each = (time.process_time() - began) / steps
    assert spec.over_time is not None
    calls, began = 0, time.process_time()
    while time.process_time() - began < seconds / 2:
        watch = BatchMonitor(spec.over_time, *spec.definition.box(), True, 1)
        for moment in np.ascontiguousarray(motions.poses[calls % 16]):
            watch.add(moment[None])
            calls += 1
    return each, (time.process_time() - began) / calls


def together(spec: scenegen.Spec, motions: Any, tables: int, mode: str, seconds: float) -> float:
    """Steps a second of all tables."""
    many = gymnasium.make_vec(NAME, tables, vectorization_mode=mode, spec=spec, source=motions, phi=(None, None))
    many.action_space.seed(0)
    many.reset(seed=0)
    steps, over, began = 0, np.zeros(tables, dtype=bool), time.process_time()
    while time.process_time() - began < seconds:
        steps += int((~over).sum())
        _, _, ended, late, _ = many.step(many.action_space.sample())
        over = ended | late
    found = steps / (time.process_time() - began)
    many.close()
    return found


def main(seconds: float) -> None:
    heads = [f"{what} {tables}" for tables in TABLES for what in ("vector", "sync")]
    print(f"| spec | single: steps a second | of a step the monitor | {' | '.join(heads)} |")
    print("|---" * (3 + len(heads)) + "|")
    for path in sorted(SPECS.glob("*.spec")):
        spec = scenegen.load(path)
        motions = scenegen.sample_motions(spec, None, 16, seed=1, spread="base")
        each, alone = single(spec, motions, seconds)
        rates = [
            together(spec, motions, tables, mode, seconds)
            for tables in TABLES
            for mode in ("vector_entry_point", "sync")
        ]
        shown = " | ".join(f"{rate:,.0f}" for rate in rates)
        print(f"| {path.stem} | {1 / each:,.0f} | {alone / each:.0%} | {shown} |", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 4.0)
