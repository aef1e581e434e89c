"""Which atom decides: many scenes at once agree with one by one."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings

from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import deciding_atom, deciding_atoms, evaluate, is_constant
from tests.robustness.formulas import scenes, seeds, specs

from ..laws import examples


@settings(max_examples=examples(50), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_counts_agree_scene_by_scene(spec, seed):
    core, rows = spec.core, scenes(len(spec.objects), 12, seed)
    for label, top in core.labels.items():
        # numpy's sin and cos may differ from math's in the last bit, so both read numpy's values
        one_by_one = []
        for column in rows.T:
            values = evaluate(core, column, NUMPY)
            atom = deciding_atom(core, label, values)
            assert isinstance(core.nodes[atom], Atom)
            # what is the same in every scene decides nothing, if there is anything else
            same = [index for index in range(top + 1) if is_constant(core, index) and values[index] == values[top]]
            assert values[atom] == values[top] or (same and not is_constant(core, atom))
            one_by_one.append(atom)
        counts = deciding_atoms(core, rows, label)
        assert counts == dict(Counter(one_by_one))
        assert list(counts.values()) == sorted(counts.values(), reverse=True)


def test_a_scene_whose_atoms_are_known():
    core = check_text("object a, b\ntask: leftOf(a, b) & (belowOf(a, b) | closeTo(a, b, 0.5))").core
    #          x(b)-x(a): 0.25, 0.75    y(b)-y(a): 0.5, -0.5     0.5-dist: -0.06, -0.40
    rows = np.array([[0.0, 0.0], [0.0, 0.5], [0.0, 0.0], [0.25, 0.75], [0.5, 0.0], [0.0, 0.0]])
    texts = {core.nodes[atom].text: count for atom, count in deciding_atoms(core, rows, "task").items()}
    assert texts == {"leftOf(a, b)": 1, "closeTo(a, b, 0.5)": 1}


def test_of_two_that_tie_the_first_decides():
    core = check_text("object a, b\ntask: leftOf(a, b) & belowOf(a, b)").core
    atoms = deciding_atoms(core, np.zeros((6, 3)), "task")
    assert [core.nodes[atom].text for atom in atoms] == ["leftOf(a, b)"] and list(atoms.values()) == [3]


def test_what_is_the_same_in_every_scene_decides_nothing():
    """Both are held in place: the first atom is 1 cm in every scene, and holds phi down."""
    spec = check_text("object a at (0.4, 0.5), b at (0.41, 0.5), c\ntask: leftOf(a, b) & (leftOf(b, c) | leftOf(c, a))")
    core = spec.core
    rows = np.array(
        [[0.4] * 3, [0.5] * 3, [0.0] * 3, [0.41] * 3, [0.5] * 3, [0.0] * 3, [0.9, 0.1, 0.4], [0.5] * 3, [0.0] * 3]
    )
    phi = evaluate(core, list(rows), NUMPY)[core.labels["task"]]
    assert phi[:2] == pytest.approx([0.01, 0.01]) and phi[2] < 0.01
    texts = [core.nodes[deciding_atom(core, "task", evaluate(core, column))].text for column in rows.T.tolist()]
    assert texts == ["leftOf(b, c)", "leftOf(c, a)", "leftOf(c, a)"]
    counts = {core.nodes[atom].text: count for atom, count in deciding_atoms(core, rows, "task").items()}
    assert counts == {"leftOf(c, a)": 2, "leftOf(b, c)": 1}
