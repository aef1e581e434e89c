"""`scenegen experiment`: the paper's tables and figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def experiment(
    name: Annotated[
        str,
        typer.Argument(
            help="semantics, exp1, exp2, exp3, rejection, space, curriculum, curriculum-deep or all.",
            metavar="NAME",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="The folder for the reports.", metavar="DIR", show_default=False)],
    seeds: Annotated[
        int | None,
        typer.Option(
            "--seeds", help="Trainings of each: seeds 0, 1, ...; default: 3, curriculum 5.", show_default=False
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", help="Processes that train; default: one per core.", show_default=False)
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Tiny settings, to see that it works; the figures mean nothing.")
    ] = False,
) -> None:
    """Repeat an experiment of the paper with every model and sampler, and write a report with its figures.

    \b
      scenegen experiment semantics --out reports
      scenegen experiment exp1 --out reports
      scenegen experiment all --out reports --seeds 1

    A report is NAME.md, NAME.json and PNG files. Trained models are kept in DIR/trained and used again, so what is
    broken off goes on where it was. Needs the extra `experiments` (matplotlib, scikit-learn, numba,
    stable-baselines3). On two cores these take about

    \b
      semantics  10 seconds  phi while a mug moves round a plate
      exp1       20 minutes  a mug to the upper left of a plate, two labels
      exp2       20 minutes  a table set for one, rare
      exp3       70 minutes  3, 5 and 7 blocks in order
      rejection   2 minutes  draws per scene, by every sampler
      space       1 minute   look-up tables against networks and specs
      curriculum  15 minutes  Q-learning with scenes by phi
      curriculum-deep  10 minutes  two and four objects, learnt by PPO
    """
    from scenegen.cli.output import print_error
    from scenegen.experiments.run import run

    run(name, out, seeds=seeds, workers=workers, quick=quick, tell=print_error)
