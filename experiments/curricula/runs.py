"""Carrying out cases on threads, and keeping what they found: an interrupted experiment goes on where it was."""

from __future__ import annotations

import dataclasses
import queue
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict

from experiments.cache import Cache, Request, canonical
from experiments.curricula.cases import GAP, MODEL, RELATIONS, TASKS, Case
from experiments.errors import CHANGED_RECORD
from experiments.tabular.choose import LINES, memory
from experiments.tabular.features import by_relations
from experiments.tabular.grid import ORDER, GridTask, grid_task
from experiments.tabular.lines import NO_LINES, corridors
from experiments.tabular.model import Explorer, train_map
from experiments.tabular.play import Scenes, play
from experiments.tabular.qlearning import Learner, Result, Stop, train
from experiments.tabular.rng import seeded
from experiments.tabular.starts import Starts, of_scenes
from experiments.trained import Training, ensure, find
from scenegen.api.spec import Spec, parse
from scenegen.errors import DataError
from scenegen.learn.model import Model
from scenegen.learn.training.config import make_config
from scenegen.play.strategies import strategy
from scenegen.play.tasks import PhiBox, Strategy

VERSION = 2  # of the learners and of the model's training: raise it when their numbers change
TOLD = 50  # runs
NAME = "curriculum"
TRAINING, QUICK_TRAINING = (4, 200_000), (1, 2_000)  # epochs and scenes of a model
SCENES = 12  # for each cell, on average


class Record(BaseModel):
    """What a run found (see Result), and its CPU seconds."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    episodes: int
    steps: int
    resets: int
    any_episodes: int
    any_steps: int
    any_resets: int
    any_share: float
    level: int
    cpu: float


def spec_of(task: str) -> Spec:
    """One of the paper's tasks."""
    return parse(TASKS[task], f"task_{task.lower()}.spec")


def training_of(task: str, quick: bool) -> Training:
    """The model of a task whose scenes a learner begins with."""
    epochs, scenes = QUICK_TRAINING if quick else TRAINING
    config = make_config("flow", epochs=epochs, scenes=scenes, data="balanced", seed=0)
    return Training(f"curriculum-model-{task}", spec_of(task), config)


class Runner:
    """Tasks and scenes, made once; what was found, by the request as text."""

    def __init__(self, cache: Cache, quick: bool, each: int = SCENES) -> None:
        self.cache, self.quick, self.each = cache, quick, each
        self.found: dict[str, Record] = {}
        self.grids: dict[tuple[str, int, tuple[str, ...]], GridTask] = {}
        self.starts: dict[tuple[str, int, str], Starts] = {}

    def request(self, case: Case) -> Request:
        """All that a run follows from; the part of the report that shows it is not among it."""
        values = dataclasses.asdict(case)
        del values["group"], values["name"]
        model = training_of(case.task, self.quick).request if case.source == MODEL else None
        kind = type(case.learner).__name__
        return {"version": VERSION, **values, "learner": [kind, case.learner], "model": model, "each": self.each}

    def key(self, case: Case) -> str:
        """The same as text."""
        return canonical(self.request(case))

    def grid(self, task: str, size: int, order: tuple[str, ...] = ORDER) -> GridTask:
        """A task of 2 * size + 1 columns."""
        if (task, size, order) not in self.grids:
            self.grids[task, size, order] = grid_task(spec_of(task), 2 * size + 1, order=order)
        return self.grids[task, size, order]

    def draw(self, case: Case) -> Starts:
        """The cells in which its episodes begin."""
        which = (case.task, case.size, case.source)
        if which not in self.starts:
            grid = self.grid(case.task, case.size)
            source = self.model(case.task) if case.source == MODEL else grid.spec
            self.starts[which] = of_scenes(grid, source, self.each)
        return self.starts[which]

    def model(self, task: str) -> Model:
        """The model of a task, trained now unless an earlier run did. Raises ScenegenError."""
        training = training_of(task, self.quick)
        ensure(self.cache, training)
        found = find(self.cache, training)
        if found is None:
            raise DataError(CHANGED_RECORD(path=training.path(self.cache)))
        return found.model

    def perform(self, case: Case) -> Record:
        """Carry out a case."""
        task, starts = self.grid(case.task, case.size, case.order), self.draw(case)
        rows, count = by_relations(task, parse(RELATIONS)) if case.relations else (None, len(task.phi))
        lines = corridors(task, GAP) if case.curriculum.kind == LINES else NO_LINES
        stop, rng = Stop(both=case.both, episodes=case.most), seeded(case.seed)
        began = time.thread_time()
        if case.strategy and isinstance(case.learner, Learner):
            make, scenes = _maker(case), Scenes(task, starts.anywhere, case.seed)
            result = play(task, scenes, case.learner, make, stop, case.seed)
        elif isinstance(case.learner, Explorer):
            result = train_map(task.board, case.learner, starts, stop, rng)
        else:
            q, begun = np.zeros((count, 4)), memory(lines)
            result = train(task.board, q, rows, case.learner, case.curriculum, lines, begun, starts, stop, rng)
        return Record(**Result(*result)._asdict(), cpu=time.thread_time() - began)

    def all(self, cases: Sequence[Case], workers: int, tell: Callable[[str], None]) -> None:
        """Carry out what is not there yet on so many threads, while scenes are drawn for what comes next: the shortest
        first, so that much is kept of a run that is broken off. Raises ScenegenError."""
        wanted = {self.key(case): case for case in cases}
        for which, case in wanted.items():
            record = self.cache.find(NAME, self.request(case), Record)
            if record is not None:
                self.found[which] = record
        missing = [case for which, case in wanted.items() if which not in self.found]
        if self.found:
            tell(f"curriculum: {len(wanted) - len(missing)} of {len(wanted)} runs are there from an earlier run")
        if not missing:
            return
        missing.sort(key=lambda case: (case.source == MODEL, _cost(case)))
        for case in {
            (type(case.learner), case.relations, bool(case.strategy)): case for case in reversed(missing)
        }.values():
            self.perform(dataclasses.replace(case, most=1))  # compiled before anything is timed
        waiting: queue.SimpleQueue[Case | None] = queue.SimpleQueue()
        failures, lock, ended = list[Exception](), threading.Lock(), threading.Event()
        done = 0

        def serve() -> None:
            nonlocal done
            while (case := waiting.get()) is not None and not failures and not ended.is_set():
                try:
                    record = self.perform(case)
                    self.cache.keep(NAME, self.request(case), record)
                except Exception as error:
                    failures.append(error)
                    return
                with lock:
                    self.found[self.key(case)] = record
                    done += 1
                    if done % TOLD == 0:
                        tell(f"curriculum: {done} of {len(missing)} runs done")

        # daemons: compiled code cannot be interrupted, and a process that is ended need not wait for it
        threads = [threading.Thread(target=serve, daemon=True) for _ in range(min(workers, len(missing)))]
        for thread in threads:
            thread.start()
        try:
            for case in missing:
                if failures:
                    break
                self.draw(case)  # on this thread: what samples and trains wants the main one
                waiting.put(case)
            for _ in threads:
                waiting.put(None)
            for thread in threads:
                while thread.is_alive():
                    thread.join(0.5)
        finally:
            ended.set()
            for _ in threads:
                waiting.put(None)  # for those that wait still
        if failures:
            raise failures[0]

    def of(self, case: Case) -> Record:
        return self.found[self.key(case)]


def _maker(case: Case) -> Callable[[PhiBox], Strategy]:
    """What makes the strategy of a case."""

    def make(space: PhiBox) -> Strategy:
        return strategy(case.strategy, space, np.random.default_rng(case.seed), **dict(case.options))

    return make


def _cost(case: Case) -> float:
    """About how long a run takes, in any unit: Q-learning's steps grow with the fifth power of the size."""
    slow = 1.0 if isinstance(case.learner, Explorer) or case.learner.lots else 10.0
    return slow * case.size**4 * (3.0 if case.curriculum.kind == 0 else 1.0)
