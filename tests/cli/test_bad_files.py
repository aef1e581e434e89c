"""Scenes files and model files that are not what they should be."""

import json

import pytest
import safetensors.torch


@pytest.fixture
def model(here):
    """A model file of good.spec, barely trained, with its training state beside it."""
    import scenegen

    scenegen.train(scenegen.load("good.spec"), "gan", recipe="paper", out="m.safetensors", epochs=1, scenes=64)
    return here / "m.safetensors"


@pytest.fixture
def scenes(here):
    import scenegen

    scenegen.sample(scenegen.load("good.spec"), {"task": (0.1, 0.2)}, n=3).save("s.json")
    return here / "s.json"


def test_scenes_of_other_objects(refused, scenes, golden):
    golden("cli/errors/scenes_of_other_objects.txt", refused("eval", "forks.spec", "s.json"))


def _later(data):
    data["version"] = 3


def _other_format(data):
    data["format"] = "scenegen/pictures"


def _lost_object(data):
    del data["scenes"][1]["poses"]["mug"]


def _word_for_a_number(data):
    data["scenes"][0]["poses"]["mug"]["x"] = "left"


def _no_scenes(data):
    data["scenes"] = []


def _other_labels(data):
    data["scenes"][2]["phi"] = {"other": 0.1}


CHANGES = [_later, _other_format, _lost_object, _word_for_a_number, _no_scenes, _other_labels]


@pytest.mark.parametrize("change", CHANGES)
def test_changed_scenes_file(change, refused, scenes, golden):
    data = json.loads(scenes.read_text())
    change(data)
    scenes.write_text(json.dumps(data))
    said = refused("eval", "good.spec", "s.json")
    golden(f"cli/errors/scenes{change.__name__}.txt", said)
    if change is not _other_labels:
        assert refused("render", "s.json", "--out", "pictures").startswith("error[")


def test_garbage_truncated_and_missing_scenes_files(refused, scenes, here, golden):
    # what a sampler says of itself changes from version to version: the cut comes before it
    whole = scenes.read_bytes()
    (here / "cut.json").write_bytes(whole[: whole.index(b'"sampler"') + 4])
    (here / "noise.json").write_bytes(bytes(range(255, 0, -1)))
    (here / "sub.json").mkdir()
    for name in ("cut", "noise", "sub", "ss"):
        golden(f"cli/errors/scenes_{name}.txt", refused("eval", "good.spec", f"{name}.json"))
    assert "--> cut.json:" in refused("render", "cut.json", "--out", "pictures")


def test_tampered_phi_is_noticed(scenegen, scenes, golden):
    data = json.loads(scenes.read_text())
    data["scenes"][1]["phi"]["task"] += 2e-9
    scenes.write_text(json.dumps(data))
    outcome = scenegen("eval", "good.spec", "s.json")
    assert outcome.status == 1
    assert "scene 2 of s.json" in outcome.err
    data["scenes"][1]["phi"]["task"] -= 1.5e-9
    scenes.write_text(json.dumps(data))
    assert scenegen("eval", "good.spec", "s.json").status == 0


@pytest.mark.parametrize("name", ["garbage", "cut", "empty", "version", "spec"])
def test_model_file(name, refused, model, here, golden):
    whole = model.read_bytes()
    bad = here / "bad.safetensors"
    words = ["--out", "o.json"]
    if name == "version":
        with safetensors.safe_open(model, "pt") as file:
            envelope = json.loads(file.metadata()["scenegen"])
        envelope["version"] = 2
        bad.write_bytes(safetensors.torch.save(safetensors.torch.load(whole), {"scenegen": json.dumps(envelope)}))
    elif name == "spec":
        bad.write_bytes(whole)
        words += ["--spec", "two.spec"]
    else:
        bad.write_bytes({"garbage": bytes(range(1, 256)) * 9, "cut": whole[:-500], "empty": b""}[name])
    golden(f"cli/errors/model_{name}.txt", _without_sums(refused("sample", "bad.safetensors", *words)))


def test_resume_with_another_spec_or_options(refused, model, golden):
    words = ["--model", "gan", "--recipe", "paper", "--out", "m.safetensors", "--resume", "--scenes", "64"]
    said = refused("train", "two.spec", *words, "--epochs", "2")
    golden("cli/errors/resume_other_spec.txt", said)
    golden("cli/errors/resume_other_seed.txt", refused("train", "good.spec", *words, "--epochs", "2", "--seed", "4"))


def _without_sums(text):
    return "\n".join(line for line in text.splitlines() if "SHA-256" not in line) + "\n"
