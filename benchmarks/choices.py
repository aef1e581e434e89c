"""How good `auto`'s choice of method is: its CPU seconds over random tables, beside those of each method.

    python benchmarks/choices.py [--seed 9000] [--first 0] [--count 20] [--scenes 100] [--limit 30] [--methods M ...]

The tables are those of `make fuzz-tables` (tests/fuzz/tables.py). Each run is a process of its own on one thread, with
everything imported before it begins; it is ended after so many CPU seconds and then counts as that many. Printed are
the seconds, the method that `auto` took and why, and the ratio of its seconds to those of the best method that gave all
scenes; tables on which no run gives scenes are left out of the summary. Ratios compare whole requests, so what `auto`
spends on looking at methods that it does not take counts.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import scenegen
from scenegen.api.sample import sample
from scenegen.errors import ScenegenError

HERE = Path(__file__).resolve().parent
NEVER = 3600.0  # wall seconds: runs are ended by CPU seconds, because other work may run on the machine
AHEAD = 0.3  # seconds: differences below it say nothing, so both sides of a ratio are at least this


@dataclass(frozen=True, slots=True)
class Run:
    """One request: CPU seconds, whether all scenes came, the method that drew them, and why `auto` took it."""

    seconds: float
    whole: bool
    method: str = "-"
    why: str = ""


def run(text: str, ranges: dict[str, tuple[float | None, float | None]], method: str, count: int, limit: int) -> Run:
    """The request in a process of its own."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        answer: dict[str, str] = {}
        try:
            warnings.simplefilter("ignore")
            found = sample(scenegen.parse(text), ranges, count, method=method, timeout=NEVER, workers=1)
            facts = found.header.sampler
            answer = {"method": str(facts["method"]), "why": str(facts.get("reason", ""))}
        except ScenegenError as error:
            answer = {"why": str(error).splitlines()[0]}
        finally:
            os.write(write, json.dumps(answer).encode())
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        said = pipe.read()
    _, _, used = os.wait4(child, 0)
    answer = json.loads(said) if said else {"why": f"over {limit} s"}
    return Run(used.ru_utime + used.ru_stime, "method" in answer, answer.get("method", "-"), answer.get("why", ""))


def main() -> None:
    """Prints a line for each table, then the median and the worst ratios."""
    sys.path.insert(0, str(HERE.parent))
    from tests.fuzz.tables import table

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--limit", type=int, default=30, help="CPU seconds of a run")
    parser.add_argument("--methods", nargs="*", default=["rejection", "growth"])
    parser.add_argument("--for-seconds", type=float, default=1e9, help="wall seconds after which no table is begun")
    options = parser.parse_args()
    ratios = []
    begun = time.monotonic()
    for number in range(options.first, options.first + options.count):
        if time.monotonic() - begun > options.for_seconds:
            break
        case = table(options.seed, number)
        runs = {
            method: run(case.text, case.ranges, method, options.scenes, options.limit)
            for method in ("auto", *options.methods)
        }
        auto = runs["auto"]
        best = min((one.seconds for one in runs.values() if one.whole), default=None)
        seconds = "  ".join(f"{name} {one.seconds:5.1f}{' ' if one.whole else '*'}" for name, one in runs.items())
        ratio = "" if best is None else f"{max(auto.seconds, AHEAD) / max(best, AHEAD):5.2f}"
        print(f"{number:4d}  {seconds}  {ratio:5s} {auto.method}: {auto.why}", flush=True)
        if best is not None:
            ratios.append(max(auto.seconds, AHEAD) / max(best, AHEAD))
    if ratios:
        worst = ", ".join(f"{one:.1f}" for one in sorted(ratios, reverse=True)[:5])
        print(f"{len(ratios)} tables with scenes: median {statistics.median(ratios):.2f}, worst {worst}")
        print(f"mean of the logarithm: factor {statistics.geometric_mean(ratios):.2f}  (* gave no scenes)")


if __name__ == "__main__":
    main()
