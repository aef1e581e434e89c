"""Training data from scene files: any format, relabelled, checked. The range of phi that balanced training data
covers, where chains of splitting cannot tell it.
"""

import dataclasses
import math
import time

import numpy as np
import pytest
import torch

import scenegen
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.errors import DataError, RequestError
from scenegen.geometry import ANGLE, LENGTH
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, gate
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.robustness import Robustness
from scenegen.learn.training import balanced as balanced_reach
from scenegen.learn.training import feed
from scenegen.learn.training.balanced import draw_balanced
from scenegen.learn.training.config import DATASETS, dataset_maker
from scenegen.learn.training.dataset import held_count, held_places, split, uniform
from scenegen.learn.training.feed import whole_file
from scenegen.learn.training.gathering import Gathering
from scenegen.sampling.growth import rarity
from scenegen.sampling.rarity import RequirementUnmet
from scenegen.scenes.data import RequestData

SPACE = Workspace(x=(-0.3, 0.1), y=(0.7, 2.0))


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def numpy_phi(rows):
    """Experiment 1's labels, written out here."""
    mx, my, _, px, py, _ = rows.double().numpy()
    return np.stack([np.minimum(px - mx, my - py), np.hypot(mx - px, my - py) - 0.25])


def narrow(limit, axis=0):
    """One object whose x (or theta) must be at most `limit`: as rare as one likes."""
    nodes = (Const(limit), Coord(0, axis), Apply("sub", (0, 1)), Atom(2, "atom", (LENGTH, ANGLE)[axis // 2], ()))
    return CheckedSpec("narrow.spec", f"task: {limit} {axis}\n", Workspace(), Core(nodes, {"task": 3}, ("mug",)))


@pytest.mark.long
@pytest.mark.parametrize("name", DATASETS)
def test_every_data_set(name, make_exp1):
    spec = make_exp1(SPACE)
    data = dataset_maker(name)(spec, 500, seeded())
    assert data.rows.shape == (6, 500) and data.phi.shape == (2, 500) and len(data) == 500
    assert data.rows.dtype == data.phi.dtype == torch.float32
    assert (data.objects, data.labels) == (("mug", "plate"), ("task", "safe"))
    assert SPACE.contains(data.rows.double().numpy()).all()
    np.testing.assert_allclose(data.phi.numpy(), numpy_phi(data.rows), atol=1e-6)
    again, other = (dataset_maker(name)(spec, 500, seeded(seed)) for seed in (0, 1))
    assert torch.equal(again.rows, data.rows) and again.sha256 == data.sha256 != other.sha256
    with pytest.raises(dataclasses.FrozenInstanceError):
        data.rows = data.rows


def test_uniform_rates_of_experiment_1(exp1):
    data = uniform(exp1, 20_000, seeded())
    # P(task) = 25 % exactly, P(both) = 21.1 %; 4 standard errors are 1.2 %.
    assert float((data.phi[0] >= 0.0).float().mean()) == pytest.approx(0.25, abs=0.012)
    assert data.positives == pytest.approx(0.211, abs=0.012)
    means = data.rows.mean(dim=1).tolist()
    assert means == pytest.approx([0.5, 0.5, np.pi] * 2, abs=0.06)


def test_unknown_data_set():
    with pytest.raises(RequestError, match="did you mean `uniform`"):
        dataset_maker("unifrom")


@pytest.mark.long
def test_balanced_scenes_are_exact_and_flat(exp1):
    """Jointly over the cells that are in reach: no part of the range has much more or less than its share."""
    data = draw_balanced(exp1, 8000, seeded(1))
    assert len(data) == 8000 and torch.unique(data.rows, dim=1).shape[1] == 8000
    np.testing.assert_allclose(data.phi.numpy(), numpy_phi(data.rows), atol=1e-6)
    joint, plain = (
        np.histogram2d(*phi.numpy(), bins=4, range=((-1.0, 1.0), (-0.25, 1.15)))[0]
        for phi in (data.phi, uniform(exp1, 8000, seeded(1)).phi)
    )
    # Uniform scenes leave one of the 13 parts that scenes reach empty, and two to a dozen or two. The rarest two hold 5
    # to 15 balanced scenes, whatever the seed.
    assert (joint >= 4).sum() == 13 and (joint > 300).sum() == 11
    assert (plain >= 10).sum() == 11 and (plain > 300).sum() == 8
    assert joint.max() < 2 * 8000 / 13


def test_balanced_data_has_the_part_that_is_nearly_solved():
    spec = narrow(0.02)  # phi from -0.98 to 0.02
    data = draw_balanced(spec, 4000, seeded())
    near = float((data.phi.abs() <= 0.02).float().mean())
    assert near == pytest.approx(0.5 + 0.5 * 0.04, abs=0.02)
    far = data.phi[data.phi < -0.02]
    counts = torch.histc(far, 8)
    assert float(counts.max() / counts.min()) < 1.5


@pytest.mark.long
def test_balanced_data_keeps_what_is_required():
    spec = check_text("object mug, plate\nrequire noOverlap()\ntask: closeTo(mug, plate, 0.2)", "apart.spec")
    data = draw_balanced(spec, 500, seeded())
    core = gate(spec.core)
    assert (Robustness(core).rows(data.rows.double())[-1] >= -1e-6).all()


def test_a_label_that_cannot_vary_is_told():
    spec = check_text("task: 0 * x(mug) <= 1 & x(mug) <= 2 + 0 * x(mug)", "still.spec")
    with pytest.raises(RequestError, match="phi of `task` is 1 in every scene"):
        draw_balanced(spec, 100, seeded())


def test_held_objects_and_requirements():
    text = "object mug, plate at (0.5, 0.4, 1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
    spec = check_text(text, "held.spec")
    data = uniform(spec, 3000, seeded())
    assert torch.allclose(data.rows[3:], torch.tensor([0.5, 0.4, 1.0])[:, None].expand(3, 3000))
    assert (Robustness(gate(spec.core)).rows(data.rows)[-1] >= 0.0).all()


def test_a_requirement_that_plain_draws_do_not_meet():
    spec = check_text("object mug, plate\nrequire closeTo(mug, plate, 0.0001)\ntask: leftOf(mug, plate)", "rare.spec")
    with pytest.raises(RequestError, match="too rare for plain draws"):
        uniform(spec, 100, seeded())


TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(TEXT), {"task": (-0.5, 0.5)}, n=40, seed=1)


@pytest.mark.parametrize("ending", [".json", ".jsonl", ".parquet"])
def test_every_format_gives_the_same_scenes(ending, scenes, tmp_path):
    spec = check_text(TEXT, "a.spec")
    data = whole_file(spec, scenes.save(tmp_path / f"s{ending}"), None)
    assert (data.objects, data.labels, len(data)) == (("mug", "plate"), ("task",), 40)
    assert torch.equal(data.rows, torch.from_numpy(scenes.poses.reshape(40, 6).T).float())
    np.testing.assert_allclose(data.phi[0].numpy(), scenes.phi["task"], atol=1e-6)
    first = whole_file(spec, tmp_path / f"s{ending}", 7)
    assert torch.equal(first.rows, data.rows[:, :7])


def test_another_spec_of_the_same_objects_labels_anew(scenes, tmp_path):
    other = check_text("object plate, mug\nnear: closeTo(mug, plate)\nup: aboveOf(mug, plate)\n", "b.spec")
    data = whole_file(other, scenes.save(tmp_path / "s.parquet"), None)
    assert (data.objects, data.labels) == (("plate", "mug"), ("near", "up"))
    assert torch.equal(data.rows[3:], torch.from_numpy(scenes.poses[:, 0].T).float())
    assert torch.equal(data.phi, Robustness(other.core).rows(data.rows))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("object mug, fork\ntask: leftOf(mug, fork)", "the scenes lack `fork`"),
        ("object mug, plate at (0.5, 0.5, 0)\ntask: leftOf(mug, plate)", r"`plate` is held at \(0.5, 0.5, 0\)"),
        ("workspace [0, 0.1] x [0, 1]\nobject mug, plate\ntask: leftOf(mug, plate)", "outside of the workspace in"),
        ("object mug, plate\nrequire aboveOf(mug, plate)\ntask: leftOf(mug, plate)", "does not meet what the spec"),
    ],
)
def test_scenes_that_the_spec_does_not_have(text, said, scenes, tmp_path):
    with pytest.raises(DataError, match=said):
        whole_file(check_text(text, "other.spec"), scenes.save(tmp_path / "s.json"), None)


def test_the_scene_at_fault_is_named(scenes, tmp_path):
    poses = scenes.poses.copy()
    poses[33, 1, 0] = 1.25
    bad = dataclasses.replace(scenes, poses=poses, trusted=True).save(tmp_path / "s.jsonl")
    with pytest.raises(DataError, match="`plate` is outside of the workspace in scene 34"):
        whole_file(check_text(TEXT, "a.spec"), bad, None)


def test_too_few_and_too_many(scenes, tmp_path, monkeypatch):
    spec = check_text(TEXT, "a.spec")
    path = scenes.save(tmp_path / "s.json")
    with pytest.raises(DataError, match="holds 40 scenes, fewer than the 41 of `scenes`"):
        whole_file(spec, path, 41)
    monkeypatch.setattr(feed, "MEMORY_NUMBERS", 7 * 39)
    with pytest.raises(RequestError, match="more scenes than fit into memory"):
        whole_file(spec, path, None)
    assert len(whole_file(spec, path, 39)) == 39


def test_an_empty_file(tmp_path):
    spec = check_text(TEXT, "a.spec")
    header = make_header(spec, {"method": "none"}, RequestData(phi={}, n=1))
    empty = SceneSet(np.empty((0, 2, 3)), {"task": np.empty(0)}, header)
    for ending in (".json", ".parquet"):
        with pytest.raises(DataError, match="no scenes"):
            whole_file(spec, empty.save(tmp_path / f"s{ending}"), None)


DRAWN = "object block[1..3], mug\ntask: forall b in block: leftOf(b, mug)\n"


@pytest.mark.parametrize("ending", [".json", ".parquet"])
def test_a_file_of_drawn_numbers_gives_each_model_its_own_scenes(ending, tmp_path):
    drawn = scenegen.parse(DRAWN)
    scenes = scenegen.sample(drawn, {"task": (-0.5, 0.5)}, n=30, seed=2)
    path = scenes.save(tmp_path / f"s{ending}")
    for numbers, member in drawn.members:
        mine = np.flatnonzero(scenes.counts["block"] == numbers["block"])
        data = whole_file(member.checked, path, None)
        assert (data.objects, len(data)) == (member.objects, 10)
        there = [column for column, name in enumerate(scenes.objects) if name in member.objects]
        assert torch.equal(data.rows, torch.from_numpy(scenes.poses[mine][:, there].reshape(10, -1).T).float())
        np.testing.assert_allclose(data.phi[0].numpy(), scenes.phi["task"][mine], atol=1e-6)
    two = whole_file(check_text(DRAWN.replace("1..3", "2"), "two.spec"), path, 4)
    assert len(two) == 4
    with pytest.raises(DataError, match=r"10 scenes with block\[2\], fewer than the 11"):
        whole_file(check_text(DRAWN.replace("1..3", "2"), "two.spec"), path, 11)
    with pytest.raises(DataError, match=r"the spec does not know|the scenes lack"):
        whole_file(check_text(DRAWN.replace("1..3", "4"), "four.spec"), path, None)


def test_a_number_that_a_file_has_not_is_named(tmp_path):
    scenes = scenegen.sample(scenegen.parse(DRAWN), n=3, seed=2)
    few = scenes.only({"block": 2}, np.flatnonzero(scenes.counts["block"] == 2))
    assert len(few) == 1
    kept = np.flatnonzero(scenes.counts["block"] != 2)
    path = SceneSet(scenes.poses[kept], {"task": scenes.phi["task"][kept]}, scenes.header).save(tmp_path / "s.json")
    with pytest.raises(DataError, match=r"there are no scenes in .*s.json with block\[2\]"):
        whole_file(check_text(DRAWN.replace("1..3", "2"), "two.spec"), path, None)


@pytest.mark.parametrize("total", [2, 3, 10, 11, 57, 2049, 20_481, 1_000_003])
def test_places_are_distinct_and_evenly_spread(total):
    places = held_places(total, held_count(total))
    assert len(places) == held_count(total) < total
    assert int(places[0]) >= 0 and int(places[-1]) < total
    gaps = places.diff()
    assert len(gaps) == 0 or (int(gaps.min()) > 0 and int(gaps.max() - gaps.min()) <= 1)


def test_too_few():
    for total in (0, 1):
        with pytest.raises(DataError, match="too few"):
            held_places(total, held_count(total))


def test_a_split_loses_nothing(exp1):
    data = uniform(exp1, 101, torch.Generator().manual_seed(0))
    training, held = split(data, 10)
    assert (len(training), len(held)) == (91, 10)
    both = torch.cat([training.rows, held.rows], dim=1)
    assert torch.equal(torch.unique(both, dim=1), torch.unique(data.rows, dim=1))
    assert held.phi.shape == (2, 10)


TEXT_REACH = "object a, b\nrequire dist(a, b) >= 10 cm\ntask: dist(a, b) <= 30 cm"


@pytest.fixture
def grown(monkeypatch):
    """Chains find nothing; growth takes little time."""
    monkeypatch.setattr(balanced_reach, "measure", lambda *given, **more: RequirementUnmet(-0.1, 1))
    monkeypatch.setattr(rarity, "TAIL_EFFORT", 2e7)


def test_growth_tells_what_chains_do_not_reach(grown):
    """phi runs from 30 cm less the diagonal of the table to 20 cm."""
    low, high = balanced_reach.reach(check_text(TEXT_REACH), 0)["task"]
    assert 0.3 - math.sqrt(2.0) <= low < -0.8 and 0.17 < high <= 0.2


def test_what_nothing_meets_is_an_error(grown):
    nothing = TEXT_REACH.replace(">= 10 cm", ">= 10 m")
    with pytest.raises(RequestError):
        balanced_reach.reach(check_text(nothing), 0)


def test_time_is_kept(grown):
    gathering = Gathering(0.0)
    with pytest.raises(RequestError) as caught:
        balanced_reach.reach(check_text(TEXT_REACH), 0, gathering, time.monotonic() - 1.0)
    assert caught.value.diagnostics[0].code == "no-time-to-train"
