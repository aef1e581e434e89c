"""Specs of the paper, phi of experiment 1 written out by hand, and a Kolmogorov-Smirnov test."""

import math

import numpy as np
import pytest

from scenegen.lang.checker import check_text
from scenegen.resources import shipped_specs


def _checked(name):
    return check_text(shipped_specs()[name].read_text(), name)


@pytest.fixture(scope="session")
def exp1():
    return _checked("mug_left_of_plate")


@pytest.fixture(scope="session")
def exp2():
    return _checked("table_setting")


@pytest.fixture(scope="session")
def phi1():
    """(6, B) rows of experiment 1 -> (2, B): task and safe."""

    def phi(rows):
        mx, my, _, px, py, _ = rows
        return np.stack([np.minimum(px - mx, my - py), np.sqrt((mx - px) ** 2 + (my - py) ** 2) - 0.25])

    return phi


@pytest.fixture(scope="session")
def direct():
    """Uniform scenes of two objects by numpy alone, (6, count)."""

    def draw(count, seed=12345):
        rows = np.random.default_rng(seed).random((6, count))
        rows[2::3] *= 2 * math.pi
        return rows

    return draw


@pytest.fixture(scope="session")
def same_distribution():
    """Whether two samples pass the two-sample Kolmogorov-Smirnov test at p > 0.001 (asymptotic)."""

    def test(one, two):
        one, two = np.sort(one), np.sort(two)
        both = np.concatenate([one, two])
        gap = np.searchsorted(one, both, side="right") / len(one) - np.searchsorted(two, both, side="right") / len(two)
        return np.abs(gap).max() < math.sqrt(-math.log(0.0005) / 2 * (1 / len(one) + 1 / len(two)))

    return test
