"""The least clearance from few of them: the same bits, whatever may decide."""

import numpy as np
import pytest

from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate
from scenegen.lang.formula.nearest import every, find_groups, minimum

TABLE = """object a, b = box(0.1, 0.06, 0.05), c = box(0.3, 0.01, 0.05), d = cylinder(0.04, 0.1)
object e = box(0.1, 0.06, 0.05)
region tray = polygon([(0.6, 0.1), (0.9, 0.1), (0.9, 0.5), (0.7, 0.5)])
task: forall p in [a, b, c, d, e]: clearOf(p, tray)
safe: noOverlap() & leftOf(a, b)"""


SHARE = 0.5


def gap(*given):
    return PRIMITIVES["gap"].evaluate(NUMPY, *given)


def find(core):
    return find_groups(core, core.labels.values(), 3, 1, fixed=True)


def both(rows, pairs=10):
    """The least clearance as found, and as that of all pairs."""
    core = check_text(TABLE).core
    (closest,) = [one for one in find(core).by_node.values() if len(one.atoms) == pairs]
    with np.errstate(invalid="ignore", over="ignore"):
        values = evaluate(core, list(rows), NUMPY)
        given = {arg: np.asarray(values[arg], rows.dtype) for arg in closest.places}
        found = minimum(closest, given.__getitem__, gap, share=SHARE)
        return found, np.min(every(closest, given.__getitem__, gap), axis=0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("size", [1.0, 2.5, 1e3])
def test_the_same_bits(dtype, size):
    rows = np.random.default_rng(1).uniform(0.0, size, (15, 3000)).astype(dtype)
    for pairs in (5, 10):
        found, wanted = both(rows, pairs)
        assert found.dtype == dtype and np.array_equal(found, wanted)


def test_ties_and_places_in_common():
    rows = np.round(np.random.default_rng(2).uniform(0.0, 1.0, (15, 3000)), 1)
    found, wanted = both(rows)
    assert np.array_equal(found, wanted)


def test_it_says_which_is_the_least():
    rows = np.random.default_rng(7).uniform(0.0, 1.0, (15, 2000))
    core = check_text(TABLE).core
    values = evaluate(core, list(rows), NUMPY)
    for closest in find(core).by_node.values():
        which = np.full(2000, closest.atoms[0], np.int32)
        found = minimum(closest, values.__getitem__, gap, which=which)
        assert set(which) <= set(closest.atoms) and len(set(which)) > 3
        assert np.array_equal(
            np.stack([np.broadcast_to(value, 2000) for value in values])[which, np.arange(2000)], found
        )


def test_numbers_without_bounds():
    rows = np.random.default_rng(3).uniform(0.0, 1.0, (15, 40))
    rows[0, 0], rows[1, 1], rows[4, 2], rows[3, 3] = np.nan, np.nan, 1e200, -1e300
    found, wanted = both(rows)
    assert np.array_equal(found[:2], wanted[:2], equal_nan=True) and np.isnan(found[:2]).all()
    assert np.array_equal(found[2:], wanted[2:])


def test_where_most_may_decide_it_says_so():
    rows = np.random.default_rng(4).uniform(0.0, 0.01, (15, 100))
    assert both(rows)[0] is None


def test_few_clearances_are_computed():
    core = check_text("object a[20] = box(0.05, 0.03, 0.05)\ntask: noOverlap()").core
    ((_, closest),) = find(core).by_node.items()
    rows, computed = np.random.default_rng(5).uniform(0.0, 1.0, (60, 500)), 0

    def counted(*given):
        nonlocal computed
        computed += len(given[-1])
        return gap(*given)

    minimum(closest, lambda arg: rows[core.nodes[arg].row], counted)
    assert 500 <= computed < 190 * 500 // 20


def test_what_is_wanted_elsewhere_is_left_alone():
    boxes = "object a, b, c, d = box(0.1, 0.1, 0.1)\n"
    assert find(check_text(boxes + "task: clearOf(a, b) & clearOf(b, c)").core).by_node == {}  # too few
    twice = check_text(boxes + "one: clearOf(a, b)\ntask: clearOf(a, b) & clearOf(b, c) & clearOf(a, c)").core
    assert find(twice).by_node == {}
    assert find(check_text(boxes + "task: clearOf(a, b) | clearOf(b, c) | clearOf(a, c)").core).by_node == {}
    cans = "object a[3] = cylinder(0.1, 0.1)\ntask: noOverlap()"
    assert find(check_text(cans).core).by_node == {}


def test_poses_stay_until_the_conjunction_is_done():
    core = check_text(TABLE).core
    found = find(core)
    freed = {child: node for node, some in enumerate(found.last_uses(core)) for child in some}
    assert len(found.by_node) == 2
    for index, closest in found.by_node.items():
        assert all(freed[arg] >= index for arg in closest.places) and not closest.within & freed.keys()
