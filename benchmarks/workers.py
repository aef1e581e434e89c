"""One worker and two: seconds on the clock of requests that take one core more than ten seconds, start and files
included.

    python -m benchmarks.workers [--repeats N] [NAME ...]

Both run in turns, N times each; printed are the least times, the CPU seconds that go with them, and the ratio of the
times. It stops if two workers write other bytes than one. Without names all requests are run, which takes five minutes
for each repeat.
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


def run(words: str, workers: int, folder: Path) -> tuple[float, float, str]:
    """Seconds on the clock, CPU seconds, and a hash of what was written."""
    place = folder / words.split()[-1]
    shutil.rmtree(place, ignore_errors=True)
    place.unlink(missing_ok=True)
    one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "scenegen", "sample", *words.split(), "--workers", str(workers), "-q"]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([*command, "--timeout", "3600"], cwd=folder, env={**os.environ, **one}, check=True)
    wall, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    files = sorted(place.glob("*.parquet")) if place.is_dir() else [place]
    digest = hashlib.sha256(b"".join(hashlib.sha256(one.read_bytes()).digest() for one in files)).hexdigest()
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, digest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(REQUESTS), metavar="NAME", help=", ".join(REQUESTS))
    parser.add_argument("--repeats", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "gather.spec").write_text(GATHER)
        for request in options.names:
            found: dict[int, list[tuple[float, float, str]]] = {1: [], 2: []}
            for _ in range(options.repeats):
                for workers, runs in found.items():
                    runs.append(run(REQUESTS[request], workers, folder))
            if len({digest for runs in found.values() for _, _, digest in runs}) != 1:
                sys.exit(f"{request}: two workers write other bytes than one")
            (one, cpu, _), (two, both, _) = map(min, found.values())
            alone, shared = f"one {one:5.1f} s ({cpu:.1f} CPU s)", f"two {two:5.1f} s ({both:.1f} CPU s)"
            print(f"{request:14} {alone}, {shared}: {one / two:.2f}", flush=True)


if __name__ == "__main__":
    main()
