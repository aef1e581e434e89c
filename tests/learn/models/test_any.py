"""The model of any spec: what is asked of it is answered as by other models, or refused with the reason."""

import json
import subprocess
import sys

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import RequestError
from scenegen.errors.learning import NOT_MEASURED, POOR_MODEL
from scenegen.learn import any as any_model
from scenegen.learn.any import compared, exact_scenes, left_out
from scenegen.learn.models.codec import ways_of
from scenegen.learn.models.graph_flow import shipped
from scenegen.sampling.request import Range, SampleRequest

TEXT = """object plate, mug, bowl
require noOverlap()
goal: leftOf(mug, plate) & (closeTo(mug, plate, 20 cm) | closeTo(bowl, plate, 25 cm))
"""


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(TEXT)


@pytest.mark.long
def test_its_scenes_are_verified_and_repeat(spec):
    scenes = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=300, method="any", seed=4)
    assert len(scenes) == 300 and all(-0.1 <= one <= 0.0 for one in scenes.phi["goal"])
    assert scenes.header.sampler["method"] == "model" and scenes.header.sampler["model"] == "any"
    again = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=300, method="any", seed=4, workers=2)
    assert np.array_equal(scenes.poses, again.poses)
    model = scenegen.load_model("any", spec)
    assert np.array_equal(scenes.poses, scenegen.sample(model, {"goal": (-0.1, 0.0)}, n=300, seed=4).poses)
    other = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=300, method="any", seed=5)
    assert not np.array_equal(scenes.poses, other.poses)


@pytest.mark.long
def test_its_scenes_go_into_files_and_are_judged(spec, tmp_path):
    written = scenegen.sample_to(tmp_path / "a.parquet", spec, {"goal": (0.0, None)}, n=500, method="any")
    assert written.count == 500 and scenegen.read_scenes(tmp_path / "a.parquet").phi["goal"].min() >= 0.0


@pytest.mark.long
def test_raw_scenes_are_near_their_phi(spec):
    model = scenegen.load_model("any", spec)
    wanted = torch.full((1, 500), -0.05)
    rows = model.trained.propose(wanted, torch.Generator().manual_seed(0))
    phi = spec.robustness().rows(rows)[0]
    assert float((phi + 0.05).abs().mean()) < 0.01
    assert scenegen.sample(model, {"goal": (-0.1, 0.0)}, n=50, raw=True).header.sampler["raw"] is True


def test_it_does_not_wait_for_sympy():
    """torch imports it, which takes half a second, where slopes are given to begin with."""
    program = (
        f"import sys, scenegen; scenegen.sample(scenegen.parse({TEXT!r}), n=10, method='any'); print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "torch" in done.stdout.split() and "sympy" not in done.stdout.split()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time 10 steps\nobject mug, plate\ngoal: eventually leftOf(mug, plate)\n", "single scenes"),
        ("object mugs[1..3]\nobject plate\ngoal: forall m in mugs: leftOf(m, plate)\n", "number"),
        ("object tray, book\nobject mug on any of [tray, book]\ngoal: leftOf(mug, book)\n", "surface"),
    ],
)
def test_what_it_does_not_take_is_refused(text, why):
    with pytest.raises(RequestError, match=why):
        scenegen.load_model("any", scenegen.parse(text))


def test_it_has_to_be_told_of_which_spec():
    with pytest.raises(RequestError, match="of which spec"):
        scenegen.load_model("any")


def test_a_part_that_is_left_out_is_named(spec):
    request = SampleRequest({"goal": Range(-0.05, 0.05)}, 400, seed=1, spread="base")
    exact, _ = exact_scenes(spec.checked, request)
    assert left_out(spec.checked, exact, exact) == "" and compared(spec.checked, exact, exact, "goal") == []
    decides = ways_of(spec.checked, torch.from_numpy(exact))[0].numpy()
    texts = [getattr(spec.checked.core.nodes[node], "text", "") for node in decides]
    kept = exact[:, [not text.startswith("closeTo(bowl") for text in texts]]
    assert 100 < kept.shape[1] < 0.95 * exact.shape[1]
    said = left_out(spec.checked, exact, kept)
    assert said.startswith("`closeTo(bowl, plate, 0.25)` decides `goal` in 0% of them")
    found = compared(spec.checked, exact, kept, "goal=-0.05:0.05")
    assert found and {one.kind for one in found} == {POOR_MODEL} and said in found[-1].title


@pytest.mark.long
def test_it_says_where_it_could_not_be_compared(spec, monkeypatch):
    model = scenegen.load_model("any", spec)
    looked = []
    monkeypatch.setattr(
        any_model, "exact_scenes", lambda *asked: looked.append(asked) or (np.empty((9, 0)), np.empty((1, 0)))
    )
    satisfied = {"goal": Range(0.0, None)}
    model.proposer_of(spec.checked, satisfied)
    [said] = model.advice(SampleRequest(satisfied, 10), None)
    assert said.kind is NOT_MEASURED and len(looked) == 1, "what is too rare is not looked for twice"


def test_the_card_of_the_weights():
    card, weights = shipped()
    assert card.steps > 0 and card.specs > 0 and sum(one.numel() for one in weights.values()) < 3_000_000
    assert all(bool(torch.isfinite(one).all()) for one in weights.values())


@pytest.mark.long
def test_it_can_be_tuned_to_one_spec(spec, tmp_path):
    model = scenegen.train(spec, "any", out=tmp_path / "m.safetensors", scenes=600, epochs=1)
    assert model.name == "any" and model.trained.card.epochs_done == 1
    again = scenegen.load_model(tmp_path / "m.safetensors", spec)
    scenes = scenegen.sample(again, {"goal": (-0.1, 0.0)}, n=50)
    assert len(scenes) == 50 and json.loads(json.dumps(scenes.header.sampler))["model"] == "any"
    fresh = shipped()[1]["goal.made.weight"]
    assert not torch.equal(again.trained.model.networks.goal.made.weight, fresh)


@pytest.mark.long
def test_with_what_is_held_it_is_compared_with_what_is_held(spec):
    held = {"plate": (0.3, 0.7)}
    scenes = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=400, method="any", fix=held)
    assert np.allclose(scenes.poses[:, 0, :2], (0.3, 0.7))
    # networks do not know what a request holds, and it is said that this shows
    assert [one.kind for one in scenes.warnings] == [POOR_MODEL]
    free = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=400, method="any")
    assert free.warnings == ()
