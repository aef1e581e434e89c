"""What is measured of scenes, against scenes worked out by hand. Trainings are kept, and not taken for what they are
not.
"""

import dataclasses

import numpy as np
import pytest

from experiments import trainings
from experiments.cache import Cache
from experiments.known import HITS, KNOWN
from experiments.measure import (
    accuracy,
    columns,
    covered,
    in_range,
    ks_distance,
    margins,
    phi_of,
    rows_of,
    shares,
    target,
)
from experiments.plan import FULL, Plan
from experiments.problems import BAND, ORDERINGS, PROBLEMS
from experiments.samplers import plain_rejection
from experiments.trainings import Job, kept, perform, trained
from experiments.variants import VARIANTS
from scenegen.api.sample import sample
from scenegen.learn.models.registry import MODELS

EXP1, SORT = PROBLEMS["exp1"], PROBLEMS["exp3_3"]


def blocks(*centres):
    """One scene (9, 1) of three blocks."""
    return np.array([[x, y, 0.0] for x, y in centres]).reshape(-1, 1)


@pytest.mark.parametrize(
    "scene, ordering, margin",
    [
        (blocks((0.1, 0.5), (0.3, 0.5), (0.35, 0.5)), 0, 0.05),
        (blocks((0.9, 0.5), (0.7, 0.6), (0.2, 0.5)), 1, 0.2),
        (blocks((0.5, 0.1), (0.4, 0.2), (0.5, 0.4)), 2, 0.1),
        (blocks((0.5, 0.9), (0.4, 0.2), (0.5, 0.1)), 3, 0.1),
    ],
)
def test_orderings(scene, ordering, margin):
    found = margins(scene)
    assert found[:, 0].argmax() == ordering and found[ordering, 0] == pytest.approx(margin)
    # the spec says the same
    assert phi_of(SORT.load(), scene)[0, 0] == pytest.approx(margin)
    assert shares(SORT, scene, "raw")[f"raw:{ORDERINGS[ordering]}"] == 1.0


def test_shares_are_of_orderings_only():
    scenes = np.concatenate([blocks((0.1, 0), (0.3, 0), (0.5, 0))] * 3 + [blocks((0, 0.1), (0, 0.3), (0, 0.5))], axis=1)
    assert list(shares(SORT, scenes, "x").values()) == [0.75, 0.0, 0.25, 0.0]
    assert shares(EXP1, scenes, "x") == {} and shares(SORT, scenes[:, :0], "x") == {}


def test_errors_and_range_by_hand():
    """Mug at the upper left: dx = 0.2, dy = 0.3, so task = 0.2, safe = sqrt(0.13) - 0.25; wanted (0.19, 0.08)."""
    spec, scene = EXP1.load(), np.array([0.3, 0.8, 0.0, 0.5, 0.5, 0.0]).reshape(-1, 1)
    safe = np.sqrt(0.13) - 0.25
    found = accuracy(EXP1, spec, scene)
    assert found["mean:task"] == pytest.approx(0.01) and found["error:safe"] == pytest.approx(safe - 0.08)
    assert found["within"] == 0.0 and in_range(EXP1, spec, scene) == 0.0
    truth = rows_of(sample(spec, EXP1.band, 50, seed=0, spread="base"))
    assert in_range(EXP1, spec, truth) == 1.0
    assert in_range(EXP1, spec, np.concatenate([truth, np.repeat(scene, 50, axis=1)], axis=1)) == 0.5


def test_no_scenes_cover_nothing():
    spec = EXP1.load()
    truth = rows_of(sample(spec, EXP1.band, 64, seed=0, spread="base"))
    assert covered(truth, truth[:, :0]) == 0.0 and in_range(EXP1, spec, truth[:, :0]) == 0.0
    assert covered(truth, truth) == 1.0


def test_targets_are_in_the_order_of_the_labels():
    assert target(EXP1, ("task", "safe"), 2).tolist() == [[pytest.approx(0.19)] * 2, [pytest.approx(0.08)] * 2]
    assert columns({"a": 1.0, "b": 2.0}, ("b", "a"), 1).tolist() == [[2.0], [1.0]]


def test_plain_rejection_finds_the_share_that_the_exact_sampler_names():
    problem = PROBLEMS["exp3_5"]
    spec, draws = problem.load(), 4 * 65_536
    hits, _ = plain_rejection(problem, spec, draws)
    scenes = sample(spec, problem.band, 2_000, seed=0, spread="base", method="rejection")
    expected = draws * 10.0 ** scenes.header.sampler["log10_probability"]
    assert abs(hits.shape[1] - expected) < 5.0 * np.sqrt(expected)
    assert (abs(phi_of(spec, hits) - 0.05) <= BAND).all()
    again, _ = plain_rejection(problem, spec, draws)
    assert (again == hits).all()


@pytest.mark.parametrize("key", PROBLEMS)
def test_what_was_there_before_fits_the_labels(key):
    labels = PROBLEMS[key].load().labels
    assert set(labels) == set(PROBLEMS[key].wanted) and key in HITS
    for one in KNOWN[key]:
        assert len(one.error) in (0, len(labels)) and len(one.absolute) in (0, len(labels))
        assert one.error or one.absolute


def test_ks_distance_sees_what_coverage_does_not():
    generator = np.random.default_rng(0)
    reference, same, narrowed = (generator.random((6, 2000)) for _ in range(3))
    narrowed[1, 1000:] = 0.4 + 0.2 * narrowed[1, 1000:]  # half of the scenes crowd in the middle
    assert ks_distance(reference, same) < 0.06
    assert 0.18 < ks_distance(reference, narrowed) < 0.25  # 0.2 but for noise
    assert covered(reference, narrowed) > 0.9  # and would pass for diverse
    assert ks_distance(reference, reference[:, :0]) == 1.0


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
    assert found.model.name == "paper-gan" and found.model.spec.checked.sha256 == PROBLEMS["exp1"].load().checked.sha256
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
    assert {(one.epochs, one.lr, one.model, one.seed) for one in found.values()} == {(50, 1e-3, "paper-gan", 3)}
    assert found["exp3_5"].scenes == 61_867


def test_our_recipes_are_the_same_for_every_experiment():
    ours = [one for one in VARIANTS if one.recipe == "default"]
    assert [one.family for one in ours if one.steps is None] == [
        name for name in MODELS if not name.startswith("paper")
    ]
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
