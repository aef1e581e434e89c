"""Layouts per second on one core, beside the published figures of Isaac Lab-Arena's placer.

    python benchmarks/layouts.py [--layouts 20000] [--seed 0] [--repeat 1]

CPU seconds of one process for `Layouts(...).take(n)`: the plan, the scenes, their verification, the tensor. phi is 0 or
more; boxes have any heading. `auto` is what a user gets; `rejection` is asked for by name.

Arena's figures are those of its pull request 1086 (August 2026), on an RTX 6000 Ada: of `ObjectPlacer.place` with
bounding boxes, batches of 1 to 128. Its scene is a table of 1 x 1 m and two boxes of 12 cm, On(table), with no other
relation and no rotation; with nine boxes, a batch of one takes its solver 4.0 s. What differs: its boxes do not turn
and are compared by their axis-aligned bounds; its layouts minimise a loss from random starts, ours are draws from the
uniform distribution; its solver also takes meshes and heights as variables; and a GPU against one CPU core.
"""

from __future__ import annotations

import argparse
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch

import scenegen
from scenegen.errors import RequestError
from scenegen.layouts import Layouts

ARENA = "0.66 (batch 1) to 67 (batch 128)"
NEXT_TO = "def nextTo(a, b, e = 10 cm) = fullyRightOf(a, b) & gap(a, b) <= e & alignedY(a, b, 5 cm)\n"
TABLE = "workspace [0, 1.2] x [0, 0.8]\nobject box[10] = box(8 cm, 6 cm, 6 cm)\n"
ON = "require noOverlap() & insideWorkspace()\n"
CIRCLES = "require insideWorkspace() & (forall p, q in box: dist(p, q) >= 10 cm)  # circles around the boxes\n"
ONE = "task: nextTo(box[2], box[1]) & facing(box[3], box[1], 20 deg)\n"
TWO = ONE.rstrip() + " & nextTo(box[5], box[4]) & facing(box[6], box[4], 20 deg)\n"
ANY = "task: x(box[1]) >= 0\n"
CASES = {
    "Arena's: 2 boxes of 12 cm On": f"object box[2] = box(12 cm, 12 cm, 12 cm)\n{ON}{ANY}",
    "Arena's: 9 boxes of 12 cm On": f"object box[9] = box(12 cm, 12 cm, 12 cm)\n{ON}{ANY}",
    "10 boxes On": TABLE + ON + ANY,
    "10 boxes On, 1 NextTo, 1 FaceTo, apart by circles": TABLE + NEXT_TO + CIRCLES + ONE,
    "10 boxes On, 1 NextTo, 1 FaceTo": TABLE + NEXT_TO + ON + ONE,
    "10 boxes On, 2 NextTo, 2 FaceTo": TABLE + NEXT_TO + ON + TWO,
}


def rate(spec: scenegen.Spec, count: int, seed: int, method: str) -> float:
    """Layouts per CPU second."""
    layouts = Layouts(spec, (0.0, None), quaternion="wxyz", seed=seed, method=method, timeout=240.0)
    begin = time.process_time()
    poses, phi = layouts.take(count)
    spent = time.process_time() - begin
    assert poses.shape == (count, len(spec.objects), 7) and bool((phi >= 0).all())
    return count / spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--layouts", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repeat", type=int, default=1, help="runs of each; the fastest counts")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    rate(scenegen.parse(CASES["Arena's: 2 boxes of 12 cm On"]), 100, 0, "auto")  # imports
    print(f"layouts per CPU second, one core, {asked.layouts:,} each; Arena's placer: {ARENA}\n")
    print(f"| {'scene':<50} | auto | rejection |\n|---|---|---|")
    for name, text in CASES.items():
        spec, cells = scenegen.parse(text), []
        for method in ("auto", "rejection"):
            try:
                best = max(rate(spec, asked.layouts, asked.seed, method) for _ in range(asked.repeat))
                cells.append(f"{best:,.0f}")
            except RequestError as error:
                cells.append(error.diagnostics[0].code)
        print(f"| {name:<50} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
