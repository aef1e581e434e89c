"""Sines and cosines of headings are worked out once, and nothing else changes."""

import numpy as np

from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.namespace import turning
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate


class Counting:
    """numpy's functions, counting sines."""

    def __init__(self):
        self.sines = 0

    def __getattr__(self, name):
        return getattr(NUMPY, name)

    def sin(self, a):
        self.sines += 1
        return NUMPY.sin(a)

    def turn(self, a):
        return NUMPY.cos(a), self.sin(a)


def test_each_heading_is_turned_by_once():
    core = check_text("object a, b, c, d = box(0.1, 0.06, 0.05)\ntask: noOverlap() & sin(theta(a)) <= 2").core
    rows = list(np.random.default_rng(0).random((12, 50)))
    counting = Counting()
    values = evaluate(core, rows, counting)
    assert counting.sines == 4
    plain = [evaluate(core, row) for row in np.array(rows).T.tolist()]
    assert np.abs(np.array(plain).T[-1] - values[-1]).max() < 1e-15


def test_only_headings_are_kept_and_by_identity():
    heading, other = np.array([0.3]), np.array([0.3])
    namespace = turning(NUMPY, [heading])
    assert namespace.sin(heading) is namespace.sin(heading)
    assert namespace.sin(other) is not namespace.sin(other)
    assert PRIMITIVES["sin"].evaluate(namespace, heading) == np.sin(0.3)
