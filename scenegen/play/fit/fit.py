"""A fit: how often a policy succeeds in each task of a suite, predicted from the start. Format `scenegen/fit`, version
2."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, FiniteFloat

from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.learning import MODEL_OF_ANOTHER_SPEC
from scenegen.errors.requests import OUT_OF_PLACE, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec
from scenegen.play.fit import logistic
from scenegen.play.fit.features import fingerprint, measured
from scenegen.play.fit.logistic import Interval, Logistic, Outcomes
from scenegen.play.suites.outcomes import OutcomesHeader, SuiteOutcomes, differences, read_outcomes
from scenegen.play.suites.statistics import base_rate
from scenegen.play.suites.suite import BLANK, Suite, SuiteModel, SuiteTask, dump_with_digest, load_with_digest
from scenegen.scenes.files import write_whole
from scenegen.scenes.sets import Sha256
from scenegen.validation import as_path

FEWEST = 50  # episodes of a task
COIN = 0.5  # the AUC of a score that tells nothing
VAGUE = 0.5  # width of an interval of an AUC that says next to nothing


class HeldOut(SuiteModel):
    """How good predictions are at starts that the fit has not seen: measures with their 95 % intervals. `by_chance` is
    the calibration error that perfect predictions would show in so few episodes, on the average and in 5 % of cases;
    `auc_of_phi` is what phi alone tells."""

    calibration_error: FiniteFloat
    by_chance: tuple[FiniteFloat, FiniteFloat]
    brier: Interval
    auc: Interval
    auc_of_phi: Interval


class TaskFit(SuiteModel):
    """The fit of a task, whose label `success` is success; `digest` is the fingerprint of what predictions follow from.
    `base_rate` is the success rate of its base distribution, with a 95 % interval, by the bands of the suite.
    There is no `held_out` where all episodes ended alike: no measure tells anything there."""

    name: str
    success: str
    digest: Sha256
    episodes: int
    starts: int
    base_rate: Interval
    model: Logistic
    held_out: HeldOut | None

    def predicted(self, spec: CheckedSpec, rows: Array) -> Array:
        """The success rate in scenes with the rows of the spec's core, (3M, B) -> (B,)."""
        features, values = measured(spec, self.success, rows)
        return self.model([one.name for one in features], values)

    @property
    def findings(self) -> list[str]:
        """Where phi, or all that is measured, does not tell what it should, in words."""
        if self.held_out is None:
            return [f"nothing can be told of success in {self.name}: all {self.episodes} episodes ended alike"]
        mine, (phi, low, high) = self.held_out.auc, self.held_out.auc_of_phi
        found = []
        if low <= COIN:
            what = "phi does not predict success" if high >= COIN else "success is more frequent where phi is lower"
            what = "it cannot be told whether phi predicts success" if high - low > VAGUE else what
            found.append(f"{what} in {self.name}: AUC {phi:.2f}, 95 % interval {low:.2f} to {high:.2f}")
        if low <= COIN <= high and mine[1] <= COIN and mine[2] - mine[1] <= VAGUE:
            said = "AUC {:.2f}, 95 % interval {:.2f} to {:.2f}".format(*mine)
            found.append(f"nothing measured at the start predicts success in {self.name}: {said}")
        return found


class Fit(SuiteModel):
    """How often a policy succeeds in the tasks of a suite; `run` says which, and in which world."""

    format: Literal["scenegen/fit"] = "scenegen/fit"
    version: Literal[2] = 2
    digest: Sha256 = BLANK
    run: OutcomesHeader
    monotone: bool
    tasks: Annotated[tuple[TaskFit, ...], Field(min_length=1)]

    @staticmethod
    def load(path: str | Path) -> Fit:
        """The fit in a file. Raises DataError."""
        return load_with_digest(Fit, as_path("fit", path), "a fit", "a fit of outcomes")

    def save(self, path: str | Path) -> None:
        """Write the fit as JSON; the file appears whole or not at all. Raises OutputError."""
        write_whole(as_path("out", path), dump_with_digest(self))

    def task_of(self, spec: CheckedSpec) -> TaskFit:
        """The task of a spec: same objects, workspace and success formula, whatever it requires. Raises RequestError
        for other specs."""
        for task in self.tasks:
            if task.success in spec.labels and task.digest == fingerprint(spec, task.success):
                return task
        raise RequestError(MODEL_OF_ANOTHER_SPEC(spec=spec.name, fitted=tuple(one.name for one in self.tasks)))

    def predict(self, scenes: SceneSet) -> Array:
        """The success rate that is predicted at each of n scenes, (n,). Raises RequestError for scenes of others."""
        spec = scenes.header.spec.checked_spec
        return self.task_of(spec).predicted(spec, rows_of(spec, scenes))


def fit_outcomes(outcomes: Sequence[str | Path], suite: str | Path, *, monotone: bool = False) -> Fit:
    """The fit of a policy's outcomes on a suite: files of one policy in one world, where several have been run. With
    `monotone` the predicted rate never falls as phi or a margin of the success formula rises.

    Raises DataError for files that are none or of another suite, RequestError for files of different runs, and for
    fewer than FEWEST episodes of a task that has any.
    """
    paths = [as_path("outcomes", one) for one in outcomes]
    if not paths:
        raise RequestError(WRONG_VALUE(argument="outcomes", value="empty", wanted="files of `scenegen suite run`"))
    first = read_outcomes(paths[0]).header
    found = Suite.load(suite, reverse=first.reverse)
    runs = [read_outcomes(path, found) for path in paths]
    for path, run in zip(paths, runs, strict=True):
        for name, (mine, other) in differences(first, run.header).items():
            rule = f"is of another run than {paths[0]}: its {name} is {other}, not {mine}"
            raise RequestError(OUT_OF_PLACE(option=path, rule=rule, remedy="fit the outcomes of one run, repeated"))
    tasks = [one for task in found.tasks for one in _fitted(found, task, runs, monotone)]
    if not tasks:
        remedy = f"run {FEWEST} episodes at least"
        raise RequestError(OUT_OF_PLACE(option="the outcomes", rule="have no episodes", remedy=remedy))
    return Fit(run=first, monotone=monotone, tasks=tuple(tasks))


def _fitted(suite: Suite, task: SuiteTask, runs: Sequence[SuiteOutcomes], monotone: bool) -> list[TaskFit]:
    """The fit of a task; none of one without episodes."""
    ended: dict[int, list[bool]] = defaultdict(list)  # by start
    for run in runs:
        for one in run.episodes:
            if one.task == task.name:
                ended[one.episode].append(one.success)
    if not ended:
        return []
    data = outcomes_of(suite, task, ended)
    y, which, phi = data.success, data.start, data.values[0]
    if len(y) < FEWEST:
        rule = f"are too few for a fit: {len(y)} of {task.name}"
        raise RequestError(OUT_OF_PLACE(option="the outcomes", rule=rule, remedy=f"run {FEWEST} episodes at least"))
    held_out = None
    if 0 < y.sum() < len(y):
        p = logistic.held_out(data, monotone)
        held_out = HeldOut(
            calibration_error=logistic.calibration_error(y, p),
            by_chance=logistic.by_chance(p),
            brier=logistic.with_interval(logistic.brier, y, p, which),
            auc=logistic.auc_with_interval(y, p, which),
            auc_of_phi=logistic.auc_with_interval(y, phi, which),
        )
    bands = [[ended[number] for number in ended if suite[number].band == band.name] for band in task.bands]
    won = [sum(float(np.mean(one)) for one in band) for band in bands]
    probability, error = zip(*((one.probability, one.error) for one in task.bands), strict=True)
    return [
        TaskFit(
            name=task.name, success=task.success, digest=fingerprint(task.spec.checked, task.success),
            episodes=len(y), starts=len(ended), model=logistic.chosen(data, monotone),
            base_rate=base_rate(won, list(map(len, bands)), probability, error), held_out=held_out,
        )
    ]  # fmt: skip


def outcomes_of(suite: Suite, task: SuiteTask, ended: Mapping[int, Sequence[bool]]) -> Outcomes:
    """The outcomes at the starts of a task that have `ended`, with what was measured there."""
    starts = [suite[number] for number in sorted(ended)]
    rows = rows_of(task.spec.checked, task.scenes[np.array([one.row for one in starts])])
    features, values = measured(task.spec.checked, task.success, rows)
    which = np.repeat(np.arange(len(starts)), [len(ended[one.number]) for one in starts])
    success = np.array([one for start in starts for one in ended[start.number]])
    return Outcomes(features, values[:, which], success, which)
