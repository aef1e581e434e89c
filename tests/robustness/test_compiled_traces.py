"""Motions by a compiled kernel beside the eager tape: values, gradients, fallbacks, one kernel whatever T."""

import math
import pickle
import warnings

import pytest
import torch

import scenegen
from scenegen.learn.native.kernel import write

TEXT = """time {} steps
object mug, plate, fork
require speed(mug) <= 20 cm/s
near: always[0, 3] (closeTo(mug, plate, 0.4) -> eventually[0, 2] angle(fork, NORTH))
order: farFrom(fork, mug) until moved(plate, 5 cm)
start: initially 0 <= sin(theta(mug)) * x(plate)
"""


def motions(steps, count=50, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, steps + 1, 3, 3, dtype=torch.float64, generator=generator)


@pytest.mark.long
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_compiled_motions_are_those_of_the_tape(dtype, monkeypatch):
    """Windows choose among values, so phi differs no more than a scene's."""
    spec, poses = scenegen.parse(TEXT.format(5)), motions(5).to(dtype)
    eager, run = spec.trace_robustness(), spec.trace_robustness(compiled=True)
    near = 64 * torch.finfo(dtype).eps
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = run(poses)
        assert found.dtype == dtype and torch.allclose(found, eager(poses), rtol=0.0, atol=near)
        signals = run(poses, signals=True)
        assert torch.equal(signals[:, 0], found)
        assert torch.allclose(signals, eager(poses, signals=True), rtol=0.0, atol=near)
        assert torch.allclose(run.required(poses), eager.required(poses), rtol=0.0, atol=near)
        for count in (0, 1, 2):
            assert torch.equal(run(poses[:count]), found[:count])
        monkeypatch.setattr("scenegen.learn.robustness.traces.STATES", 31)
        assert torch.equal(run(poses), found)


@pytest.mark.long
def test_gradients_of_compiled_motions_are_those_of_the_tape():
    spec, poses = scenegen.parse(TEXT.format(5)), motions(5).requires_grad_()
    wanted, found = (
        torch.autograd.grad(one(poses).sum(), poses)[0]
        for one in (spec.trace_robustness(), spec.trace_robustness(compiled=True))
    )
    assert torch.equal(found, wanted) and wanted.abs().sum() > 0


def test_the_kernel_is_the_same_for_all_horizons():
    texts = {
        write(scenegen.parse(TEXT.format(steps)).trace_robustness().timed.state, single=False) for steps in (4, 300)
    }
    assert len(texts) == 1


def test_refusals_and_copies():
    run = scenegen.parse(TEXT.format(4)).trace_robustness(compiled=True)
    again = pickle.loads(pickle.dumps(run))  # noqa: S301
    assert again.compiled and again.labels == run.labels
    assert not pickle.loads(pickle.dumps(scenegen.parse(TEXT.format(4)).trace_robustness())).compiled  # noqa: S301
    poses = motions(4)
    poses[7, 2, 1, 0] = math.nan
    with pytest.raises(ValueError, match="x of `plate` at moment 2 of motion 7 is not finite"):
        run(poses)
    with pytest.raises(scenegen.RequestError):
        scenegen.parse("leftOf(a, b)").trace_robustness(compiled=True)


def test_where_compiling_fails_motions_are_scored_all_the_same(monkeypatch):
    monkeypatch.setenv("CC", "false")
    spec = scenegen.parse("time 3 steps object a, b task: always farFrom(a, b, 0.0625)")  # of no other test
    poses, run = motions(3)[:, :, :2], spec.trace_robustness(compiled=True)
    with pytest.warns(RuntimeWarning, match=r"operation by operation.*: false failed"):
        found = run(poses)
    assert torch.equal(found, spec.trace_robustness()(poses))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        assert torch.equal(run(poses), found)
