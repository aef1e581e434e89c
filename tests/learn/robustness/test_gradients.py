"""Gradients: those of the exact value against finite differences, and the straight-through ones. A heading outside [0,
2 pi) is worth what the same direction inside is worth, and bounds are never left. One motion in numpy: the values
are those of torch, and what decides phi is worth phi at its moment. Gradients through the atom that decides: those
of the whole formula. phi under torch.func: what vmap, grad and their kin give is what loops and autograd give.
Tensors that are not dense are told what to do.
"""

import dataclasses
import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from torch.func import grad, jacfwd, jacrev, vmap

import scenegen
from scenegen.api.monitor import score_trajectory
from scenegen.api.spec import parse
from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import wrap_headings
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, gate
from scenegen.lang.formula.interpret import bare_rows, evaluate, phi
from scenegen.lang.formula.timed import score
from scenegen.learn.robustness import Robustness
from scenegen.learn.robustness.deciding import Slopes
from scenegen.learn.robustness.traces import TraceRobustness
from scenegen.pose import TWO_PI

from ...laws import examples
from .formulas import away_from_jumps, magnitude, scenes, seeds, specs
from .slow_time import text
from .test_traces import OBJECTS, T, formulas, motions
from .test_traces import seeds as seeds_moments
from .unroll import unroll

STEP = 1e-6


def gradient(run, rows, beta=None):
    rows = rows.clone().requires_grad_()
    run.rows(rows, beta=beta).sum().backward()
    return rows.grad


checked_points = 0


@pytest.mark.long
@settings(max_examples=examples(80), deadline=None, derandomize=True)
@given(specs(), seeds)
def test_the_gradient_is_the_slope(spec, seed):
    """Along a random direction, wherever the slopes to both sides agree (elsewhere there is a kink)."""
    global checked_points
    core, rng = spec.core, np.random.default_rng(seed)
    rows = scenes(len(spec.objects), 4, seed)[:, :2]  # the uniform half
    way = rng.normal(size=rows.shape[0])
    grads = gradient(Robustness(core), torch.from_numpy(rows)).numpy()
    for column, slopes in zip(rows.T, grads.T, strict=True):
        before, here, after = (phi(core, (column + step * way).tolist())["task"] for step in (-STEP, 0.0, STEP))
        slack = 1e-4 * magnitude(core, column)
        left, right = (here - before) / STEP, (after - here) / STEP
        if abs(left - right) > slack or away_from_jumps(core, column) < 1e-4:
            continue
        checked_points += 1
        assert slopes @ way == pytest.approx((left + right) / 2.0, abs=slack)


@pytest.mark.long
def test_most_points_were_smooth_enough_to_be_checked():
    assert checked_points > examples(80)


@pytest.mark.long
@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_straight_through_keeps_the_value_and_is_finite_everywhere(spec, seed):
    run, rows = Robustness(spec.core), torch.from_numpy(scenes(len(spec.objects), 8, seed))
    assert torch.equal(run.rows(rows, beta=10.0), run.rows(rows))
    assert torch.isfinite(gradient(run, rows, beta=10.0)).all()
    assert torch.isfinite(gradient(run, rows)).all()


def test_straight_through_reaches_every_object_with_the_weights_of_log_sum_exp():
    run = Robustness(check_text("object a, b, c\ntask: x(a) <= 1 & x(b) <= 1 & x(c) <= 1").core)
    rows = torch.zeros(9, 1, dtype=torch.float64)
    rows[0], rows[3], rows[6] = 0.1, 0.2, 0.4  # margins 0.9, 0.8, 0.6
    exact, smooth = gradient(run, rows), gradient(run, rows, beta=10.0)
    assert exact[:, 0].tolist() == [0, 0, 0, 0, 0, 0, -1, 0, 0]
    weights = np.exp([-9.0, -8.0, -6.0]) / np.exp([-9.0, -8.0, -6.0]).sum()
    assert smooth[[0, 3, 6], 0].numpy() == pytest.approx(-weights, rel=1e-12)
    either = Robustness(check_text("object a, b\ntask: x(a) >= 0 | x(b) >= 0").core)
    rows = torch.tensor([[0.2], [0.0], [0.0], [0.1], [0.0], [0.0]], dtype=torch.float64)
    weights = np.exp([2.0, 1.0]) / np.exp([2.0, 1.0]).sum()
    assert gradient(either, rows, beta=10.0)[[0, 3], 0].numpy() == pytest.approx(weights, rel=1e-12)


@pytest.mark.parametrize("beta", [None, 10.0])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_coincident_objects_have_a_finite_gradient(beta, dtype):
    run = Robustness(check_text("closeTo(a, b) & farFrom(b, c) & dist(a, (0.5, 0.5)) <= 0.1").core)
    rows = torch.full((9, 5), 0.5, dtype=dtype)
    assert torch.isfinite(gradient(run, rows, beta)).all()
    lone = Robustness(check_text("closeTo(a, b)").core)
    assert torch.equal(gradient(lone, rows[:6], beta), torch.zeros(6, 5, dtype=dtype))


@pytest.mark.parametrize("beta", [None, 10.0])
def test_a_batch_larger_than_a_chunk_has_a_gradient(beta):
    run = Robustness(check_text("leftOf(a, b) & !closeTo(a, b, 0.25)").core)
    rows = torch.rand(6, 50, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    whole = gradient(run, rows, beta)
    run._chunk = 7
    assert torch.equal(gradient(run, rows, beta), whole)
    with torch.no_grad():
        assert torch.equal(run.rows(rows.clone().requires_grad_(), beta=beta), run.rows(rows, beta=beta))
    assert whole.abs().sum(0).min() > 0


def test_gradients_flow_through_the_poses_view():
    run = Robustness(check_text("leftOf(a, b)").core)
    poses = torch.zeros(3, 2, 3, dtype=torch.float64, requires_grad=True)
    run(poses).sum().backward()
    assert poses.grad[:, 0, 0].tolist() == [-1.0] * 3 and poses.grad[:, 1, 0].tolist() == [1.0] * 3
    assert poses.grad.abs().sum() == 6.0


BARE = "leftOf(a, b) & theta(b) <= 0.5 rad & angle(a, NORTH)"
THETAS = [-1.0, TWO_PI - 1.0, TWO_PI, 0.0, -1e-20, -0.0, 100.0, math.nextafter(TWO_PI, 0.0), 3.0]


def poses(dtype=torch.float64):
    return torch.tensor([[[0.2, 0.1, 1.0], [0.5, 0.5, theta]] for theta in THETAS], dtype=dtype)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_phi_is_that_of_the_heading_inside(dtype):
    spec = scenegen.parse(BARE)
    phi = spec.robustness()(poses(dtype))[:, 0]
    north = 0.2 - (math.pi / 2 - 1.0)
    assert phi[:4].tolist() == pytest.approx([1.5 - TWO_PI, 1.5 - TWO_PI, north, north], abs=1e-6)
    low, high = spec.bounds()["task"]
    assert low <= phi.min() and phi.max() <= high


def test_headings_inside_keep_every_bit():
    spec = scenegen.parse("theta(b) <= 0.5 rad")
    theta = torch.tensor([0.0, 5e-324, 1.0, 3.0, math.nextafter(TWO_PI, 0.0)], dtype=torch.float64)
    rows = torch.stack([torch.zeros(5), torch.zeros(5), theta])
    assert torch.equal(spec.robustness().rows(rows)[0], 0.5 - theta)


def test_the_gradient_goes_through():
    given = poses().requires_grad_(True)
    scenegen.parse("theta(b) <= 0.5 rad").robustness()(given[:, 1:]).sum().backward()
    assert torch.equal(given.grad[:, 1, 2], -torch.ones(len(THETAS), dtype=torch.float64))


def test_nothing_is_done_where_a_turn_makes_no_difference():
    spec = scenegen.parse("angle(a, theta(b)) & facing(a, b) & noOverlap([a, b]) & sin(theta(a)) <= 1")
    assert not bare_rows(spec.checked.core)
    assert bare_rows(scenegen.parse(BARE).checked.core) == {5}


def test_storage():
    rows = np.array([[0.5] * len(THETAS), [0.5] * len(THETAS), THETAS])
    theta = wrap_headings(rows)[2]
    assert ((theta >= 0.0) & (theta < TWO_PI)).all()
    assert np.allclose(np.exp(1j * theta), np.exp(1j * np.array(THETAS)), atol=1e-12)
    inside = rows[:, -2:]
    assert wrap_headings(inside) is inside


def test_scenes_that_were_read_and_scored(tmp_path):
    spec = scenegen.parse("theta(mug) <= 0.5 rad")
    scenes = scenegen.sample(spec, n=2, seed=0)
    poses = scenes.poses.copy()
    poses[:, 0, 2] = -1.0, 1.0
    scenes = dataclasses.replace(scenes, poses=poses, phi={"task": np.array([1.5 - TWO_PI, -0.5])}, trusted=True)
    scenes.save(tmp_path / "a.json")
    read = scenegen.read_scenes(tmp_path / "a.json")
    assert read.poses[:, 0, 2].tolist() == pytest.approx([TWO_PI - 1.0, 1.0])
    from scenegen.api.scenes import evaluate

    for found in (scenes, read):
        assert evaluate(spec.checked, found)["task"].tolist() == pytest.approx([1.5 - TWO_PI, -0.5])


@settings(max_examples=examples(200), deadline=None, derandomize=True)
@given(formulas, seeds_moments)
def test_what_decides_is_worth_phi(formula, seed):
    try:
        timed = check_text(f"time {T} steps\n{OBJECTS}task: {text(formula)}").timed
    except scenegen.SpecError:
        return
    poses = motions(seed, 1)
    scored = score(timed, poses[0].numpy())
    assert scored.signals["task"].tolist() == TraceRobustness(timed)(poses, signals=True)[0, :, 0].tolist()
    atom, moment = scored.decides("task")
    margin = scored.states[atom.margin][moment]
    assert margin == scored.phi["task"] and 0 <= moment <= T


def test_steps_and_requirements():
    spec = scenegen.parse(
        "time [0, 1 s] every 0.5 s object a, b require speed(a) <= 1 m/s require x(a) >= 0 "
        "task: eventually moved(a, 10 cm) gone: leftOf(a, b) until carried(b, a)"
    )
    poses = np.zeros((3, 2, 3))
    poses[:, 0, 0] = 0.1, 0.1, 0.5
    poses[:, 1, 0] = 0.2, 0.3, 0.3
    scored = score_trajectory(spec, poses)
    assert (scored.decides("task").atom.text, scored.decides("task").moment) == ("moved(a, 0.1)", 2)
    assert np.isclose(scored.phi["task"], 0.3)
    assert np.isclose(scored.requirement.min(), 0.1)
    atom, moment = scored.decides(None)
    assert (atom.text, moment) == ("0 <= x(a)", 0) or (atom.text, moment) == ("x(a) >= 0", 0)
    run = spec.trace_robustness()
    assert torch.allclose(run(torch.from_numpy(poses)[None])[0], torch.tensor([*scored.phi.values()]).double())


@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(formulas, seeds_moments)
def test_unrolled_it_is_a_formula_of_one_scene(formula, seed):
    try:
        timed = check_text(f"time {T} steps\n{OBJECTS}require {text(formula)}\ntask: {text(formula)}").timed
    except scenegen.SpecError:
        return
    core = unroll(timed)
    assert core.objects[:4] == ("o0 at 0", "o1 at 0", "o2 at 0", "o0 at 1")
    poses = motions(seed, 2)
    run = TraceRobustness(timed)
    for motion, expected, required in zip(poses, run(poses)[:, 0].tolist(), run.required(poses).tolist(), strict=True):
        values = evaluate(core, motion.reshape(-1).tolist())
        assert values[core.labels["task"]] == expected
        assert values[core.requirement] == required


def test_unrolled_steps():
    timed = scenegen.parse(
        "time 3 steps object a, b require speed(a) <= 0.5 m/s task: eventually moved(a, 10 cm) & always carried(b, a)"
    ).over_time
    core = unroll(timed)
    poses = torch.rand(5, 4, 2, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    run = TraceRobustness(timed)
    still = Robustness(core)
    assert torch.equal(still(poses.reshape(5, 8, 3)), run(poses))
    assert torch.equal(Robustness(gate(core))(poses.reshape(5, 8, 3))[:, 1], run.required(poses))


TABLE = """object plate, mug, fork, knife, spoon, a = box(0.1, 0.1, 0.05), b = box(0.1, 0.1, 0.05)
region mat = rect(0.3, 0.1, 0.7, 0.4)
region tray = polygon([(0.6, 0.1), (0.9, 0.1), (0.9, 0.5), (0.7, 0.5)])
require noOverlap()
require insideWorkspace()
task: (leftOf(mug, plate) | on(mug, mat)) & inside(a, tray) & theta(fork) >= 1
safe: exists p in [mug, plate, a]: closeTo(p, b, 0.2) & clearOf(p, fork, 3 cm)
"""


def uniform(objects, count, seed=0):
    return torch.rand(3 * objects, count, generator=torch.Generator().manual_seed(seed)) * torch.tensor(
        [1.0, 1.0, 6.2]
    ).repeat(objects).view(-1, 1)


def whole(core, rows):
    """phi and its gradients, of the formula as one, each (L, ...)."""
    rows = rows.clone().requires_grad_()
    values = Robustness(core).rows(rows)
    slopes = [torch.autograd.grad(value.sum(), rows, retain_graph=True)[0] for value in values]
    return values.detach(), torch.stack(slopes)


def everywhere(slopes, rows, atoms):
    where = torch.ones(rows.shape[1], dtype=torch.bool)
    return torch.stack([slopes.gradient(rows, each, where) for each in atoms])


def close(found, wanted):
    """Up to the last bits of sin, cos and atan2, which depend on where in a batch a scene stands."""
    slack = 1e-5 if wanted.dtype == torch.float32 else 1e-13
    torch.testing.assert_close(found, wanted, rtol=slack, atol=slack)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_same_as_of_the_whole_formula(dtype):
    core = gate(check_text(TABLE).core)
    rows, slopes = uniform(7, 4096).to(dtype), Slopes(core)
    values, atoms = slopes(rows)
    wanted, gradients = whole(core, rows)
    assert values.dtype == dtype and torch.equal(values, wanted)
    close(everywhere(slopes, rows, atoms), gradients)
    assert len(atoms[-1].unique()) > 20  # many pairs decide, and footprints of four kinds


def test_the_atom_named_is_one_that_decides():
    core = gate(check_text(TABLE).core)
    rows = uniform(7, 512, 1).double()
    values, atoms = Slopes(core)(rows)
    margins = np.stack([np.broadcast_to(value, 512) for value in evaluate(core, list(rows.numpy()), NUMPY)])
    assert all(isinstance(core.nodes[atom], Atom) for atom in atoms.unique().tolist())
    for value, atom in zip(values, atoms, strict=True):
        np.testing.assert_allclose(margins[atom, np.arange(512)], value, rtol=0.0, atol=1e-14)


def test_only_where_it_is_wanted():
    core = gate(check_text(TABLE).core)
    rows, slopes = uniform(7, 300, 2), Slopes(core)
    atoms = slopes(rows)[1][-1]
    where = torch.arange(300) % 3 == 0
    some = slopes.gradient(rows, atoms, where)
    assert bool((some[:, ~where] == 0.0).all())
    close(some[:, where], slopes.gradient(rows, atoms, ~torch.zeros_like(where))[:, where])
    assert bool((slopes.gradient(rows, atoms, torch.zeros_like(where)) == 0.0).all())


def test_footprints_of_any_size_share_a_form():
    text = "object " + ", ".join(
        f"a{k} = box(0.{k + 10}, 0.05, 0.1), b{k} = cylinder(0.0{k + 3}, 0.1)" for k in range(5)
    )
    core = check_text(text + "\ntask: noOverlap()").core
    rows, slopes = uniform(10, 4096, 3), Slopes(core)
    _, atoms = slopes(rows)
    gradients = everywhere(slopes, rows, atoms)
    assert len(atoms.unique()) > 30 and len(slopes._forms) <= 4  # boxes and circles, in each order
    close(gradients, whole(core, rows)[1])


def test_all_in_one_place_and_what_never_changes():
    """Where most pairs may decide all are computed; a constant has no slope."""
    core = check_text("object a, b, c, d\ntask: noOverlap()\nsafe: 1 <= 2 & x(a) <= 9").core
    rows, slopes = 0.001 * uniform(4, 64, 4), Slopes(core)
    values, atoms = slopes(rows)
    wanted, gradients = whole(core, rows)
    found = everywhere(slopes, rows, atoms)
    assert torch.equal(values, wanted)
    close(found, gradients)
    assert bool((found[1] == 0.0).all())


@pytest.mark.long
@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_of_any_formula(spec, seed):
    """Uniform scenes have no ties, and there the gradient is that of the only atom that decides."""
    core = spec.core
    rows = torch.from_numpy(scenes(len(spec.objects), 8, seed))[:, :4].contiguous()
    slopes = Slopes(core)
    values, atoms = slopes(rows)
    wanted, gradients = whole(core, rows)
    assert torch.equal(values, wanted)
    margins = evaluate(core, list(rows.numpy()), NUMPY)
    every = [margins[index] for index, node in enumerate(core.nodes) if isinstance(node, Atom)]
    ties = sum((np.broadcast_to(margin, 4) == value.numpy()).astype(int) for margin in every for value in values[:1])
    alone = torch.from_numpy(ties == 1)
    close(everywhere(slopes, rows, atoms)[0][:, alone], gradients[0][:, alone])


SPEC = """object a = box(0.1, 0.05, 0.1), b = cylinder(0.05, 0.1), c
task: leftOf(a, b) & closeTo(a, c, 0.2) | angle(a, NORTH, 0.2) & gap(a, b) >= 0 & abs(bearing(a, c)) <= 1
safe: farFrom(a, b, 0.3)"""


@pytest.fixture(scope="module")
def phi_transforms():
    return parse(SPEC).robustness()


@pytest.fixture(scope="module")
def poses_transforms():
    return torch.rand(3, 5, 3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))


def alone(phi, **options):
    """phi of one scene, (N, 3) -> (L,)."""
    return lambda pose: phi(pose[None], **options)[0]


def test_vmap_over_batches_and_over_scenes(phi_transforms, poses_transforms):
    wanted = torch.stack([phi_transforms(batch) for batch in poses_transforms])
    assert torch.equal(vmap(phi_transforms)(poses_transforms), wanted)
    assert torch.equal(vmap(phi_transforms, in_dims=1, out_dims=1)(poses_transforms), wanted)
    assert torch.equal(vmap(vmap(alone(phi_transforms)))(poses_transforms), wanted)


def test_vmap_in_several_chunks(poses_transforms, monkeypatch):
    monkeypatch.setattr("scenegen.learn.robustness.compile.CHUNK_SCENES", 2)
    phi = parse(SPEC).robustness()
    assert torch.equal(vmap(phi)(poses_transforms), torch.stack([phi(batch) for batch in poses_transforms]))


@pytest.mark.long
@pytest.mark.parametrize("beta", [None, 10.0])
def test_gradients_are_those_of_autograd(beta, phi_transforms, poses_transforms):
    scenes = poses_transforms[0].clone().requires_grad_()
    (wanted,) = torch.autograd.grad(phi_transforms(scenes, beta=beta)[:, 0].sum(), scenes)
    one = alone(phi_transforms, beta=beta)
    for found in (
        vmap(grad(lambda pose: one(pose)[0]))(poses_transforms[0]),
        vmap(jacrev(one))(poses_transforms[0])[:, 0],
        vmap(jacfwd(one))(poses_transforms[0])[:, 0],
        torch.autograd.grad(vmap(one)(scenes)[:, 0].sum(), scenes)[0],
    ):
        torch.testing.assert_close(found, wanted, rtol=1e-12, atol=1e-12)


def test_nan_is_refused_there_too(phi_transforms, poses_transforms):
    broken = poses_transforms.clone()
    broken[1, 2, 0, 1] = float("nan")
    with pytest.raises(ValueError, match="a coordinate is not finite"):
        vmap(phi_transforms)(broken)
    assert torch.isfinite(vmap(phi_transforms)(poses_transforms * 1e300)).any()  # finite numbers whose sum is not


def test_nothing_is_written_into_out(phi_transforms, poses_transforms):
    rows = poses_transforms.permute(0, 2, 3, 1).reshape(3, 9, 5)
    with pytest.raises(ValueError, match="leave it out"):
        vmap(lambda part: phi_transforms.rows(part, out=torch.empty(2, 5, dtype=torch.float64)))(rows)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    "make, said",
    [
        (lambda poses: poses.to_sparse(), r"not a sparse one; use poses.to_dense\(\)"),
        (lambda poses: torch.nested.nested_tensor(list(poses)), "not a nested one; torch.stack its scenes"),
        (lambda poses: poses.to("meta"), "a meta tensor has a shape alone"),
    ],
)
def test_tensors_that_are_not_dense(make, said, phi_transforms, poses_transforms):
    with pytest.raises(ValueError, match=said):
        phi_transforms(make(poses_transforms[0]))
    with pytest.raises(ValueError, match=r"use rows.to_dense\(\)"):
        phi_transforms.rows(torch.rand(9, 4).to_sparse_csr())
