"""What the paper left undone: tasks with several movable objects, where tables no longer fit, learnt by a network."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from experiments.charts import check_libraries
from experiments.deep.learner import NETWORK, SETTINGS, check_learner
from experiments.deep.lessons import EXACT, LESSONS
from experiments.deep.runs import Job, Record, kept, perform
from experiments.deep.summary import JUDGED, Key, tables, verdict
from experiments.deep.tasks import FULL, QUICK, TASKS
from experiments.errors import CHANGED_RECORD
from experiments.figures.learning import curves
from experiments.jobs import share
from experiments.page import picture, table
from experiments.plan import Plan
from experiments.report import Report
from experiments.trained import ensure
from scenegen.errors import DataError

NAME = "curriculum-deep"
FIGURE = "curriculum-deep.png"


def run(plan: Plan) -> Report:
    """The learning curves and the tables."""
    check_libraries()
    check_learner()
    found = _learnt(plan)
    effort = QUICK if plan.quick else FULL
    verdicts = [verdict(found, task) for task in TASKS]
    blocks = {"fig": picture(FIGURE, "Learning curves"), **tables(found), "limits": _limits(plan)}
    blocks["settings"] = _settings(plan)
    data: dict[str, Any] = {
        "tasks": {key: asdict(task) | {"spec": task.load().source} for key, task in TASKS.items()},
        "learner": {"tables": effort.tables, **SETTINGS, **NETWORK},
        "mark": JUDGED,
        "verdicts": [asdict(one) for one in verdicts],
        "runs": [
            {"task": task, "lesson": lesson, "source": source, "seed": seed, **record.model_dump()}
            for (task, lesson, source), records in found.items()
            for seed, record in zip(plan.seeds, records, strict=True)
        ],
    }
    return Report(NAME, "Curricula for deep learners", blocks, data, {FIGURE: curves(found)})


def _limits(plan: Plan) -> str:
    """What a step, an episode and a run are of each task."""
    rows = []
    for what in TASKS.values():
        steps = Job(what.key, "uniform", EXACT, 0, plan.quick, "").steps
        rows.append([what.title, f"{what.step:g} m", f"{what.turn:g} rad", str(what.horizon), f"{steps:,}"])
    return table(["", "step", "turn", "steps an episode", "steps a run"], rows)


def _settings(plan: Plan) -> str:
    """The learner's."""
    effort = QUICK if plan.quick else FULL
    own = {"tables": effort.tables, "steps between measurements": effort.each, "held-out scenes": effort.held_out}
    return table(["setting", "value"], [[name, str(value)] for name, value in {**own, **SETTINGS, **NETWORK}.items()])


def _learnt(plan: Plan) -> dict[Key, list[Record]]:
    """All runs: what is kept already, and the rest made now. Raises ScenegenError."""
    cache = plan.cache()
    jobs = {
        (task, lesson, source): [Job(task, lesson, source, seed, plan.quick, str(cache.folder)) for seed in plan.seeds]
        for task in TASKS
        for lesson in LESSONS
        for source in LESSONS[lesson].sources
    }
    everything = [job for row in jobs.values() for job in row]
    for job in {(job.task, job.source): job for job in everything}.values():
        if job.training is not None and ensure(cache, job.training):
            plan.tell(f"{job.what.title}: a model was trained")
    missing = [job for job in everything if kept(job) is None]
    if len(missing) < len(everything):
        plan.tell(f"{len(everything) - len(missing)} of {len(everything)} runs are there from an earlier run")
    if missing:
        share(missing, plan, perform, "learnt")
    return {key: [_whole(job) for job in row] for key, row in jobs.items()}


def _whole(job: Job) -> Record:
    found = kept(job)
    if found is None:
        raise DataError(CHANGED_RECORD(path=f"the record of {job}"))
    return found
