"""Runs that are kept: a record that says what is asked for is not made again."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, FiniteFloat

from experiments.cache import Cache, Request
from experiments.deep.heldout import SEED, random_scenes, success
from experiments.deep.learner import NETWORK, SETTINGS, make_learner
from experiments.deep.lessons import LESSONS, MODEL, Lesson
from experiments.deep.tasks import FULL, QUICK, TASKS, Effort, Task
from experiments.errors import CHANGED_RECORD
from experiments.trained import Training, find
from scenegen.errors import DataError
from scenegen.learn.model import Model
from scenegen.learn.training.config import make_config
from scenegen.play.environments.library import forget
from scenegen.play.environments.tabletop import TableTopVector
from scenegen.play.environments.wrapper import VectorCurriculum
from scenegen.processes.pool import one_thread

KIND = "flow"  # of model
RANDOM = 4096  # scenes that tell how often which phi occurs
MASTERED, IN_A_ROW = 0.99, 5  # success in so many measurements ends a run
VERSION = 2  # of the environment and of what is measured: raise it when numbers change
P = ParamSpec("P")
R = TypeVar("R")


class Record(BaseModel):
    """A finished run. `curve` has (steps, success on the held-out scenes). Seconds
    are of the CPU but for `wall`, and without those of the examinations; `ahead` is what it took to draw the library of
    scenes, `sampling` is what choosing tasks and dealing scenes took after that."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    curve: list[tuple[int, FiniteFloat]]
    episodes: int
    cpu: FiniteFloat
    wall: FiniteFloat
    ahead: FiniteFloat
    sampling: FiniteFloat


@dataclass(frozen=True, slots=True)
class Job:
    """A run: the keys of a task, a lesson and a source, and the learner's seed."""

    task: str
    lesson: str
    source: str
    seed: int
    quick: bool
    folder: str

    @property
    def what(self) -> Task:
        return TASKS[self.task]

    @property
    def how(self) -> Lesson:
        return LESSONS[self.lesson]

    @property
    def effort(self) -> Effort:
        return QUICK if self.quick else FULL

    @property
    def steps(self) -> int:
        """Of all tables together."""
        return self.effort.budget or self.what.budget

    @property
    def cache(self) -> Cache:
        return Cache(Path(self.folder))

    @property
    def name(self) -> str:
        """The readable part of the record's file name."""
        return f"deep-{self.task}-{self.lesson}-{self.source}-{self.seed}"

    @property
    def training(self) -> Training | None:
        """The model that scenes are taken from."""
        if self.source != MODEL:
            return None
        effort, options = self.effort, dict[str, Any]()
        options |= {"epochs": effort.epochs, "scenes": effort.scenes, "data": effort.data}
        return Training(f"deep-model-{self.task}", self.what.load(), make_config(KIND, seed=0, **options))

    @property
    def request(self) -> Request:
        """All that the run follows from."""
        training = self.training
        return {
            "version": VERSION,
            "task": asdict(self.what),
            "spec": self.what.load().checked.sha256,
            "lesson": [self.how.strategy, self.how.reward, self.how.settled()],
            "mastered": [MASTERED, IN_A_ROW],
            "effort": asdict(self.effort),
            "learner": [SETTINGS, NETWORK],
            "model": None if training is None else training.request,
            "seed": self.seed,
        }

    def __str__(self) -> str:
        return f"{self.what.title}: {self.how.title}, {self.source}, seed {self.seed}"


def kept(job: Job) -> Record | None:
    """What an earlier run left, if it is whole and is what is asked for."""
    return job.cache.find(job.name, job.request, Record)


def perform(job: Job) -> float:
    """Learn, and keep the record; returns CPU seconds. Raises ScenegenError, gymnasium.error.Error."""
    with one_thread():
        record = _learn(job)
    job.cache.keep(job.name, job.request, record)
    return record.cpu


def _model(job: Job) -> Model | None:
    training = job.training
    if training is None:
        return None
    found = find(job.cache, training)
    if found is None:
        raise DataError(CHANGED_RECORD(path=training.path(job.cache)))
    return found.model


def _learn(job: Job) -> Record:
    task, effort, spec = job.what, job.effort, job.what.load()
    examination, _ = random_scenes(task, effort.held_out, SEED)
    _, phi = random_scenes(task, RANDOM, SEED + 1)
    source = _model(job)
    forget()  # what a run draws is its own cost
    tables = TableTopVector(
        effort.tables,
        spec,
        moves="continuous",
        step=task.step,
        turn=task.turn,
        reward=job.how.reward,
        source=source,
        max_episode_steps=task.horizon,
        autoreset_mode="SameStep",
    )
    library = _Meter()
    space = library.timed(lambda: tables.space)()
    meter = _Meter()
    plan = job.how.make(space, job.seed, phi.tolist())
    # a strategy and starts may be any objects; only their methods are wrapped
    setattr(plan, "next_task", meter.timed(plan.next_task))  # noqa: B010
    setattr(plan, "report", meter.timed(plan.report, count=True))  # noqa: B010
    starts = tables.starts
    setattr(starts, "draw", meter.timed(starts.draw))  # noqa: B010
    learner = make_learner(VectorCurriculum(tables, plan), job.seed)

    def examined() -> float:
        def policy(seen: npt.NDArray[np.float32]) -> npt.NDArray[Any]:
            return learner.predict(seen, deterministic=True)[0]

        return success(tables.rules, examination, policy, task.horizon)

    curve, steps, cpu, wall = [(0, examined())], 0, 0.0, 0.0
    while steps < job.steps and not mastered(curve):
        began, started = time.process_time(), time.monotonic()
        learner.learn(effort.each, reset_num_timesteps=steps == 0)
        cpu, wall = cpu + time.process_time() - began, wall + time.monotonic() - started
        steps = learner.num_timesteps
        curve.append((steps, examined()))
    return Record(
        curve=curve,
        episodes=meter.counted,
        cpu=cpu,
        wall=wall,
        ahead=library.seconds,
        sampling=meter.seconds,
    )


def mastered(curve: Sequence[tuple[int, float]]) -> bool:
    """Whether there is nothing more to learn."""
    return len(curve) > IN_A_ROW and all(success >= MASTERED for _, success in curve[-IN_A_ROW:])


class _Meter:
    """CPU seconds that functions take together."""

    def __init__(self) -> None:
        self.seconds, self.counted = 0.0, 0

    def timed(self, function: Callable[P, R], count: bool = False) -> Callable[P, R]:
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            began = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                self.seconds += time.process_time() - began
                self.counted += count

        return call
