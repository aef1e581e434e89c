"""Laws of the quantitative semantics, exactly, bit for bit, in the oracle's float64. phi written into memory that the
caller gives, constants, pickles, and torch.compile. torch and numpy agree with the plain-Python oracle on formulas
and scenes that hypothesis makes up. Clearances inside a core formula: the compiler, the interpreter and the bounds
hand them their shapes and poses. What Robustness takes and refuses at its border. Experiment 1 on uniform scenes:
the published shares, P(task) = 25 % and P(both) = 21.1 %.
"""

import math
import pickle

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.geometry import LENGTH, NUMPY, Box, Circle, Polygon
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.lang.formula.interpret import phi
from scenegen.learn.robustness import Robustness
from scenegen.resources import shipped_specs
from scenegen.search import label_bounds

from ...laws import examples
from .formulas import away_from_jumps, formulas, magnitude, objects, scenes, seeds, spec_text, specs

pairs = objects.flatmap(lambda names: st.tuples(st.just(names), formulas(names), formulas(names)))

# each line: two formulas over f and g that are worth the same everywhere
EQUAL = [
    ("!(f & g)", "!f | !g"),
    ("!(f | g)", "!f & !g"),
    ("!!f", "f"),
    ("f -> g", "!f | g"),
    ("f & g", "g & f"),
    ("f | g", "g | f"),
    ("f & f", "f"),
    ("f | f", "f"),
    ("f & (f | g)", "f"),
    ("f & true", "f"),
    ("f | false", "f"),
    ("!(f -> g)", "f & !g"),
]


@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(pairs, seeds)
def test_what_negation_and_the_connectives_do(pair, seed):
    names, f, g = pair
    labels = {"f": f, "g": g, "both": "f & g", "either": "f | g", "not_f": "!f"}
    for number, (left, right) in enumerate(EQUAL):
        labels[f"left{number}"], labels[f"right{number}"] = left, right
    anchor = f" & x({names[0]}) <= 99"  # keeps every label depending on the scene
    spec = check_text(spec_text(names, f=labels.pop("f") + anchor, g=labels.pop("g") + anchor, **labels))
    for column in scenes(len(names), 6, seed).T:
        worth = phi(spec.core, column.tolist())
        assert worth["not_f"] == -worth["f"]
        assert worth["both"] == min(worth["f"], worth["g"])
        assert worth["either"] == max(worth["f"], worth["g"])
        for number, law in enumerate(EQUAL):
            assert worth[f"left{number}"] == worth[f"right{number}"], law


@settings(max_examples=examples(25), deadline=None, derandomize=True)
@given(pairs, seeds)
def test_a_definition_and_a_label_are_worth_what_they_stand_for(pair, seed):
    names, f, _ = pair
    f = f"{f} & x({names[0]}) <= 99"
    named = spec_text(names) + f"def whole() = {f}\nplain: {f}\ncalled: whole()\nagain: plain\nminus: !whole()\n"
    spec = check_text(named)
    for column in scenes(len(names), 4, seed).T:
        worth = phi(spec.core, column.tolist())
        assert worth["plain"] == worth["called"] == worth["again"] == -worth["minus"]


# comparisons, distances, wrapped angles, sine and cosine, labels that share atoms, constants, sums
MIXED = """object mug, plate, fork
near: closeTo(mug, plate, 0.4) & !leftOf(mug, plate) | angle(fork, NORTH)
task: near & farFrom(fork, mug) & 0 <= sin(theta(mug)) * x(plate) + max(x(mug), 0.3, y(fork)) / 3
low: y(fork) - 0.5 <= 0
"""


@pytest.fixture(scope="module")
def mixed():
    return check_text(MIXED)


@pytest.mark.long
def test_phi_goes_where_it_is_wanted(mixed):
    run, rows = Robustness(mixed.core), torch.from_numpy(scenes(3, 100, seed=9))
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


def test_nan_is_refused_or_kept_to_the_labels_that_read_it(mixed):
    run = Robustness(mixed.core)
    rows = torch.zeros(9, 5, dtype=torch.float64)
    rows[2, 3] = math.nan
    with pytest.raises(ValueError, match="θ of `mug` in scene 3 is nan"):
        run.rows(rows)
    assert run.rows(rows, check=False)[0].isnan().tolist() == [False] * 5  # the heading of the mug is not in `near`
    assert run.rows(rows, check=False)[1].isnan().tolist() == [False, False, False, True, False]


def test_it_can_be_pickled(mixed):
    run, rows = pickle.loads(pickle.dumps(Robustness(mixed.core))), torch.from_numpy(scenes(3, 10, seed=9))  # noqa: S301
    assert run.labels == ("near", "task", "low") and torch.equal(run.rows(rows), Robustness(mixed.core).rows(rows))


def test_constants_alone():
    nodes = (Const(0.5), Const(-1.0), Atom(0, "", LENGTH, ()), Atom(1, "", LENGTH, ()), Junction("min", (2, 3)))
    run = Robustness(Core(nodes, {"task": 4, "half": 2}, ("a",)))
    assert run.rows(torch.zeros(3, 2)).tolist() == [[-1.0, -1.0], [0.5, 0.5]]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_torch_compiles_it(mixed):
    run, poses = Robustness(mixed.core), torch.from_numpy(scenes(3, 50, seed=9)).T.reshape(-1, 3, 3)
    assert torch.allclose(torch.compile(run)(poses), run(poses), rtol=0.0, atol=1e-14)


BATCH = 8


def oracle(core, rows):
    return np.array([[*phi(core, column.tolist()).values()] for column in rows.T]).T


@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_every_reader_agrees(spec, seed):
    core, rows = spec.core, scenes(len(spec.objects), BATCH, seed)
    expected = oracle(core, rows)
    jump = np.array([away_from_jumps(core, column) for column in rows.T])
    scale = np.array([magnitude(core, column) for column in rows.T])
    run = Robustness(core)

    clear = jump > 1e-12
    double = run.rows(torch.from_numpy(rows)).numpy()
    assert double.dtype == np.float64
    bound = 1e-12 * np.maximum(np.abs(expected), 1.0)
    assert (np.abs(double - expected) <= bound)[:, clear].all()

    array = np.stack([np.broadcast_to(value, BATCH) for value in phi(core, list(rows), NUMPY).values()])
    assert (np.abs(array - expected) <= bound)[:, clear].all()

    single = run.rows(torch.from_numpy(rows).float())
    assert single.dtype == torch.float32
    clear = jump > 1e-5 * scale
    assert (np.abs(single.numpy() - expected) <= 1e-5 * scale)[:, clear].all()


@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_layout_batching_and_chunking_change_nothing(spec, seed):
    rows = torch.from_numpy(scenes(len(spec.objects), BATCH, seed))
    run = Robustness(spec.core)
    together = run.rows(rows)
    poses = rows.T.reshape(BATCH, -1, 3)
    assert torch.equal(run(poses), together.T)
    assert torch.equal(run(poses.contiguous()), together.T)
    assert torch.equal(torch.cat([run.rows(rows[:, i : i + 1]) for i in range(BATCH)], 1), together)
    assert torch.equal(run.rows(rows, check=False), together)
    for chunk in (1, 3, BATCH - 1):
        run._chunk = chunk
        assert torch.equal(run.rows(rows), together)


def test_the_size_of_the_numbers_is_what_rounding_is_relative_to():
    """What is left of 0.1 after 0.1 + 1e6 - 1e6 in float32 is off by up to 1e6 / 2^24 = 0.06."""
    spec = check_text("x(a) + 1000000 - x(b) <= 0")
    rows = np.array([[0.1], [0.0], [0.0], [1e6], [0.0], [0.0]])
    assert magnitude(spec.core, rows[:, 0]) > 2e6


DART = Polygon(((-0.05, -0.05), (0.15, 0.0), (-0.05, 0.05)))


@pytest.fixture(scope="module")
def core():
    """gap(a, b) & room(a, tray) & reach(a, 1), b - a; the tray stands still at (0.5, 0.5), turned by 0.3."""
    coords = tuple(Coord(row // 3, row % 3) for row in range(6))
    nodes = (
        *coords,
        *(Const(0.5), Const(0.5), Const(0.3), Const(1.0)),
        Apply("gap", (0, 1, 2, 3, 4, 5), (Box(0.2, 0.1), DART)),
        Apply("room", (0, 1, 2, 6, 7, 8), (Box(0.2, 0.1), Box(0.8, 0.6))),
        Apply("reach", (0, 1, 2, 9), (Box(0.2, 0.1),)),
        Apply("gap", (3, 4, 5, 6, 7, 8), (DART, Circle(0.1))),
        *(Atom(margin, "", LENGTH, ()) for margin in (10, 11, 12, 13)),
        Junction("min", (14, 15, 16, 17)),
    )
    return Core(nodes, {"all": 18, "gap": 14, "room": 15, "reach": 16, "disc": 17}, ("a", "b"))


@pytest.fixture(scope="module")
def rows():
    return np.random.default_rng(0).uniform(0.0, [[1.0], [1.0], [6.0]] * 2, size=(6, 400))


def test_torch_agrees_with_the_interpreter(core, rows):
    found = Robustness(core).rows(torch.from_numpy(rows)).numpy()
    one_by_one = np.array([list(phi(core, column).values()) for column in rows.T.tolist()]).T
    at_once = np.array([np.broadcast_to(value, 400) for value in phi(core, list(rows), NUMPY).values()])
    assert found == pytest.approx(one_by_one, abs=1e-15) and at_once == pytest.approx(one_by_one, abs=1e-15)
    single = Robustness(core).rows(torch.from_numpy(rows).float()).numpy()
    assert single.dtype == np.float32 and single == pytest.approx(found, abs=1e-6)


def test_the_gradient_reaches_what_decides(core, rows):
    where = torch.from_numpy(rows).requires_grad_()
    Robustness(core).rows(where)[1].sum().backward()
    # A translation of both changes no gap, and a gap changes as fast as its footprint moves along the nearest way.
    a, b = where.grad[:2], where.grad[3:5]
    assert a.numpy() == pytest.approx(-b.numpy(), abs=1e-12)
    assert torch.linalg.norm(a, dim=0).numpy() == pytest.approx(1.0, abs=1e-12)


def test_every_scene_lies_within_the_bounds(core, rows):
    low, high = rows - 0.05, rows + 0.05
    lowest, highest = label_bounds(core, low, high)
    values = Robustness(core).rows(torch.from_numpy(rows)).numpy()
    assert lowest.shape == (5, 400) and (lowest <= values).all() and (values <= highest).all()
    assert label_bounds(core, low[:, 7], high[:, 7])[0] == pytest.approx(lowest[:, 7])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("size", [1.0, 0.05])
def test_the_least_clearance_is_the_same_with_and_without_gradients(dtype, size):
    text = """object a, b = box(0.1, 0.06, 0.05), c = cylinder(0.03, 0.1), d = box(0.2, 0.02, 0.05)
    region tray = polygon([(0.6, 0.1), (0.9, 0.1), (0.9, 0.5), (0.7, 0.5)])
    require clearOf(a, tray)
    task: noOverlap() & clearOf(d, tray) & leftOf(a, b)
    near: closeTo(a, b) | noOverlap([a, b, d])"""
    run = Robustness(check_text(text).core)
    rows = size * torch.rand(12, 500, dtype=dtype, generator=torch.Generator().manual_seed(1))
    plain, column = run.rows(rows), run.rows(rows[:, :1])
    assert torch.equal(plain, run.rows(rows.clone().requires_grad_()).detach())
    assert torch.equal(plain[:, :1], column) and torch.equal(plain, run.rows(rows, beta=10.0))


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


SCENES = 400_000


def test_the_shares_of_uniform_scenes():
    run = Robustness(check_text(shipped_specs()["mug_left_of_plate"].read_text(encoding="utf-8")).core)
    rows = torch.rand(6, SCENES, generator=torch.Generator().manual_seed(20240607), dtype=torch.float64)
    task, safe = run.rows(rows) >= 0.0
    # Of a square's pairs of points, those closer than e are pi e^2 - 8/3 e^3 + e^4 / 2 (e <= 1); by symmetry the four
    # quadrants have a quarter of the rest each.
    e = 0.25
    close = math.pi * e**2 - 8.0 / 3.0 * e**3 + e**4 / 2.0
    assert round((1.0 - close) / 4.0, 3) == 0.211
    for hits, share in (
        (task, 0.25),
        (~safe, close),
        (task & safe, (1.0 - close) / 4.0),
    ):
        z = (int(hits.sum()) - SCENES * share) / math.sqrt(SCENES * share * (1.0 - share))
        assert abs(z) < 3.5, (share, z)
