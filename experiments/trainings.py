"""The trainings of the experiments that compare models: every variant, on every problem, with every seed."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from experiments.cache import Cache
from experiments.errors import CHANGED_RECORD
from experiments.jobs import share
from experiments.plan import FULL, QUICK, Plan
from experiments.problems import PROBLEMS, Problem
from experiments.trained import Trained, Training, find, train_now
from experiments.variants import VARIANTS, Variant
from scenegen.errors import DataError


@dataclass(frozen=True, slots=True)
class Job:
    """A training: the key of a problem, the place of a variant in VARIANTS, a seed, the folder of the cache."""

    problem: str
    variant: int
    seed: int
    quick: bool
    folder: str

    @property
    def what(self) -> Variant:
        return VARIANTS[self.variant]

    @property
    def cache(self) -> Cache:
        return Cache(Path(self.folder))

    @property
    def training(self) -> Training:
        """What is trained; variants that differ in their steps share it."""
        problem, sizes = PROBLEMS[self.problem], QUICK if self.quick else FULL
        name = f"{self.problem}-{self.what.family}-{self.what.recipe}-{self.seed}"
        return Training(name, problem.load(), self.what.config(problem, sizes, self.seed))

    @property
    def path(self) -> Path:
        """The model file."""
        return self.training.path(self.cache)

    def __str__(self) -> str:
        return f"{PROBLEMS[self.problem].title}: {self.what.name}, seed {self.seed}"


def kept(job: Job) -> Trained | None:
    """What an earlier run left, in the variant's steps."""
    found = find(job.cache, job.training)
    if found is None or job.what.steps is None:
        return found
    return dataclasses.replace(found, model=found.model.in_steps(job.what.steps))


def perform(job: Job) -> float:
    """Train, and keep the model; returns CPU seconds. Raises ScenegenError."""
    return train_now(job.cache, job.training)


def trained(plan: Plan, problem: Problem) -> dict[str, list[Trained]]:
    """Every variant by name, a training per seed: what is kept already, and the rest trained now. Raises
    ScenegenError."""
    folder = str(plan.cache().folder)
    jobs = [Job(problem.key, place, seed, plan.quick, folder) for place in range(len(VARIANTS)) for seed in plan.seeds]
    files = {job.path: job for job in reversed(jobs)}  # one training for all variants that share a file
    missing = [job for job in files.values() if kept(job) is None]
    if len(missing) < len(files):
        plan.tell(f"{problem.title}: {len(files) - len(missing)} of {len(files)} models are there from an earlier run")
    if missing:
        share(list(reversed(missing)), plan, perform, "trained")
    return {
        variant.name: [_whole(job) for job in jobs if job.variant == place] for place, variant in enumerate(VARIANTS)
    }


def _whole(job: Job) -> Trained:
    found = kept(job)
    if found is None:
        raise DataError(CHANGED_RECORD(path=job.path))
    return found
