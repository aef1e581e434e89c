"""Carrying out cases on threads, and keeping what they found: a run that is broken off goes on where it was."""

from __future__ import annotations

import dataclasses
import json
import queue
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from scenegen.api.spec import Spec, parse
from scenegen.api.train import Model
from scenegen.curriculum.strategies.table import strategy
from scenegen.curriculum.tabular.choose import LINES, memory
from scenegen.curriculum.tabular.features import by_relations
from scenegen.curriculum.tabular.grid import ORDER, GridTask, grid_task
from scenegen.curriculum.tabular.lines import NO_LINES, corridors
from scenegen.curriculum.tabular.model import Explorer, train_map
from scenegen.curriculum.tabular.play import Scenes, play
from scenegen.curriculum.tabular.qlearning import Learner, Result, Stop, train
from scenegen.curriculum.tabular.rng import seeded
from scenegen.curriculum.tabular.starts import Starts, of_scenes
from scenegen.curriculum.tasks import PhiBox, Strategy
from scenegen.experiments.curricula.cases import GAP, MODEL, RELATIONS, TASKS, Case
from scenegen.formats.files import write_whole

VERSION = 2  # of the learners and of the model's training: raise it when their numbers change
TOLD = 50  # runs
KEEP = 5.0  # seconds between two writings of what was found
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


class Kept(BaseModel):
    """The file of what was found."""

    model_config = ConfigDict(extra="forbid")

    version: int
    runs: dict[str, Record]


def key(case: Case) -> str:
    """All that decides a run, as text; the part of the report that shows it does not."""
    values = dataclasses.asdict(case)
    del values["group"], values["name"]
    if not case.strategy:
        del values["strategy"], values["options"]
    kind = type(case.learner).__name__
    return json.dumps({"learner is": kind, **values}, separators=(",", ":"))


def spec_of(task: str) -> Spec:
    """One of the paper's tasks."""
    return parse(TASKS[task], f"task_{task.lower()}.spec")


class Runner:
    """Tasks and scenes, made once; what was found, by key. `models` maps a task to its trained model."""

    def __init__(self, path: Path, models: Callable[[str], Model], each: int = SCENES) -> None:
        self.path, self.models, self.each = path, models, each
        self.found: dict[str, Record] = {}
        self.grids: dict[tuple[str, int, tuple[str, ...]], GridTask] = {}
        self.starts: dict[tuple[str, int, str], Starts] = {}
        self.drawing = 0.0  # CPU seconds for scenes
        try:
            kept = Kept.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            return  # nothing that could be used
        if kept.version == VERSION:
            self.found = kept.runs

    def grid(self, task: str, size: int, order: tuple[str, ...] = ORDER) -> GridTask:
        """A task of 2 * size + 1 columns."""
        if (task, size, order) not in self.grids:
            self.grids[task, size, order] = grid_task(spec_of(task), 2 * size + 1, order=order)
        return self.grids[task, size, order]

    def draw(self, case: Case) -> Starts:
        """The cells in which its episodes begin."""
        which = (case.task, case.size, case.source)
        if which not in self.starts:
            began = time.thread_time()
            grid = self.grid(case.task, case.size)
            source = self.models(case.task) if case.source == MODEL else grid.spec
            self.starts[which] = of_scenes(grid, source, self.each)
            self.drawing += time.thread_time() - began
        return self.starts[which]

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
        missing = list({key(case): case for case in cases if key(case) not in self.found}.values())
        if len(missing) < len(cases):
            tell(
                f"curriculum: {len(cases) - len(missing)} of {len(cases)} runs are there from an earlier run, or twice"
            )
        if not missing:
            return
        missing.sort(key=lambda case: (case.source == MODEL, _cost(case)))
        for case in {
            (type(case.learner), case.relations, bool(case.strategy)): case for case in reversed(missing)
        }.values():
            self.perform(dataclasses.replace(case, most=1))  # compiled before anything is timed
        waiting: queue.SimpleQueue[Case | None] = queue.SimpleQueue()
        failures, lock, ended = list[Exception](), threading.Lock(), threading.Event()
        done, written = 0, time.monotonic()

        def serve() -> None:
            nonlocal done, written
            while (case := waiting.get()) is not None and not failures and not ended.is_set():
                try:
                    record = self.perform(case)
                except Exception as error:
                    failures.append(error)
                    return
                with lock:
                    self.found[key(case)] = record
                    done += 1
                    if done % TOLD == 0:
                        tell(f"curriculum: {done} of {len(missing)} runs done")
                    if time.monotonic() - written > KEEP:
                        self.keep()
                        written = time.monotonic()

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
            with lock:
                self.keep()
        if failures:
            raise failures[0]

    def keep(self) -> None:
        """Write what was found, as a whole."""
        write_whole(self.path, Kept(version=VERSION, runs=dict(self.found)).model_dump_json(indent=0).encode())

    def of(self, case: Case) -> Record:
        return self.found[key(case)]


def _maker(case: Case) -> Callable[[PhiBox], Strategy]:
    """What makes the strategy of a case."""

    def make(space: PhiBox) -> Strategy:
        return strategy(case.strategy, space, np.random.default_rng(case.seed), **dict(case.options))

    return make


def _cost(case: Case) -> float:
    """About how long a run takes, in any unit: Q-learning's steps grow with the fifth power of the size."""
    slow = 1.0 if isinstance(case.learner, Explorer) or case.learner.lots else 10.0
    return slow * case.size**4 * (3.0 if case.curriculum.kind == 0 else 1.0)
