"""Furniture: pieces that share no space, surfaces that are free above, meshes as high as both."""

import itertools

import numpy as np
import pytest

from scenegen.geometry import Box, Circle, Polygon
from scenegen.things import ASSETS, shape_of
from scenegen.things.bodies import collision_of, mass_of, parts_of
from scenegen.things.furniture import PITCH, Cabinet
from scenegen.things.library import cabinet_shape
from scenegen.things.palette import colors_of
from scenegen.things.surfaces import base_heights, fits, narrowest, overlapping, slabs_of, surfaces_of

OPEN = [(0.0,), (0.02,), (0.4,), (1.0, 0.7, 0.3), (0.0, 0.9, 0.0), (0.1, 0.05, 0.9, 0.0), (1.0,) * 6]
SHAPES = [*map(cabinet_shape, OPEN), *map(shape_of, ("cabinet", "drawer", "rack"))]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.asset}{shape.open}")
def test_pieces_share_no_space_and_fill_what_the_footprint_says(shape):
    slabs = slabs_of(shape)
    low = np.array([(*one.box[:2], one.low) for one in slabs])
    high = np.array([(*one.box[2:], one.high) for one in slabs])
    assert (high - low > 1e-9).all()
    for a, b in itertools.combinations(range(len(slabs)), 2):
        assert (np.minimum(high[a], high[b]) - np.maximum(low[a], low[b])).min() < 1e-9, (slabs[a], slabs[b])
    size = np.array([*shape.footprint.extent, shape.height])
    assert high.max(axis=0) == pytest.approx(size * (0.5, 0.5, 1.0))
    assert low.min(axis=0) == pytest.approx(size * (-0.5, -0.5, 0.0))
    assert len(collision_of(shape)) == len(slabs)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.asset}{shape.open}")
def test_nothing_is_above_a_surface_and_something_below(shape):
    for surface in surfaces_of(shape):
        if surface.pull is not None and surface.pull.reach <= 0.0:
            continue
        xs, ys = zip(*surface.outline.vertices, strict=True)
        over = [
            one
            for one in slabs_of(shape)
            if min(one.box[2], max(xs)) - max(one.box[0], min(xs)) > 1e-9
            and min(one.box[3], max(ys)) - max(one.box[1], min(ys)) > 1e-9
        ]
        assert not [one for one in over if one.high > surface.height + 1e-9], surface
        assert any(abs(one.high - surface.height) < 1e-9 for one in over), surface


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.asset}{shape.open}")
def test_what_is_drawn_is_as_high_as_the_surfaces_to_the_micrometre(shape):
    """Closed meshes within footprint and height, with a flat part at the height of every surface, none above it."""
    parts = parts_of(shape, ASSETS[shape.asset].color)
    points = np.concatenate([part.mesh.vertices for part in parts])
    assert all(part.mesh.closed and part.mesh.volume > 0.0 for part in parts)
    limits = np.array(shape.footprint.extent) / 2.0
    assert (np.abs(points[:, :2]).max(axis=0) <= limits + 1e-9).all()
    assert points[:, 2].min() == pytest.approx(0.0, abs=1e-12) and points[:, 2].max() <= shape.height + 1e-9
    for surface in surfaces_of(shape):
        if surface.pull is None or surface.pull.reach > 0.0:
            xs, ys = zip(*surface.outline.vertices, strict=True)
            middle = np.array([(min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0])
            assert drawn_height(parts, middle, surface.height) == pytest.approx(surface.height, abs=1e-6)


def drawn_height(parts, place, start):
    """The highest that a mesh gets right above or below a place, from 1 cm below a height on."""
    best = -1.0
    for part in parts:
        a, b, c = (part.mesh.vertices[part.mesh.faces[:, corner]] for corner in range(3))
        u, v, w = b[:, :2] - a[:, :2], c[:, :2] - a[:, :2], place - a[:, :2]
        area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        flat = np.abs(area) > 1e-12
        s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0])[flat] / area[flat]
        t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])[flat] / area[flat]
        z = a[flat, 2] + s * (b[flat, 2] - a[flat, 2]) + t * (c[flat, 2] - a[flat, 2])
        best = max(best, z[(s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)].max(initial=-1.0))
    return best if best > start - 0.01 else -1.0


def test_a_cabinet_has_the_drawers_it_was_made_with():
    shape = cabinet_shape((0.0, 0.9, 0.0, 0.5))
    assert [one.name for one in surfaces_of(shape)] == ["top", *(f"drawer[{k}]" for k in (1, 2, 3, 4))]
    heights = [one.height for one in surfaces_of(shape)[1:]]
    assert np.diff(heights) == pytest.approx([PITCH] * 3)
    assert mass_of(shape) == pytest.approx(ASSETS["cabinet"].mass * shape.height / ASSETS["cabinet"].height)
    assert (Cabinet().length, Cabinet().height) == pytest.approx((*ASSETS["cabinet"].footprint.extent[:1], 0.35))
    assert cabinet_shape((0.0,) * 3).footprint.extent == pytest.approx(ASSETS["cabinet"].footprint.extent)


def test_a_drawer_above_hides_what_is_below_it():
    free, hidden = (Cabinet((0.0, 0.8, share)).surfaces()[2].pull for share in (0.0, 0.5))
    assert free.reach - hidden.reach == pytest.approx(0.5 * 0.3)
    assert hidden.least(hidden.reach) == pytest.approx(0.8)


@pytest.mark.parametrize("footprint", [Box(0.18, 0.038), Circle(0.05), Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1)))])
def test_the_narrowest_strip_that_holds_a_footprint(footprint):
    """What fits into a strip of that length fits, and into one that is shorter it does not."""
    need = narrowest(footprint, 0.38)
    strips = [Polygon(((0.0, -0.19), (long, -0.19), (long, 0.19), (0.0, 0.19))) for long in (need + 1e-4, need - 1e-3)]
    if not isinstance(footprint, Polygon):  # a polygon's middle is not the middle of what it covers
        assert [fits(footprint, strip) for strip in strips] == [True, False]
    assert narrowest(footprint, 0.03) is None


def test_without_declared_heights_things_stand_where_they_are():
    """On the top, in the drawer, on its rim where they do not fit, on the table beside the cabinet."""
    shapes = [cabinet_shape((0.0, 0.0, 0.9)), shape_of("apple"), shape_of("tray")]
    top, *_, drawer = surfaces_of(shapes[0])
    apple = [(-0.1, 0.0), (0.15, 0.1), (0.297, 0.0), (0.9, 0.0)]
    poses = np.array([[(0.0, 0.0, 0.0), (*place, 0.0), (5.0, 5.0, 0.0)] for place in apple])
    found = base_heights(shapes, poses)[:, 1]
    assert found == pytest.approx([top.height, drawer.height, 0.03 + 3 * PITCH - 0.003, 0.0])


def test_what_is_under_an_open_drawer_does_not_overlap_it():
    shapes = [cabinet_shape((0.0, 0.0, 0.9)), shape_of("crackerbox")]
    reach = shapes[0].footprint.extent[0] / 2.0
    poses = np.array([[(0.0, 0.0, 0.0), (reach + 0.02, 0.0, 0.0)], [(0.0, 0.0, 0.0), (-reach - 0.02, 0.0, 0.0)]])
    assert overlapping(shapes, poses, declared=(0.0, 0.0)) == [[], [(0, 1)]]


def test_bins_with_names_of_their_own_differ_in_colour():
    assert len(set(colors_of([("food", "bin"), ("metal", "bin"), ("toy", "bin")]))) == 3
    assert len(set(colors_of([(f"bin[{k}]", "bin") for k in (1, 2, 3)]))) == 1
