"""phi of a million scenes beside the time that memory takes.

    python benchmarks/robustness.py [--scenes 1000000] [--seconds 6] [--out FILE]

One process, one thread, CPU seconds of that thread, the fastest of all rounds: other work on the machine only ever
slows one down. A round makes each call twice and times the second, so that what fits into a cache is there for all of
them (in float32, a million scenes of the smallest formula are 20 MB). The floor is measured in the same rounds: the
numbers that a formula reads (the rows of the storage that occur in it, and no others) and writes (one for each label)
are moved through memory once, in the fastest way of three: half of them copied to the other half, all of them summed
up, the rows added up by torch into a row. `plain` is without check=False and out: all rows are searched for NaN and
infinity, and phi gets memory of its own, which the system may have to hand out page by page.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch

import scenegen
from scenegen.lang.formula.core import Coord
from scenegen.pose import row_count
from scenegen.resources import shipped_specs

OF_POINTS, OF_FOOTPRINTS = 12.0, 50.0  # the bars, in floors

BOXES = "object a, b, c, d = box(0.1, 0.06, 0.05)\ntask: noOverlap()"
ON_TRAY = """object a, b = box(0.1, 0.06, 0.05)
region tray = polygon([(0.65, 0.12), (0.95, 0.12), (0.9, 0.48), (0.7, 0.48)])
task: clearOf(a, tray) & clearOf(b, tray)"""

# name, what it is, its text, its bars
CASES = (
    ("3 atoms", "leftOf, aboveOf, closeTo in one label", "leftOf(a, b) & aboveOf(a, b) & !closeTo(a, b)", OF_POINTS),
    ("3 atoms, 2 labels", "mug_left_of_plate", "mug_left_of_plate", None),
    ("15 atoms", "table_setting", "table_setting", OF_POINTS),
    ("24 atoms in 4 disjuncts", "sort_7", "sort_7", OF_POINTS),
    ("6 gaps", "noOverlap of 4 boxes", BOXES, OF_FOOTPRINTS),
    ("2 gaps to a polygon", "clearOf of 2 boxes", ON_TRAY, None),
)


def text_of(source: str) -> str:
    path = shipped_specs().get(source)
    return source if path is None else path.read_text(encoding="utf-8")


def fastest(calls: dict[str, Callable[[], object]], seconds: float) -> dict[str, float]:
    """Seconds of each call: all take turns, five times or more, so that other work on the machine meets them alike."""
    best = dict.fromkeys(calls, float("inf"))
    begin, rounds = time.thread_time(), 0
    while rounds < 5 or time.thread_time() - begin < seconds:
        rounds += 1
        for name, call in calls.items():
            call()
            start = time.thread_time()
            call()
            best[name] = min(best[name], time.thread_time() - start)
    return best


def floor_calls(read: int, written: int, scenes: int, dtype: torch.dtype) -> dict[str, Callable[[], object]]:
    """Ways to move the numbers once."""
    numbers = torch.rand((read + written) * scenes, dtype=dtype)
    half, other = torch.chunk(numbers, 2)
    other = other[: len(half)]
    rows, out = numbers[: read * scenes].view(read, scenes), numbers[read * scenes :].view(written, scenes)

    return {
        "copied": lambda: other.copy_(half[: len(other)]),
        "summed": numbers.sum,
        "added": lambda: (torch.sum(rows, 0, out=out[0]), *(row.copy_(out[0]) for row in out[1:])),
    }


def measure(source: str, dtype: torch.dtype, scenes: int, seconds: float) -> tuple[dict[str, float], int]:
    """Seconds of the floor, eager and plain; and the number of rows that the formula reads."""
    spec = scenegen.parse(text_of(source))
    core = spec.checked.core
    read = len({node.row for node in core.nodes if isinstance(node, Coord)})
    generator = torch.Generator().manual_seed(0)
    rows = torch.rand(row_count(len(spec.objects)), scenes, dtype=dtype, generator=generator)
    eager = spec.robustness()
    phi = torch.empty(len(spec.labels), scenes, dtype=dtype)
    floors = floor_calls(read, len(spec.labels), scenes, dtype)
    took = fastest(
        {
            **floors,
            "eager": lambda: eager.rows(rows, check=False, out=phi),
            "plain": lambda: eager.rows(rows),
        },
        seconds,
    )
    took["floor"] = min(took[name] for name in floors)
    return took, read


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=6.0, help="CPU seconds for each line")
    parser.add_argument("--out", type=Path, default=None, help="write the table there, too")
    options = parser.parse_args()
    torch.set_num_threads(1)
    columns = (
        "formula",
        "dtype",
        "rows read",
        "floor, ms (GB/s)",
        "phi, ms",
        "phi / floor",
        "scenes/s",
        "plain / floor",
    )
    lines = [f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|"]
    print(lines[0], flush=True)
    for name, what, source, limit in CASES:
        for dtype in (torch.float32, torch.float64):
            took, read = measure(source, dtype, options.scenes, options.seconds)
            floor = took["floor"]
            written = len(scenegen.parse(text_of(source)).labels)
            moved = (read + written) * options.scenes * dtype.itemsize / floor / 1e9
            bar = f" (bar {limit:.0f})" if limit else ""
            lines.append(
                f"| {name}: {what} | {str(dtype).removeprefix('torch.')} | {read} | {1e3 * floor:.2f} ({moved:.0f}) "
                f"| {1e3 * took['eager']:.2f} | {took['eager'] / floor:.1f}{bar} "
                f"| {options.scenes / took['eager']:.3g} | {took['plain'] / floor:.2f} |"
            )
            print(lines[-1], flush=True)
    if options.out is not None:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
