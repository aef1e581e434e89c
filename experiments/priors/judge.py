"""Scenes of specs with priors against plain rejection and Scenic, and what they cost: a line for each case and method.

    python -m experiments.priors.judge DIR [NAME ...] [--methods auto growth] [-n 20000] [--seed 0]
    python -m experiments.priors.judge --speed DIR [NAME ...] [--seed 0]

DIR has the scenes of `experiments.priors.truth` and of scenic_scenes.py. Bars: Kolmogorov-Smirnov distances (of
headings: Kuiper) of all coordinates and of 50 directions at most 0.02; p of the energy test above 0.01; log10 of the
probability within both 95 % intervals. Directions are those of whitened coordinates, headings as cosine and sine, so
that a difference that a spec restricts to a centimetre counts as much as a coordinate that varies over the table. Of
chains and populations, as many scenes go into the energy test as they say they are worth.

`--speed`: seconds of CPU time of 100 scenes, which is the plan's, and of 1,000 more, in one process; the same of the
spec without its priors; and of plain rejection, with phi by the same evaluator.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.metrics import energy_test
from experiments.priors.cases import CASES, Case
from experiments.priors.draws import Floats
from experiments.priors.truth import Truth, spec_of
from scenegen.api.sample import sample
from scenegen.api.scenes import SceneSet
from scenegen.errors import ScenegenError
from scenegen.learn.evaluation.fidelity import ks_distance, kuiper_distance, whiten
from scenegen.pose import THETA, axis_of
from scenegen.processes.pool import one_thread

METHODS = ("auto", "rejection", "growth", "splitting")
MOST_KS, LEAST_P = 0.02, 0.01
DIRECTIONS = 50
DIRECTION_SEED = 57
PERMUTATIONS, MOST_IN_ENERGY_TEST = 99, 5_000
FEW, MANY, IN_CROWDS = 1_000, 50_000, 5_000  # scenes of the sets that are timed
REPEATS = 3  # of which the fastest counts
PATIENCE = 250.0  # seconds for a set of scenes


@dataclass(frozen=True)
class Distances:
    """The largest Kolmogorov-Smirnov distance of a coordinate, and which; that of a direction; p of the energy test."""

    marginal: float
    row: str
    sliced: float
    energy: float

    @property
    def passes(self) -> bool:
        return max(self.marginal, self.sliced) <= MOST_KS and self.energy > LEAST_P


def compare(truth: Floats, made: Floats, names: Sequence[str], share: float, rng: np.random.Generator) -> Distances:
    """Of scenes (D, n) and (D, m); the first rows are x, y and heading of each of `names`, the others surfaces, which
    are compared with the rest. `share` says how many independent scenes one that was made is worth."""
    poses = 3 * len(names)
    found = []
    for row, (a, b) in enumerate(zip(truth, made, strict=True)):
        distance = kuiper_distance if row < poses and axis_of(row) == THETA else ks_distance
        name = f"{'xyt'[row % 3]}({names[row // 3]})" if row < poses else f"surface {row - poses + 1}"
        found.append((distance(a, b) if min(a.min(), b.min()) < max(a.max(), b.max()) else 0.0, name))
    both = whiten(np.concatenate([_points(truth, poses), _points(made, poses)])).astype(np.float64)
    directions = np.random.default_rng(DIRECTION_SEED).normal(size=(both.shape[1], DIRECTIONS))
    along = both @ directions
    n = truth.shape[1]
    sliced = max(ks_distance(along[:n, k], along[n:, k]) for k in range(DIRECTIONS))
    worth = made[:, : max(2, int(made.shape[1] * share))]
    energy = energy_test(truth[:poses], worth[:poses], rng, permutations=PERMUTATIONS, most=MOST_IN_ENERGY_TEST)
    return Distances(*max(found), sliced, energy.p)


def _points(rows: Floats, poses: int) -> Floats:
    """(n, D'): places, headings as cosine and sine, surfaces."""
    heading = rows[2:poses:3]
    return np.concatenate([rows[0:poses:3], rows[1:poses:3], np.cos(heading), np.sin(heading), rows[poses:]]).T


def rows_of(scenes: SceneSet) -> Floats:
    """Scenes as `Truth.rows` has them."""
    rows = scenes.poses.reshape(len(scenes), -1).T
    return np.ascontiguousarray(rows if scenes.on is None else np.concatenate([rows, scenes.on.T]))


def judged(folder: Path, name: str, methods: Sequence[str], n: int, seed: int) -> Iterator[list[str]]:
    """A row of the table for each method, and for Scenic where it has scenes."""
    case, truth = CASES[name], Truth.load(folder / f"{name}.npz")
    rng = np.random.default_rng([seed, *name.encode()])
    spec = spec_of(case, priors=True)
    for method in methods:
        began = time.process_time()
        try:
            made = sample(
                spec, {"task": case.phi}, n, seed=seed, method=method, spread="base", timeout=PATIENCE, workers=1,
                keep_partial=True,
            )  # fmt: skip
        except ScenegenError as error:
            yield [name, method, "none", "", "", "", "", "", str(error).splitlines()[0]]
            continue
        seconds = time.process_time() - began
        info = made.header.sampler
        share = float(str(info.get("effective_share") or 1.0))
        found = compare(truth.rows, rows_of(made), spec.objects, min(share, 1.0), rng)
        right, log10 = _agree(truth, info.get("log10_probability"), info.get("log10_error"))
        verdict = "passes" if found.passes and right else "FAILS"
        yield [name, method, f"{len(made):,}", *_cells(found), log10, f"{1e3 * seconds / len(made):.2f}", verdict]
    scenic = folder / f"{name}.scenic.npz"
    if scenic.exists():
        with np.load(scenic) as kept:
            rows, tries, seconds = kept["rows"], int(kept["tries"]), float(kept["seconds"])
        found = compare(truth.rows, rows, spec.objects, 1.0, rng)
        many = rows.shape[1]
        width = 1.96 * math.sqrt((1.0 - many / tries) / many) / math.log(10.0)
        right, log10 = _agree(truth, math.log10(many / tries), width)
        verdict = "passes" if found.passes and right else "FAILS"
        yield [name, "Scenic", f"{many:,}", *_cells(found), log10, f"{1e3 * seconds / many:.2f}", verdict]


def _cells(found: Distances) -> list[str]:
    return [f"{found.marginal:.4f} {found.row}", f"{found.sliced:.4f}", f"{found.energy:.2f}"]


def _agree(truth: Truth, log10: object, error: object) -> tuple[bool, str]:
    if log10 is None or error is None:
        return False, f"none; {truth.log10:.3f} +- {truth.error:.3f}"
    value, off = float(str(log10)), float(str(error))
    inside = abs(value - truth.log10) <= math.hypot(off, truth.error)
    return inside, f"{value:.3f} +- {off:.3f}; {truth.log10:.3f} +- {truth.error:.3f}"


def timed(folder: Path, name: str, seed: int) -> list[str]:
    """Seconds of CPU time of a small and a large set, plan and all: with priors, without, and by plain rejection."""
    case, truth = CASES[name], Truth.load(folder / f"{name}.npz")
    plain = truth.seconds / truth.rows.shape[1] if truth.tries else math.inf
    cells, passes = [name], True
    for n in (FEW, IN_CROWDS if name == "crowd" else MANY):
        ours, flat = (_seconds(case, priors, n, seed) for priors in (True, False))
        passes = passes and ours <= (3.0 if name == "crowd" else 2.0) * flat and ours <= n * plain
        cells += [f"{ours:.3f}", f"{flat:.3f}", f"{n * plain:.3f}"]
    return [*cells, "passes" if passes else "FAILS"]


def _seconds(case: Case, priors: bool, n: int, seed: int) -> float:
    spec, best = spec_of(case, priors=priors), math.inf
    for _ in range(REPEATS):
        began = time.process_time()
        made = sample(spec, {"task": case.phi}, n, seed=seed, spread="base", timeout=PATIENCE, workers=1)
        assert len(made) == n
        best = min(best, time.process_time() - began)
    return best


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", default=[*CASES])
    parser.add_argument("--methods", nargs="+", default=METHODS)
    parser.add_argument("-n", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", action="store_true")
    given = parser.parse_args()
    head = ["case", "method", "scenes", "KS", "sliced KS", "energy p", "log10 P; of plain rejection", "s / 1,000", ""]
    if given.speed:
        few, many = f"{FEW:,}", f"{MANY:,}"
        head = ["case", few, "without priors", "plain rejection", many, "without priors", "plain rejection", ""]
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}", flush=True)
    with one_thread():
        if given.speed:
            timed(given.folder, given.names[0], given.seed)  # imports are not what is measured
        for name in given.names:
            lines = (
                [timed(given.folder, name, given.seed)]
                if given.speed
                else judged(given.folder, name, given.methods, given.n, given.seed)
            )
            for line in lines:
                print(f"| {' | '.join(line)} |", flush=True)


if __name__ == "__main__":
    main()
