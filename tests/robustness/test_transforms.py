"""phi under torch.func: what vmap, grad and their kin give is what loops and autograd give. Tensors that are not dense
are told what to do."""

import pytest
import torch
from torch.func import grad, jacfwd, jacrev, vmap

from scenegen.api.spec import parse

SPEC = """object a = box(0.1, 0.05, 0.1), b = cylinder(0.05, 0.1), c
task: leftOf(a, b) & closeTo(a, c, 0.2) | angle(a, NORTH, 0.2) & gap(a, b) >= 0 & abs(bearing(a, c)) <= 1
safe: farFrom(a, b, 0.3)"""


@pytest.fixture(scope="module")
def phi():
    return parse(SPEC).robustness()


@pytest.fixture(scope="module")
def poses():
    return torch.rand(3, 5, 3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))


def alone(phi, **options):
    """phi of one scene, (N, 3) -> (L,)."""
    return lambda pose: phi(pose[None], **options)[0]


def test_vmap_over_batches_and_over_scenes(phi, poses):
    wanted = torch.stack([phi(batch) for batch in poses])
    assert torch.equal(vmap(phi)(poses), wanted)
    assert torch.equal(vmap(phi, in_dims=1, out_dims=1)(poses), wanted)
    assert torch.equal(vmap(vmap(alone(phi)))(poses), wanted)


def test_vmap_in_several_chunks(poses, monkeypatch):
    monkeypatch.setattr("scenegen.learn.robustness.compile.CHUNK", 2)
    phi = parse(SPEC).robustness()
    assert torch.equal(vmap(phi)(poses), torch.stack([phi(batch) for batch in poses]))


@pytest.mark.long
@pytest.mark.parametrize("beta", [None, 10.0])
def test_gradients_are_those_of_autograd(beta, phi, poses):
    scenes = poses[0].clone().requires_grad_()
    (wanted,) = torch.autograd.grad(phi(scenes, beta=beta)[:, 0].sum(), scenes)
    one = alone(phi, beta=beta)
    for found in (
        vmap(grad(lambda pose: one(pose)[0]))(poses[0]),
        vmap(jacrev(one))(poses[0])[:, 0],
        vmap(jacfwd(one))(poses[0])[:, 0],
        torch.autograd.grad(vmap(one)(scenes)[:, 0].sum(), scenes)[0],
    ):
        torch.testing.assert_close(found, wanted, rtol=1e-12, atol=1e-12)


def test_nan_is_refused_there_too(phi, poses):
    broken = poses.clone()
    broken[1, 2, 0, 1] = float("nan")
    with pytest.raises(ValueError, match="a coordinate is not finite"):
        vmap(phi)(broken)
    assert torch.isfinite(vmap(phi)(poses * 1e300)).any()  # finite numbers whose sum is not


def test_nothing_is_written_into_out(phi, poses):
    rows = poses.permute(0, 2, 3, 1).reshape(3, 9, 5)
    with pytest.raises(ValueError, match="leave it out"):
        vmap(lambda part: phi.rows(part, out=torch.empty(2, 5, dtype=torch.float64)))(rows)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    "make, said",
    [
        (lambda poses: poses.to_sparse(), r"not a sparse one; use poses.to_dense\(\)"),
        (lambda poses: torch.nested.nested_tensor(list(poses)), "not a nested one; torch.stack its scenes"),
        (lambda poses: poses.to("meta"), "a meta tensor has a shape alone"),
    ],
)
def test_tensors_that_are_not_dense(make, said, phi, poses):
    with pytest.raises(ValueError, match=said):
        phi(make(poses[0]))
    with pytest.raises(ValueError, match=r"use rows.to_dense\(\)"):
        phi.rows(torch.rand(9, 4).to_sparse_csr())
