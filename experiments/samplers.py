"""Scenes without a model: the exact sampler, plain rejection, and uniform scenes that are refined."""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt

from experiments.bench import REFERENCE, Bench, Row
from experiments.measure import Array, Values, accuracy, phi_of, target
from experiments.problems import BAND, Problem
from experiments.speed import per_second
from scenegen.api.sample import sample
from scenegen.api.spec import Spec
from scenegen.learn.refine import draw, piece_generator, refine

CHUNK = 65_536
EXACT = "exact sampler (the spec alone)"
CLOSE = 1e-6  # to the wanted phi, where refinement stops


def no_model(here: Bench) -> Row:
    """Uniform scenes moved onto the wanted phi: what refinement does by itself."""
    spec, count, runs = here.spec, here.sizes.scenes, []
    wanted = target(here.problem, spec.labels, count).double()
    for seed in here.seeds:
        chance = draw(*spec.checked.box(), count, piece_generator(seed, 0))
        began = time.process_time()
        moved = refine(spec.robustness(), spec.workspace, chance, wanted, wanted - CLOSE, wanted + CLOSE).numpy()
        seconds = time.process_time() - began
        arrived = moved[:, _within(here.problem, spec, moved)]
        runs.append(here.handed(arrived, arrived.shape[1] / max(seconds, 1e-9), count))
    return Row("no model: uniform scenes, refined", tuple(runs))


def exact(here: Bench, fresh: list[Array]) -> Row:
    """What the exact sampler hands out for the range; `fresh` are its scenes (3N, n), a set per seed."""

    def draw_many() -> int:
        return len(sample(here.spec, here.problem.band, here.sizes.exact, seed=0, spread="base", workers=1))

    speed = per_second(draw_many, 1)
    size = float(len(here.spec.source.encode()))
    runs = [
        accuracy(here.problem, here.spec, rows) | here.handed(rows, speed, rows.shape[1]) | {"cpu": 0.0, "bytes": size}
        for rows in fresh
    ]
    return Row(EXACT, tuple(runs))


def plain(here: Bench) -> Row:
    """What plain rejection finds; how good that is only where it finds enough."""
    hits, seconds = plain_rejection(here.problem, here.spec, here.sizes.draws)
    speed = hits.shape[1] / seconds
    values: Values = {"handed_speed": speed, "cpu": 0.0}
    if hits.shape[1] >= here.sizes.covered:
        found = here.handed(hits, speed, hits.shape[1])
        del found["handed"]  # nothing was asked for
        values |= accuracy(here.problem, here.spec, hits) | found
    return Row("plain rejection", (values,))


def plain_rejection(problem: Problem, spec: Spec, draws: int) -> tuple[Array, float]:
    """Uniform scenes, those in the range kept: (3N, hits) and CPU seconds. Draws are rounded up to whole chunks."""
    box, kept = spec.checked.box(), []
    began = time.process_time()
    for piece in range(-(-draws // CHUNK)):
        rows = draw(*box, CHUNK, piece_generator(REFERENCE, piece)).numpy()
        kept.append(rows[:, _within(problem, spec, rows)])
    return np.concatenate(kept, axis=1), max(time.process_time() - began, 1e-9)


def _within(problem: Problem, spec: Spec, rows: Array) -> npt.NDArray[np.bool_]:
    wanted = np.array([problem.wanted[label] for label in spec.labels])[:, None]
    inside: npt.NDArray[np.bool_] = (np.abs(phi_of(spec, rows) - wanted) <= BAND).all(axis=0)
    return inside
