"""Scenes of each case by plain rejection from its prior, kept in DIR for the judge; of the crowd, by its own chains.

    python -m experiments.priors.truth DIR [NAME ...] [--scenes 100000] [--seconds 180] [--seed 0]

Only phi is scenegen's; nothing of it draws. One file NAME.npz each: `rows`, (D, n): x, y and heading of each object and
then, numbered from 1, the surfaces of those that have a choice; `log10` of the probability of range and requirement,
and `error`, half of its 95 % interval; `tries`, `seconds` of CPU time.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.priors.cases import CASES, Case
from experiments.priors.draws import Bools, Draws, Floats
from scenegen.api.spec import Spec, load, parse
from scenegen.geometry.namespace import NUMPY
from scenegen.lang.formula.core import gate
from scenegen.lang.formula.interpret import phi
from scenegen.pose import row_count, row_of

CHUNK = 32_768  # scenes scored at a time, so that they stay in cache
NORMAL = 1.96  # standard deviations to either side: a 95 % interval


@dataclass(frozen=True)
class Truth:
    """See the module."""

    rows: Floats
    log10: float
    error: float
    tries: int
    seconds: float

    def save(self, path: Path) -> None:
        np.savez_compressed(
            path, rows=self.rows, log10=self.log10, error=self.error, tries=self.tries, seconds=self.seconds
        )

    @classmethod
    def load(cls, path: Path) -> Truth:
        with np.load(path) as found:
            return cls(
                found["rows"], float(found["log10"]), float(found["error"]), int(found["tries"]),
                float(found["seconds"]),
            )  # fmt: skip


def spec_of(case: Case, *, priors: bool) -> Spec:
    """The case's spec, with its number of blocks. Raises SpecError."""
    spec = load(case.path) if priors else parse(case.uniform_text, f"{case.spec} without priors")
    return spec if case.count is None else spec.with_counts({"block": case.count})


def plain_rejection(case: Case, scenes: int, seconds: float, seed: int) -> Truth:
    """So many scenes, or as many as are found in the seconds of CPU time."""
    spec = spec_of(case, priors=False)
    rng = np.random.default_rng([seed, *case.spec.encode(), case.count or 0])
    kept: list[Floats] = []
    tries = found = 0
    began = time.process_time()
    while found < scenes and time.process_time() - began < seconds:
        drawn = case.draw(Draws(rng, CHUNK))
        rows = np.array([one for (x, y), heading in drawn.poses for one in (x, y, heading)])
        surfaces = np.array([*(drawn.surfaces or {}).values()]).reshape(-1, CHUNK)
        fits = fit(spec, rows, surfaces, case.phi)
        kept.append(np.concatenate([rows, surfaces + 1.0])[:, fits])
        tries, found = tries + CHUNK, found + int(fits.sum())
    share = found / tries
    error = NORMAL * math.sqrt((1.0 - share) / max(found, 1)) / math.log(10.0)
    log10 = math.log10(max(found, 1) / tries * case.probability_of_surfaces)
    return Truth(np.concatenate(kept, axis=1), log10, error, tries, time.process_time() - began)


def fit(spec: Spec, rows: Floats, surfaces: Floats, wanted: tuple[float, float]) -> Bools:
    """Which scenes, rows (3N, n), have phi of `task` in the range and meet the requirement; `surfaces` (M, n), from 0,
    of the objects with choices."""
    checked = spec.checked
    core = gate(checked.core)
    full = np.zeros((row_count(len(core.objects)), rows.shape[1]))
    full[: len(rows)] = rows
    for choice, numbers in zip(checked.choices.values(), surfaces, strict=True):
        full[row_of(choice.switch, 0)] = np.array(choice.middles)[numbers.astype(int)]
    values = phi(core, list(full), NUMPY)
    task = values.pop("task")
    found: Bools = checked.workspace.contains(full) & (task >= wanted[0]) & (task <= wanted[1])
    for margin in values.values():
        found &= margin >= 0.0
    return found


# Ten cans, of which plain rejection finds none: objects are placed one by one in a population, of which those survive
# in which the next one fits; then chains forget that some of them are copies.
RADIUS = 0.1128
PLACE, DEVIATION = (0.3, 0.4), 0.005
POPULATIONS, POPULATION = 8, 12_500
SWEEPS, LAST_SWEEPS = 30, 100
STEP = 0.06  # metres, of half of the moves; the other half is drawn from the prior


def crowd(wanted: tuple[float, float], seed: int) -> Truth:
    """100,000 scenes of `crowd`; the probability is the product of the shares in which the next can fits, its error
    from the scatter of independent populations."""
    began = time.process_time()
    runs = [_population(wanted, np.random.default_rng([seed, run])) for run in range(POPULATIONS)]
    logs = np.array([log10 for _, log10 in runs])
    error = 2.365 * float(logs.std(ddof=1)) / math.sqrt(POPULATIONS)  # Student's t with 7 degrees of freedom
    places = np.concatenate([places for places, _ in runs], axis=2)
    cans, _, n = places.shape
    circle = np.random.default_rng([seed, POPULATIONS]).uniform(0.0, math.tau, (cans, 1, n))
    rows = np.concatenate([places, circle], axis=1).reshape(3 * cans, n)
    return Truth(rows, float(logs.mean()), error, 0, time.process_time() - began)


def _population(wanted: tuple[float, float], rng: np.random.Generator) -> tuple[Floats, float]:
    """Places (10, 2, n), and log10 of the probability."""
    places = np.empty((0, 2, POPULATION))
    log10 = 0.0
    for can in range(10):
        grown = np.concatenate([places, _from_prior(can, POPULATION, rng)[None]])
        fits = _fits(grown, can, wanted)
        log10 += math.log10(fits.mean())
        places = grown[:, :, rng.choice(np.flatnonzero(fits), POPULATION)]
        for _ in range(LAST_SWEEPS if can == 9 else SWEEPS):
            for moved in range(can + 1):
                _move(places, moved, wanted, rng)
    order = rng.permuted(np.tile(np.arange(8)[:, None], POPULATION), axis=0)  # all but the first two are alike
    places[2:] = np.take_along_axis(places[2:], order[:, None], axis=0)
    return places, log10


def _from_prior(can: int, n: int, rng: np.random.Generator) -> Floats:
    draws = Draws(rng, n)
    return np.array(draws.normal(*PLACE, DEVIATION) if can == 0 else draws.anywhere())


def _fits(places: Floats, can: int, wanted: tuple[float, float]) -> Bools:
    """Whether the can is in the workspace and clear of the others, and the first two are as far apart as asked for."""
    apart = np.hypot(*(places - places[can]).transpose(1, 0, 2))
    found: Bools = (np.abs(places[can] - 0.5) <= 0.5 - RADIUS).all(axis=0)
    found &= (np.delete(apart, can, axis=0) >= 2.0 * RADIUS).all(axis=0)
    if can < 2 and len(places) > 1:
        found &= (apart[1 - can] >= 0.4 - wanted[1]) & (apart[1 - can] <= 0.4 - wanted[0])
    return found


def _move(places: Floats, can: int, wanted: tuple[float, float], rng: np.random.Generator) -> None:
    """A Metropolis step of one can in all scenes, in place."""
    n = places.shape[2]
    was = places[can].copy()
    to = _from_prior(can, n, rng)
    if can and rng.random() < 0.5:  # the prior is flat there
        to = was + rng.normal(0.0, STEP, was.shape)
    places[can] = to
    back = ~_fits(places, can, wanted)
    places[can][:, back] = was[:, back]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", default=[*CASES])
    parser.add_argument("--scenes", type=int, default=100_000)
    parser.add_argument("--seconds", type=float, default=180.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in given.names:
        case = CASES[name]
        if name == "crowd":
            found = crowd(case.phi, given.seed)
        else:
            found = plain_rejection(case, given.scenes, given.seconds, given.seed)
        found.save(given.folder / f"{name}.npz")
        n = found.rows.shape[1]
        print(
            f"{name}: {n} scenes in {found.seconds:.0f} s, log10 P {found.log10:.4f} +- {found.error:.4f}", flush=True
        )


if __name__ == "__main__":
    main()
