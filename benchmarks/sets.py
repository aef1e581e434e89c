"""What sets cost: memory of every process of a run, shuffled reading, workers and engines against one worker.

    python -m benchmarks.sets memory --scenes 10_000_000     docs/images/set_memory.png
    python -m benchmarks.sets reading SET
    python -m benchmarks.sets engines --scenes 5_000_000     one and two workers, local and Ray
    python -m benchmarks.sets engines --scenes 30_000 --spec benchmarks/tables/dinner4.spec --phi 0:

The spec is table_setting with phi from -0.1 to 0.1, seed 0. CPU seconds are those of all processes, of Ray's too.
`engines` runs each engine twice: for one scene, which is what starting and ending take, and for all. The throughput is
that of the difference. The plan is in it: that of one scene is small.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "images" / "set_memory.png"
REQUEST = ("table_setting", "--phi=-0.1:0.1")
ENGINES = {
    "one worker": ("--workers", "1"),
    "two workers": ("--workers", "2"),
    "Ray, two cores": ("--workers", "2", "--engine", "ray"),
}


def command(out: str, scenes: int, *more: str, request: Sequence[str] = REQUEST) -> list[str]:
    fixed = ("--timeout", "36000", "-q", "-n", str(scenes), "--out", out)
    return [sys.executable, "-m", "scenegen", "sample", *request, *fixed, *more]


def processes(root: int) -> dict[int, tuple[float, float]]:
    """MB and CPU seconds of a process and of all below it."""
    page, tick = os.sysconf("SC_PAGE_SIZE"), os.sysconf("SC_CLK_TCK")
    parents, sizes = {}, {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        pid = int(entry.parent.name)
        parents[pid] = int(fields[1])
        sizes[pid] = int(fields[21]) * page / 1e6, (int(fields[11]) + int(fields[12])) / tick

    def below(pid: int) -> bool:
        while pid in parents and pid != root:
            pid = parents[pid]
        return pid == root

    return {pid: size for pid, size in sizes.items() if below(pid)}


def memory(scenes: int) -> None:
    """Runs `scenegen sample` and draws what its processes hold, once a second."""
    found: dict[int, list[tuple[float, float]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        start = time.monotonic()
        run = subprocess.Popen(command(f"{folder}/set/", scenes))
        while run.poll() is None:
            now = time.monotonic() - start
            for pid, (size, _) in processes(run.pid).items():
                found[pid].append((now, size))
            time.sleep(1.0)
    if run.returncode:
        sys.exit(f"the run ended with status {run.returncode}")
    curves = [curve for _, curve in sorted(found.items()) if len(curve) > 1]
    for number, curve in enumerate(curves):
        half = [size for _, size in curve[len(curve) // 2 :]]
        print(f"process {number}: at most {max(size for _, size in curve):.0f} MB; {max(half):.0f} in the second half")
    draw(curves, scenes)


def draw(curves: list[list[tuple[float, float]]], scenes: int) -> None:
    """A picture of MB over seconds: the process of the command first, then its workers."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.2), dpi=100, layout="constrained")
    axes = figure.subplots()
    for number, curve in enumerate(curves):
        name = "the command, which writes" if number == 0 else f"worker {number}"
        axes.plot(*zip(*curve, strict=True), label=name, linewidth=1.2)
    axes.axhline(1500.0, color="0.6", linestyle="--", linewidth=1.0, label="limit")
    axes.set(xlabel="seconds", ylabel="MB resident", ylim=(0, 1600), title=f"{scenes:,} scenes of table_setting")
    axes.legend(fontsize=8, ncols=2)
    figure.savefig(PICTURE, metadata={"Software": None})
    print(f"wrote {PICTURE}")


def reading(location: str) -> None:
    """Scenes per second of one process, shuffled and in order; files are read once before, so they are in memory."""
    import scenegen

    stored = scenegen.open_set(location)
    for shard in stored.shards:
        stored.store.read(shard.file)
    for shuffle in (True, False):
        cpu, wall, count = time.process_time(), time.perf_counter(), 0
        for _, phi in stored.batches(4096, shuffle=shuffle, seed=0):
            count += len(phi)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        how = "shuffled" if shuffle else "in order"
        print(f"{how}: {count:,} scenes, {count / cpu / 1e6:.2f} million per CPU s, {count / wall / 1e6:.2f} per s")


@dataclass(frozen=True, slots=True)
class Cost:
    """Seconds of one run of the command: on the clock, of its own process, and of all processes below it."""

    wall: float
    own: float
    others: float

    def without(self, start: Cost) -> Cost:
        return Cost(self.wall - start.wall, self.own - start.own, self.others - start.others)

    def __str__(self) -> str:
        return f"{self.wall:.1f} s, {self.own:.1f} + {self.others:.1f} CPU s"


def cost(scenes: int, request: Sequence[str], options: Sequence[str]) -> Cost:
    """One run into an empty folder. CPU seconds are read four times a second, so the last moments are not in them."""
    with tempfile.TemporaryDirectory() as folder:
        start, spent = time.monotonic(), {}
        run = subprocess.Popen(command(f"{folder}/set/", scenes, *options, request=request))
        while run.poll() is None:
            spent |= {pid: cpu for pid, (_, cpu) in processes(run.pid).items()}
            time.sleep(0.25)
        wall = time.monotonic() - start
        if run.returncode:
            sys.exit(f"the run ended with status {run.returncode}")
    own = spent.pop(run.pid, 0.0)
    return Cost(wall, own, sum(spent.values()))


def engines(scenes: int, request: Sequence[str], only: Sequence[str]) -> None:
    """One and two local workers, and Ray with two cores. CPU seconds are those of the command + of other processes.
    `times` is the throughput beside that of the first one, with the start and without it."""
    first: tuple[float, float] | None = None
    for name in only:
        options = ENGINES[name]
        start = cost(1, request, options)
        whole = cost(scenes, request, options)
        rest = whole.without(start)
        rate = f"{scenes / rest.wall:,.0f} scenes/s" if rest.wall > 0 else "no time measured"
        first = first or (whole.wall, rest.wall)
        times = f"{first[0] / whole.wall:.2f} times, {first[1] / rest.wall:.2f} without the start"
        print(f"{name}: {whole}; start {start}; the rest {rest}: {rate}; {times}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["memory", "reading", "engines"])
    parser.add_argument("location", nargs="?")
    parser.add_argument("--scenes", type=lambda text: int(text.replace("_", "")), default=10_000_000)
    parser.add_argument("--spec", default=REQUEST[0], help="of `engines`")
    parser.add_argument("--phi", default="-0.1:0.1", help="of `engines`")
    parser.add_argument("--only", choices=list(ENGINES), action="append", help="of `engines`: may be repeated")
    given = parser.parse_args()
    if given.what == "reading":
        reading(given.location or parser.error("reading needs a set"))
    elif given.what == "memory":
        memory(given.scenes)
    else:
        engines(given.scenes, (given.spec, f"--phi={given.phi}"), given.only or list(ENGINES))


if __name__ == "__main__":
    main()
