"""Deep learners: lessons, examinations, runs that are kept, and what is made of them."""

import dataclasses
import json

import numpy as np
import pytest
from scipy import stats

from experiments.deep import runs, summary
from experiments.deep.heldout import random_scenes, success
from experiments.deep.lessons import BANDS, EXACT, LESSONS, LEVELS, SOURCES, AsTheyCome
from experiments.deep.runs import IN_A_ROW, MASTERED, Job, Record, kept, mastered, perform
from experiments.deep.tasks import TASKS
from experiments.figures.learning import STYLES, together
from experiments.run import run
from scenegen.play.environments.rules import make_rules
from scenegen.play.strategies.levels import Linear
from scenegen.play.tasks import PhiBox

SPACE = PhiBox((-2.0,), (0.0,))


@pytest.fixture(scope="module")
def two():
    """The smaller task, its rules, and random scenes."""
    task = TASKS["two"]
    spec = task.load()
    rules = make_rules(spec, goal=None, moves="continuous", move=None, step=task.step, turn=task.turn, reward="sparse")
    return task, rules, random_scenes(task, 40, 1)


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
def test_tasks_are_such_as_the_experiment_takes_them(task):
    """One label, nothing required (the examination does not look), nothing held in place."""
    checked = task.load().checked
    assert len(checked.labels) == 1 and not checked.fixed and checked.core.requirement is None
    assert task.budget % runs.FULL.each == 0 and task.horizon * task.step >= 1.0


def test_lessons_are_told_apart():
    assert set(STYLES) == set(LESSONS) and len(set(STYLES.values())) == len(STYLES)
    assert {"random", "uniform", *summary.CURRICULA} <= set(LESSONS)
    made = LESSONS["linear"].make(SPACE, 0, [-1.0])
    assert set(LESSONS["linear"].settled()) > {"levels", "episodes"}, "defaults are part of the request"
    assert isinstance(made, Linear) and made.settings.levels == LEVELS and made.space == SPACE


def test_random_scenes_are_asked_for_as_often_as_they_occur():
    rng = np.random.default_rng(0)
    phi = -rng.beta(2.0, 5.0, 5000) * 2.2  # some are harder than the reach goes: these count for the hardest band
    lesson = LESSONS["random"].make(SPACE, 0, phi.tolist())
    assert isinstance(lesson, AsTheyCome)
    drawn = [lesson.next_task() for _ in range(5000)]
    assert all(SPACE.low <= task.low < task.high <= SPACE.high for task in drawn)
    width = 2.0 / BANDS
    places = np.array([round((task.low[0] + 2.0) / width) for task in drawn])
    wanted = np.bincount(np.minimum((np.maximum(phi, -2.0) + 2.0) // width, BANDS - 1).astype(int), minlength=BANDS)
    got = np.bincount(places, minlength=BANDS)
    assert (got[wanted == 0] == 0).all()
    enough = wanted >= 20
    assert stats.chisquare(got[enough], wanted[enough] * got[enough].sum() / wanted[enough].sum()).pvalue > 1e-3


def test_an_examination_marks_those_who_can_and_those_who_cannot(two):
    task, rules, (scenes, phi) = two
    assert scenes.shape == (6, 40) and (phi < 0).all()
    assert (rules.score(scenes)[0] == pytest.approx(phi)) and np.ptp(phi) > 0.3

    def mover(where):
        def policy(seen):
            at = (seen + 1.0) / 2.0  # x, y of the plate and of the mug, in metres
            return np.clip((np.array(where) - at) / task.step, -1.0, 1.0)

        return policy

    assert success(rules, scenes, mover((0.5, 0.25, 0.53, 0.28)), task.horizon) == 1.0
    assert success(rules, scenes, mover((0.5, 0.25, 0.53, 0.28)), 3) < 0.2
    # a mug that goes to the left of the plate is to the right of it only on its way
    assert success(rules, scenes, mover((0.5, 0.25, 0.45, 0.28)), task.horizon) < 0.5
    assert success(rules, scenes, lambda seen: np.zeros((len(seen), 4)), task.horizon) == 0.0
    # rushing to the right leaves the table, whatever comes afterwards
    assert success(rules, scenes, lambda seen: np.tile([1.0, 0.0, 1.0, 0.0], (len(seen), 1)), task.horizon) == 0.0


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A short run."""
    job = Job("two", "self_paced", "exact", 0, True, str(tmp_path_factory.mktemp("trained")))
    return job, perform(job)


def test_what_is_learnt_is_kept(done):
    job, seconds = done
    found = kept(job)
    assert found is not None and found.cpu == seconds and 0.0 < found.sampling < found.cpu
    effort = job.effort
    assert [steps for steps, _ in found.curve] == list(range(0, job.steps + 1, effort.each))
    # no episode is longer than the horizon
    assert found.episodes >= job.steps // job.what.horizon - effort.tables


def path_of(job):
    return job.cache.path(job.name, job.request)


OTHERS = ({"seed": 1}, {"lesson": "uniform"}, {"source": "model"}, {"task": "setting"}, {"quick": False})


@pytest.mark.parametrize("change", OTHERS)
def test_another_run_is_another_file(done, change):
    job = dataclasses.replace(done[0], **change)
    assert path_of(job) != path_of(done[0]) and kept(job) is None


def test_a_run_by_other_settings_is_not_taken(done, monkeypatch):
    job = done[0]
    with monkeypatch.context() as patch:
        patch.setitem(runs.SETTINGS, "gamma", 0.9)
        assert kept(job) is None
    with monkeypatch.context() as patch:
        patch.setitem(LESSONS, "self_paced", dataclasses.replace(job.how, settings={"levels": 7}))
        assert kept(job) is None
    with monkeypatch.context() as patch:
        patch.setitem(TASKS, "two", dataclasses.replace(TASKS["two"], text="object a\ntask: closeTo(a, (0, 0), 0.1)"))
        assert kept(job) is None
    assert kept(job) is not None
    path = path_of(job)
    text = path.read_text()
    path.write_text(text[:-9])
    assert kept(job) is None
    path.write_text(text)


def test_the_same_seed_learns_the_same(done, tmp_path):
    again = dataclasses.replace(done[0], folder=str(tmp_path))
    perform(again)
    first, second = kept(done[0]), kept(again)
    assert first is not None and second is not None
    assert (first.curve, first.episodes) == (second.curve, second.episodes)


def record(*curve):
    costs = {"episodes": 100, "cpu": 10.0, "wall": 20.0, "ahead": 0.1, "sampling": 1.0}
    return Record(curve=list(curve), **costs)


def reaching(steps):
    """A run that masters its task after so many steps, if ever."""
    return record((0, 0.0), *[(steps or 9000, 1.0 if steps else 0.3)])


def test_a_run_is_over_when_there_is_nothing_more_to_learn():
    up = [(k, MASTERED) for k in range(IN_A_ROW)]
    assert mastered([(0, 0.0), *up]) and not mastered([(0, 0.0), *up[:-1]]) and not mastered([*up, (9, 0.98)])


def test_the_first_measurement_counts():
    one = record((0, 0.0), (10, 0.5), (20, 0.4), (30, 0.9))
    assert [summary.until(one, mark) for mark in (0.5, 0.8, 0.95)] == [10, 30, None]
    assert summary.usual([one, reaching(50)]) == 40 and summary.usual([one, reaching(None)]) is None


def found(**steps):
    """Runs of one task: of each lesson, the steps of its seeds."""
    given = {lesson: steps.get(lesson, (None,)) for lesson in LESSONS}
    return {("two", lesson, "exact"): [reaching(one) for one in seeds] for lesson, seeds in given.items()}


def test_the_table():
    lines = summary.results(found(random=(2000, 1000, None), uniform=(3000, 3000, 3000)), "two").splitlines()
    assert lines[2].startswith("| random scenes; exact sampler | 1.5k [1k, 2k], 2 of 3 |")
    assert "| 0.77 [0.30, 1.00] | 100 | 10.0 | 20.0 | 10% |" in lines[2]
    assert "| 3k | 3k | 3k | 1.00 |" in lines[4] and "| not within | not within | not within | 0.30 |" in lines[3]
    assert len(lines) == 2 + len(LESSONS)


@pytest.mark.parametrize(
    ("steps", "best", "factor"),
    [
        ({"uniform": (3000, 5000), "self_paced": (1000, 1000), "linear": (1000, 2000)}, "self_paced", 4.0),
        ({"uniform": (1000,), "self_paced": (1100,)}, "self_paced", 1 / 1.1),
        ({"uniform": (1000, None), "linear": (2000,)}, "linear", None),
        ({"uniform": (1000,), "linear": (2000, None)}, None, None),
    ],
)
def test_the_verdict_is_what_the_runs_say(steps, best, factor, monkeypatch):
    monkeypatch.delitem(TASKS, "setting")
    judged = summary.verdict(found(**steps), "two")
    assert (judged.best, judged.factor) == (best, pytest.approx(factor) if factor else None)
    lines = summary.judged(found(**steps)).splitlines()
    assert lines[0] == "|  | Two movable objects; exact sampler | Two movable objects; trained model |"
    assert lines[2] == "| random scenes | not in all runs | - |"
    assert lines[-1].endswith(f" | {'-' if factor is None else f'{factor:.1f}'} | - |")


def test_a_run_that_was_over_keeps_what_it_reached():
    steps, values = together([[(0, 0.0), (10, 0.9)], [(0, 0.1), (10, 0.2), (20, 0.3)]])
    assert steps.tolist() == [0, 10, 20] and values.tolist() == [[0.0, 0.9, 0.9], [0.1, 0.2, 0.3]]


@pytest.fixture
def few_lessons():
    """Three lessons instead of five, one of them with a model's scenes; the order of the table is kept."""
    all_lessons = dict(LESSONS)
    for key in ("random", "dense"):
        del LESSONS[key]
    for key in summary.CURRICULA:
        LESSONS[key] = dataclasses.replace(LESSONS[key], sources=(EXACT,))
    yield
    LESSONS.clear()
    LESSONS.update(all_lessons)


@pytest.mark.long
@pytest.mark.usefixtures("few_lessons")
def test_the_whole_experiment_on_one_task(tmp_path, monkeypatch):
    """Learnt for a moment; the second time nothing is. The slow tests take all lessons and both tasks."""
    monkeypatch.delitem(TASKS, "setting")
    told: list[str] = []
    run("curriculum-deep", tmp_path, seeds=1, workers=1, quick=True, tell=told.append)
    pairs = sum(len(lesson.sources) for lesson in LESSONS.values())
    assert sum("learnt in" in line for line in told) == pairs
    report = json.loads((tmp_path / "curriculum-deep.json").read_text())
    assert len({(one["lesson"], one["source"]) for one in report["runs"]}) == len(report["runs"]) == pairs
    assert [one["task"] for one in report["verdicts"]] == ["two"] and report["figures"] == ["curriculum-deep.png"]
    text = (tmp_path / "curriculum-deep.md").read_text()
    for lesson in LESSONS.values():
        for source in lesson.sources:
            assert f"| {lesson.title}; {SOURCES[source]} |" in text
    assert "object plate, mug" in text and "(curriculum-deep.png)" in text
    files = {path: path.read_bytes() for path in tmp_path.glob("curriculum*")}
    told.clear()
    run("curriculum-deep", tmp_path, seeds=1, workers=1, quick=True, tell=told.append)
    assert told[0] == f"{pairs} of {pairs} runs are there from an earlier run" and len(told) == 2
    assert files == {path: path.read_bytes() for path in tmp_path.glob("curriculum*")}


@pytest.mark.slow
def test_two_workers_learn_what_one_does(tmp_path, monkeypatch):
    monkeypatch.delitem(TASKS, "setting")
    curves = []
    for workers in (1, 2):
        out = tmp_path / str(workers)
        run("curriculum-deep", out, seeds=1, workers=workers, quick=True)
        report = json.loads((out / "curriculum-deep.json").read_text())
        curves.append([(one["lesson"], one["source"], one["curve"], one["episodes"]) for one in report["runs"]])
    assert curves[0] == curves[1]
