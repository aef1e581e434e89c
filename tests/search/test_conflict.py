"""What clashes is proved, and as small as it can be: without any one of the conjuncts there is a scene."""

import time

import numpy as np
import pytest

from scenegen.errors import Kind
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import phi
from scenegen.resources import shipped_specs
from scenegen.search.conflict import conflict_diagnostic, conjuncts_of, minimal_conflict
from scenegen.search.prune import find_witness

EXP1 = "object mug, plate\ntask: leftOf(mug, plate) & aboveOf(mug, plate)\nsafe: !closeTo(mug, plate, 0.25)"

CIRCLE = "sin(theta(a)) * sin(theta(a)) + cos(theta(a)) * cos(theta(a))"

NO = Kind("no", "no", "{clash}", note="{others}")


def wanted(spec, **ranges):
    return {spec.core.labels[name]: ends for name, ends in ranges.items()}


def texts(spec, found):
    return [getattr(spec.core.nodes[node], "text", "") for node in found.nodes]


def test_the_infeasible_query_of_experiment_1():
    """A distance of 0.16 cannot leave a coordinate 0.17 short."""
    spec = check_text(EXP1)
    found = minimal_conflict(spec.core, *spec.box(), wanted(spec, task=(-0.17, -0.17), safe=(-0.09, -0.09)))
    assert found.proved
    task, safe = spec.core.labels["task"], spec.core.labels["safe"]
    assert found.conjuncts == ((task, -np.inf, -0.17), (safe, -np.inf, -0.09))
    said = conflict_diagnostic(spec.core, found, NO)
    assert said.span.text == "leftOf(mug, plate)"
    assert said.note == "`!closeTo(mug, plate, 0.25)` <= -0.09  (<spec>:3:8)\nbounds prove it"


def test_the_band_around_it_is_not_empty():
    spec = check_text(EXP1)
    band = wanted(spec, task=(-0.1825, -0.1575), safe=(-0.1025, -0.0775))
    assert minimal_conflict(spec.core, *spec.box(), band) is None
    scene = find_witness(spec.core, *spec.box(), band)
    values = phi(spec.core, [float(value) for value in scene.witness])
    assert -0.1825 <= values["task"] <= -0.1575 and -0.1025 <= values["safe"] <= -0.0775


# formula that cannot be satisfied -> the conjuncts that clash
CLASHES = {
    "leftOf(a, b) & aboveOf(c, a) & x(a) >= x(b) + 0.1": ["leftOf(a, b)", "x(a) >= x(b) + 0.1"],
    "closeTo(a, b, 0.1) & closeTo(b, c, 0.1) & farFrom(a, c, 0.21) & leftOf(a, c)": [
        "closeTo(a, b, 0.1)",
        "closeTo(b, c, 0.1)",
        "farFrom(a, c, 0.21)",
    ],
    "(leftOf(a, b) | closeTo(a, b, 0.1)) & x(a) >= x(b) + 0.2 & theta(a) <= 1": ["", "x(a) >= x(b) + 0.2"],
    "x(a) >= 0.6 & angle(a, 0) & x(a) <= 0.5": ["x(a) >= 0.6", "x(a) <= 0.5"],
    "theta(a) <= 1 & theta(a) >= 0.5 & sin(theta(a)) <= 0.4 & aboveOf(b, a)": [
        "theta(a) >= 0.5",
        "theta(a) <= 1",
        "sin(theta(a)) <= 0.4",
    ],
}


@pytest.mark.long
@pytest.mark.parametrize("text", CLASHES)
def test_a_smallest_set_of_conjuncts(text):
    spec = check_text(text)
    demand = wanted(spec, task=(0.0, np.inf))
    found = minimal_conflict(spec.core, *spec.box(), demand)
    assert found.proved
    assert sorted(t.split(" - ")[0] for t in texts(spec, found)) == sorted(t.split(" - ")[0] for t in CLASHES[text])
    for left_out in found.conjuncts:
        rest = {node: (low, high) for node, low, high in found.conjuncts if (node, low, high) != left_out}
        assert find_witness(spec.core, *spec.box(), rest).verdict == "yes"


def test_what_only_a_search_can_tell():
    """Bounds take the sine and the cosine of an angle for independent, and would need thousands of boxes."""
    spec = check_text(f"{CIRCLE} <= 0.9999 & leftOf(a, b)")
    found = minimal_conflict(spec.core, *spec.box(), wanted(spec, task=(0.0, np.inf)))
    assert not found.proved
    assert [type(spec.core.nodes[node]) for node in found.nodes] == [Atom]
    said = conflict_diagnostic(spec.core, found, NO)
    assert said.span.text.startswith("sin(theta(a))") and said.note == "no proof: a short search found no scene"
    assert minimal_conflict(spec.core, *spec.box(), wanted(spec, task=(0.0, np.inf)), search=False) is None


@pytest.mark.parametrize("name", sorted(shipped_specs()))
def test_shipped_specs_can_be_satisfied_and_that_is_found_fast(name):
    spec = check_text(shipped_specs()[name].read_text(), name)
    for node in spec.core.labels.values():
        start = time.process_time()
        reach = find_witness(spec.core, *spec.box(), {node: (0.0, np.inf)})
        assert reach.verdict == "yes"
        assert time.process_time() - start < 10.0  # typically a tenth of that; a busy machine costs CPU time, too
        values = phi(spec.core, [float(value) for value in reach.witness])
        label = next(key for key, index in spec.core.labels.items() if index == node)
        assert values[label] >= 0.0


def test_no_and_unknown():
    contrary = check_text("leftOf(a, b) & x(a) >= x(b) + 0.1")
    assert find_witness(contrary.core, *contrary.box(), wanted(contrary, task=(0.0, np.inf))).verdict == "no"
    beyond = check_text(f"{CIRCLE} <= 0.9999")
    reach = find_witness(beyond.core, *beyond.box(), wanted(beyond, task=(0.0, np.inf)))
    assert reach.verdict == "unknown" and reach.witness is None
    assert reach.best == pytest.approx(-0.0001, abs=1e-9)


def test_conjuncts_of_a_demand():
    spec = check_text("leftOf(a, b) & (aboveOf(a, b) | closeTo(a, b, 0.2))")
    task = spec.core.labels["task"]
    _, either = spec.core.nodes[task].args
    found = conjuncts_of(spec.core, {task: (0.0, 0.3)})
    assert (task, -np.inf, 0.3) in found and (either, 0.0, np.inf) in found and len(found) == 3
