"""The compiled core against the eager one: shipped specs, made-up formulas, batches of every size and layout."""

import math
import pickle
import warnings

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings

import scenegen
from scenegen.geometry import LENGTH
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, Const, Core, Junction
from scenegen.learn.native import MOST_LINES
from scenegen.learn.native.kernel import build, write
from scenegen.learn.robustness import Robustness
from scenegen.resources import shipped_specs

from ..laws import examples
from .formulas import away_from_jumps, magnitude, scenes, seeds, specs

# comparisons, distances, wrapped angles, sine and cosine, labels that share atoms, constants, sums: one compilation
MIXED = """object mug, plate, fork
near: closeTo(mug, plate, 0.4) & !leftOf(mug, plate) | angle(fork, NORTH)
task: near & farFrom(fork, mug) & 0 <= sin(theta(mug)) * x(plate) + max(x(mug), 0.3, y(fork)) / 3
low: y(fork) - 0.5 <= 0
"""
# circle and box, box and box, box in region
SHAPES = """object a = box(0.2, 0.1, 0.05), b = box(0.1, 0.1, 0.05)
object disc = cylinder(0.05, 0.1)
region tray = polygon([(0.1, 0.1), (0.9, 0.2), (0.5, 0.9)])
task: clearOf(a, b) & clearOf(disc, a, 1 cm)
in_tray: inside(b, tray)
"""

BOXES = "object a, b, c = box(0.2, 0.1, 0.05)\ntask: noOverlap()"


def agree(spec, rows, dtype=torch.float64):
    core, rows = spec.core, torch.from_numpy(rows).to(dtype)
    expected, found = (Robustness(core, compiled=compiled).rows(rows) for compiled in (False, True))
    assert found.dtype == dtype and found.shape == expected.shape
    columns = rows.double().numpy().T
    scale = np.array([magnitude(core, column) for column in columns])
    # Where wrap jumps, either side is right.
    clear = np.array([away_from_jumps(core, column) for column in columns]) > 64 * torch.finfo(dtype).eps
    difference = np.abs((found - expected).double().numpy())
    assert (difference <= 16 * torch.finfo(dtype).eps * scale)[:, clear].all()
    assert clear.any()


@pytest.fixture(scope="module")
def mixed():
    return check_text(MIXED)


@pytest.mark.long
def test_the_kernel_agrees_with_the_tape_whatever_the_batch_and_layout(mixed, monkeypatch):
    rows = torch.from_numpy(scenes(3, 1000, seed=5))
    eager, run = Robustness(mixed.core).rows(rows), Robustness(mixed.core, compiled=True)
    whole = run.rows(rows)
    assert not torch.equal(whole, torch.zeros_like(whole)) and whole.is_contiguous()
    agree(mixed, rows.numpy()[:, :200])
    assert whole.numpy() == pytest.approx(eager.numpy(), abs=1e-14)
    for count in (0, 1, 2, 3, 17, 999):
        assert torch.equal(run.rows(rows[:, :count].contiguous()), whole[:, :count])
        assert torch.equal(run.rows(rows[:, 1 : 1 + count]), whole[:, 1 : 1 + count])
    poses = rows.T.reshape(-1, 3, 3)
    assert torch.equal(run(poses), whole.T) and torch.equal(run(poses.contiguous()), whole.T)
    assert torch.equal(run.rows(rows[:, ::2]), whole[:, ::2])
    many = rows.repeat(1, 70)
    for threads in (1, 2, 3):  # as many as there are shares of work for
        monkeypatch.setattr(torch, "get_num_threads", lambda threads=threads: threads)
        assert torch.equal(run.rows(many), whole.repeat(1, 70))


def test_one_compilation_serves_all_calls(monkeypatch):
    built = []
    monkeypatch.setattr("scenegen.learn.native.kernel.build", lambda *args: built.append(args) or build(*args))
    text = "leftOf(mug, plate) & farFrom(mug, plate, 0.3125)"  # of no other test: equal cores share a kernel
    rows = torch.from_numpy(scenes(2, 64, seed=6))
    for count in (1, 2, 5, 64):
        Robustness(check_text(text).core, compiled=True).rows(rows[:, -count:])
    with torch.no_grad():
        Robustness(check_text(text).core, compiled=True).rows(rows)
    with torch.inference_mode():
        Robustness(check_text(text).core, compiled=True).rows(rows)
    assert len(built) == 1
    Robustness(check_text(text).core, compiled=True).rows(rows.float())
    assert len(built) == 2


@pytest.mark.long
@pytest.mark.parametrize("compiled", [False, True])
def test_phi_goes_where_it_is_wanted(mixed, compiled):
    run, rows = Robustness(mixed.core, compiled=compiled), torch.from_numpy(scenes(3, 100, seed=9))
    run._chunk = 7
    out = torch.full((3, 100), math.nan, dtype=torch.float64)
    assert run.rows(rows, out=out) is out and torch.equal(out, run.rows(rows)) and torch.isfinite(out).all()
    one = torch.full((3, 1), math.nan, dtype=torch.float64)
    assert torch.equal(run.rows(rows[:, :1], out=one), out[:, :1])
    assert run.rows(rows[:, :0], out=out[:, :0].contiguous()).shape == (3, 0)
    for wrong in (out[:, :99].contiguous(), out[:2], out.float(), torch.empty(100, 3, dtype=torch.float64).T):
        with pytest.raises(ValueError, match=r"`out` must be contiguous, \(3, 100\), torch.float64 and on cpu"):
            run.rows(rows, out=wrong)
    with pytest.raises(ValueError, match="has no gradient"):
        run.rows(rows.clone().requires_grad_(), out=out)


@pytest.mark.long
def test_gradients_are_those_of_the_tape(mixed):
    eager, run = Robustness(mixed.core), Robustness(mixed.core, compiled=True)
    rows = torch.from_numpy(scenes(3, 20, seed=7))
    for beta in (None, 10.0):
        wanted, found = (
            torch.autograd.grad(one.rows(here, beta=beta).sum(), here)[0]
            for one, here in ((eager, rows.clone().requires_grad_()), (run, rows.clone().requires_grad_()))
        )
        assert torch.equal(found, wanted) and wanted.abs().sum() > 0
    with torch.no_grad():
        assert torch.equal(run.rows(rows.clone().requires_grad_()), run.rows(rows))
    assert torch.equal(run.rows(rows, beta=10.0), eager.rows(rows, beta=10.0))


def test_what_is_refused_stays_refused(mixed):
    run = Robustness(mixed.core, compiled=True)
    rows = torch.zeros(9, 5, dtype=torch.float64)
    rows[2, 3] = math.nan
    with pytest.raises(ValueError, match="θ of `mug` in scene 3 is nan"):
        run.rows(rows)
    assert run.rows(rows, check=False)[0].isnan().tolist() == [False] * 5  # the heading of the mug is not in `near`
    assert run.rows(rows, check=False)[1].isnan().tolist() == [False, False, False, True, False]


def test_a_compiled_spec_can_be_pickled(mixed):
    run = pickle.loads(pickle.dumps(Robustness(mixed.core, compiled=True)))  # noqa: S301
    assert run.compiled and run.labels == ("near", "task", "low")


@pytest.mark.long
def test_too_large_a_formula_is_not_compiled():
    count = MOST_LINES // 3
    text = f"object a[{count}]\ntask: forall p in a: x(p) <= 1 & y(p) <= 1"
    run, rows = scenegen.parse(text).robustness(compiled=True), torch.zeros(3 * count, 3)
    rows[4] = 0.25
    with pytest.warns(RuntimeWarning, match="more than 4,000 operations"):
        assert run.rows(rows).tolist() == [[0.75] * 3]


def test_constants_alone_are_not_compiled():
    nodes = (Const(0.5), Const(-1.0), Atom(0, "", LENGTH, ()), Atom(1, "", LENGTH, ()), Junction("min", (2, 3)))
    run = Robustness(Core(nodes, {"task": 4, "half": 2}, ("a",)), compiled=True)
    assert run.rows(torch.zeros(3, 2)).tolist() == [[-1.0, -1.0], [0.5, 0.5]]


@pytest.mark.parametrize(
    "variables, why",
    [
        ({"CC": "", "PATH": ""}, r"no C compiler \(cc, gcc, clang\) is on the PATH\. It takes a C compiler"),
        ({"CC": "/none/such"}, r"No such file or directory: '/none/such'"),
        ({"CC": "false"}, "false failed: exit status 1"),
    ],
)
def test_where_compiling_fails_it_says_so_once_and_goes_on(monkeypatch, variables, why):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    distance = 0.125 + len(why) / 1024  # of no other test
    spec = scenegen.parse(f"leftOf(a, b) & farFrom(a, b, {distance})")
    rows = torch.tensor([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 0.5], [0.0, 0.0], [0.0, 0.0]])
    run = spec.robustness(compiled=True)
    with pytest.warns(RuntimeWarning, match=rf"operation by operation.*: .*{why}"):
        assert run.rows(rows).tolist() == [[1 - distance, 0.5 - distance]]
    for again in (run, spec.robustness(compiled=True)):
        assert again.rows(rows).tolist() == [[1 - distance, 0.5 - distance]]


@pytest.mark.long
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_footprints(dtype):
    spec = check_text(SHAPES)
    rows = torch.from_numpy(scenes(3, 2000, seed=8)).to(dtype)
    eager, run = Robustness(spec.core).rows(rows), Robustness(spec.core, compiled=True).rows(rows)
    # The square root of the gap near contact is what loses most.
    assert run.numpy() == pytest.approx(eager.numpy(), abs=1e-6 if dtype == torch.float64 else 1e-3)
    assert np.median(np.abs((run - eager).numpy())) <= 4 * torch.finfo(dtype).eps
    rows[2] += 1e8  # no angle for the kernel
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = Robustness(spec.core, compiled=True).rows(rows)
    assert torch.equal(again, Robustness(spec.core).rows(rows))


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["breakfast", "chess_corner", "dinner_for_two", "recycling", "shop_shelf", "tea_party"]
)
def test_shipped_specs(name):
    spec = scenegen.load(shipped_specs()[name])
    lowest, highest = (torch.from_numpy(end)[:, None] for end in spec.checked.box())
    generator = torch.Generator().manual_seed(3)
    rows = lowest + (highest - lowest) * torch.rand(len(lowest), 2000, generator=generator, dtype=torch.float64)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = spec.robustness(compiled=True).rows(rows)
    assert found.numpy() == pytest.approx(spec.robustness().rows(rows).numpy(), abs=1e-12)


@pytest.mark.slow
@settings(max_examples=examples(20), deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(specs(labels=("task", "safe")), seeds)
def test_made_up_formulas(spec, seed):
    rows = scenes(len(spec.objects), 64, seed)
    agree(spec, rows)
    agree(spec, rows, torch.float32)


def test_the_roots_of_gaps_are_taken_once_and_only_where_they_are_needed():
    """The least gap is the root of the least square; a gap beside something else is a root of its own."""
    for task, roots in (("noOverlap()", 1), ("noOverlap() & leftOf(a, b) & gap(a, b) + gap(b, c) >= 1 cm", 3)):
        core = check_text(BOXES.replace("noOverlap()", task)).core
        assert write(core, single=False).text.count("= COPYSIGN(SQRT(") == roots
        rows = torch.from_numpy(scenes(3, 500, seed=6))
        found = Robustness(core, compiled=True).rows(rows)
        assert (found - Robustness(core).rows(rows)).abs().max() < 1e-15
