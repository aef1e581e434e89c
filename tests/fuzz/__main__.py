"""`make fuzz`: python -m tests.fuzz [--minutes 30] [--seed 0] [--workers CORES] [--out fuzz-out] [--number K]

Writes each kind of fault once, minimised, to OUT/SEED-NUMBER.spec with its story beside it. Exit status 1 if there is
any. `--number K` judges input K alone and prints it.
"""

from __future__ import annotations

import argparse
import faulthandler
import multiprocessing
import os
import resource
import sys
import time
from pathlib import Path

from .run import SIZES, Bench, corpus, inputs, make, scratch

MEMORY = 2 << 30  # bytes of address space
FILES = 20  # one input in so many is followed by a hostile scene file of its number
STUCK = 300.0  # seconds after which a worker that no signal reaches shows where it is and ends


def work(seed: int, first: int, step: int, seconds: float, out: Path) -> int:
    """Judges every `step`th input until the time is up. Returns the number of kinds of faults."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    known: set[str] = set()
    began = report = time.monotonic()
    count = accepted = 0
    slowest = 0.0
    with scratch() as folder:
        bench = Bench(Path(folder))
        for number, case in inputs(seed, first, step):
            faulthandler.dump_traceback_later(STUCK, exit=True)
            before = time.process_time()
            good, signature, story = bench.verdict(case)
            slowest = max(slowest, time.process_time() - before)
            count += 1
            accepted += good
            if signature and signature not in known:
                known.add(signature)
                print(f"input {number}: {signature}", flush=True)
                faulthandler.cancel_dump_traceback_later()
                small = bench.shrink(case, signature)
                out.mkdir(parents=True, exist_ok=True)
                name = f"{seed}-{number}"
                (out / f"{name}.spec").write_bytes(small.main)
                beside = "".join(f"---- {one}\n{data.decode(errors='replace')}\n" for one, data in small.beside.items())
                (out / f"{name}.txt").write_text(f"{signature}\nseed {seed}, number {number}\n{story}\n{beside}")
            if number % FILES == 0:
                signature, story = bench.file_verdict(seed, number)
                if signature and signature not in known:
                    known.add(signature)
                    print(f"scene file {number}: {signature}", flush=True)
                    out.mkdir(parents=True, exist_ok=True)
                    said = f"{signature}\nseed {seed}, number {number}\n{story}"
                    (out / f"{seed}-{number}-file.txt").write_text(said)
            now = time.monotonic()
            if now - report > 30:
                report = now
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
                print(
                    f"{count} inputs, {accepted} accepted, {len(known)} kinds of faults, slowest {slowest:.2f} s,"
                    f" {peak} MB, up to number {number}",
                    flush=True,
                )
            if now - began > seconds:
                break
    faulthandler.cancel_dump_traceback_later()
    print(
        f"done: {count} inputs, {accepted} accepted, {len(known)} kinds of faults, slowest {slowest:.2f} s", flush=True
    )
    return len(known)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=float(os.environ.get("FUZZ_MINUTES", "30")))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("fuzz-out"))
    parser.add_argument("--number", type=int, help="judge this input alone")
    asked = parser.parse_args()
    if asked.number is not None:
        case = make(asked.seed, asked.number, corpus(), SIZES)
        sys.stdout.buffer.write(case.main + b"\n")
        with scratch() as folder:
            good, _, story = Bench(Path(folder)).verdict(case)
        print(story or ("accepted" if good else "refused"))
        return int(bool(story))
    jobs = [
        (asked.seed, asked.first + worker, asked.workers, 60 * asked.minutes, asked.out)
        for worker in range(asked.workers)
    ]
    if len(jobs) == 1:
        return int(work(*jobs[0]) > 0)
    with multiprocessing.get_context("spawn").Pool(len(jobs)) as pool:
        return int(sum(pool.starmap(work, jobs)) > 0)


if __name__ == "__main__":
    sys.exit(main())
