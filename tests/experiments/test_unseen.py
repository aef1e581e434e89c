"""Random specs: the same for everyone, all of them specs, and what is asked of their models."""

import hashlib
import time

import numpy as np
import pytest

from experiments.__main__ import parser
from experiments.plan import Plan
from experiments.run import run
from experiments.unseen import queries as unseen
from experiments.unseen import report
from experiments.unseen.named import NAMED, named_queries, named_spec
from experiments.unseen.patience import CpuBudget
from experiments.unseen.queries import QUANTILES, quantiles, queries, truth
from experiments.unseen.report import BARS, _bars, _figures, _missing, _scope, _specs, _targets
from experiments.unseen.runs import Row, Run
from experiments.unseen.specs import REPORT, TUNE, TWELVE, spec_text
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.lang.checker import check_text
from scenegen.sampling.engine.run import SampledScenes


def test_the_problems_never_change():
    """Reports of all versions are about the same specs. With another number here none could be compared."""
    text = "".join(spec_text(seed) for seed in (*TUNE, *REPORT)) + TWELVE
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == "0ca37835108b8266"
    assert not set(TUNE) & set(REPORT) and len(TUNE) == len(REPORT) == 40


@pytest.mark.parametrize("seed", [*TUNE, *REPORT])
def test_every_seed_is_a_spec(seed):
    spec = check_text(spec_text(seed), "random.spec")
    assert 2 <= len(spec.objects) <= 10 and 1 <= len(spec.labels) <= 2


def test_together_they_are_about_everything():
    text = "".join(map(spec_text, TUNE))
    for word in (
        "closeTo",
        "leftOf",
        "angle",
        "facing",
        "clearOf",
        "|",
        "forall",
        "exists",
        "require",
        "safe:",
        "between",
    ):
        assert word in text
    assert len(check_text(TWELVE, "twelve.spec").labels) == 12


def test_quantiles_are_of_half_the_range_and_half_its_middle():
    assert quantiles((-1.0, 1.0)) == pytest.approx([2.0 * share - 1.0 for share in QUANTILES], abs=1e-3)
    random = np.random.default_rng(0)
    scenes = np.concatenate([random.uniform(-2.0, 0.1, 50_000), random.uniform(-0.1, 0.1, 50_000)])
    assert quantiles((-2.0, 0.1)) == pytest.approx(np.quantile(scenes, QUANTILES), abs=0.02)


def test_queries_ask_for_what_there_is():
    spec = check_text("object a, b\none: leftOf(a, b)\ntwo: closeTo(a, b, 0.3)", "two.spec")
    found, missing = queries(spec, {"one": (-0.9, 0.9), "two": (-0.9, 0.25)}, 3)
    assert [sorted(query.wanted) for query in found] == [["one"]] * 3 + [["two"]] * 3 + [["one", "two"]] * 3
    rows, phi = truth(spec, found[-1], 20, 1)
    assert rows.shape == (6, 20)
    for place, label in enumerate(spec.labels):
        assert np.abs(phi[place] - found[-1].wanted[label]).max() <= found[-1].half[label] + 1e-9
    assert not missing


def test_what_is_too_rare_is_named_with_the_reason(monkeypatch):
    nothing = SampledScenes(np.empty((6, 0)), np.empty((2, 0)), {}, (), NO_TIME_TO_CHECK())
    monkeypatch.setattr(unseen, "draw", lambda *_: nothing)
    spec = check_text("object a, b\none: leftOf(a, b)\ntwo: closeTo(a, b, 0.3)", "two.spec")
    found, missing = queries(spec, {"one": (-0.9, 0.9), "two": (-0.9, 0.25)}, 3)
    assert [sorted(query.wanted) for query in found] == [["one"]] * 3 + [["two"]] * 3
    assert len(missing) == 3 and all(line.startswith("one ") and "value of two: " in line for line in missing)


def test_the_limit_counts_work_and_not_waiting(monkeypatch):
    budget = CpuBudget(5.0, started=time.monotonic() - 1000.0)
    assert not budget.is_spent and not budget.overdrawn and budget.ends > time.monotonic()
    assert CpuBudget(5.0, used=time.process_time() - 5.1).is_spent
    assert CpuBudget(5.0, used=time.process_time() - 6.0).overdrawn


def row(error, coverage):
    figures = {"ks": 0.1, "sliced": 0.13, "energy": 0.0, "required": 1.0, "returned": 0.95, "alone": (0.1, 0.8)}
    true = {"true_coverage": 0.97, "true_ks": 0.05, "true_sliced": 0.06, "true_energy": 0.0}
    return Row(wanted={"task": 0.0}, error=error, coverage=coverage, **figures, **true)


def test_the_report_has_the_median_the_worst_decile_and_the_worst_row():
    rows = [row(0.001 * number, 0.99 - 0.01 * number) for number in range(11)]
    runs = [
        Run(seed=1, spec="", objects=2, labels=1, rows=rows, cpu_seconds=60.0, size=10, speed=6e4),
        Run(seed=2, spec="", objects=2, labels=1, failed="constant"),
    ]
    assert "| error of phi, raw | 0.0050 | 0.0090 | 0.0100 |" in _figures(runs)
    assert "| coverage, raw | 0.9400 | 0.9000 | 0.8900 |" in _figures(runs)
    bars = _bars(runs)
    assert (
        "| raw error <= 0.01 in 90 % | 100.0 % | yes |" in bars and "| sliced KS <= 0.12 in 90 % | 0.0 % | no |" in bars
    )
    assert "| raw coverage >= 0.90 in 90 % | 90.9 % | yes |" in bars and len(bars.splitlines()) == 2 + len(BARS) + 3
    assert _specs(runs).splitlines()[2].startswith("| 1 | 2 | 1 | 11 | 0 | 0.0100 | 0.890 |")


def test_training_seeds_are_compared_on_the_specs_that_all_have():
    good, bad = row(0.001, 0.99), row(0.02, 0.99)
    common = {"spec": "", "objects": 2, "labels": 1, "cpu_seconds": 60.0, "size": 10}
    runs = [
        Run(seed=1, rows=[good, bad], speed=6e4, **common),
        Run(seed=2, rows=[bad, bad], **common),
        Run(seed=1, training_seed=1, rows=[good, good], speed=4e4, **common),
    ]
    bars = _bars(runs)
    assert "| bar | met by | held | each of 2 training seeds, on 1 specs |" in bars
    assert "| raw error <= 0.01 in 90 % | 50.0 % | no | 50.0 % to 100.0 % |" in bars
    assert "| raw scenes >= 50,000 a CPU second | 50.0 % | no | 0.0 % to 100.0 % |" in bars  # one was not measured
    assert _specs(runs).splitlines()[3].endswith("| 60 | 0 | - |")


def test_the_report_says_what_is_not_in_it():
    rare = Run(seed=3, training_seed=1, spec="", objects=2, labels=1, missing=["task 0.1: found 3 of 4,000"])
    runs = [rare, Run(seed=2, spec="", objects=2, labels=1, failed="constant")]
    assert "| 3, seed 1 | task 0.1: found 3 of 4,000 |" in _missing(runs) and "| 2 | constant |" in _missing(runs)
    assert _scope(runs, 80).startswith("2 of 80 runs: 1 with training seed 0, 1 with training seed 1. 1 of")
    assert _missing([]) == "Nothing is missing."


def test_models_are_measured_spec_by_spec_and_reported_apart(monkeypatch, tmp_path):
    """So that a cut leaves both models half measured, and not one of them."""

    def done(plan, jobs):
        common = {"spec": "", "objects": 2, "labels": 1}
        return {
            job: Run(seed=job.seed, rows=[row(0.001, 0.8 if job.model == "gan" else 0.9)], **common) for job in jobs
        }

    monkeypatch.setattr(report, "_run", done)
    found = report.run_games(Plan(tmp_path, (1000, 1001), False, 1, print))
    assert [(run["seed"], run["model"]) for run in found.data["runs"]] == [
        *((1000, "gan"), (1000, "aae"), (1001, "gan"), (1001, "aae"))
    ]
    assert "| raw coverage >= 0.85 in 80 % | 0.0 % | no |" in found.blocks["gan-bars"]
    assert "| raw coverage >= 0.85 in 80 % | 100.0 % | yes |" in found.blocks["aae-bars"]


@pytest.mark.parametrize("name", NAMED)
def test_named_specs_are_asked_for_labels_that_they_have(name):
    spec = named_spec(name)
    asked = named_queries(name, spec, dict.fromkeys(spec.labels, (-1.0, 1.0)))
    assert asked and all(set(query.wanted) <= set(spec.labels) for query in asked)


def test_single_targets_stand_beside_the_truth():
    [line] = _targets([Run(seed=0, name="pairs", spec="", objects=10, labels=1, rows=[row(0.001, 0.9)])]).splitlines()[
        2:
    ]
    assert line.startswith(
        "| pairs | 0 | 0.0010 | 0.900 (0.970) | 0.100 (0.050) | 0.130 (0.060) | 0.950 | 0.100; 0.80 |"
    )


def test_seeds_of_the_command():
    ask = parser().parse_args(["unseen", "--out", "x", "--seeds", "1000:1040", "--epochs", "3"])
    assert ask.seeds == (1000, 1040) and ask.epochs == 3
    assert parser().parse_args(["exp1", "--out", "x", "--seeds", "2"]).seeds == 2
    assert not ask.kept and ask.trainings == 1


@pytest.mark.parametrize("seeds", [(5, 5), (-1, 3), (0, 1000), 0])
def test_seeds_out_of_range_are_refused(seeds, tmp_path):
    with pytest.raises(RequestError, match="seeds"):
        run("unseen", tmp_path, seeds=seeds)


@pytest.mark.slow
def test_a_run_goes_on_where_it_stopped(tmp_path):
    told = []
    for _ in range(2):
        run("unseen", tmp_path, seeds=(9, 10), workers=1, quick=True, tell=told.append)
    assert sum("trained and measured" in line for line in told) == 1
    assert "| 9 | 2 | 1 | 3 | 0 |" in (tmp_path / "unseen.md").read_text()
