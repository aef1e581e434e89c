"""Trainings are kept, and not taken for what they are not."""

import dataclasses

import pytest

from experiments import trainings
from experiments.cache import Cache
from experiments.plan import FULL, Plan
from experiments.problems import PROBLEMS
from experiments.trainings import Job, kept, perform, trained
from experiments.variants import VARIANTS
from scenegen.learn.models.registry import MODELS


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A training of a few steps."""
    job = Job("exp1", 0, 0, True, str(tmp_path_factory.mktemp("trained")))
    seconds = perform(job)
    return job, seconds


def test_what_is_done_is_kept(done):
    job, seconds = done
    found = kept(job)
    assert found is not None and found.cpu_seconds == seconds and found.size == job.path.stat().st_size
    assert found.model.name == "gan" and found.model.spec.checked.sha256 == PROBLEMS["exp1"].load().checked.sha256
    # the state to resume from is gone: it is larger than the model
    assert sorted(path.suffix for path in job.path.parent.iterdir()) == [".json", ".safetensors"]


@pytest.mark.parametrize("change", [{"seed": 1}, {"variant": 1}, {"problem": "exp2"}, {"quick": False}])
def test_another_training_is_another_file(done, change):
    job = dataclasses.replace(done[0], **change)
    assert job.path != done[0].path and kept(job) is None


def test_a_changed_file_is_not_taken(done, tmp_path):
    job = dataclasses.replace(done[0], folder=str(tmp_path))
    record = done[0].path.with_suffix(".json").read_text()
    weights = done[0].path.read_bytes()

    def kept_with(record, weights):
        job.path.with_suffix(".json").write_text(record)
        job.path.write_bytes(weights)
        return kept(job) is not None

    assert kept_with(record, weights)
    assert not kept_with(record, weights[:-1] + bytes([weights[-1] ^ 1]))
    assert not kept_with("not JSON", weights)
    assert not kept_with(record, b"")


def test_a_model_of_another_recipe_is_not_taken(done, monkeypatch):
    """A recipe that changes makes what was trained by it stale."""
    other = dataclasses.replace(done[0].training, config=dataclasses.replace(done[0].training.config, lr=2e-3))
    monkeypatch.setattr(Job, "training", other)
    assert kept(done[0]) is None


def test_a_model_of_another_spec_is_not_taken(done, monkeypatch):
    monkeypatch.setitem(PROBLEMS, "exp1", dataclasses.replace(PROBLEMS["exp1"], spec="first"))
    assert kept(done[0]) is None


def test_the_papers_settings():
    found = {key: VARIANTS[0].config(problem, FULL, 3) for key, problem in PROBLEMS.items()}
    assert {key: one.batch_size for key, one in found.items()} == dict.fromkeys(PROBLEMS, 32) | {"exp2": 512}
    assert {key for key, one in found.items() if one.data == "uniform"} == {"exp1"}
    assert {(one.epochs, one.lr, one.recipe, one.seed) for one in found.values()} == {(50, 1e-3, "paper", 3)}
    assert found["exp3_5"].scenes == 61_867


def test_our_recipes_are_the_same_for_every_experiment():
    ours = [one for one in VARIANTS if one.recipe == "default"]
    assert [one.family for one in ours if one.steps is None] == list(MODELS)
    for one in ours:
        assert len({repr(one.config(problem, FULL, 0)) for problem in PROBLEMS.values()}) == 1


FILES = {(one.family, one.recipe) for one in VARIANTS}


def test_variants_that_differ_in_steps_share_a_training(tmp_path, monkeypatch):
    few = next(place for place, one in enumerate(VARIANTS) if one.family == "flow")
    pair = (VARIANTS[few], dataclasses.replace(VARIANTS[few], steps=5))
    monkeypatch.setattr(trainings, "VARIANTS", pair)
    told: list[str] = []
    found = trained(Plan(tmp_path, (0,), True, 1, told.append), PROBLEMS["exp1"])
    assert list(found) == ["flow", "flow, 5 steps"] and sum("trained in" in line for line in told) == 1
    assert [runs[0].model.trained.steps for runs in found.values()] == [3, 5]


@pytest.mark.slow
def test_two_workers_train_what_one_does(tmp_path):
    problem = PROBLEMS["exp1"]
    files = []
    for workers in (1, 2):
        out = tmp_path / str(workers)
        out.mkdir()
        told: list[str] = []
        plan = Plan(out, (0, 1), True, workers, told.append)
        found = trained(plan, problem)
        assert {name: len(runs) for name, runs in found.items()} == {one.name: 2 for one in VARIANTS}
        assert sum("trained in" in line for line in told) == 2 * len(FILES)
        files.append({path.name: path.read_bytes() for path in Cache.beside(out).folder.glob("*.safetensors")})
    assert files[0] == files[1]
    told.clear()
    trained(plan, problem)
    assert told == [f"{problem.title}: {len(files[0])} of {len(files[0])} models are there from an earlier run"]
