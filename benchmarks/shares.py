"""What of a request one process does alone: CPU seconds until the plan is begun, of the plan, and of the rest.

    python -m benchmarks.shares table_setting --phi=-0.1:0.1 -n 5000000 --out DIR/

The words are those of `scenegen sample`, which is run twice, with one worker and with two; DIR is emptied before. Each
part is printed as seconds of the command + of its worker processes. The last figure is what two cores need at least if
nothing waits: what the command does before there is work for others, and half of all that follows, or its own part of
that. Unlike times on the clock, it can be measured on a machine that does other work, too.
"""

from __future__ import annotations

import os
import resource
import shutil
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def spent() -> tuple[float, float]:
    """CPU seconds of this process, and of those below it that have ended."""
    others = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), others.ru_utime + others.ru_stime


def measure(words: list[str], workers: int) -> None:
    """The command in this process; prints a line."""
    from scenegen.cli import main
    from scenegen.sampling import plans

    marks, make = [], plans.make_plan

    def noted(*given: object, **named: object) -> object:
        marks.append(spent())
        plan = make(*given, **named)  # type: ignore[arg-type]
        marks.append(spent())
        return plan

    plans.make_plan = noted  # type: ignore[assignment]
    sys.argv = ["scenegen", "sample", *words, "--workers", str(workers), "--timeout", "36000", "-q"]
    try:
        main()
    except SystemExit as end:
        if end.code:
            raise
    if len(marks) != 2:
        sys.exit("a request of one plan, please")
    (start, _), (planned, others), (whole, all_others) = *marks, spent()
    rest = whole - planned, all_others - others
    least = planned + others / workers + max(sum(rest) / workers, rest[0])
    print(
        f"{workers} workers: start {start:.1f}, plan {planned - start:.1f} + {others:.1f}, rest {rest[0]:.1f} +"
        f" {rest[1]:.1f} CPU s; in all {whole + all_others:.1f}, on as many cores {least:.1f} s or more",
        flush=True,
    )


def main() -> None:
    words = sys.argv[1:]
    if "--out" not in words:
        sys.exit(__doc__)
    out = Path(words[words.index("--out") + 1])
    for workers in (1, 2):
        shutil.rmtree(out) if out.is_dir() else out.unlink(missing_ok=True)
        child = os.fork()
        if not child:
            measure(words, workers)
            os._exit(0)
        if os.waitpid(child, 0)[1]:
            sys.exit(1)


if __name__ == "__main__":
    main()
