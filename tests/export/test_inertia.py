"""Centre and moments of meshes, against formulas of textbooks."""

import math

import numpy as np
import pytest

from scenegen.things.mesh import box, disc, revolve
from scenegen.worlds.export.world import inertia


def test_a_box_anywhere():
    found = inertia([box(0.3, 0.2, 0.1).moved(1.0, -2.0, 5.0)])
    np.testing.assert_allclose(found.center, [1.0, -2.0, 5.05], atol=1e-12)
    moments = np.array([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2]) / 12
    np.testing.assert_allclose(found.moments, np.diag(moments), atol=1e-12)


def test_a_box_in_parts():
    parts = [box(0.1, 0.2, 0.1).moved(x=0.1 * k) for k in (-1, 0, 1)]
    whole = inertia([box(0.3, 0.2, 0.1)])
    np.testing.assert_allclose(inertia(parts).moments, whole.moments, atol=1e-12)


def test_round_things():
    sides = 400
    found = inertia([disc(0.05, 0.0, 0.2, sides)])
    np.testing.assert_allclose(found.center, [0.0, 0.0, 0.1], atol=1e-9)
    radial, axial = 0.05**2 / 4 + 0.2**2 / 12, 0.05**2 / 2
    np.testing.assert_allclose(np.diag(found.moments), [radial, radial, axial], rtol=1e-3)
    arc = [math.pi * k / 200 for k in range(201)]
    ball = revolve(
        [(abs(0.1 * math.sin(a)) if 0 < k < 200 else 0.0, -0.1 * math.cos(a)) for k, a in enumerate(arc)], sides
    )
    np.testing.assert_allclose(inertia([ball]).moments, 0.4 * 0.1**2 * np.eye(3), rtol=1e-3, atol=1e-9)


def test_products_have_the_right_sign():
    """Two cubes on the line x = y: the moment about that line is the smallest."""
    pair = [box(0.1, 0.1, 0.1).moved(d, d) for d in (-1.0, 1.0)]
    moments = inertia(pair).moments
    assert moments[0, 1] == pytest.approx(-1.0)
    along = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    assert along @ moments @ along == pytest.approx(np.linalg.eigvalsh(moments)[0])
