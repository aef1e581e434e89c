"""phi of motions: traces a second beside rtamt 0.4.10, and how time grows with T.

    python benchmarks/traces.py [--seconds 1] [--longest 10000] [--out FILE]

One process, one thread, CPU seconds of it, the fastest of several rounds. Ours takes poses, (B, T + 1, N, 3) in
float64, and does everything from there: distances, atoms, windows. rtamt gets the atoms' margins as signals, one trace
at a time (it has no batches), so the work on poses is not counted for it. Both are parsed beforehand, and phi is
compared for every trace that rtamt scores. Where rtamt is not installed, its columns are left out. Two formulas: one
with an until without a window, for which rtamt is fastest, and one with a window, for which its time grows with the
square of the window.

The exponent is the slope of log time over log T, for T from a tenth of the longest on, with windows of a quarter of T:
1 is linear. The number of motions keeps the number of poses the same, so each call has as much to do beside overhead.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch

import scenegen

BAR = 100.0  # times rtamt's traces a second, at T = 50
BATCH = 2000
POSES = 200_000  # of each call that measures the exponent

OURS = """time {T} steps
object mug, plate, knife
task: (eventually[0, {half}] closeTo(mug, plate, 25 cm))
    & (always[0, {T}] dist(mug, knife) >= 10 cm)
    & (leftOf(mug, plate) until%s closeTo(mug, knife, 30 cm))
    & (always[0, {half}] (closeTo(plate, knife, 20 cm) -> eventually[0, {quarter}] leftOf(plate, knife)))
"""
THEIRS = (
    "(eventually[0:{half}](a >= 0)) and (always[0:{T}](b >= 0)) and ((c >= 0) until%s (d >= 0))"
    " and (always[0:{half}]((e >= 0) implies (eventually[0:{quarter}](f >= 0))))"
)
CASES = {
    "until": (OURS % "", THEIRS % ""),
    "until with a window": (OURS % "[0, {half}]", THEIRS % "[0:{half}]"),
}


def windows(steps: int) -> dict[str, int]:
    return {"T": steps, "half": steps // 2, "quarter": max(1, steps // 4)}


def margins(poses: np.ndarray) -> dict[str, np.ndarray]:
    """The atoms of the formula over motions, each (B, T + 1)."""
    mug, plate, knife = (poses[:, :, index] for index in range(3))

    def dist(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.hypot(a[..., 0] - b[..., 0], a[..., 1] - b[..., 1])

    return {
        "a": 0.25 - dist(mug, plate),
        "b": dist(mug, knife) - 0.1,
        "c": plate[..., 0] - mug[..., 0],
        "d": 0.3 - dist(mug, knife),
        "e": 0.2 - dist(plate, knife),
        "f": knife[..., 0] - plate[..., 0],
    }


def motions(count: int, steps: int, seed: int = 0) -> torch.Tensor:
    """Random walks around a table, (count, steps + 1, 3, 3)."""
    rng = np.random.default_rng(seed)
    walk = rng.normal(scale=0.05, size=(count, steps + 1, 3, 3)).cumsum(1)
    return torch.from_numpy(np.abs((walk + rng.random((count, 1, 3, 3))) % 2.0 - 1.0))


def fastest(call: Callable[[], Any], seconds: float) -> float:
    """CPU seconds of the fastest call, of at least three and for at least so long."""
    best, spent, rounds = math.inf, 0.0, 0
    while spent < seconds or rounds < 3:
        began = time.process_time()
        call()
        took = time.process_time() - began
        best, spent, rounds = min(best, took), spent + took, rounds + 1
    return best


def ours(case: str, steps: int) -> Any:
    return scenegen.parse(CASES[case][0].format(**windows(steps))).trace_robustness()


def monitor(case: str, steps: int) -> Any:
    """rtamt's monitor of the formula; None where rtamt is missing."""
    try:
        import rtamt
    except ImportError:
        return None
    spec = rtamt.StlDiscreteTimeSpecification()
    for name in ("a", "b", "c", "d", "e", "f", "out"):
        spec.declare_var(name, "float")
    spec.spec = f"out = {CASES[case][1].format(**windows(steps))}"
    spec.parse()
    return spec


def beside_rtamt(case: str, steps: int, seconds: float) -> list[str]:
    """A line of the table: traces a second of both, the ratio, and how far phi differs."""
    run, poses = ours(case, steps), motions(BATCH, steps)
    mine = BATCH / fastest(lambda: run(poses), seconds)
    with_gradient = poses.clone().requires_grad_()
    slopes = BATCH / fastest(lambda: run(with_gradient).sum().backward(), seconds)
    spec = monitor(case, steps)
    if spec is None:
        return [case, str(steps), f"{mine:,.0f}", f"{slopes:,.0f}", "-", "-", "-"]
    signals = margins(poses.numpy())
    times = list(range(steps + 1))
    traces = [{"time": times} | {name: values[k].tolist() for name, values in signals.items()} for k in range(20)]
    theirs = len(traces) / fastest(lambda: [spec.evaluate(dict(one)) for one in traces], seconds)
    phi = run(poses[: len(traces)])[:, 0].tolist()
    apart = max(abs(value - spec.evaluate(dict(one))[0][1]) for value, one in zip(phi, traces, strict=True))
    return [
        case,
        str(steps),
        f"{mine:,.0f}",
        f"{slopes:,.0f}",
        f"{theirs:,.0f}",
        f"{mine / theirs:,.0f}",
        f"{apart:.1g}",
    ]


def exponent(longest: int, seconds: float, slopes: bool) -> tuple[list[tuple[int, float]], float]:
    """(T, microseconds a pose) and the slope of log time of a motion over log T; with gradients, of both ways."""
    found = []
    for steps in sorted({round(longest * share) for share in (0.01, 0.03, 0.1, 0.2, 0.5, 1.0)}):
        count = max(1, POSES // (steps + 1))
        run, poses = ours("until with a window", steps), motions(count, steps)
        if slopes:
            poses.requires_grad_()
            took = fastest(lambda run=run, poses=poses: run(poses).sum().backward(), seconds)
        else:
            took = fastest(lambda run=run, poses=poses: run(poses), seconds)
        found.append((steps, took / count))
    long = [(math.log(steps), math.log(took)) for steps, took in found if steps >= 0.1 * longest]
    slope = float(np.polyfit(*zip(*long, strict=True), 1)[0])
    return [(steps, took / (steps + 1) * 1e6) for steps, took in found], slope


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement")
    parser.add_argument("--longest", type=int, default=10_000, help="T of the last measurement of the exponent")
    parser.add_argument("--out", type=Path, help="write the tables here, too")
    given = parser.parse_args()
    lines = [
        "| formula | T | traces a second | with gradients | rtamt | times rtamt | phi differs by |",
        "|---|---|---|---|---|---|---|",
    ]
    for case in CASES:
        for steps in (10, 50, 200):
            lines.append(f"| {' | '.join(beside_rtamt(case, steps, given.seconds))} |")
            print(lines[-1], flush=True)
    points, slope = exponent(given.longest, given.seconds, False)
    backwards, steep = exponent(given.longest, given.seconds, True)
    lines += ["", "| T | microseconds a pose | with gradients |", "|---|---|---|"]
    both = zip(points, backwards, strict=True)
    lines += [f"| {steps:,} | {each:.3f} | {other:.3f} |" for (steps, each), (_, other) in both]
    lines += ["", f"time grows with T to the power of {slope:.3f}, with gradients {steep:.3f}"]
    lines += [f"(bar at T = 50: {BAR:g} times rtamt)"]
    text = "\n".join(lines)
    print(text)
    if given.out:
        given.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
