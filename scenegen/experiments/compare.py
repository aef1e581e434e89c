"""One problem, every way to get scenes for it: what was there before, our models by both recipes, our samplers."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from scenegen.api.sample import sample
from scenegen.api.spec import Spec
from scenegen.api.train import Model
from scenegen.errors import RequestError
from scenegen.experiments.crew import trained
from scenegen.experiments.known import KNOWN, Known
from scenegen.experiments.measure import (
    Array,
    Values,
    accuracy,
    covered,
    in_range,
    phi_of,
    rows_of,
    shares,
    target,
)
from scenegen.experiments.plan import Plan
from scenegen.experiments.problems import BAND, Problem
from scenegen.experiments.speed import model_speed, one_thread, per_second
from scenegen.experiments.training_data import data_source, training_rows
from scenegen.experiments.trainings import Trained
from scenegen.experiments.variants import VARIANTS
from scenegen.metrics.training import training_distances
from scenegen.sampling.base import draw, piece_generator
from scenegen.sampling.refine import refine

REFERENCE, FRESH, RAW = 99, 100, 1000  # where the seeds of the truth, of more truth and of the models' noise begin
CHUNK = 65_536
EXACT = "exact sampler (the spec alone)"


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the tables: one set of values per seed. `family` is a model's name, `recipe` its recipe."""

    name: str
    runs: tuple[Values, ...]
    family: str = ""
    recipe: str = ""


@dataclass(frozen=True, slots=True)
class Comparison:
    """The rows; of the first seed the models, their raw output and their training scenes, by the variant's name; and
    scenes of the truth, (3N, n) like all the others."""

    problem: Problem
    spec: Spec
    rows: tuple[Row, ...]
    models: Mapping[str, Model]
    raw: Mapping[str, Array]
    training: Mapping[str, Array]
    truth: Array


def compare(plan: Plan, problem: Problem) -> Comparison:
    """Train what is missing, and measure everything. Raises ScenegenError."""
    spec, sizes = problem.load(), plan.sizes
    found = trained(plan, problem)
    plan.tell(f"{problem.title}: measuring")
    with one_thread():
        reference = _truth(spec, problem, sizes.covered, REFERENCE)
        fresh = [_truth(spec, problem, sizes.scenes, FRESH + seed) for seed in plan.seeds]
        rows = [_known(one, spec.labels) for one in KNOWN[problem.key]]
        raw, training = {}, {}
        data_sets: dict[str, Array] = {}  # models by one recipe learn from the same scenes
        for variant in VARIANTS:
            runs = []
            for place, (seed, one) in enumerate(zip(plan.seeds, found[variant.name], strict=True)):
                output = _raw(one.model, problem, spec, sizes.scenes, seed)
                source = data_source(one.model)
                if source not in data_sets:
                    data_sets[source] = training_rows(one.model)
                data = data_sets[source]
                if not place:
                    raw[variant.name], training[variant.name] = output, data
                runs.append(_measured(plan, problem, spec, one, seed, output, data, reference, fresh[place]))
            rows.append(Row(variant.name, tuple(runs), variant.family, variant.recipe))
        rows.append(_no_model(plan, problem, spec, reference))
        rows.append(_exact(plan, problem, spec, reference, fresh))
        rows.append(_plain(plan, problem, spec, reference))
    models = {name: runs[0].model for name, runs in found.items()}
    return Comparison(problem, spec, tuple(rows), models, raw, training, fresh[0])


def _truth(spec: Spec, problem: Problem, count: int, seed: int) -> Array:
    return rows_of(sample(spec, problem.band, count, seed=seed, spread="base", workers=1))


def _known(one: Known, labels: tuple[str, ...]) -> Row:
    values: Values = {}
    for label, (mean, std) in zip(labels, one.error, strict=False):
        values |= {f"mean:{label}": mean, f"std:{label}": std}
    values |= {f"error:{label}": error for label, error in zip(labels, one.absolute, strict=False)}
    for key, value in (("within", one.within), ("coverage", one.coverage), ("speed", one.speed)):
        if value is not None:
            values[key] = value
    return Row(one.name, (values,), one.family)


def _raw(model: Model, problem: Problem, spec: Spec, count: int, seed: int) -> Array:
    wanted = target(problem, spec.labels, count)
    return model.trained.propose(wanted, torch.Generator().manual_seed(RAW + seed)).double().numpy()


def _measured(
    plan: Plan,
    problem: Problem,
    spec: Spec,
    one: Trained,
    seed: int,
    output: Array,
    data: Array,
    reference: Array,
    fresh: Array,
) -> Values:
    sizes = plan.sizes
    near, near_truth = (
        training_distances(rows[:, : sizes.covered], data, levels=(0.5,)).quantiles[0] for rows in (output, fresh)
    )
    values = accuracy(problem, spec, output) | shares(problem, output, "raw")
    values |= {"coverage": covered(reference, output), "near": near, "near_truth": near_truth}
    began = time.process_time()
    handed = _handed_out(one.model, problem, sizes.scenes, seed, sizes.patience)
    seconds = time.process_time() - began
    values |= shares(problem, handed, "handed")
    return values | {
        "handed": handed.shape[1] / sizes.scenes,
        "handed_in_range": in_range(problem, spec, handed),
        "handed_coverage": covered(reference, handed),
        "handed_speed": handed.shape[1] / max(seconds, 1e-9),
        "speed": model_speed(one.model, target(problem, spec.labels, sizes.batch), sizes.repeats),
        "bytes": float(one.size),
        "cpu": one.cpu_seconds,
    }


def _handed_out(model: Model, problem: Problem, count: int, seed: int, patience: float) -> Array:
    """What scenegen hands out for the range: (3N, n), n = 0 where it finds none in time."""
    try:
        found = sample(model, problem.band, count, seed=seed, spread="base", timeout=patience, keep_partial=True)
    except RequestError:
        return np.empty((3 * len(model.spec.objects), 0))
    return rows_of(found)


def _no_model(plan: Plan, problem: Problem, spec: Spec, reference: Array) -> Row:
    """Uniform scenes moved onto the wanted phi: what refinement does by itself."""
    sizes, runs = plan.sizes, []
    wanted = target(problem, spec.labels, sizes.scenes).double()
    for seed in plan.seeds:
        chance = draw(*spec.checked.box(), sizes.scenes, piece_generator(seed, 0))
        began = time.process_time()
        moved = refine(spec.robustness(), spec.workspace, chance, wanted, wanted - 1e-6, wanted + 1e-6).numpy()
        seconds = time.process_time() - began
        arrived = moved[:, _within(problem, spec, moved)]
        runs.append(
            {
                "handed": arrived.shape[1] / sizes.scenes,
                "handed_in_range": in_range(problem, spec, arrived),
                "handed_coverage": covered(reference, arrived),
                "handed_speed": arrived.shape[1] / max(seconds, 1e-9),
            }
            | shares(problem, arrived, "handed")
        )
    return Row("no model: uniform scenes, refined", tuple(runs))


def _exact(plan: Plan, problem: Problem, spec: Spec, reference: Array, fresh: list[Array]) -> Row:
    def draw_many() -> int:
        return len(sample(spec, problem.band, plan.sizes.exact, seed=0, spread="base", workers=1))

    speed = per_second(draw_many, 1)
    runs = [
        accuracy(problem, spec, rows)
        | shares(problem, rows, "handed")
        | {
            "handed": 1.0,
            "handed_in_range": in_range(problem, spec, rows),
            "handed_coverage": covered(reference, rows),
            "handed_speed": speed,
            "cpu": 0.0,
            "bytes": float(len(spec.source.encode())),
        }
        for rows in fresh
    ]
    return Row(EXACT, tuple(runs))


def _plain(plan: Plan, problem: Problem, spec: Spec, reference: Array) -> Row:
    hits, seconds = plain_rejection(problem, spec, plan.sizes.draws)
    values: Values = {"handed_speed": hits.shape[1] / seconds, "cpu": 0.0}
    if hits.shape[1] >= plan.sizes.covered:
        values |= accuracy(problem, spec, hits) | shares(problem, hits, "handed")
        values |= {"handed_in_range": in_range(problem, spec, hits), "handed_coverage": covered(reference, hits)}
    return Row("plain rejection", (values,))


def plain_rejection(problem: Problem, spec: Spec, draws: int) -> tuple[Array, float]:
    """Uniform scenes, those in the range kept: (3N, hits) and CPU seconds. Draws are rounded up to whole chunks."""
    box, kept = spec.checked.box(), []
    began = time.process_time()
    for piece in range(-(-draws // CHUNK)):
        rows = draw(*box, CHUNK, piece_generator(REFERENCE, piece))
        kept.append(rows.numpy()[:, _within(problem, spec, rows.numpy())])
    hits = np.concatenate(kept, axis=1)
    return hits, max(time.process_time() - began, 1e-9)


def _within(problem: Problem, spec: Spec, rows: Array) -> npt.NDArray[np.bool_]:
    wanted = np.array([problem.wanted[label] for label in spec.labels])[:, None]
    inside: npt.NDArray[np.bool_] = (np.abs(phi_of(spec, rows) - wanted) <= BAND).all(axis=0)
    return inside
