"""What a unit of counted work takes on this machine: the constants of `scenegen/search/effort.py`.

    python benchmarks/units.py [--only NAME ...] [--limit 12]

Over the shipped specs and `benchmarks/tables`, at phi >= 0 of every label, in nanoseconds of CPU: `bound`, for a unit
of bounds and planning; `draw`, for a candidate of rejection; `grow`, for an evaluation of growth; `move`, for a unit of
scoring a scene that a chain moves to. What is behind `draw` and `grow` is fitted over all specs (least squares of the
relative errors). Each spec is a process of its own, ended after `--limit` CPU seconds: what it has not measured by then
is left out.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import statistics
import sys
import time
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.resources import shipped_specs
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rejection.sampler import make_plan, work_of
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.splitting.chain_state import ChainTape, chain_state_of
from scenegen.sampling.splitting.chains import Chains
from scenegen.sampling.splitting.sampler import MAX_CHAINS, generator
from scenegen.sampling.splitting.tuning import Tuner
from scenegen.search.effort import MOVE_WORK, Budget, work_per_scene

HERE = Path(__file__).resolve().parent
KINDS = {"bound": ["BOUNDED"], "draw": ["SCORED", "CALLED", "DRAWN"], "grow": ["STEPPED", "GROWN"], "move": ["MOVED"]}
SINGLE = "bound", "move"
LEAST = 0.1  # CPU seconds of a measurement


def measures(text: str) -> Iterator[tuple[str, float, list[float]]]:
    """Kinds, seconds, and what was counted meanwhile."""
    spec = check_text(text)
    problem = make_problem(spec, SampleRequest({label: Range(0.0) for label in spec.labels}, n=1000))
    each, _ = work_per_scene(problem.core.nodes)
    state = Chains.start(
        chain_state_of(problem), ChainTape(chain_state_of(problem)), problem.cells, MAX_CHAINS, generator(0, -1)
    )
    begun, before = time.process_time(), state.evaluations
    with np.errstate(all="ignore"):
        while time.process_time() - begun < LEAST:
            state.run(16, Tuner(state).tuning())
    yield "move", time.process_time() - begun, [(state.evaluations - before) * (each + MOVE_WORK)]
    begun = time.process_time()
    grown = plan_growth(problem, Budget(math.inf), patient=False)
    if isinstance(grown, Growth):
        taken, machine = time.process_time() - begun, grown.model
        yield "grow", taken / machine.work, [machine.steps_done / machine.work, each]
    begun = time.process_time()
    try:
        trial = make_trial(problem, Budget(math.inf))
    except RequestError:
        return
    yield "bound", time.process_time() - begun, [trial.work]
    if not trial.rate.hits:
        return
    plan = make_plan(problem, Budget(math.inf), trial)
    begun, pieces = time.process_time(), 0
    while time.process_time() - begun < LEAST:
        plan.draw(pieces)
        pieces += 1
    moving = np.count_nonzero(problem.lowest < problem.highest)
    yield "draw", (time.process_time() - begun) / (pieces * plan.candidates), [*work_of(plan), moving]


def in_a_process(text: str, limit: int) -> dict[str, tuple[float, list[float]]]:
    """What a process measures within a limit of CPU seconds, by kind."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        try:
            for kind, seconds, counted in measures(text):
                os.write(write, (json.dumps([kind, seconds, list(map(float, counted))]) + "\n").encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        lines = pipe.read().splitlines()
    os.waitpid(child, 0)
    return {kind: (seconds, counted) for kind, seconds, counted in map(json.loads, lines)}


def main() -> None:
    """Prints a line for each spec, then the constants."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--limit", type=int, default=12)
    options = parser.parse_args()
    texts = {name: path.read_text(encoding="utf-8") for name, path in shipped_specs().items()}
    texts |= {path.stem: path.read_text(encoding="utf-8") for path in sorted((HERE / "tables").glob("*.spec"))}
    found: dict[str, list[tuple[float, list[float]]]] = {kind: [] for kind in KINDS}
    print(f"{'':26}" + "".join(f"{kind:>10}" for kind in KINDS))
    for name, text in texts.items():
        if options.only and name not in options.only:
            continue
        mine = in_a_process(text, options.limit)
        for kind, measured in mine.items():
            found[kind].append(measured)
        shown = {
            kind: 1e9 * seconds / (counted[0] if kind in SINGLE else 1.0) for kind, (seconds, counted) in mine.items()
        }
        print(
            f"{name:26}" + "".join(f"{shown[kind]:10.1f}" if kind in shown else f"{'':10}" for kind in KINDS),
            flush=True,
        )
    print("\nseconds of CPU:")
    for kind, names in KINDS.items():
        if found[kind]:
            print(*(f"{name} {value:.2g}" for name, value in zip(names, _fitted(found[kind]), strict=True)), sep=", ")


def _fitted(measured: list[tuple[float, list[float]]]) -> list[float]:
    """What each of the things counted takes."""
    if len(measured[0][1]) == 1:
        return [statistics.median(seconds / counted[0] for seconds, counted in measured)]
    table = np.array([[count / seconds for count in counted] for seconds, counted in measured])
    return [float(one) for one in np.linalg.lstsq(table, np.ones(len(table)), rcond=None)[0]]


if __name__ == "__main__":
    sys.exit(main())
