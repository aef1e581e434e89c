"""phi written into memory that the caller gives, constants, pickles, and torch.compile."""

import math
import pickle

import pytest
import torch

from scenegen.geometry import LENGTH
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, Const, Core, Junction
from scenegen.learn.robustness import Robustness

from .formulas import scenes

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
