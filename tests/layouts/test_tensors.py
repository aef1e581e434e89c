"""Batches of layouts as tensors."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import RequestError
from scenegen.layouts import Layouts

SPEC = scenegen.parse("""
workspace [-0.2, 0.2] x [-0.1, 0.3]
object red = box(4 cm, 4 cm, 4 cm), blue = box(6 cm, 4 cm, 10 cm)
require noOverlap()
near: closeTo(red, blue, 12 cm)
faces: angle(blue, NORTH, 45 deg)
""")
WANTED = {"near": (-0.1, 0.0), "faces": (0.0, None)}


def near_of(poses):
    """phi of `near` by hand."""
    return 0.12 - (poses[:, 0, :2] - poses[:, 1, :2]).norm(dim=1)


def heading_of(poses, w, z):
    return 2.0 * torch.atan2(poses[..., z], poses[..., w])


@pytest.mark.parametrize(("order", "w", "z"), [("wxyz", 3, 6), ("xyzw", 6, 5)])
def test_a_batch_has_the_phi_that_was_asked_for(order, w, z):
    layouts = Layouts(SPEC, WANTED, quaternion=order, ahead=64)
    poses, phi = layouts.take(50)
    assert poses.shape == (50, 2, 7) and phi.shape == (50, 2) and poses.dtype == torch.float32
    assert layouts.objects == ("red", "blue")
    assert torch.allclose(near_of(poses), phi[:, 0], atol=1e-6)
    assert ((phi[:, 0] >= -0.1) & (phi[:, 0] <= 0.0)).all() and (phi[:, 1] >= 0).all()
    off = heading_of(poses[:, 1], w, z) - math.pi / 2
    assert torch.allclose(math.pi / 4 - torch.atan2(off.sin(), off.cos()).abs(), phi[:, 1], atol=1e-5)
    others = [at for at in (3, 4, 5, 6) if at not in (w, z)]
    assert (poses[..., others] == 0).all() and torch.allclose(poses[..., 3:].norm(dim=-1), torch.ones(()))


def test_takes_go_on_without_repeating_and_are_the_same_again():
    def taken(*counts, **settings):
        layouts = Layouts(SPEC, WANTED, quaternion="wxyz", ahead=32, **settings)
        return torch.cat([layouts.take(count).poses for count in counts])

    poses = taken(10, 30, 1, 50)
    assert len(poses) == 91 and len(torch.unique(poses, dim=0)) == 91
    assert torch.equal(poses, taken(10, 30, 1, 50))
    assert not torch.equal(poses[:10], taken(10, seed=1))


def test_draws_that_end_early_are_followed_by_others(monkeypatch):
    """What a draw has found when its time is up is used."""
    from scenegen.layouts import tensors

    asked = []

    def few(spec, request):
        asked.append(request)
        return draw(spec, replace(request, n=7))

    draw = tensors.draw_scenes
    monkeypatch.setattr(tensors, "draw_scenes", few)
    poses, phi = Layouts(SPEC, WANTED, quaternion="wxyz", ahead=20).take(20)
    assert len(torch.unique(poses, dim=0)) == len(phi) == 20
    assert [one.n for one in asked] == [20, 20, 20] and all(one.keep_partial for one in asked)


def test_the_frame_of_a_simulator():
    plain = Layouts(SPEC, WANTED, quaternion="wxyz", dtype=torch.float64).take(20)
    there = Layouts(
        SPEC, WANTED, quaternion="wxyz", dtype=torch.float64, origin=(1, 2, 3), turn=math.pi / 2, origins="middle"
    ).take(20)
    assert torch.equal(plain.phi, there.phi)
    a, b = plain.poses, there.poses
    assert torch.allclose(b[..., 0], 1 - a[..., 1]) and torch.allclose(b[..., 1], 2 + a[..., 0])
    assert torch.allclose(b[..., 2], torch.tensor([3.02, 3.05], dtype=torch.float64))
    turned = heading_of(b, 3, 6) - heading_of(a, 3, 6) - math.pi / 2
    assert torch.allclose(turned.cos(), torch.ones(20, 2, dtype=torch.float64))
    lifted = Layouts(SPEC, WANTED, quaternion="wxyz", origins={"blue": 0.01}).take(1).poses
    assert lifted[0, :, 2].tolist() == pytest.approx([0.0, 0.01])


def test_what_stands_on_something_is_as_high():
    spec = scenegen.parse("object tray, red = box(4 cm, 4 cm, 4 cm) on tray\ntask: x(red) >= 0.5\n")
    layouts = Layouts(spec, quaternion="wxyz", ahead=8)
    scenes = scenegen.sample(spec, n=1)
    assert layouts.take(1).poses[0, 1, 2].item() == pytest.approx(scenes.poses7()[0, 1, 2])


def test_the_order_of_quaternions_has_to_be_said():
    with pytest.raises(TypeError):
        Layouts(SPEC)


@pytest.mark.parametrize(
    ("code", "settings"),
    [
        ("unknown-choice", {"quaternion": "wzyx"}),
        ("out-of-range", {"ahead": 0}),
        ("wrong-value", {"origin": (0, 0)}),
        ("wrong-value", {"turn": "left"}),
        ("wrong-value", {"origins": "top"}),
        ("unknown-choice", {"origins": {"green": 0.1}}),
        ("wrong-value", {"origins": {"red": np.nan}}),
        ("range-not-a-pair", {"phi": {"near": 0.1}}),
        ("beyond-bounds", {"phi": {"near": (0.5, None)}}),
    ],
)
def test_bad_requests_are_answered(code, settings):
    with pytest.raises(RequestError) as error:
        Layouts(SPEC, **{"quaternion": "wxyz", **settings}).take(1)
    assert error.value.diagnostics[0].code == code
