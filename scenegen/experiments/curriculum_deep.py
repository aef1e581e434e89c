"""What the paper left undone: tasks with several movable objects, where tables no longer fit, learnt by a network."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from scenegen.curriculum.strategies.self_paced import SelfPacedSettings
from scenegen.errors import DataError, Diagnostic
from scenegen.experiments.charts import check_libraries
from scenegen.experiments.crew import share
from scenegen.experiments.deep.learner import NETWORK, SETTINGS, check_learner
from scenegen.experiments.deep.lessons import EXACT, LESSONS, LEVELS, SCHEDULE
from scenegen.experiments.deep.models import KIND, ensure_model
from scenegen.experiments.deep.runs import IN_A_ROW, MASTERED, Job, Record, kept, perform
from scenegen.experiments.deep.summary import JUDGED, Key, results, verdict, without
from scenegen.experiments.deep.tasks import FULL, QUICK, TASKS
from scenegen.experiments.figures.learning import curves
from scenegen.experiments.plan import FOLDER, Plan
from scenegen.experiments.report import Report, picture
from scenegen.formats.files import ensure_folder, write_whole

NAME = "curriculum-deep"
FIGURE = "curriculum-deep.png"


def run(plan: Plan) -> Report:
    """The learning curves and the tables."""
    check_libraries()
    check_learner()
    found = _learnt(plan)
    verdicts = [verdict(found, task) for task in TASKS]
    effort = QUICK if plan.quick else FULL
    pace = SelfPacedSettings(**LESSONS["self_paced"].settings)
    blocks = [
        *(one.words for one in verdicts),
        without(found),
        "All objects of a scene can be moved, and the state is continuous: a table of 100 cells a side would have 10^8"
        " rows for two objects and 10^18 for four, one of them with its heading. So a network learns:"
        " Stable-Baselines3's PPO."
        f" Success is the share of {effort.held_out} random unsatisfied scenes that the policy, without its noise,"
        " solves; these scenes are the same for all runs, and no run begins with one of them. Rewards are the paper's"
        " (10 satisfied, -10 off the table, which ends the episode, 0 otherwise), but for the row that says dense, to"
        " which the change of phi is added.",
        picture(
            FIGURE,
            "Learning curves",
            f"Mean over the seeds; the bands are 95 % confidence intervals of the mean by Student's t, wide for"
            f" {len(plan.seeds)} seeds, cut off at 0 and 1.",
        ),
        *(block for task in TASKS for block in (f"## {TASKS[task].title}", *_about(task, plan), results(found, task))),
        f"A run ends before its last step when {IN_A_ROW} measurements in a row were at {MASTERED} or above; curves go"
        " on at what was reached. Steps are those of all tables together, to the first of the measurements, one every"
        f" {effort.each:,} steps, that reached the mark: mean and [least, greatest] over the seeds; where not all"
        " seeds reached it, of those that did. The last columns are means; CPU and wall seconds are those of learning,"
        " acting and dealing scenes, without the measurements, on a core that other work may share. The last column is"
        " the share of CPU time that choosing tasks and dealing scenes took, draws for narrow bands included. Drawing"
        " the first few thousand scenes is not:"
        f" {max(one.ahead for records in found.values() for one in records):.2f} s at most.",
        "## What is compared",
        "* **random scenes**: as plain rejection of satisfied scenes gives them, the distribution that is examined.\n"
        "* **uniform in phi**: all of the reach of phi, from the hardest thousandth of the random scenes to satisfied,"
        " equally often. This is already what no rejection gives: easy scenes are rare among random ones.\n"
        f"* **linear in phi**: {LEVELS} levels, each for as many episodes, {SCHEDULE:,} in all: more than a run has, so"
        " none gets beyond the easier levels, and none needs to. How fast it goes decides: in short trials of the"
        " second task, with one or two seeds, 10,000 to 40,000 episodes left the easy scenes before they were mastered,"
        " and nothing was learnt.\n"
        f"* **self-paced**: the newest {pace.band} of {pace.levels} levels, with a share of {pace.share:g} of uniform"
        f" scenes; on when {pace.rate:.0%} of the last {pace.window} outcomes were successes, or after"
        f" {pace.patience:,} outcomes; then uniform.\n"
        f"* **trained model**: scenes are those that `{KIND}`, trained on the spec for {effort.epochs} epochs,"
        " proposes, moved onto their phi and verified, as `scenegen sample MODEL` gives them.",
        f"PPO: {effort.tables} tables, {', '.join(f'{name} {value}' for name, value in SETTINGS.items())}; a network of"
        f" {' x '.join(map(str, NETWORK['net_arch']))}, its noise at first exp({NETWORK['log_std_init']:g}) of the"
        " largest move. The same for all rows; moves, tasks and settings were chosen in a few short trials with one"
        " seed, in which scenes uniform in phi were learnt from in both tasks, too.",
    ]
    data: dict[str, Any] = {
        "tasks": {key: asdict(task) | {"spec": task.load().source} for key, task in TASKS.items()},
        "learner": {"tables": effort.tables, **SETTINGS, **NETWORK},
        "mark": JUDGED,
        "verdicts": [asdict(one) for one in verdicts],
        "runs": [
            {"task": task, "lesson": lesson, "source": source, "seed": seed, **record.model_dump(exclude={"asked"})}
            for (task, lesson, source), records in found.items()
            for seed, record in zip(plan.seeds, records, strict=True)
        ],
    }
    return Report(NAME, "Curricula for deep learners", blocks, data, {FIGURE: curves(found)})


def _about(task: str, plan: Plan) -> list[str]:
    what = TASKS[task]
    steps = Job(task, "uniform", EXACT, 0, plan.quick, "").steps
    shown = "```spec\n" + what.load().source.strip() + "\n```"
    return [
        shown,
        f"Moves of up to {what.step:g} m along x and y of every object at once, and {what.turn:g} rad where a heading"
        f" counts; {what.horizon} steps an episode, {steps:,} steps a run at most.",
    ]


def _learnt(plan: Plan) -> dict[Key, list[Record]]:
    """All runs: what is kept already, and the rest made now. Raises ScenegenError."""
    folder = plan.out / FOLDER
    ensure_folder(folder)
    write_whole(folder / ".gitignore", b"*\n")
    jobs = {
        (task, lesson, source): [Job(task, lesson, source, seed, plan.quick, str(folder)) for seed in plan.seeds]
        for task in TASKS
        for lesson in LESSONS
        for source in LESSONS[lesson].sources
    }
    everything = [job for row in jobs.values() for job in row]
    for job in {job.model: job for job in everything}.values():
        if job.model is not None and ensure_model(job.model, job.what, job.effort):
            plan.tell(f"{job.what.title}: a model was trained")
    missing = [job for job in everything if kept(job) is None]
    if len(missing) < len(everything):
        plan.tell(f"{len(everything) - len(missing)} of {len(everything)} runs are there from before")
    if missing:
        share(missing, plan, perform, "learnt", "learns")
    return {key: [_whole(job) for job in row] for key, row in jobs.items()}


def _whole(job: Job) -> Record:
    found = kept(job)
    if found is None:
        raise DataError(Diagnostic(f"{job.path} was changed while it was in use", help="run the experiment again"))
    return found
