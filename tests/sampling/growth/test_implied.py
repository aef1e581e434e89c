"""What formulas imply: no value of phi changes, and rows are scored before their last object comes."""

import numpy as np
import pytest

from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.sampling.growth.graph import with_implied

from .made import anywhere, machine_of, posed

ROW = "object c[5] = box(0.1, 0.1, 0.1)\ntask: evenlySpaced(c, 2 cm) & leftOf(c[1], c[2])\n"


def test_phi_stays_and_there_is_more_to_meet():
    core = check_text(ROW).core
    more = with_implied(core)
    assert len(more.nodes) > len(core.nodes)
    rows = list(anywhere(posed(ROW, {}), 2000))
    one, two = (phi(part, rows, NUMPY)["task"] for part in (core, more))
    np.testing.assert_allclose(one, two, atol=1e-15)


def test_a_core_without_means_stays_itself():
    core = check_text("leftOf(a, b) & closeTo(b, c, 0.2)").core
    assert with_implied(core) is core


@pytest.mark.parametrize("size", [4, 6])
def test_rows_are_scored_from_the_third_object_on(size):
    machine = machine_of(f"object c[{size}] = box(0.1, 0.1, 0.1)\ntask: evenlySpaced(c, 2 cm)\n")
    sizes = {len(clause.objects) for clause in machine.graph.clauses}
    assert min(sizes) == 3 and max(sizes) == size
