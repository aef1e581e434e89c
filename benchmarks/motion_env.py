"""Steps a second of `scenegen/Motion-v0` with random actions on the specs of examples/motions, on one core.

`python benchmarks/motion_env.py [seconds]`: CPU time, resets from a source included; and how much of a step the
monitor takes, which is the floor of this design.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import scenegen
from scenegen.curriculum import MotionTable
from scenegen.motions.monitor import Watch

SPECS = Path(__file__).resolve().parents[1] / "examples" / "motions"


def main(seconds: float) -> None:
    print("| spec | steps a second | ms a step | of it the monitor |")
    print("|---|---|---|---|")
    for path in sorted(SPECS.glob("*.spec")):
        spec = scenegen.load(path)
        motions = scenegen.sample_motions(spec, None, 16, seed=1, spread="base")
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
            watch = Watch(spec.over_time, *spec.declared.box(), True, 1)
            for moment in np.ascontiguousarray(motions.poses[calls % 16]):
                watch.add(moment[None])
                calls += 1
        alone = (time.process_time() - began) / calls
        print(f"| {path.stem} | {1 / each:,.0f} | {1e3 * each:.2f} | {1e3 * alone:.2f} ms |", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 4.0)
