"""Pruned rejection beside plain numpy rejection: scenes per second in the band, coverage, duplicates, time to a file.

    python benchmarks/sampling.py [--scenes 1000000] [--seconds 4] [--workers 2] [--out FILE]

One process, one core, CPU seconds, the fastest of three runs. Plain rejection is written by hand for each spec: whole
scenes (3N numbers in float64) in chunks that stay in cache, the formula in as few numpy calls as it takes, nothing but
the hits kept. `rejection` is the sampler, plan included; `sample` is the public call, which looks at every scene a
second time and keeps them all. All are asked for |phi - wanted| <= 0.0125 on every label, and the base
distribution in the band.

With `--workers W` a second table follows: the same request on W processes beside one, the plan and the processes' start
included. Wall seconds say something on W idle cores only. CPU seconds always do: those of one process, over those of
the parent and of the workers divided by W, are what W idle cores could reach if nobody waited, and cannot exceed.
`parent` receives, fills and hands out while the workers work; `alone` is what nobody shares: the wall seconds from the
start to the first scenes, less those that one process needs for that. Workers are ended in the midst of pieces that
nobody wants any more; that is in their CPU seconds, too.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import numpy.typing as npt
import torch

import scenegen
from scenegen.resources import shipped_specs
from scenegen.sampling.engine.blocks import run_blocks
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rejection.sampler import Rejection, make_plan
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.coverage import coverage
from scenegen.search.effort import Budget

Array = npt.NDArray[np.float64]
BAND = 0.0125
REPEAT = 3  # runs of everything; the fastest counts, for other work on the machine only ever slows one down
CHUNK = 16_384
COVERED = 2000


def _exp1(rows: Array, phi: Callable[[Array, float], npt.NDArray[np.bool_]]) -> npt.NDArray[np.bool_]:
    mx, my, _, px, py, _ = rows
    dx, dy = px - mx, my - py
    return phi(np.minimum(dx, dy), 0.19) & phi(np.sqrt(dx * dx + dy * dy) - 0.25, 0.08)


def _exp2(rows: Array, phi: Callable[[Array, float], npt.NDArray[np.bool_]]) -> npt.NDArray[np.bool_]:
    px, py, _, mx, my, _, kx, ky, kt, cx, cy, _ = rows
    least = np.minimum(px - 0.3, 0.7 - px)
    turned = np.abs(kt - math.pi / 2)
    turned = np.minimum(turned, 2 * math.pi - turned)
    for margin in (
        0.2 - py, py, mx - 0.3, 0.7 - mx, my - 0.2, kx - 0.7, ky, 0.2 - ky, 0.2 - turned, cy - py, px - cx,
        0.25 - np.sqrt((mx - 0.5) ** 2 + (my - 0.2) ** 2), 0.25 - np.sqrt((kx - 0.7) ** 2 + (ky - 0.1) ** 2),
    ):  # fmt: skip
        np.minimum(least, margin, out=least)
    return phi(least, 0.03)


def _sorted(rows: Array, phi: Callable[[Array, float], npt.NDArray[np.bool_]]) -> npt.NDArray[np.bool_]:
    dx, dy = rows[3::3] - rows[:-3:3], rows[4::3] - rows[1:-3:3]
    best = np.maximum(dx.min(axis=0), -dx.max(axis=0))
    return phi(np.maximum(best, np.maximum(dy.min(axis=0), -dy.max(axis=0))), 0.05)


# spec, wanted phi by label, numbers of a scene, plain rejection's test, scenes/s of plain known from elsewhere, the bar
CASES = (
    ("mug_left_of_plate", {"task": 0.19, "safe": 0.08}, 6, _exp1, 16_500, 30),
    ("table_setting", {"task": 0.03}, 12, _exp2, 11, 40_000),
    ("sort_3", {"sorted": 0.05}, 9, _sorted, 416_000, 1),
    ("sort_5", {"sorted": 0.05}, 15, _sorted, 37_800, None),
    ("sort_7", {"sorted": 0.05}, 21, _sorted, 433, 500),
)


def plain(
    numbers: int, test: Callable[..., npt.NDArray[np.bool_]], seconds: float, seed: int = 0
) -> tuple[Array, float, int]:
    """Hits of plain rejection (3N, n), the CPU seconds they took, and how many scenes were drawn."""
    rng = np.random.default_rng(seed)
    rows = np.empty((numbers, CHUNK))

    def near(value: Array, wanted: float) -> npt.NDArray[np.bool_]:
        value = np.abs(value - wanted)
        return value <= BAND

    hits: list[Array] = []
    drawn = 0
    start = time.process_time()
    while time.process_time() - start < seconds:
        rng.random(out=rows)
        rows[2::3] *= 2 * math.pi
        found = np.flatnonzero(test(rows, near))
        if len(found):
            hits.append(rows.take(found, axis=1))
        drawn += CHUNK
    took = time.process_time() - start
    return (np.concatenate(hits, axis=1) if hits else rows[:, :0]), took, drawn


def fresh(name: str, wanted: dict[str, float]) -> float:
    """Wall seconds from the command to 1,000 scenes on disk, in a process of its own."""
    words = [sys.executable, "-m", "scenegen", "sample", str(shipped_specs()[name]), "-n", "1000"]
    for label, value in wanted.items():
        words += ["--phi", f"{label}={value - BAND}:{value + BAND}"]
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run([*words, "--out", str(Path(folder) / "s.json")], check=True, capture_output=True)
        return time.perf_counter() - start


def _plan(spec: scenegen.Spec, phi: dict[str, Range], scenes: int, seed: int = 0) -> Rejection:
    request = SampleRequest(phi, scenes, seed, spread="base")
    return make_plan(make_problem(spec.checked, request), Budget(600.0))


def measure(
    case: tuple[str, dict[str, float], int, Callable[..., npt.NDArray[np.bool_]], float, int | None],
    scenes: int,
    seconds: float,
) -> str:
    name, wanted, numbers, test, known, bar = case
    spec = scenegen.load(shipped_specs()[name])
    band = {label: (value - BAND, value + BAND) for label, value in wanted.items()}
    runs = [plain(numbers, test, seconds / REPEAT, seed) for seed in range(REPEAT)]
    hits = np.concatenate([found for found, _, _ in runs], axis=1)
    drawn = sum(count for _, _, count in runs)
    speed = max(count / took for _, took, count in runs)
    ranges = {label: Range(*ends) for label, ends in band.items()}
    alone = ours = cpu = 0.0
    for seed in range(REPEAT):
        start = time.process_time()
        plan = _plan(spec, ranges, scenes, seed)
        assert sum(block.count for block in run_blocks(plan, len(spec.labels))) == scenes
        alone = max(alone, scenes / (time.process_time() - start))
        start, begun = time.process_time(), time.perf_counter()
        made = scenegen.sample(spec, band, scenes, seed=seed, spread="base", timeout=600.0)
        took = time.process_time() - start
        if scenes / took > ours:
            ours, cpu, wall = scenes / took, took, time.perf_counter() - begun
    # Where hits are rare, plain rejection's rate follows from its draws and the probability that sampling estimates.
    probability = 10 ** made.header.sampler["log10_probability"]
    rate = speed * probability
    counted = f"{hits.shape[1]} hits, {drawn * probability:.0f} expected"
    rows = made.poses.reshape(scenes, -1).T
    distinct = len(np.unique(rows[0::3].T.copy().view([("", rows.dtype)] * (numbers // 3))))
    if hits.shape[1] >= COVERED:
        truth = hits[:, :COVERED]
    else:
        truth = scenegen.sample(spec, band, COVERED, seed=99, spread="base").poses.reshape(COVERED, -1).T
    source = "plain" if hits.shape[1] >= COVERED else "ours, another seed"
    cover = coverage(truth, rows[:, :COVERED])
    inside = all(np.abs(made.phi[label] - value).max() <= BAND + 1e-12 for label, value in wanted.items())
    assert inside and distinct == scenes
    verdict = "" if bar is None else f"; bar {bar:,}"
    return (
        f"| {name} | {rate:,.4g} ({known:,}) | {alone:,.0f} | {ours:,.0f} "
        f"| {alone / rate:,.1f}; {ours / rate:,.1f}; {ours / known:,.1f}{verdict} | {cover:.3f} ({source}) "
        f"| {scenes - distinct} | {made.header.sampler['acceptance']:.2f} | {cpu:.2f} / {wall:.2f} "
        f"| {fresh(name, wanted):.2f} | {counted} |"
    )


def shared(name: str, wanted: dict[str, float], scenes: int, workers: int) -> str:
    """One line on a request's time with several processes beside one; the fastest of the runs of each, by turns."""
    spec = scenegen.load(shipped_specs()[name])
    ranges = {label: Range(value - BAND, value + BAND) for label, value in wanted.items()}

    def run(processes: int) -> tuple[float, float, float, float]:
        """Wall seconds in all and up to the first scenes; CPU seconds of this process and of the workers."""
        began, used, below = time.perf_counter(), time.process_time(), _below()
        plan = _plan(spec, ranges, scenes)
        blocks = run_blocks(plan, len(spec.labels), workers=processes)
        count = next(blocks).count
        first = time.perf_counter() - began
        count += sum(block.count for block in blocks)
        assert count == scenes
        return time.perf_counter() - began, first, time.process_time() - used, _below() - below

    runs = [(run(1), run(workers)) for _ in range(REPEAT)]
    wall, first, cpu, _ = (min(values) for values in zip(*(one for one, _ in runs), strict=True))
    walls, firsts, parent, below = (min(values) for values in zip(*(many for _, many in runs), strict=True))
    return (
        f"| {name} | {scenes / wall:,.0f} | {scenes / walls:,.0f} | {wall / walls:.2f} | {cpu:.2f} "
        f"| {parent:.2f} + {below:.2f} | {workers * cpu / (parent + below):.2f} | {firsts - first:.2f} |"
    )


def _below() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=4.0, help="CPU seconds of plain rejection for each spec")
    parser.add_argument("--workers", type=int, default=1, help="compare that many processes with one, too")
    parser.add_argument("--out", type=Path, default=None, help="write the table there, too")
    options = parser.parse_args()
    torch.set_num_threads(1)
    scenegen.sample(
        scenegen.parse("leftOf(mug, plate)"), {"task": (0.1, 0.2)}, 1000
    )  # imports are not what is measured
    columns = (
        "spec", "plain numpy, scenes/s (known)", "rejection, scenes/s", "sample, scenes/s",
        "ratio of rejection, of sample, of sample to the known", "coverage (truth from)", "duplicates", "acceptance",
        "CPU / wall s", "1,000 scenes in a fresh process, wall s", "plain run",
    )  # fmt: skip
    head = f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|"
    lines = [head]
    print(head, flush=True)
    for case in CASES:
        lines.append(measure(case, options.scenes, options.seconds))
        print(lines[-1], flush=True)
    if options.workers > 1:
        columns = (
            "spec", "1 process, scenes/s (wall)", f"{options.workers} workers, scenes/s (wall)", "ratio (bar 1.8)",
            "1 process, CPU s", "parent + workers, CPU s", "ratio by CPU", "alone, wall s",
        )  # fmt: skip
        lines.append(f"\n| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
        print(lines[-1], flush=True)
        for name, wanted, *_ in CASES:
            lines.append(shared(name, wanted, options.scenes, options.workers))
            print(lines[-1], flush=True)
    if options.out is not None:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
