"""One worker and two: seconds on the clock of requests that take one core more than ten seconds, start and files
included.

    python -m benchmarks.workers [--repeats N] [--limit] [NAME ...]

Both run in turns, N times each; printed are the least times, the CPU seconds that go with them, and the ratio of the
times. It stops if two workers write other bytes than one. With --limit two commands of one worker each run side by
side, too, with other seeds: twice the time of one over theirs is what the machine's two cores are worth at the moment.
Without names all requests are run, which takes six minutes for each repeat, ten with --limit.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

GATHER = """object a = cylinder(0.04, 0.1), b = cylinder(0.04, 0.1), c = cylinder(0.04, 0.1)
object d = cylinder(0.04, 0.1), e = cylinder(0.04, 0.1)
time 20 steps
moves all
require speed(a) <= 20 cm/s & speed(b) <= 20 cm/s & speed(c) <= 20 cm/s & speed(d) <= 20 cm/s & speed(e) <= 20 cm/s
require noOverlap() & insideWorkspace()
task: eventually (closeTo(a, b, 25 cm) & closeTo(b, c, 25 cm) & closeTo(c, d, 25 cm) & closeTo(d, e, 25 cm))
"""
TABLES = Path(__file__).parent / "tables"
REQUESTS = {
    "table_setting": "table_setting --phi=-0.1:0.1 -n 10000000 --out set/",
    "file": "table_setting --phi=-0.1:0.1 -n 8000000 --out scenes.parquet",
    "sort_7": "sort_7 --satisfied -n 10000000 --out set/",
    "tea_party": "tea_party --satisfied -n 100000 --out set/",
    "boxes20": f"{TABLES}/boxes20.spec --phi 0: -n 40000 --out set/",
    "dinner4": f"{TABLES}/dinner4.spec --phi 0: -n 20000 --out set/",
    "parts12": f"{TABLES}/parts12.spec --phi 0: -n 10000 --out set/",
    "boxes40": f"{TABLES}/boxes40.spec --phi 0: -n 20000 --out set/",
    "discs60": f"{TABLES}/discs60.spec --phi 0: -n 5000 --out set/",
    "tidy_desk": "tidy_desk --satisfied -n 10000 --out set/",
    "breakfast": "breakfast --satisfied --method splitting -n 100000 --out set/",
    "gather": "gather.spec --phi 0: -n 1000 --out motions.parquet",
}


def start(words: str, workers: int, folder: Path, seed: int = 0) -> subprocess.Popen[bytes]:
    """The command, without what an earlier one has left."""
    place = folder / words.split()[-1]
    if place.is_dir():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "scenegen", "sample", *words.split(), "--workers", str(workers), "-q"]
    return subprocess.Popen([*command, "--seed", str(seed), "--timeout", "3600"], cwd=folder, env={**os.environ, **one})


def run(words: str, workers: int, folder: Path) -> tuple[float, float, str]:
    """Seconds on the clock, CPU seconds, and a hash of what was written."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    if start(words, workers, folder).wait():
        sys.exit(f"{words}: failed")
    wall, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    place = folder / words.split()[-1]
    files = sorted(place.glob("*.parquet")) if place.is_dir() else [place]
    digest = hashlib.sha256(b"".join(hashlib.sha256(one.read_bytes()).digest() for one in files)).hexdigest()
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, digest


def side_by_side(words: str, folder: Path) -> float:
    """Seconds that two commands of one worker each take together."""
    folders = [folder / "first", folder / "second"]
    for one in folders:
        one.mkdir(exist_ok=True)
        (one / "gather.spec").write_text(GATHER)
    begun = time.monotonic()
    for running in [start(words, 1, one, seed) for seed, one in enumerate(folders)]:
        running.wait()
    return time.monotonic() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(REQUESTS), metavar="NAME", help=", ".join(REQUESTS))
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--limit", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "gather.spec").write_text(GATHER)
        for request in options.names:
            found: dict[int, list[tuple[float, float, str]]] = {1: [], 2: []}
            beside: list[float] = []
            for _ in range(options.repeats):
                for workers, runs in found.items():
                    runs.append(run(REQUESTS[request], workers, folder))
                if options.limit:
                    beside.append(side_by_side(REQUESTS[request], folder))
            if len({digest for runs in found.values() for _, _, digest in runs}) != 1:
                sys.exit(f"{request}: two workers write other bytes than one")
            (one, cpu, _), (two, both, _) = map(min, found.values())
            alone, shared = f"one {one:5.1f} s ({cpu:.1f} CPU s)", f"two {two:5.1f} s ({both:.1f} CPU s)"
            limit = f" of at most {2.0 * one / min(beside):.2f}" if beside else ""
            print(f"{request:14} {alone}, {shared}: {one / two:.2f}{limit}", flush=True)


if __name__ == "__main__":
    main()
