"""Cells: how many, which one a scene is in, and how scenes are shared among them."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.sampling.request import Cells, Range, SampleRequest, cut

from ..laws import examples

LABELS = ("a", "b", "c", "d")


def cells_of(spread="flat", **ranges):
    return cut(SampleRequest(ranges, 1, spread=spread), LABELS)


@pytest.mark.parametrize("bounded, count", [(0, 1), (1, 32), (2, 16**2), (3, 8**3), (4, 8**4)])
def test_counts(bounded, count):
    cells = cells_of(**{name: Range(0.0, 1.0) for name in LABELS[:bounded]})
    assert cells.count == count
    assert cells_of("base", **{name: Range(0.0, 1.0) for name in LABELS[:bounded]}).count == 1


@pytest.mark.parametrize(("most", "count"), [(1, 1), (4, 4), (32, 32), (100, 32)])
def test_what_wants_few_scenes_gets_few_cells(most, count):
    request = SampleRequest({LABELS[0]: Range(0.0, 1.0)}, 1)
    found = cut(request, LABELS, most)
    assert found.count == count and found.edges[0][[0, -1]].tolist() == [0.0, 1.0]


def test_few_cells_of_two_bounded_labels_and_of_none():
    request = SampleRequest({LABELS[0]: Range(0.0, 1.0), LABELS[1]: Range(0.0, 1.0)}, 1)
    assert cut(request, LABELS, 4).count == 4 and cut(request, LABELS, 5).count == 9
    assert cut(SampleRequest({}, 1), LABELS, 4).count == 1


def test_open_ends_bound_without_being_cut():
    cells = cells_of(a=Range(0.0, 1.0), b=Range(0.0), c=Range(None, 0.5))
    assert cells.count == 32
    phi = np.array([[0.5] * 4, [0.0, -0.1, 9.0, 9.0], [0.5, 0.5, 0.6, -9.0], [0.0] * 4])
    assert cells.find(phi).tolist() == [16, -1, -1, 16]


ENDS = st.tuples(st.floats(-2, 2), st.floats(0.001, 2)).map(lambda pair: (pair[0], pair[0] + pair[1]))


@pytest.mark.long
@settings(max_examples=examples(40))
@given(st.lists(ENDS, min_size=1, max_size=3), st.integers(0, 2**32 - 1), st.booleans())
def test_find_is_what_the_limits_say(ends, seed, at_borders):
    cells: Cells = cells_of(**{name: Range(*pair) for name, pair in zip(LABELS, ends, strict=False)})
    random = np.random.default_rng(seed)
    phi = random.uniform(-3, 4, (4, 20))
    if at_borders:
        for row, edge in enumerate(cells.edges):
            phi[row] = random.choice(edge, 20)
    for scene, found in enumerate(cells.find(phi)):
        inside = [k for k in range(cells.count) if _within(phi[:, scene], *cells.limits(k))]
        assert (found in inside) if inside else found == -1


def _within(phi, low, high):
    return bool(((phi >= low) & (phi <= high)).all())


def test_cells_are_equal_and_fill_the_range():
    cells = cells_of(a=Range(-0.3, 0.5), c=Range(0.0, 1.0))
    limits = [cells.limits(cell) for cell in range(cells.count)]
    boxes = [(low[0], low[2], high[0], high[2]) for low, high in limits]
    assert len(set(boxes)) == 256
    sizes = np.array([[x1 - x0, y1 - y0] for x0, y0, x1, y1 in boxes])
    np.testing.assert_allclose(sizes, [[0.05, 0.0625]] * 256)
    assert {(box[0], box[1]) for box in boxes} == set(itertools.product(cells.edges[0][:-1], cells.edges[1][:-1]))
