"""`scenegen suite metaworld`: a suite as a list of Meta-World's tasks, which its environments take by `set_task`.

A task of the suite that is called as an environment of Meta-World, such as `push-v3`, stands for it, in Meta-World's
own frame: the object `obj` is what the environment places, `target` where it wants that, if it draws this, too. These
are the numbers `rand_vec` of a task. Meta-World draws no headings, and heights only of some targets: such a target
is as low as it allows, but not below the scene's.

Every start is set in the environment itself before anything is written, since Meta-World checks nothing: an environment
that wants `obj` and `target` apart draws again until they are, with a given `rand_vec` for ever.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from scenegen.errors import DataError, RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.errors.worlds import METAWORLD_START
from scenegen.needs import need
from scenegen.play.suites.suite import GradedStart, Suite, SuiteTask
from scenegen.pose import THETA
from scenegen.scenes.files import check_writable, write_whole
from scenegen.scenes.formats.registry import check_ending
from scenegen.validation import as_path

PLACED_OBJECTS = ("obj", "target")  # the spec's objects, in the order of the triples of `rand_vec`
SEEN_OBJECTS = (slice(4, 6), slice(36, 38))  # where an observation has their x and y
SLACK, MAX_OFF = 1e-6, 1e-3  # metres beyond a range, and from a start to what the environment says of it
MAX_GOAL_DRAWS = 4  # of a `rand_vec` in a reset; two are usual


def write_metaworld(
    suite: str | Path, out: str | Path, *, told: Callable[[int, int], None] = lambda done, count: None
) -> float:
    """Write the starts of a suite to a file `.pkl`, a list of `metaworld.Task`; task i is start i. Returns how far an
    object stands at most from its place in the suite, in metres, as the environments say. Raises RequestError,
    DataError and OutputError."""
    need("metaworld", "for its task lists")
    from metaworld import Task
    from metaworld.env_dict import ALL_V3_ENVIRONMENTS

    out = as_path("out", out)
    check_ending(out, ".pkl")
    check_writable(out)
    loaded = Suite.load(suite)
    for task in loaded.tasks:
        if task.name not in ALL_V3_ENVIRONMENTS:
            raise RequestError(
                UNKNOWN_CHOICE(what="environment of Meta-World", name=task.name, known=sorted(ALL_V3_ENVIRONMENTS))
            )
    placers = {task.name: TaskPlacer(task, ALL_V3_ENVIRONMENTS[task.name], Task) for task in loaded.tasks}
    tasks = []
    for done, start in enumerate(loaded, 1):
        tasks.append(placers[start.task.name].place(start))
        told(done, len(loaded))
    write_whole(out, pickle.dumps(tasks, protocol=4))
    return max(placer.off for placer in placers.values())


class TaskPlacer:
    """The environment `kind` of a task; `off` is how far, in metres, an object stood at most from where it should.
    Raises DataError for a spec that does not fit."""

    def __init__(self, task: SuiteTask, kind: type[Any], make: Callable[[str, bytes], Any]) -> None:
        self.task, self.kind, self.make, self.off = task, kind, make, 0.0
        self.env: Any = kind()
        space = self.env._random_reset_space
        self.low, self.high = (np.asarray(end, dtype=np.float64).reshape(-1, 3) for end in (space.low, space.high))
        objects, held = task.spec.objects, task.spec.checked.fixed
        wanted = PLACED_OBJECTS[: len(self.low)]
        free = [name for index, name in enumerate(objects) if index not in held and name not in wanted]
        if free or not set(wanted) <= set(objects):
            self._refuse(wanted=wanted, objects=objects)
        self.which = [objects.index(name) for name in wanted]
        poses = task.scenes.poses.copy()
        poses[:, [index for index in self.which if index not in held], THETA] = 0.0
        self.phi = task.spec.scenes(poses, on=task.scenes.on).phi  # as Meta-World has them, which turns nothing
        self.draw, self.draws = self.env._get_state_rand_vec, 0
        self.env._get_state_rand_vec = self._draw  # an attribute of this one environment

    def place(self, start: GradedStart) -> Any:
        """The task of a start, set in the environment. Raises DataError where that has it otherwise."""
        vector = start.poses[self.which, :3].copy()
        for name, at, low, high in zip(PLACED_OBJECTS, vector, self.low, self.high, strict=False):
            if (at[:2] < low[:2] - SLACK).any() or (at[:2] > high[:2] + SLACK).any():
                ends = {"low": f"({low[0]:g}, {low[1]:g})", "high": f"({high[0]:g}, {high[1]:g})"}
                self._refuse(number=start.number, name=name, x=at[0], y=at[1], **ends)
        vector[:, 2] = np.clip(vector[:, 2], self.low[:, 2], self.high[:, 2])
        for label, phi in start.phi.items():
            if abs(self.phi[label][start.row] - phi) > SLACK:
                self._refuse(number=start.number, label=label, phi=phi, unturned=self.phi[label][start.row])
        data = {"rand_vec": vector.ravel(), "env_cls": self.kind, "partially_observable": False}
        task = self.make(start.task.name, pickle.dumps(data, protocol=4))
        self.draws = 0
        self.env.set_task(task)
        try:
            observation, _ = self.env.reset()
        except _DrawsForever:
            apart = 100.0 * float(np.hypot(*(vector[0] - vector[-1])[:2]))
            self._refuse(number=start.number, apart=apart)
        for name, at, seen in zip(PLACED_OBJECTS, vector, SEEN_OBJECTS, strict=False):
            off = float(np.abs(observation[seen] - at[:2]).max())
            if off > MAX_OFF:
                self._refuse(number=start.number, name=name, off=1000.0 * off)
            self.off = max(self.off, off)
        return task

    def _draw(self) -> Any:
        self.draws += 1
        if self.draws > MAX_GOAL_DRAWS:
            raise _DrawsForever
        return self.draw()

    def _refuse(self, **facts: Any) -> NoReturn:
        raise DataError(METAWORLD_START(task=self.task.name, **facts))


class _DrawsForever(Exception):  # noqa: N818
    """An environment that does not take a `rand_vec`."""
