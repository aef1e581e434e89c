"""A fit of outcomes: what it finds out, its file, and what it is good for."""

import json

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import MODEL_OF_ANOTHER_SPEC
from scenegen.errors.requests import OUT_OF_PLACE, WRONG_VALUE
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.fit import Fit, base_rate, fit_outcomes, strata
from scenegen.play.suites.suite import Suite

from .conftest import OWN, TASK, write_outcomes


def test_phi_predicts_a_policy_that_goes_by_phi(fitted):
    task = Fit.load(fitted("by phi")).tasks[0]
    assert task.findings == [] and {one.kind for one in task.model.curves} == {"phi"}
    assert task.held_out.auc_of_phi[1] > 0.8 and task.held_out.auc[0] > 0.85
    assert task.held_out.calibration_error < task.held_out.by_chance[1]


@pytest.mark.long
def test_where_phi_predicts_nothing_that_is_said(fitted):
    reach, nothing = (Fit.load(fitted(policy)).tasks[0] for policy in ("by reach", "by nothing"))
    assert len(reach.findings) == 1 and reach.findings[0].startswith("phi does not predict success in cube: AUC 0.")
    assert reach.held_out.auc[1] > 0.85
    assert len(nothing.findings) == 2 and nothing.findings[1].startswith("nothing measured at the start")
    assert nothing.model.curves == ()


def test_the_base_rate_is_that_of_the_bands(halves, outcomes, fitted):
    suite, task = Suite.load(halves), Fit.load(fitted("by phi")).tasks[0]
    ended = [json.loads(line) for line in outcomes("by phi").read_text().splitlines()[1:]]
    won = [sum(one["success"] for one in ended if one["band"] == f"level{k}") for k in (1, 2)]
    assert (
        task.base_rate == pytest.approx(base_rate(won, [100, 100], [0.5, 0.5])) and len(suite) == task.episodes == 200
    )


def test_predictions_are_near_the_truth(fitted):
    """At new starts, whatever else the spec requires."""
    fit = Fit.load(fitted("by phi"))
    for text in (TASK, OWN):
        scenes = scenegen.sample(scenegen.parse(text), {"goal": (-0.9, 0.0)}, n=400, seed=9)
        true = 1.0 / (1.0 + np.exp(-14.0 * (scenes.phi["goal"] + 0.4)))
        assert fit.predict(scenes).shape == (400,) and np.abs(fit.predict(scenes) - true).mean() < 0.07


def test_the_file_reads_back(fitted, tmp_path):
    fit = Fit.load(fitted("by phi"))
    fit.save(tmp_path / "again.fit")
    assert Fit.load(tmp_path / "again.fit") == fit
    assert (tmp_path / "again.fit").read_bytes() == fitted("by phi").read_bytes()


def test_the_format(golden, fitted):
    """Names and kinds of values: numbers differ in their last digits between processors."""

    def shape(value):
        if isinstance(value, dict):
            return {name: shape(one) for name, one in value.items()}
        if isinstance(value, list):
            return [shape(value[0]), "..."] if value else []
        return "number" if isinstance(value, float) else value

    found = json.loads(fitted("by phi").read_text())
    assert len(found["run"]["digest"]) == len(found["digest"]) == 64
    found["run"]["digest"] = found["digest"] = "digest"
    golden("play/fit/format.json", json.dumps(shape(found), indent=1) + "\n")


def test_a_fit_of_a_header_alone_is_refused(fitted, tmp_path):
    text = fitted("by phi").read_text()
    (tmp_path / "head.fit").write_text(text[: text.index(',\n "tasks"')] + "}")
    (tmp_path / "none.fit").write_text(text[: text.index('"tasks"')] + '"tasks": []}')
    for name in ("head.fit", "none.fit"):
        with pytest.raises(DataError) as caught:
            Fit.load(tmp_path / name)
        assert caught.value.diagnostics[0].kind is NOT_A_SUITE and "`tasks`" in str(caught.value)


def test_where_all_ended_alike_nothing_is_told(halves, outcomes, tmp_path):
    fit = fit_outcomes([outcomes("never")], halves)
    (task,) = fit.tasks
    assert task.held_out is None and task.base_rate[:2] == (0.0, 0.0) and 0.0 < task.base_rate[2] < 0.05
    assert task.findings == ["nothing can be told of success in cube: all 200 episodes ended alike"]
    fit.save(tmp_path / "never.fit")
    assert Fit.load(tmp_path / "never.fit").tasks == fit.tasks


@pytest.mark.long
def test_one_failure_tells_next_to_nothing(halves, outcomes):
    (task,) = fit_outcomes([outcomes("but for one")], halves).tasks
    (said,) = task.findings
    assert said.startswith("it cannot be told whether phi predicts success in cube: AUC 0.")
    for _, low, high in (task.held_out.auc, task.held_out.auc_of_phi):
        assert high - low > 0.7


def test_outcomes_without_episodes_are_refused(halves, tmp_path):
    with pytest.raises(RequestError) as caught:
        fit_outcomes([write_outcomes(tmp_path / "none.jsonl", halves, "by phi", episodes=0)], halves)
    assert caught.value.diagnostics[0].kind is OUT_OF_PLACE and "no episodes" in str(caught.value)


def test_runs_of_other_lengths_are_refused(halves, outcomes, tmp_path):
    longer = write_outcomes(tmp_path / "longer.jsonl", halves, "by phi", steps=99)
    with pytest.raises(RequestError, match="its steps is 99, not None"):
        fit_outcomes([outcomes("by phi"), longer], halves)


def test_scenes_of_other_specs_are_refused(fitted):
    with pytest.raises(RequestError) as caught:
        Fit.load(fitted("by phi")).predict(scenegen.sample(scenegen.parse("leftOf(mug, plate)"), n=2))
    assert caught.value.diagnostics[0].kind is MODEL_OF_ANOTHER_SPEC and "`cube`" in caught.value.diagnostics[0].help
    wider = scenegen.parse(OWN.replace("12 cm", "14 cm"))
    with pytest.raises(RequestError):
        Fit.load(fitted("by phi")).predict(scenegen.sample(wider, n=2))


@pytest.mark.parametrize(
    "old, new",
    [
        ("scenegen/fit", "scenegen/outcomes"),
        ('"version": 2', '"version": 1'),
        ('"episodes": 200', '"episodes": 201'),
        ('"strength": ', '"strength": 1'),
        ('"digest": "', '"digestive": "'),
        ('"intercept": ', '"intercept": NaN, "odd": '),
        ("{", ""),
        ('"knots": [', '"knots": [9.0,'),
    ],
)
def test_files_that_are_no_fits_are_refused(fitted, tmp_path, old, new):
    path = tmp_path / "odd.fit"
    path.write_text(fitted("by phi").read_text().replace(old, new, 1))
    with pytest.raises(DataError) as caught:
        Fit.load(path)
    assert caught.value.diagnostics[0].kind is NOT_A_SUITE and "is not a fit of outcomes" in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(DataError):
        Fit.load(tmp_path / "none.fit")


@pytest.mark.long
def test_several_runs_of_one_policy(halves, outcomes, tmp_path):
    """Repeats are of the same starts, and the base rate does not take them for new ones."""
    again = write_outcomes(tmp_path / "again.jsonl", halves, "by phi", seed=1)
    task = fit_outcomes([outcomes("by phi"), again], halves, monotone=True).tasks[0]
    assert (task.episodes, task.starts) == (400, 200)
    assert all(height >= 0.0 for one in task.model.curves if one.kind == "phi" for height in one.heights)
    once = fit_outcomes([again], halves).tasks[0]
    assert np.diff(task.base_rate[1:]) == pytest.approx(np.diff(once.base_rate[1:]), rel=0.1)


def test_runs_of_two_policies_are_refused(halves, outcomes):
    with pytest.raises(RequestError) as caught:
        fit_outcomes([outcomes("by phi"), outcomes("by reach")], halves)
    assert caught.value.diagnostics[0].kind is OUT_OF_PLACE and "its policy is by reach, not by phi" in str(
        caught.value
    )
    with pytest.raises(RequestError) as caught:
        fit_outcomes([], halves)
    assert caught.value.diagnostics[0].kind is WRONG_VALUE


def test_too_few_episodes_are_refused(halves, tmp_path):
    few = write_outcomes(tmp_path / "few.jsonl", halves, "by phi", episodes=30)
    with pytest.raises(RequestError) as caught:
        fit_outcomes([few], halves)
    assert caught.value.diagnostics[0].kind is OUT_OF_PLACE and "30 of cube" in str(caught.value)


def test_outcomes_of_another_suite_are_refused(halves, tmp_path):
    other = write_outcomes(tmp_path / "other.jsonl", halves, "by phi")
    other.write_text(other.read_text().replace(Suite.load(halves).digest, "f" * 64))
    with pytest.raises(DataError):
        fit_outcomes([other], halves)


# --------------------------------------------------------------------------------------------------------------------
# Strata of a fit, and the base rate that they give.


@pytest.mark.long
def test_strata_of_a_fit_tell_the_base_rate_with_few_episodes(fitted):
    """By the road that docs/fit.md shows: strata, shares of episodes, scenes of each stratum, and their outcomes."""
    spec, fit = scenegen.parse(TASK), Fit.load(fitted("by phi"))
    ends, probability, episodes = strata(fit, spec, 100, scenes=20_000)
    assert episodes.sum() == 100 and probability.sum() == pytest.approx(1.0)
    rng, won = np.random.default_rng(0), []
    for k, n in enumerate(episodes):
        scenes = scenegen.sample(
            spec, n=int(n), seed=k, spread="base", success=(ends[k], ends[k + 1]), under=fitted("by phi")
        )
        won.append(int((rng.random(n) < 1.0 / (1.0 + np.exp(-14.0 * (scenes.phi["goal"] + 0.4)))).sum()))
    base = scenegen.sample(spec, n=50_000, seed=77, spread="base").phi["goal"]
    true = float((1.0 / (1.0 + np.exp(-14.0 * (base + 0.4)))).mean())
    _, low, high = base_rate(won, episodes, probability)
    plain = base_rate([true * 100], [100], [1.0])
    assert low <= true <= high and high - low < 0.8 * (plain[2] - plain[1])
