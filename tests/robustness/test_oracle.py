"""torch and numpy agree with the plain-Python oracle on formulas and scenes that hypothesis makes up."""

import numpy as np
import torch
from hypothesis import given, settings

from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.learn.robustness import Robustness

from ..laws import examples
from .formulas import away_from_jumps, magnitude, scenes, seeds, specs

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
