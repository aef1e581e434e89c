"""A suite: graded starts of several tasks, frozen in a folder of scenes files, one a task, and suite.json.

A *cell* is one band of difficulty of one task. Start i is number i // C of cell i mod C, where C is the number of
cells: the first C starts have one of each, and every multiple of C is a smaller suite of the same make. That follows
from the files alone, so episode i has start i in every program that reads them. Format `scenegen/suite`, version 1.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import itemgetter, not_
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, FiniteFloat, model_validator

from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet, compare, evaluate
from scenegen.api.spec import Spec, parse
from scenegen.arrays import Array
from scenegen.errors import DataError, RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.lang.check.arms import YAWS
from scenegen.learn.success.files import FileModel, dump_with_digest, load_with_digest
from scenegen.resources import shipped_suites
from scenegen.sampling.grasps import FITS, pair_grasp
from scenegen.scenes.arrange import check_scenes
from scenegen.scenes.files import inside, read_bytes
from scenegen.scenes.sets import Seed, Sha256
from scenegen.validation import as_int, as_path

SUITE_JSON = "suite.json"
MARGIN_TOLERANCE = 1e-9  # metres, of the margin of a grasp
NAME_PATTERN = r"[^\x00-\x1f\x7f-\x9f\u2028\u2029/\\]{1,200}"  # part of a file's name, and of lines
Name = Annotated[str, Field(pattern=f"^{NAME_PATTERN}$")]


def overlapping(ranges: Iterable[tuple[str, float, float]]) -> tuple[str, str] | None:
    """Two ranges, by name, lowest and highest, that have more in common than an end: their names."""
    ordered = sorted(ranges, key=itemgetter(1, 2))
    return next(((one[0], other[0]) for one, other in pairwise(ordered) if other[1] < one[2]), None)


class GraspData(FileModel):
    """A goal of a start, and the grasp that leads there: of each thing that is moved its `goal`, x and y in metres and
    theta in radians, and the `yaw` of the hand in its own frame, in radians. `margin` is the least of the grasps at
    both ends, in metres."""

    margin: FiniteFloat
    yaw: dict[str, FiniteFloat]
    goal: dict[str, tuple[FiniteFloat, FiniteFloat, FiniteFloat]]


class BandData(FileModel):
    """A band of difficulty: phi of the success label from the first to the second, and its `probability` among the
    starts that the task's spec allows; `error` is half of a 95 % interval of its log10. Of each start `log10p`, log10
    of the share of these starts that is at least as hard, and a seed for what else is random in its episode; in a suite
    with grasps also one."""

    name: Name
    phi: tuple[FiniteFloat, FiniteFloat]
    probability: Annotated[FiniteFloat, Field(gt=0, le=1)]
    error: Annotated[FiniteFloat, Field(ge=0)]
    log10p: list[FiniteFloat]
    seeds: list[Seed]
    grasps: list[GraspData] = Field(default_factory=list, exclude_if=not_)


class TaskData(FileModel):
    """A task: `scenes` is its scenes file, band after band; its spec is that of the file, and `success` is the label
    whose phi >= 0 is success."""

    name: Name
    instruction: str
    success: str
    scenes: Annotated[str, AfterValidator(inside)]
    sha256: Sha256
    bands: Annotated[list[BandData], Field(min_length=1)]


class SuiteFile(FileModel):
    """suite.json. `digest` is the SHA-256 of this file with 64 zeros in its place; the file has those of all others.
    `reversed` are the tasks whose start is the goal of another one, and whose goal is its start. Grasps are by the
    `robot` of this name in the specs."""

    format: Literal["scenegen/suite"] = "scenegen/suite"
    version: Literal[1] = 1
    name: Name
    digest: Sha256
    seed: Seed
    n: Annotated[int, Field(ge=1)]
    tasks: Annotated[list[TaskData], Field(min_length=1)]
    reversed: list[TaskData] = Field(default_factory=list, exclude_if=not_)
    robot: str = Field(default="", exclude_if=not_)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        for tasks in (self.tasks, self.reversed):
            for names in ([task.name for task in tasks], *([band.name for band in task.bands] for task in tasks)):
                if len(set(names)) < len(names):
                    raise ValueError("two tasks, or two bands of one, have the same name")
        for task in (*self.tasks, *self.reversed):
            if any(band.phi[0] > band.phi[1] for band in task.bands):
                raise ValueError(f"a band of {task.name} ends below its beginning")
            if both := overlapping((band.name, *band.phi) for band in task.bands):
                raise ValueError("the bands {} and {} of {} overlap".format(*both, task.name))
            if sum(band.probability for band in task.bands) > 1.001:  # they are rounded
                raise ValueError(f"the bands of {task.name} are more probable than all starts")
        bands = [band for task in (*self.tasks, *self.reversed) for band in task.bands]
        if any(not len(band.log10p) == len(band.seeds) == self.n for band in bands):
            raise ValueError(f"a band has not {self.n} starts")
        if any(len(band.grasps) != (self.n if self.robot else 0) for band in bands):
            raise ValueError("a start has no grasp, or one without a robot")
        return self

    def dump(self) -> bytes:
        """The bytes of the file, with their digest."""
        return dump_with_digest(self)


@dataclass(frozen=True, slots=True, eq=False)
class SuiteTask:
    """A task of a suite. What its spec requires holds at every start; success is phi >= 0 of the label `success`.
    `scenes` are its starts, n of each band in turn, and `poses` (n, N, 7) the same as `SceneSet.poses7` has them. In a
    suite with grasps `goals` has a goal of each start."""

    name: str
    spec: Spec
    instruction: str
    success: str
    bands: tuple[BandData, ...]
    scenes: SceneSet = field(repr=False)
    poses: Array = field(repr=False)
    goals: SceneSet | None = field(default=None, repr=False)

    def start(self, row: int, number: int) -> GradedStart:
        """The start in a row of the scenes, as start `number` of a suite."""
        which, place = divmod(row, len(self.scenes) // len(self.bands))
        band = self.bands[which]
        phi = {label: float(values[row]) for label, values in self.scenes.phi.items()}
        on = None if self.scenes.on is None else self.scenes.on[row]
        poses = self.poses[row].copy()  # worlds move things in it
        goal = yaws = margin = None
        if self.goals is not None:
            goal, grasp = self.goals[row : row + 1].poses7()[0], band.grasps[place]
            yaws, margin = np.array([grasp.yaw.get(name, np.nan) for name in self.spec.objects]), grasp.margin
        return GradedStart(
            number, self, band.name, poses, phi, band.log10p[place], band.probability, band.seeds[place], row, on,
            goal, yaws, margin,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class GradedStart:
    """Start `number` of a suite: `poses` (N, 7) in the spec's frame: x, y, z of each object's lowest point in metres,
    then qw, qx, qy, qz; `objects` are their names. `phi` is by label; `log10p` is log10 of the share of all starts that
    is at least as hard, `probability` that of its band. `seed` is for what else is random; `row` is its number among
    the task's scenes, `on` as in a SceneSet.

    In a suite with grasps `goal` (N, 7) is where things are to go, `yaws` (N,) are those of the hand on each thing that
    is moved, in its own frame, in radians, NaN for the others, and `margin` is the least of these grasps, in metres."""

    number: int
    task: SuiteTask
    band: str
    poses: Array = field(repr=False)
    phi: dict[str, float]
    log10p: float
    probability: float
    seed: int
    row: int
    on: Array | None = None
    goal: Array | None = field(default=None, repr=False)
    yaws: Array | None = None
    margin: float | None = None

    @property
    def objects(self) -> tuple[str, ...]:
        return self.task.spec.objects


@dataclass(frozen=True, slots=True, eq=False)
class Suite:
    """The suite in a `folder`: `len(suite)` starts, `suite[i]` is start i; `n` are those of each cell; `cells` are
    every band of every task, in the order of starts."""

    folder: Path
    name: str
    digest: str
    n: int
    reverse: bool
    tasks: tuple[SuiteTask, ...]
    robot: str = ""

    @staticmethod
    def load(folder: str | Path, *, reverse: bool = False) -> Suite:
        """The suite in a folder, or a shipped one by its name; with `reverse` its reversed tasks. Every byte is held
        against the digest. Raises DataError."""
        folder = find_suite(folder)
        file = read_manifest(folder)
        if reverse and not file.reversed:
            raise DataError(NOT_A_SUITE(file=folder, what="a suite with reversed tasks", reason="none has a way back"))
        tasks = (_task(folder, one, file.n) for one in (file.reversed if reverse else file.tasks))
        return Suite(folder, file.name, file.digest, file.n, reverse, tuple(tasks), file.robot)

    @property
    def cells(self) -> list[tuple[SuiteTask, BandData]]:
        return [(task, band) for task in self.tasks for band in task.bands]

    def __len__(self) -> int:
        return len(self.cells) * self.n

    def __iter__(self) -> Iterator[GradedStart]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, number: int) -> GradedStart:
        number, cells = as_int("number", number), self.cells
        if not 0 <= number < len(self):
            raise IndexError(number)
        which, cell = divmod(number, len(cells))
        task, band = cells[cell]
        return task.start(task.bands.index(band) * self.n + which, number)

    def numbers(self, task: SuiteTask) -> list[int]:
        """The numbers of the starts of a task, in their order."""
        of = [one is task for one, _ in self.cells]
        return [number for number in range(len(self)) if of[number % len(of)]]

    def part(self, first: int = 0, end: int | None = None, bands: Collection[str] | None = None) -> list[int]:
        """The numbers of the starts from `first` up to, not including, `end`, or of those of some bands. Raises
        RequestError."""
        end = len(self) if end is None else end
        if not 0 <= first < end <= len(self):
            wanted = f"FIRST:END, from 0 to {len(self)}"
            raise RequestError(OUT_OF_RANGE(argument="episodes", value=f"{first}:{end}", wanted=wanted))
        names = [band.name for _, band in self.cells]
        for name in bands or ():
            if name not in names:
                raise RequestError(UNKNOWN_CHOICE(what="band", name=name, known=dict.fromkeys(names)))
        return [number for number in range(first, end) if bands is None or names[number % len(names)] in bands]


def find_suite(folder: str | Path) -> Path:
    """The folder of a suite: one that there is, or else the shipped suite of that name."""
    path = as_path("suite", folder)
    return path if path.exists() else shipped_suites().get(str(folder), path)


def read_manifest(folder: Path) -> SuiteFile:
    """suite.json of a folder. Raises DataError, also for bytes without their digest and for other files than it
    says."""
    file = load_with_digest(SuiteFile, folder / SUITE_JSON, "a suite", "a suite")
    for task in (*file.tasks, *file.reversed):
        scenes = folder / task.scenes
        if hashlib.sha256(read_bytes(scenes, "a scenes file of the suite")).hexdigest() != task.sha256:
            reason = f"it does not have the checksum that {SUITE_JSON} says"
            raise DataError(NOT_A_SUITE(file=scenes, what="that of the suite", reason=reason))
    return file


def _task(folder: Path, data: TaskData, n: int) -> SuiteTask:
    scenes = read_scenes(folder / data.scenes)
    if data.success not in scenes.phi or len(scenes) != n * len(data.bands):
        reason = f"it has not {n * len(data.bands)} scenes with the label `{data.success}`"
        raise DataError(NOT_A_SUITE(file=folder / data.scenes, what="that of the suite", reason=reason))
    spec = Spec(replace(scenes.header.spec.checked_spec, name=data.name))
    grasps, goals = [grasp for band in data.bands for grasp in band.grasps], None
    if grasps:
        if any({*grasp.goal} - {*spec.objects} or grasp.goal.keys() != grasp.yaw.keys() for grasp in grasps):
            reason = "a grasp is of what the spec does not have, or has no goal"
            raise DataError(NOT_A_SUITE(file=folder / SUITE_JSON, what="a suite", reason=reason))
        poses = scenes.poses.copy()
        for number, grasp in enumerate(grasps):
            for name, pose in grasp.goal.items():
                poses[number, spec.objects.index(name)] = pose
        goals = SceneSet(poses, {}, scenes.header, on=scenes.on)
    bands = tuple(data.bands)
    return SuiteTask(data.name, spec, data.instruction, data.success, bands, scenes, scenes.poses7(), goals)


def goal_spec(task: Spec) -> Spec:
    """The spec of a task without what a suite adds to it, which is its last statement: that it is not solved."""
    return parse(task.source.rpartition("require ")[0], task.checked.name)


def check_suite(folder: str | Path) -> list[Suite]:
    """Compute everything of a suite again: checksums, phi of all starts by the specs' own text, what these require, and
    the bands. Returns it, and the reversed one where there is one. Raises DataError for the first thing that is
    wrong."""
    folder = find_suite(folder)
    both = (False, True) if read_manifest(folder).reversed else (False,)
    suites = [Suite.load(folder, reverse=reverse) for reverse in both]
    for suite in suites:
        goals = {task.name: task.success for other in suites if other is not suite for task in other.tasks}
        for task in suite.tasks:
            name = f"the starts of {task.name}{' reversed' if suite.reverse else ''}"
            for wrong in compare(task.spec.checked, task.scenes, name):
                raise DataError(wrong)
            check_scenes(task.spec.checked, rows_of(task.spec.checked, task.scenes))
            goal = task.scenes.phi.get(goals.get(task.name, ""))  # of the task the other way: starts are there
            if (goal is None and (suite.reverse or task.name in goals)) or (goal is not None and (goal < 0.0).any()):
                reason = "a start is not where the task the other way ends"
                raise DataError(NOT_A_SUITE(file=name, what="what the suite says", reason=reason))
            for number, band in enumerate(task.bands):
                phi = task.scenes.phi[task.success][number * suite.n : (number + 1) * suite.n]
                low, high = band.phi
                if (phi < low).any() or (phi > high).any() or (phi >= 0.0).any():
                    reason = f"a start of the band {band.name} is out of its range, or solved"
                    raise DataError(NOT_A_SUITE(file=name, what="what the suite says", reason=reason))
            if suite.robot and not _grasps_hold(suite.robot, task):
                reason = "a goal does not hold, or the margin of a grasp is another"
                raise DataError(NOT_A_SUITE(file=name, what="what the suite says", reason=reason))
    return suites


def _grasps_hold(robot: str, task: SuiteTask) -> bool:
    """Whether every goal is one, and every grasp has the margin that the suite says. Raises DataError for a goal that
    the spec does not have, and RequestError without the robot."""
    assert task.goals is not None
    spec, told = goal_spec(task.spec), [grasp for band in task.bands for grasp in band.grasps]
    start, goal = (rows_of(spec.checked, scenes) for scenes in (task.scenes, task.goals))
    check_scenes(spec.checked, goal)
    by, margin = pair_grasp(spec.checked, robot, FITS), np.full(len(told), np.inf)
    for thing in by.cores:
        yaws = np.array([grasp.yaw.get(spec.objects[thing], np.nan) for grasp in told])
        moved = np.flatnonzero(np.isfinite(yaws))
        each = by.margins(thing, start[:, moved], goal[:, moved])
        at = np.rint(yaws[moved] * YAWS / np.pi).astype(int) % YAWS
        margin[moved] = np.minimum(margin[moved], each[at, np.arange(len(moved))])
    wrong = np.abs(margin - [grasp.margin for grasp in told]) > MARGIN_TOLERANCE
    return bool((evaluate(spec.checked, task.goals)[task.success] >= 0.0).all() and not wrong.any())
