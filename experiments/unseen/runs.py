"""A model of a random spec, trained by its default recipe and measured, and what is kept of that."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, FiniteFloat

from experiments.cache import Cache, Request
from experiments.trained import Trained, Training, ensure, find
from experiments.unseen.named import named_queries, named_spec
from experiments.unseen.patience import CpuBudget
from experiments.unseen.queries import PATIENCE, QUANTILES, SCENES, Array, Query, queries, truth
from experiments.unseen.specs import TWELVE, spec_text
from scenegen.api.request import check_request
from scenegen.api.spec import Spec, parse
from scenegen.errors import RequestError
from scenegen.learn.evaluation.card import level
from scenegen.learn.evaluation.fidelity import fidelity
from scenegen.learn.model import Model
from scenegen.learn.models.card import depends_on
from scenegen.learn.training.balanced import reach
from scenegen.learn.training.config import make_config
from scenegen.processes.pool import one_thread
from scenegen.sampling.engine.run import in_memory
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import SampleRequest

TRUTH, BATCH = 20_261_123, 65_536
LABELS = -1  # stands for the seed of the spec with twelve labels


class Row(BaseModel):
    """A query: error of phi, figures of raw scenes and of other true ones, coverage of what `sample` returns, the share
    of the raw scenes that meets what is required; `alone` are error and share of the network without its correction."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    wanted: dict[str, FiniteFloat]
    error: FiniteFloat
    coverage: FiniteFloat
    ks: FiniteFloat
    sliced: FiniteFloat
    energy: FiniteFloat
    true_coverage: FiniteFloat
    true_ks: FiniteFloat
    true_sliced: FiniteFloat
    true_energy: FiniteFloat
    required: FiniteFloat
    returned: FiniteFloat | None
    alone: tuple[FiniteFloat, FiniteFloat] | None


class Run(BaseModel):
    """A spec: what it cost, and its queries. `missing` are queries for which no truth was found, and why; `failed` says
    why there is no model. A `speed` of 0 was not measured."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int
    name: str = ""
    training_seed: int = 0
    spec: str
    objects: int
    labels: int
    rows: list[Row] = []
    missing: list[str] = []
    failed: str = ""
    cpu_seconds: FiniteFloat = 0.0
    size: int = 0
    speed: FiniteFloat = 0.0


@dataclass(frozen=True, slots=True)
class Job:
    """A spec by its seed, or by its name in NAMED; a model by its name, the folder of the cache, and the seed of the
    training."""

    seed: int
    model: str
    quick: bool
    folder: str
    epochs: int | None = None
    training_seed: int = 0
    named: str = ""

    @property
    def name(self) -> str:
        which = self.named or ("labels" if self.seed == LABELS else self.seed)
        return f"unseen-{which}-{self.model}" + (f"-{self.training_seed}" if self.training_seed else "")

    @property
    def spec(self) -> Spec:
        if self.named:
            return named_spec(self.named)
        return parse(TWELVE if self.seed == LABELS else spec_text(self.seed), f"{self.name}.spec")

    @property
    def training(self) -> Training:
        sizes = {"epochs": 1, "scenes": 256} if self.quick else {"epochs": self.epochs}
        return Training(self.name, self.spec, make_config(self.model, seed=self.training_seed, **sizes))

    @property
    def request(self) -> Request:
        return {**self.training.request, "scenes_compared": self.scenes, "seconds": PATIENCE}

    @property
    def scenes(self) -> int:
        return 64 if self.quick else SCENES

    def __str__(self) -> str:
        return f"spec {self.named or self.seed}, {self.model}, training seed {self.training_seed}"


def kept(job: Job) -> Run | None:
    """What an earlier run found."""
    return Cache(Path(job.folder)).find(job.name, job.request, Run)


def perform(job: Job) -> float:
    """Train and measure, row by row, what is not kept yet; returns CPU seconds. Raises ScenegenError."""
    began, cache, spec = time.process_time(), Cache(Path(job.folder)), job.spec
    objects, labels = len(spec.objects), len(spec.labels)
    done = Run(
        seed=job.seed, training_seed=job.training_seed, name=job.named, spec=spec.source, objects=objects, labels=labels
    )
    with one_thread():
        try:
            ensure(cache, job.training)
        except RequestError as error:
            cache.keep(job.name, job.request, done.model_copy(update={"failed": error.diagnostics[0].title}))
            return time.process_time() - began
        trained = find(cache, job.training)
        assert trained is not None
        rows, missing = _rows(job, cache, trained)
        cost = {"cpu_seconds": trained.cpu_seconds, "size": trained.size, "speed": speed(trained)}
    cache.keep(job.name, job.request, done.model_copy(update={"rows": rows, "missing": missing, **cost}))
    return time.process_time() - began


def _rows(job: Job, cache: Cache, trained: Trained) -> tuple[list[Row], list[str]]:
    checked = job.spec.checked
    ends = reach(checked, 0)
    missing: list[str] = []
    if job.named:
        wanted = named_queries(job.named, job.spec, ends)
    elif job.seed == LABELS:
        wanted = _pairs(job, ends)
    else:
        wanted, missing = queries(checked, ends, job.seed)
    rows = []
    for number, query in enumerate(wanted):
        name, request = f"{job.name}-row{number}", {**job.request, "wanted": dict(query.wanted)}
        row = cache.find(name, request, Row)
        if row is None:
            try:
                row = _row(job, trained, query)
            except RequestError as error:
                missing.append(f"{query}: {error.diagnostics[0].title}")
                continue
            cache.keep(name, request, row)
        rows.append(row)
    return rows, missing


def _row(job: Job, trained: Trained, query: Query) -> Row:
    """Raises RequestError where the truth is too rare."""
    checked = job.spec.checked
    rows, phi = truth(checked, query, 2 * job.scenes, TRUTH)
    found = level(trained.model, query.wanted, rows, phi)
    try:
        given = _returned(trained.model, query, job.scenes)
        returned = fidelity(rows[:, : job.scenes], given, depends_on(checked.core)).coverage
    except RequestError:
        returned = None
    made, true = found.made, found.truth
    return Row(
        wanted=dict(query.wanted),
        error=found.error,
        coverage=made.coverage,
        ks=made.ks,
        sliced=made.sliced,
        energy=made.energy,
        true_coverage=true.coverage,
        true_ks=true.ks,
        true_sliced=true.sliced,
        true_energy=true.energy,
        required=found.required,
        returned=returned,
        alone=found.alone,
    )


def _returned(model: Model, query: Query, count: int) -> Array:
    """Scenes (3N, n) that `sample` returns, as many as it has within PATIENCE. Raises RequestError."""
    request = SampleRequest(query.ranges, count, seed=1, spread="base", keep_partial=True, workers=1)
    budget = CpuBudget(PATIENCE)
    sampled = in_memory(plan_for(model.spec.definition, check_request(model, request), budget, model), budget)
    if not sampled.count and sampled.shortfall is not None:
        raise RequestError(sampled.shortfall)
    return sampled.rows


def speed(trained: Trained) -> float:
    """Raw scenes a CPU second, at the middle of the first label's range."""
    import torch

    model = trained.model.trained
    wanted = torch.full((len(model.labels), BATCH), torch.nan if model.partial else 0.0)
    for place, (low, high) in enumerate(model.label_ranges.values()):
        if not place or not model.partial:
            wanted[place] = 0.5 * (low + high)
    took = []
    for _ in range(2):
        began = time.process_time()
        model.propose(wanted, torch.Generator().manual_seed(0))
        took.append(time.process_time() - began)
    return BATCH / min(took)


def _pairs(job: Job, ends: dict[str, tuple[float, float]]) -> list[Query]:
    """Each label alone, and twenty pairs of labels, at values that scenes have together."""
    checked, random = job.spec.checked, np.random.default_rng(0)
    half = {label: min(0.0125, 0.01 * (high - low)) for label, (low, high) in ends.items()}
    value = {label: low + QUANTILES[1] * (high - low) for label, (low, high) in ends.items()}
    found = [Query({label: value[label]}, half) for label in checked.labels]
    while len(found) < len(checked.labels) + 20:
        one, other = (checked.labels[place] for place in random.permutation(len(checked.labels))[:2])
        _, phi = truth(checked, Query({one: value[one]}, half), 16, len(found))
        found.append(Query({one: value[one], other: float(np.sort(phi[checked.labels.index(other)])[8])}, half))
    return found
