"""Carrying out experiments, one after the other, each written as soon as it is done."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

from experiments.cache import FOLDER
from experiments.charts import check_libraries
from experiments.errors import NOT_A_QUICK_RUN
from experiments.plan import Plan
from experiments.report import write
from experiments.table import chosen
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.needs import need
from scenegen.processes.process import cores
from scenegen.scenes.files import ensure_folder

MOST_SEEDS = 100


def run(
    name: str,
    out: Path,
    *,
    seeds: int | tuple[int, int] | None = None,
    workers: int | None = None,
    quick: bool = False,
    epochs: int | None = None,
    trainings: int = 1,
    kept: bool = False,
    engine: str = "local",
    address: str | None = None,
    tell: Callable[[str], None] = lambda text: None,
) -> None:
    """Carry out an experiment, or `all`, and write the reports into the folder `out` (made if its parent is there).

    Models are trained with the seeds 0 to `seeds` - 1, or from the first to below the second of two numbers, by default
    those that the table says, on `workers` processes, by default one per core, unless the cache in `out` holds them.
    `epochs`, `trainings` and `kept` (see Plan) are for random specs alone; `engine` and `address` say where trainings
    run. `tell` is told what happens. A training that fails does not stop the others: ScenegenError names it at the end.
    Raises RequestError for an unknown name, for numbers out of range, for a quick run among the reports of real ones
    and where matplotlib, scikit-learn or torch is missing, OutputError where something cannot be written;
    KeyboardInterrupt with words on how to go on.
    """
    entries = chosen(name)
    between = (0, seeds) if isinstance(seeds, int) else seeds
    if between is not None and (between[0] < 0 or not 1 <= between[1] - between[0] <= MOST_SEEDS):
        raise RequestError(OUT_OF_RANGE(argument="seeds", value=seeds, wanted=f"from 1 to {MOST_SEEDS}"))
    if not 1 <= trainings <= MOST_SEEDS:
        raise RequestError(OUT_OF_RANGE(argument="trainings", value=trainings, wanted=f"from 1 to {MOST_SEEDS}"))
    if workers is not None and workers < 1:
        raise RequestError(OUT_OF_RANGE(argument="workers", value=workers, wanted="1 or more"))
    if engine != "local" or address is not None:
        from scenegen.sampling.engine.engines import check_engine

        check_engine(engine, address)
    need("torch", "for experiments")
    check_libraries()
    if quick:
        for which in entries:
            _check_quick(out / f"{which}.json")
    ensure_folder(out)
    for which, entry in entries.items():
        named = tuple(range(*(between or (entry.first, entry.seeds))))
        plan = Plan(out, named, quick, workers or cores(), tell, epochs, trainings, kept, engine, address)
        if not quick:
            told = f"about {entry.time} on two cores with {entry.seeds - entry.first} seeds, less what is kept"
            tell(f"{which}: {entry.about}; {told}")
        began = time.monotonic()
        try:
            files = write(plan, entry.run(plan))
        except KeyboardInterrupt as error:
            again = f"interrupted; the same command goes on with what is in {out / FOLDER}"
            raise KeyboardInterrupt(again) from error
        tell(f"{which}: wrote {', '.join(files)} in {out} ({(time.monotonic() - began) / 60.0:.1f} min)")


def _check_quick(path: Path) -> None:
    """Refuse to replace the numbers of a real run by those of a quick one. Raises RequestError."""
    try:
        real = json.loads(path.read_bytes()).get("quick") is False
    except (OSError, ValueError, AttributeError):
        return  # no report
    if real:
        raise RequestError(NOT_A_QUICK_RUN(path=path))
