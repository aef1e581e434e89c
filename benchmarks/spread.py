"""How far scenes are from each other: `--spread even` beside `flat`.

    python benchmarks/spread.py [-n 100] [--seeds 5]

Per shipped spec, over so many seeds: the distance of the two nearest scenes, and the mean distance of a scene to its
nearest, by the metric of `scenegen.scenes.coverage`; and the CPU seconds of one draw. All labels satisfied, the first
within 10 cm (or 0.1 rad).
"""

from __future__ import annotations

import argparse
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import scenegen
from scenegen.api.scene_arrays import as_rows
from scenegen.resources import shipped_specs
from scenegen.scenes.coverage import features, kth_squared

SPECS = ("first", "table_setting", "medical_tray", "tidy_desk")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=100, help="scenes; default: 100")
    parser.add_argument("--seeds", type=int, default=5, help="how many, from 0; default: 5")
    parser.add_argument("specs", nargs="*", default=SPECS)
    asked = parser.parse_args()
    print(f"{'spec':24}{'objects':>8}{'spread':>8}{'smallest':>10}{'mean':>8}{'CPU s':>8}")
    for name in asked.specs:
        spec = scenegen.load(shipped_specs()[name])
        first, *others = spec.labels
        phi = {first: (0.0, 0.1), **dict.fromkeys(others, (0.0, None))}
        for spread in ("flat", "even"):
            began, found = time.process_time(), []
            for seed in range(asked.seeds):
                scenes = scenegen.sample(spec, phi, asked.n, seed=seed, spread=spread, workers=1, timeout=600.0)
                found.append(np.sqrt(kth_squared(features(as_rows(scenes.poses)), 1)))
            seconds = (time.process_time() - began) / asked.seeds
            smallest, mean = np.mean([one.min() for one in found]), np.mean(found)
            print(f"{name:24}{len(spec.objects):8}{spread:>8}{smallest:10.3f}{mean:8.3f}{seconds:8.2f}", flush=True)


if __name__ == "__main__":
    main()
