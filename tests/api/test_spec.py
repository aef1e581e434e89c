"""Spec: what is known of it, and phi as a torch function."""

import math

import pytest
import torch

import scenegen

TEXT = "object mug, plate, fork\ntask: leftOf(mug, plate) & angle(fork, NORTH)\nsafe: !closeTo(mug, plate, 0.25)\n"


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(TEXT, "table.spec")


def test_facts(spec):
    assert (spec.objects, spec.labels) == (("mug", "plate", "fork"), ("task", "safe"))
    assert spec.workspace.x == (0.0, 1.0)
    assert spec.source == TEXT
    assert repr(spec) == "<Spec table.spec: 3 objects, labels task, safe>"
    bounds = spec.bounds()
    assert bounds["safe"] == pytest.approx((-0.25, math.sqrt(2) - 0.25))
    assert bounds["task"] == pytest.approx((0.2 - math.pi, 0.2))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("batch", [0, 1, 5])
def test_robustness(spec, batch, dtype):
    poses = torch.rand(batch, 3, 3, generator=torch.Generator().manual_seed(0), dtype=dtype)
    phi = spec.robustness()(poses)
    assert phi.shape == (batch, 2) and phi.dtype == dtype
    for row, (mug, plate, fork) in zip(phi.tolist(), poses.tolist(), strict=True):
        task = min(plate[0] - mug[0], 0.2 - abs(fork[2] - math.pi / 2))
        assert row == pytest.approx([task, math.dist(mug[:2], plate[:2]) - 0.25], abs=1e-6)


def test_robustness_is_differentiable(spec):
    poses = torch.tensor([[[0.1, 0.5, 0.0], [0.15, 0.5, 0.0], [0.5, 0.5, math.pi / 2]]], requires_grad=True)
    spec.robustness()(poses)[0, 0].backward()
    expected = torch.zeros(1, 3, 3)
    expected[0, 0, 0], expected[0, 1, 0] = -1.0, 1.0
    assert torch.equal(poses.grad, expected)


@pytest.mark.parametrize("shape", [(3, 3), (5, 2, 3), (5, 3, 2), (5, 9)])
def test_other_shapes_are_refused(spec, shape):
    with pytest.raises(ValueError, match=r"\(B, 3, 3\)"):
        spec.robustness()(torch.zeros(shape))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_a_number_is_refused(spec, bad):
    poses = torch.zeros(4, 3, 3)
    poses[2, 1, 0] = bad
    with pytest.raises(ValueError, match="x of `plate` in scene 2"):
        spec.robustness()(poses)


def test_load_and_its_errors(tmp_path):
    path = tmp_path / "a.spec"
    path.write_text(TEXT)
    assert scenegen.load(str(path)).checked.sha256 == scenegen.load(path).checked.sha256
    path.write_text("leftOf(mug)")
    with pytest.raises(scenegen.SpecError, match=r"a\.spec:1:1"):
        scenegen.load(path)
    with pytest.raises(scenegen.DataError, match="no such file"):
        scenegen.load(tmp_path / "b.spec")


def test_loaded_models_know_their_spec(spec, tmp_path):
    model = scenegen.train(spec, "gan", recipe="paper", out=tmp_path / "m.safetensors", epochs=1, scenes=64)
    again = scenegen.load_model(tmp_path / "m.safetensors", spec)
    assert again.spec.checked.sha256 == spec.checked.sha256 == model.spec.checked.sha256
    assert (again.name, repr(again)) == ("gan", "<Model gan of table.spec, 1 epochs>")
    with pytest.raises(scenegen.DataError, match="another spec"):
        scenegen.load_model(tmp_path / "m.safetensors", scenegen.parse("leftOf(mug, plate)"))
