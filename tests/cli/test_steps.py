"""`--steps`: a flow is trained once and taken in any number of jumps."""

import json


def test_a_flow_in_any_number_of_jumps(scenegen, refused, here):
    trained = ["--model", "flow", "--epochs", "1", "--scenes", "128", "--data", "uniform", "--no-card", "--out"]
    assert scenegen("train", "good.spec", *trained, "m.safetensors").status == 0
    poses = {}
    for steps in ("1", "3"):
        asked = ["sample", "m.safetensors", "--phi=-0.5:0.5", "-n", "4", "--raw", "--out", "s.json"]
        assert scenegen(*asked, "--steps", steps).status == 0
        found = json.loads((here / "s.json").read_text())
        assert found["sampler"]["steps"] == int(steps)
        poses[steps] = [scene["poses"] for scene in found["scenes"]]
    assert poses["1"] != poses["3"]
    for wrong in ("0", "1001"):
        assert "must be from 1 to 1,000" in refused("sample", "m.safetensors", "--steps", wrong)
    assert "no model takes part" in refused("sample", "good.spec", "--steps", "2")


def test_models_without_steps(scenegen, refused, here):
    trained = ["--model", "gan", "--recipe", "paper", "--epochs", "1", "--scenes", "64", "--no-card", "--out"]
    assert scenegen("train", "good.spec", *trained, "m.safetensors").status == 0
    assert "one evaluation of its network" in refused("sample", "m.safetensors", "--steps", "2")
