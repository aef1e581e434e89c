"""Batches of layouts as tensors and arrays."""

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
    from scenegen.play import starts

    asked = []

    def few(spec, request):
        asked.append(request)
        return draw(spec, replace(request, n=7))

    draw = starts.draw_scenes
    monkeypatch.setattr(starts, "draw_scenes", few)
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


def test_arrays_without_a_device_are_the_tensors():
    poses, phi = Layouts(SPEC, WANTED, quaternion="wxyz", ahead=32, device=None).take(40)
    tensors = Layouts(SPEC, WANTED, quaternion="wxyz", ahead=32).take(40)
    assert isinstance(poses, np.ndarray) and poses.dtype == np.float32 and (poses == tensors.poses.numpy()).all()
    assert isinstance(phi, np.ndarray) and (phi == tensors.phi.numpy()).all()
    assert Layouts(SPEC, quaternion="wxyz", ahead=4, device=None, dtype=np.float64).take(2).poses.dtype == np.float64


@pytest.mark.parametrize("device", ["cpu", None])
def test_a_number_stands_for_one_layout_whatever_was_taken(device):
    def fresh():
        return Layouts(SPEC, WANTED, quaternion="wxyz", ahead=16, device=device)

    layouts, row = fresh(), fresh().take(16).poses  # a take up to `ahead` goes by the numbers
    layouts.take(5)
    mixed = layouts.at([33, 2, 17, 2, 0])
    assert (mixed.poses[[1, 3, 4]] == row[[2, 2, 0]]).all() and len(mixed.phi) == 5
    again = fresh()
    assert (again.at(np.array([17, 33])).poses == mixed.poses[[2, 0]]).all()
    assert (again.at(2).poses == row[2:3]).all() and again.at([]).poses.shape == (0, 2, 7)
    for bad in (-1, 0.5, [[1]], "one"):
        with pytest.raises(RequestError, match="wrong-value"):
            again.at(bad)


@pytest.mark.parametrize("make", [np.random.default_rng, lambda seed: torch.Generator().manual_seed(seed)])
def test_the_same_generator_gives_the_same_starts(make):
    layouts = Layouts(SPEC, WANTED, quaternion="wxyz", ahead=64)
    first = layouts.take(8, make(3)).poses
    layouts.take(20)
    assert torch.equal(first, layouts.take(8, make(3)).poses)
    assert not torch.equal(first, layouts.take(8, make(4)).poses)
    with pytest.raises(RequestError, match="generator"):
        layouts.take(8, 3)


@pytest.mark.parametrize(("axis", "which"), [("x", 0), ("y", 1), ("z", 2)])
def test_an_axis_of_the_body_points_up(axis, which):
    scipy = pytest.importorskip("scipy.spatial.transform")
    plain = Layouts(SPEC, WANTED, quaternion="xyzw", ahead=16, device=None, dtype=np.float64).take(16).poses[:, 1, 3:]
    turned = Layouts(SPEC, WANTED, quaternion="xyzw", ahead=16, device=None, dtype=np.float64, up={"blue": axis})
    body = scipy.Rotation.from_quat(turned.take(16).poses[:, 1, 3:])
    assert np.allclose(body.apply(np.eye(3)[which]), [0, 0, 1])
    upright = {"x": (0, -1, 0), "y": (1, 0, 0), "z": (0, 0, 0)}[axis]  # the turn that stands the body up, in quarters
    assert np.allclose(
        (body * scipy.Rotation.from_rotvec(np.pi / 2 * np.array(upright)).inv()).as_matrix(),
        scipy.Rotation.from_quat(plain).as_matrix(),
    )
    with pytest.raises(RequestError, match="axis"):
        Layouts(SPEC, WANTED, quaternion="xyzw", ahead=2, up={"blue": "w"}).take(1)


AT_BOUND = scenegen.parse("""
object red = box(4 cm, 4 cm, 4 cm), blue = box(4 cm, 4 cm, 4 cm)
task: closeTo(red, blue, 20 cm) & angle(red, NORTH, 0 deg)
""")


def test_a_range_that_phi_reaches_only_at_its_bound_is_refused():
    layouts = Layouts(AT_BOUND, (0, None), quaternion="wxyz", ahead=16)
    with pytest.raises(RequestError, match=r"only-at-bound.*\n.*ask for a band beside it, -0.025:0"):
        layouts.take(4)
