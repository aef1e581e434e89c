"""One problem, every way to get scenes for it: what was there before, our models by both recipes, our samplers."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch

from experiments.bench import Bench, Row, bench, truth
from experiments.known import KNOWN, Known
from experiments.measure import Array, Values, accuracy, rows_of, shares, target
from experiments.metrics import training_distances
from experiments.plan import Plan
from experiments.problems import Problem
from experiments.samplers import exact, no_model, plain
from experiments.speed import model_speed
from experiments.trained import Trained
from experiments.training_data import data_source, training_rows
from experiments.trainings import trained
from experiments.variants import VARIANTS
from scenegen.api.sample import sample
from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.learn.evaluation.fidelity import fidelity
from scenegen.learn.model import ANY, Model, load_model
from scenegen.learn.models.card import depends_on
from scenegen.learn.models.graph_flow import WEIGHTS
from scenegen.pose import row_count
from scenegen.processes.pool import one_thread

FRESH, RAW = 100, 1000  # where the seeds of fresh truth and of the models' noise begin


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
    found = trained(plan, problem)
    plan.tell(f"{problem.title}: measuring")
    with one_thread():
        here = bench(plan, problem)
        fresh = [truth(here.spec, problem, plan.sizes.scenes, FRESH + seed) for seed in plan.seeds]
        rows = [_known(one, here.spec.labels) for one in KNOWN[problem.key]]
        raw: dict[str, Array] = {}
        training: dict[str, Array] = {}
        data_sets: dict[str, Array] = {}  # models by one recipe learn from the same scenes
        for variant in VARIANTS:
            runs = []
            for seed, one, true in zip(plan.seeds, found[variant.name], fresh, strict=True):
                source = data_source(one.model)
                if source not in data_sets:
                    data_sets[source] = training_rows(one.model)
                output = _raw(here, one.model, seed)
                raw.setdefault(variant.name, output)
                training.setdefault(variant.name, data_sets[source])
                near = _near(here, output, true, data_sets[source])
                runs.append(near | _measured(here, one, output, seed))
            rows.append(Row(variant.name, tuple(runs), variant.family, variant.recipe))
        untrained = Trained(load_model(ANY, here.spec), WEIGHTS.stat().st_size, 0.0)
        drawn = [_raw(here, untrained.model, seed) for seed in plan.seeds]
        runs = [_measured(here, untrained, *one) for one in zip(drawn, plan.seeds, strict=True)]
        found[ANY], raw[ANY] = [untrained], drawn[0]
        rows += [Row(ANY, tuple(runs), ANY, "default"), no_model(here), exact(here, fresh), plain(here)]
    models = {name: runs[0].model for name, runs in found.items()}
    return Comparison(problem, here.spec, tuple(rows), models, raw, training, fresh[0])


def _known(one: Known, labels: tuple[str, ...]) -> Row:
    values: Values = {}
    for label, (mean, std) in zip(labels, one.error, strict=False):
        values |= {f"mean:{label}": mean, f"std:{label}": std}
    values |= {f"error:{label}": error for label, error in zip(labels, one.absolute, strict=False)}
    for key, value in (("within", one.within), ("coverage", one.coverage), ("speed", one.speed)):
        if value is not None:
            values[key] = value
    return Row(one.name, (values,), one.family)


def _raw(here: Bench, model: Model, seed: int) -> Array:
    wanted = target(here.problem, here.spec.labels, here.sizes.scenes)
    return model.trained.propose(wanted, torch.Generator().manual_seed(RAW + seed)).double().numpy()


def _measured(here: Bench, one: Trained, output: Array, seed: int) -> Values:
    """Of a model and its raw scenes (3N, n)."""
    return _quality(here, output) | _handed(here, one.model, seed) | _cost(here, one)


def _quality(here: Bench, output: Array) -> Values:
    """Of raw scenes (3N, n)."""
    values = accuracy(here.problem, here.spec, output) | shares(here.problem, output, "raw")
    some = output[:, : here.sizes.covered]
    found = fidelity(here.reference, some, depends_on(here.spec.checked.core))
    values |= {"sliced": found.sliced, "energy": found.energy}
    return values | {"coverage": here.covered(output), "ks": here.distance(output)}


def _near(here: Bench, output: Array, true: Array, data: Array) -> Values:
    """The median distance of raw scenes, and of fresh true ones, to the nearest training scene."""
    distances = [
        training_distances(rows[:, : here.sizes.covered], data, levels=(0.5,)).quantiles[0] for rows in (output, true)
    ]
    return dict(zip(("near", "near_truth"), distances, strict=True))


def _handed(here: Bench, model: Model, seed: int) -> Values:
    """Of what scenegen hands out for the range: nothing where it finds none in time."""
    count = here.sizes.scenes
    began = time.process_time()
    try:
        found = sample(
            model,
            here.problem.band,
            count,
            seed=seed,
            spread="base",
            timeout=here.sizes.patience,
            keep_partial=True,
        )
        rows = rows_of(found)
    except RequestError:
        rows = np.empty((row_count(len(model.spec.objects)), 0))
    return here.handed(rows, rows.shape[1] / max(time.process_time() - began, 1e-9), count)


def _cost(here: Bench, one: Trained) -> Values:
    wanted = target(here.problem, here.spec.labels, here.sizes.batch)
    speed = model_speed(one.model, wanted, here.sizes.repeats)
    return {"speed": speed, "bytes": float(one.size), "cpu": one.cpu_seconds}
