"""`scenegen info`: what a model file is, and `scenegen train` as people use it."""

import json
import re

import pytest

TRAIN = ["train", "two.spec", "--model", "gan", "--recipe", "paper", "--epochs", "2", "--scenes", "64"]


@pytest.fixture
def model(scenegen, here):
    outcome = scenegen(*TRAIN, "--seed", "3", "--out", "m.safetensors", "--no-card")
    assert outcome.status == 0 and outcome.out == ""
    assert "phi off by" in outcome.err
    return here / "m.safetensors"


def test_in_words(scenegen, model, golden):
    outcome = scenegen("info", "m.safetensors")
    assert (outcome.status, outcome.err) == (0, "")
    # digits of trained numbers are the machine's
    text = re.sub(r"-?\d+\.\d+(e-?\d+)?|[0-9a-f]{12}|\d{1,3}(,\d{3})+", "#", outcome.out)
    golden("cli/info.txt", text)


def test_as_json(scenegen, model):
    outcome = scenegen("info", "m.safetensors", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    found = json.loads(outcome.out)
    assert found["objects"] == ["mug", "plate"] and found["model"] == "gan" and found["recipe"] == "paper"
    assert found["bytes"] == model.stat().st_size and found["training"]["seed"] == 3
    assert found["validation"]["epochs"] == found["losses"]["epochs"] == [1, 2]
    assert found["data"]["scenes"] == 64 and found["data"]["held_out"] == 6
    assert "leftOf(mug, plate)" in found["spec"]["source"]


def test_files_that_are_no_models(refused, model, here, golden):
    (here / "noise").write_bytes(bytes(range(1, 256)))
    for name in ("noise", "m.safetensors.train", "two.spec", "missing"):
        golden(f"cli/errors/info_{name.replace('.', '_')}.txt", refused("info", name))


@pytest.mark.long
def test_the_card_is_the_default(scenegen, here, monkeypatch):
    for name in ("PATIENCE", "ALL"):  # however slow the machine
        monkeypatch.setattr(f"scenegen.learn.evaluation.card.{name}", float("inf"))
    outcome = scenegen(*TRAIN, "--out", "m.safetensors")
    assert outcome.status == 0
    names = {path.name for path in here.iterdir()}
    assert {"m.safetensors", "m.safetensors.train", "m.safetensors.md", "m.safetensors.png"} <= names
    assert "wrote m.safetensors.md" in outcome.err and "wrote m.safetensors.png" in outcome.err


def test_scene_files_as_data_and_patience(scenegen, refused, here, golden):
    assert scenegen("sample", "two.spec", "--phi", "task=-0.5:0.5", "-n", "40", "--out", "s.json").status == 0
    words = [*TRAIN[:-2], "--data", "s.json", "--patience", "1", "--no-card"]
    assert scenegen(*words, "--out", "m.safetensors").status == 0
    assert "36 scenes of s.json, 4 more held out" in scenegen("info", "m.safetensors").out
    golden("cli/errors/train_data_objects.txt", refused("train", "forks.spec", *words[2:], "--out", "f.safetensors"))
    golden("cli/errors/train_data_ending.txt", refused(*words, "--data", "s.csv", "--out", "f.safetensors"))
    golden("cli/errors/train_patience.txt", refused(*words, "--patience", "0", "--out", "f.safetensors"))
    assert refused(*words, "--data", "t.json", "--out", "f.safetensors").startswith(
        "error[cannot-read]: cannot read t.json"
    )


@pytest.mark.long
def test_settings_of_the_models_own(scenegen, here):
    words = [
        "train",
        "good.spec",
        "--model",
        "energy",
        "--epochs",
        "1",
        "--scenes",
        "600",
        "--no-card",
        "--out",
        "m.safetensors",
    ]
    assert scenegen(*words, "--hyper", "width=32", "--hyper", "consistency=0.5").status == 0
    assert "width 32, depth 4, consistency 0.5" in scenegen("info", "m.safetensors").out
