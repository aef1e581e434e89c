"""The least of many gaps is the same to the bit, though most of them are not computed."""

import math

import numpy as np
import pytest

from scenegen import parse
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import gated
from scenegen.lang.formula.interpret import evaluate
from scenegen.lang.formula.nearest import find_groups

SPECS = {
    "boxes": "object a[9] = box(9 cm, 4 cm, 5 cm)\nrequire noOverlap()\ntask: closeTo(a[1], a[2])",
    "a margin": "object a[9] = box(9 cm, 4 cm, 5 cm)\ntask: forall p, q in a: gap(p, q) >= 3 cm",
    "two shapes": "object a[8] = box(9 cm, 4 cm, 5 cm), b[4] = box(5 cm, 5 cm, 5 cm)\ntask: noOverlap()",
    "prisms": "object a[9] = prism([(1 cm, 1 cm), (9 cm, 2 cm), (3 cm, 7 cm)], 5 cm)\ntask: noOverlap()",
}


def scenes(spec, count, width, seed=0):
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-width, width, (3 * len(spec.objects), count))
    rows[2::3] *= math.pi / width
    return list(rows)


def both(spec, rows):
    core = gated(spec.checked.core)
    all_of_them = evaluate(core, rows, NUMPY)
    few = evaluate(core, rows, NUMPY, needed=core.labels.values())
    assert sum(value is None for value in few) == len(find_groups(core, core.labels.values()).skipped) > 0
    return [(all_of_them[node], few[node]) for node in core.labels.values()]


@pytest.mark.parametrize("count", [2, 300, 2048 + 5])
@pytest.mark.parametrize("width", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("name", SPECS)
def test_the_same_to_the_bit(name, width, count):
    spec = parse(SPECS[name])
    for one, other in both(spec, scenes(spec, count, width)):
        assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize("count", [20, 2048])
def test_places_that_are_none_give_none(count):
    spec = parse(SPECS["boxes"])
    rows = scenes(spec, count, 0.3)
    rows[3][7], rows[0][9], rows[5][11] = math.nan, math.inf, math.nan
    with np.errstate(all="ignore"):
        for one, other in both(spec, rows):
            np.testing.assert_array_equal(one, other)


def test_what_is_needed_is_computed():
    core = gated(parse(SPECS["boxes"]).checked.core)
    everything = find_groups(core, core.labels.values()).skipped
    one = min(everything)
    negated = parse(SPECS["boxes"] + "\nother: !noOverlap()").checked.core  # reads all gaps, of which it takes the most
    assert not find_groups(gated(negated), gated(negated).labels.values()).skipped
    assert one not in find_groups(core, [*core.labels.values(), one]).skipped


def test_few_gaps_and_one_scene_are_computed_as_they_are():
    few = parse("object a[4] = box(9 cm, 4 cm, 5 cm)\ntask: noOverlap()")
    assert not find_groups(few.checked.core, few.checked.core.labels.values()).by_node
    spec = parse(SPECS["boxes"])
    core = gated(spec.checked.core)
    values = evaluate(core, scenes(spec, 1, 0.3), NUMPY, needed=core.labels.values())
    assert not any(value is None for value in values)
