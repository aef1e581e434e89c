"""The mesh builders: volumes against formulas, closedness, normals."""

import math

import numpy as np
import pytest

from scenegen.things.mesh import Mesh, box, disc, prism, revolve, shaded, tube


def test_volumes_follow_the_formulas():
    assert box(2.0, 3.0, 4.0).volume == pytest.approx(24.0)
    assert disc(1.0, 0.0, 2.0, sides=720).volume == pytest.approx(2.0 * math.pi, rel=1e-4)
    ring = revolve([(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)], 720)
    assert ring.volume == pytest.approx(3.0 * math.pi, rel=1e-4)
    half = revolve([(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)], 360, start=-1.0, sweep=math.pi)
    assert half.volume == pytest.approx(1.5 * math.pi, rel=1e-4)
    assert prism([(0, 0), (1, 0), (0, 1)], 0.0, 1.0).volume == pytest.approx(0.5)
    assert tube([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)], 0.1, 0.1, 360).volume == pytest.approx(0.01 * math.pi, rel=1e-3)


def test_an_open_mesh_is_not_called_closed():
    whole = box(1.0, 1.0, 1.0)
    assert whole.closed
    assert not Mesh(whole.vertices, whole.faces[1:]).closed
    flipped = whole.faces.copy()
    flipped[0] = flipped[0][::-1]
    assert not Mesh(whole.vertices, flipped).closed


def test_moving_scaling_and_tipping_keep_the_form():
    mesh = box(2.0, 3.0, 4.0)
    assert mesh.moved(1.0, 2.0, 3.0).volume == pytest.approx(24.0)
    assert mesh.scaled(1.0, 2.0, 0.5).volume == pytest.approx(24.0)
    tipped = mesh.tipped()
    assert tipped.volume == pytest.approx(24.0)
    assert tipped.vertices[:, 1].min() == pytest.approx(-4.0)


def test_normals_are_flat_on_a_box_and_smooth_on_a_cylinder():
    vertices, normals, indices = shaded(box(1.0, 1.0, 1.0))
    assert np.allclose(np.abs(normals).max(axis=1), 1.0)
    assert len(vertices) == len(normals) == len(indices)
    vertices, normals, _ = shaded(disc(1.0, 0.0, 1.0, sides=36))
    wall = np.abs(normals[:, 2]) < 0.5
    assert np.allclose(normals[wall][:, :2], vertices[wall][:, :2], atol=0.02)
    assert np.allclose(normals[~wall][:, :2], 0.0, atol=1e-9)
