"""What Robustness takes and refuses at its border."""

import math

import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.learn.robustness import Robustness

SPEC = check_text("object mug, plate\ntask: leftOf(mug, plate)\nsafe: !closeTo(mug, plate, 0.25)\n")
RUN = Robustness(SPEC.core)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_any_batch_size_in_the_dtype_of_the_input(dtype):
    for batch in (0, 1, 2, 1000):
        value = RUN(torch.rand(batch, 2, 3, dtype=dtype))
        assert value.shape == (batch, 2) and value.dtype == dtype
        assert RUN.rows(torch.rand(6, batch, dtype=dtype)).shape == (2, batch)
    empty = torch.rand(0, 2, 3, dtype=dtype, requires_grad=True)
    RUN(empty, beta=10.0).sum().backward()
    assert empty.grad.shape == (0, 2, 3)


@pytest.mark.parametrize("coordinate", [0, 1, 2])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_by_name(coordinate, value):
    poses = torch.zeros(7, 2, 3)
    poses[4, 1, coordinate] = value
    with pytest.raises(ValueError, match=rf"{'xyθ'[coordinate]} of `plate` in scene 4 is {value}; .* finite"):
        RUN(poses)
    RUN.rows(poses.permute(1, 2, 0).reshape(6, -1), check=False)


@pytest.mark.parametrize("shape", [(6,), (4, 6), (4, 3, 3), (4, 2, 2), (1, 4, 2, 3)])
def test_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=r"\(B, 2, 3\).*not \("):
        RUN(torch.zeros(shape))
    with pytest.raises(ValueError, match=r"\(6, B\)"):
        RUN.rows(torch.zeros(5, 4))


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.int64, torch.bool, torch.complex64])
def test_another_dtype_is_refused(dtype):
    with pytest.raises(ValueError, match=f"float32 or float64, not {str(dtype).removeprefix('torch.')}"):
        RUN(torch.zeros(4, 2, 3).to(dtype))


def test_no_copy_of_the_storage_is_made():
    rows = torch.rand(6, 10)
    seen = []
    run = Robustness(SPEC.core)
    run._run = lambda rows, *_: seen.append(rows.data_ptr()) or torch.zeros(2, 10)
    run(rows.reshape(2, 3, 10).permute(2, 0, 1))
    assert seen == [rows.data_ptr()]


def test_labels_and_objects_are_in_the_order_of_the_spec():
    assert RUN.labels == ("task", "safe") and RUN.objects == ("mug", "plate")


def test_numpy_poses_are_refused_with_what_to_write():
    with pytest.raises(TypeError, match=r"not ndarray; use torch\.from_numpy\(poses\)"):
        RUN(torch.zeros(1, 2, 3).numpy())
