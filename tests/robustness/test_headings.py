"""A heading outside [0, 2 pi) is worth what the same direction inside is worth, and bounds are never left."""

import dataclasses
import math

import numpy as np
import pytest
import torch

import scenegen
from scenegen.geometry.workspace import turned
from scenegen.lang.formula.headings import bare_rows
from scenegen.pose import TWO_PI

BARE = "leftOf(a, b) & theta(b) <= 0.5 rad & angle(a, NORTH)"
THETAS = [-1.0, TWO_PI - 1.0, TWO_PI, 0.0, -1e-20, -0.0, 100.0, math.nextafter(TWO_PI, 0.0), 3.0]


def poses(dtype=torch.float64):
    return torch.tensor([[[0.2, 0.1, 1.0], [0.5, 0.5, theta]] for theta in THETAS], dtype=dtype)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_phi_is_that_of_the_heading_inside(dtype):
    spec = scenegen.parse(BARE)
    phi = spec.robustness()(poses(dtype))[:, 0]
    north = 0.2 - (math.pi / 2 - 1.0)
    assert phi[:4].tolist() == pytest.approx([1.5 - TWO_PI, 1.5 - TWO_PI, north, north], abs=1e-6)
    low, high = spec.bounds()["task"]
    assert low <= phi.min() and phi.max() <= high


def test_headings_inside_keep_every_bit():
    spec = scenegen.parse("theta(b) <= 0.5 rad")
    theta = torch.tensor([0.0, 5e-324, 1.0, 3.0, math.nextafter(TWO_PI, 0.0)], dtype=torch.float64)
    rows = torch.stack([torch.zeros(5), torch.zeros(5), theta])
    assert torch.equal(spec.robustness().rows(rows)[0], 0.5 - theta)


def test_the_gradient_goes_through():
    given = poses().requires_grad_(True)
    scenegen.parse("theta(b) <= 0.5 rad").robustness()(given[:, 1:]).sum().backward()
    assert torch.equal(given.grad[:, 1, 2], -torch.ones(len(THETAS), dtype=torch.float64))


def test_nothing_is_done_where_a_turn_makes_no_difference():
    spec = scenegen.parse("angle(a, theta(b)) & facing(a, b) & noOverlap([a, b]) & sin(theta(a)) <= 1")
    assert not bare_rows(spec.checked.core)
    assert bare_rows(scenegen.parse(BARE).checked.core) == {5}


def test_storage():
    rows = np.array([[0.5] * len(THETAS), [0.5] * len(THETAS), THETAS])
    theta = turned(rows)[2]
    assert ((theta >= 0.0) & (theta < TWO_PI)).all()
    assert np.allclose(np.exp(1j * theta), np.exp(1j * np.array(THETAS)), atol=1e-12)
    inside = rows[:, -2:]
    assert turned(inside) is inside


def test_scenes_that_were_read_and_scored(tmp_path):
    spec = scenegen.parse("theta(mug) <= 0.5 rad")
    scenes = scenegen.sample(spec, n=2, seed=0)
    poses = scenes.poses.copy()
    poses[:, 0, 2] = -1.0, 1.0
    scenes = dataclasses.replace(scenes, poses=poses, phi={"task": np.array([1.5 - TWO_PI, -0.5])}, trusted=True)
    scenes.save(tmp_path / "a.json")
    read = scenegen.read_scenes(tmp_path / "a.json")
    assert read.poses[:, 0, 2].tolist() == pytest.approx([TWO_PI - 1.0, 1.0])
    from scenegen.api.scenes import evaluate

    for found in (scenes, read):
        assert evaluate(spec.checked, found)["task"].tolist() == pytest.approx([1.5 - TWO_PI, -0.5])
