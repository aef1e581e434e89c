"""`python -m experiments`: what the words of its command line mean, and how it ends.

Exit status 0 done; 1 the request or the data are at fault; 2 an unknown option or a missing argument; 130 after an
interrupt.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from experiments.run import run
from experiments.table import ALL, EXPERIMENTS
from scenegen.errors import ScenegenError, render_all

ABOUT = """Repeat an experiment with every model and sampler, and write its tables and figures.

  python -m experiments semantics --out reports
  python -m experiments all --out reports --seeds 1

A report is NAME.md, NAME.json and PNG files. An existing NAME.md keeps its text: only its tables are replaced.
Finished runs and trained models are kept in DIR/runs, so an interrupted experiment continues where it stopped.
Needs the extra `experiments` (matplotlib, scikit-learn, numba, stable-baselines3).
"""


def parser() -> argparse.ArgumentParser:
    """The options; the help lists every experiment with its time."""
    width = max(map(len, EXPERIMENTS))
    listed = "\n".join(f"  {name:<{width}}  {one.time:<10}  {one.about}" for name, one in EXPERIMENTS.items())
    found = argparse.ArgumentParser(
        "python -m experiments",
        description=ABOUT,
        epilog=f"experiments, and about how long they take on two cores:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    found.add_argument("name", metavar="NAME", help=f"one of the experiments below, or `{ALL}`")
    found.add_argument("--out", metavar="DIR", type=Path, required=True, help="the folder for the reports")
    found.add_argument(
        "--seeds", type=_seeds, help="N for the seeds 0 to N - 1, or A:B for A to B - 1 (default: 3, curriculum 5)"
    )
    found.add_argument("--workers", type=int, help="processes that train (default: one per core)")
    found.add_argument("--engine", default="local", help="what trains: local processes, or a ray cluster")
    found.add_argument("--address", metavar="ADDR", help="the Ray cluster")
    found.add_argument("--epochs", type=int, help="passes of each training of `unseen` (default: the model's)")
    found.add_argument(
        "--trainings", type=int, default=1, metavar="N", help="models of each spec of `unseen` (default: 1)"
    )
    found.add_argument("--kept", action="store_true", help="report what `unseen` has finished so far, and run nothing")
    found.add_argument("--quick", action="store_true", help="tiny settings, to see that it works; meaningless numbers")
    return found


def _seeds(text: str) -> int | tuple[int, int]:
    """N or A:B."""
    first, colon, last = text.partition(":")
    return (int(first), int(last)) if colon else int(text)


def main(words: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit status. Raises SystemExit(2) for wrong usage."""
    options = parser().parse_args(words)
    try:
        run(
            options.name,
            options.out,
            seeds=options.seeds,
            workers=options.workers,
            quick=options.quick,
            epochs=options.epochs,
            trainings=options.trainings,
            kept=options.kept,
            engine=options.engine,
            address=options.address,
            tell=lambda text: print(text, file=sys.stderr, flush=True),
        )
    except ScenegenError as error:
        print(render_all(error.diagnostics, color=False), file=sys.stderr)
        return 1
    except KeyboardInterrupt as error:
        print(str(error) or "interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
