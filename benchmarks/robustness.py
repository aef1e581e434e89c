"""phi of a million scenes beside the time that memory takes: operation by operation, and compiled.

    python benchmarks/robustness.py [--scenes 1000000] [--seconds 6] [--out FILE]

One process, one thread, CPU seconds of that thread, the fastest of all rounds: other work on the machine only ever
slows one down. A round makes each call twice and times the second, so that what fits into a cache is there for all of
them (in float32, a million scenes of the smallest formula are 20 MB). The floor is measured in the same rounds: the
numbers that a formula reads (the rows of the storage that occur in it, and no others) and writes (one for each label)
are moved through memory once, in the fastest way of four: half of them copied to the other half, all of them summed up,
the rows added up by torch into a row, or by machine code of ours, which is the formula's own access to memory with next
to no arithmetic. `plain` is compiled without check=False and out: all rows are searched for NaN and infinity, and phi
gets memory of its own, which the system may have to hand out page by page. Compiling is the first call with 64 scenes,
CPU seconds of this process and of the C compiler; nothing is cached between processes.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch

import scenegen
from scenegen.lang.formula.core import Coord
from scenegen.learn.native import make_kernel
from scenegen.pose import row_count
from scenegen.resources import shipped_specs

OF_POINTS, OF_FOOTPRINTS = (12.0, 2.0), (50.0, 5.0)  # the bars, eager and compiled, in floors

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

    objects = [f"o{place}" for place in range(-(-read // 2))]
    terms = [f"{axis}({name})" for name in objects for axis in "xy"][:read]
    task = f"{' + '.join(terms)} <= 1"
    labels = "\n".join(f"label{place}: {task}" for place in range(written))
    core = scenegen.parse(f"object {', '.join(objects)}\n{labels}").checked.core
    kernel = make_kernel(core, single=dtype == torch.float32)
    storage, phi = torch.rand(row_count(len(objects)), scenes, dtype=dtype).numpy(), out.numpy()

    return {
        "copied": lambda: other.copy_(half[: len(other)]),
        "summed": numbers.sum,
        "added": lambda: (torch.sum(rows, 0, out=out[0]), *(row.copy_(out[0]) for row in out[1:])),
        "kernel": lambda: kernel(storage, phi),
    }


def measure(source: str, dtype: torch.dtype, scenes: int, seconds: float) -> tuple[dict[str, float], int]:
    """Seconds of the floor, eager, compiled and plain; and the number of rows that the formula reads."""
    spec = scenegen.parse(text_of(source))
    core = spec.checked.core
    read = len({node.row for node in core.nodes if isinstance(node, Coord)})
    generator = torch.Generator().manual_seed(0)
    rows = torch.rand(row_count(len(spec.objects)), scenes, dtype=dtype, generator=generator)
    eager, compiled = spec.robustness(), spec.robustness(compiled=True)
    difference = (compiled.rows(rows) - eager.rows(rows)).abs().max().item()
    assert difference <= 64 * torch.finfo(dtype).eps, (source, difference)
    phi = torch.empty(len(spec.labels), scenes, dtype=dtype)
    floors = floor_calls(read, len(spec.labels), scenes, dtype)
    took = fastest(
        {
            **floors,
            "eager": lambda: eager.rows(rows, check=False, out=phi),
            "compiled": lambda: compiled.rows(rows, check=False, out=phi),
            "plain": lambda: compiled.rows(rows),
        },
        seconds,
    )
    took["floor"] = min(took[name] for name in floors)
    return took, read


def compile_seconds(source: str, dtype: torch.dtype) -> float:
    """CPU seconds of the first call, which compiles, of this process and of the compiler."""

    def cpu() -> float:
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(one.ru_utime + one.ru_stime for one in used)

    spec = scenegen.parse(text_of(source))
    run, rows = spec.robustness(compiled=True), torch.zeros(row_count(len(spec.objects)), 64, dtype=dtype)
    start = cpu()
    run.rows(rows)
    return cpu() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=6.0, help="CPU seconds for each line")
    parser.add_argument("--out", type=Path, default=None, help="write the table there, too")
    options = parser.parse_args()
    torch.set_num_threads(1)
    columns = (
        "formula", "dtype", "rows read", "floor, ms (GB/s)", "eager, ms", "eager / floor", "compiled, ms",
        "compiled / floor", "scenes/s compiled", "plain / floor", "compiling, CPU s",
    )  # fmt: skip
    lines = [f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|"]
    print(lines[0], flush=True)
    for name, what, source, limits in CASES:
        for dtype in (torch.float32, torch.float64):
            compiling = compile_seconds(source, dtype)
            took, read = measure(source, dtype, options.scenes, options.seconds)
            floor = took["floor"]
            written = len(scenegen.parse(text_of(source)).labels)
            moved = (read + written) * options.scenes * dtype.itemsize / floor / 1e9
            bars = [f" (bar {bar:.0f})" for bar in limits] if limits else ["", ""]
            lines.append(
                f"| {name}: {what} | {str(dtype).removeprefix('torch.')} | {read} | {1e3 * floor:.2f} ({moved:.0f}) "
                f"| {1e3 * took['eager']:.2f} | {took['eager'] / floor:.1f}{bars[0]} "
                f"| {1e3 * took['compiled']:.2f} | {took['compiled'] / floor:.2f}{bars[1]} "
                f"| {options.scenes / took['compiled']:.3g} | {took['plain'] / floor:.2f} | {compiling:.2f} |"
            )
            print(lines[-1], flush=True)
    if options.out is not None:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
