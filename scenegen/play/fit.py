"""The fit of a policy's outcomes on a suite; learn/success has what a fit is, and what it predicts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from scenegen.api.scene_arrays import rows_of
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_PLACE, WRONG_VALUE
from scenegen.learn.success import measures
from scenegen.learn.success.features import fingerprint, measure_features
from scenegen.learn.success.fit import Fit, HeldOut, TaskFit
from scenegen.learn.success.logistic import Outcomes, fit_logistic, predict_held_out
from scenegen.learn.success.statistics import base_rate
from scenegen.play.suites.outcomes import SceneThatStood, SuiteOutcomes, differences, read_outcomes
from scenegen.play.suites.suite import Suite, SuiteTask
from scenegen.pose import span_of
from scenegen.validation import as_path

MIN_EPISODES = 50  # of a task


def fit_outcomes(outcomes: Sequence[str | Path], suite: str | Path, *, monotone: bool = False) -> Fit:
    """The fit of a policy's outcomes on a suite: files of one policy in one world, where several have been run. With
    `monotone` the predicted rate never falls as phi or a margin of the success formula rises.

    Raises DataError for files that are none or of another suite, RequestError for files of different runs, and for
    fewer than MIN_EPISODES episodes of a task that has any.
    """
    paths = [as_path("outcomes", one) for one in outcomes]
    if not paths:
        raise RequestError(WRONG_VALUE(argument="outcomes", value="empty", wanted="files of `scenegen suite run`"))
    first = read_outcomes(paths[0]).header
    whole = Suite.load(suite, reverse=first.reverse)
    runs = [read_outcomes(path, whole) for path in paths]
    for path, run in zip(paths, runs, strict=True):
        for name, (mine, other) in differences(first, run.header).items():
            rule = f"is of another run than {paths[0]}: its {name} is {other}, not {mine}"
            raise RequestError(OUT_OF_PLACE(option=path, rule=rule, remedy="fit the outcomes of one run, repeated"))
    tasks = [fit for task in whole.tasks for fit in _fit_task(whole, task, runs, monotone)]
    if not tasks:
        remedy = f"run {MIN_EPISODES} episodes at least"
        raise RequestError(OUT_OF_PLACE(option="the outcomes", rule="have no episodes", remedy=remedy))
    return Fit(run=first, monotone=monotone, tasks=tuple(tasks))


def _fit_task(suite: Suite, task: SuiteTask, runs: Sequence[SuiteOutcomes], monotone: bool) -> list[TaskFit]:
    """The fit of a task; none of one without episodes."""
    ended: dict[int, list[bool]] = defaultdict(list)  # by start
    stood: dict[tuple[int, int], SceneThatStood] = {}  # by start and repetition, where that was another scene
    for run in runs:
        for one in run.episodes:
            if one.task == task.name:
                if one.scene is not None:
                    stood[one.episode, len(ended[one.episode])] = one.scene
                ended[one.episode].append(one.success)
    if not ended:
        return []
    data = outcomes_of(suite, task, ended, stood)
    y, which, phi = data.success, data.start, data.values[0]
    if len(y) < MIN_EPISODES:
        rule = f"are too few for a fit: {len(y)} of {task.name}"
        raise RequestError(
            OUT_OF_PLACE(option="the outcomes", rule=rule, remedy=f"run {MIN_EPISODES} episodes at least")
        )
    held_out = None
    if 0 < y.sum() < len(y):
        p = predict_held_out(data, monotone)
        held_out = HeldOut(
            calibration_error=measures.calibration_error(y, p),
            by_chance=measures.chance_error(p),
            brier=measures.bootstrap_interval(measures.brier, y, p, which),
            auc=measures.auc_interval(y, p, which),
            auc_of_phi=measures.auc_interval(y, phi, which),
        )
    bands = [[ended[number] for number in ended if suite[number].band == band.name] for band in task.bands]
    won = [sum(float(np.mean(one)) for one in band) for band in bands]
    probability, error = zip(*((one.probability, one.error) for one in task.bands), strict=True)
    return [
        TaskFit(
            name=task.name, success=task.success, digest=fingerprint(task.spec.checked, task.success),
            episodes=len(y), starts=len(ended), model=fit_logistic(data, monotone),
            base_rate=base_rate(won, list(map(len, bands)), probability, error), held_out=held_out,
        )
    ]  # fmt: skip


def outcomes_of(
    suite: Suite,
    task: SuiteTask,
    ended: Mapping[int, Sequence[bool]],
    stood: Mapping[tuple[int, int], SceneThatStood] = MappingProxyType({}),
) -> Outcomes:
    """The outcomes at the starts of a task that have `ended`, with what was measured there: where an episode says what
    really `stood` there, by its start and repetition, of that."""
    starts = [suite[number] for number in sorted(ended)]
    which = np.repeat(np.arange(len(starts)), [len(ended[one.number]) for one in starts])
    rows = rows_of(task.spec.checked, task.scenes[np.array([one.row for one in starts])])[:, which]
    each = [(start.number, k) for start in starts for k in range(len(ended[start.number]))]
    for column, episode in enumerate(each):
        if (scene := stood.get(episode)) is not None:
            for place, name in enumerate(task.spec.objects):
                rows[span_of(place), column] = scene.poses[name]
    features, values = measure_features(task.spec.checked, task.success, rows)
    success = np.array([ended[number][k] for number, k in each])
    return Outcomes(features, values, success, which)
