import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenegen.geometry.workspace import Workspace
from scenegen.learn.models.codec import Codec, within
from scenegen.pose import TWO_PI

UNIT = st.lists(
    st.sampled_from([0.0, 1.0, 0.5, 1e-8, 1.0 - 6e-8]) | st.floats(0.0, 1.0, width=32), min_size=6, max_size=6
)
EDGE = st.floats(-100.0, 100.0).filter(lambda value: abs(value) > 1e-6)
SIDE = st.tuples(EDGE, st.floats(1e-2, 100.0)).map(lambda pair: (pair[0], pair[0] + pair[1]))


@given(x=UNIT, side_x=SIDE, side_y=SIDE, dtype=st.sampled_from([torch.float32, torch.float64]))
def test_decoded_poses_lie_in_the_workspace_and_the_circle(x, side_x, side_y, dtype):
    space = Workspace(x=side_x, y=side_y)
    rows = Codec(space, 2).decode(torch.tensor([x], dtype=dtype))
    assert rows.shape == (6, 1) and rows.dtype == dtype
    assert space.contains(rows.double().numpy()).all()


def test_round_trip_and_meaning():
    space = Workspace(x=(-1.0, 3.0), y=(2.0, 2.5))
    codec = Codec(space, 2)
    rows = torch.tensor([[0.0], [2.25], [np.pi], [3.0], [2.0], [1.5 * np.pi]], dtype=torch.float64)
    assert codec.encode(rows)[0].tolist() == pytest.approx([0.25, 0.5, 0.5, 1.0, 0.0, 0.75])
    x = torch.rand(1000, 6, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(codec.encode(codec.decode(x)), x, atol=1e-6, rtol=0.0)


def test_angles_outside_the_circle_are_brought_into_it():
    codec = Codec(Workspace(), 1)
    rows = torch.zeros(3, 4)
    rows[2] = torch.tensor([-0.5 * np.pi, TWO_PI, -1e-9, 5.0 * np.pi])
    theta = codec.encode(rows)[:, 2]
    assert bool(((theta >= 0.0) & (theta < 1.0)).all())
    assert theta.tolist() == pytest.approx([0.75, 0.0, 0.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("scenes", [1, 2])
def test_the_argument_is_left_alone(scenes):
    x = torch.rand(scenes, 3, generator=torch.Generator().manual_seed(0))
    before = x.clone()
    codec = Codec(Workspace(x=(5.0, 6.0)), 1)
    rows = codec.decode(x)
    assert torch.equal(x, before)
    kept = rows.clone()
    codec.encode(rows)
    assert torch.equal(rows, kept)


def test_rounding_goes_inwards():
    low, high = within(0.7, 0.1 + 0.7, torch.float32)
    assert 0.7 <= low < 0.7 + 1e-6 and 0.8 - 1e-6 < high <= 0.1 + 0.7
