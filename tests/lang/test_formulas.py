"""The one loop over the tape: children first, every kind of node, values dropped when nobody needs them any more. The
least clearance from few of them: the same bits, whatever may decide. The least of many gaps is the same to the bit,
though most of them are not computed. Which atom decides: many scenes at once agree with one by one. Inputs that
other tools drop, misread or crash on, and that are right here. Those that are mistakes are
the cases neighbour_* of golden/lang/errors.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
import torch
from hypothesis import given, settings

import scenegen
from scenegen import parse
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, children, gate, last_uses
from scenegen.lang.formula.interpret import (
    Algebra,
    deciding_atom,
    deciding_atoms,
    evaluate,
    every,
    find_groups,
    fold,
    is_constant,
    minimum,
)
from scenegen.learn.robustness import Robustness
from tests.learn.robustness.formulas import scenes, seeds, specs

from ..laws import examples
from .worth import alike, worth

TEXT = "near: closeTo(a, b) & dist(a, b) >= 0.01\napart: !closeTo(a, b) | leftOf(a, b)"


class _Text(Algebra[str]):
    """Nodes as text, with the place of each on the tape."""

    def __init__(self) -> None:
        self.seen: list[int] = []

    def constant(self, index: int, node: Const) -> str:
        self.seen.append(index)
        return f"{node.value:g}"

    def coordinate(self, index: int, node: Coord) -> str:
        self.seen.append(index)
        return f"r{node.row}"

    def apply(self, index: int, node: Apply, args: list[str]) -> str:
        self.seen.append(index)
        return f"{node.primitive}({' '.join(args)})"

    def atom(self, index: int, node: Atom, margin: str) -> str:
        self.seen.append(index)
        return f"[{margin}]"

    def junction(self, index: int, node: Junction, args: list[str]) -> str:
        self.seen.append(index)
        return f"{node.kind}({' '.join(args)})"


def _core() -> Core:
    return scenegen.parse(TEXT).checked.core


def test_every_node_gets_its_children() -> None:
    core, algebra = _core(), _Text()
    values = fold(core.nodes, algebra)
    assert algebra.seen == list(range(len(core.nodes)))
    for node, value in zip(core.nodes, values, strict=True):
        for child in children(node):
            assert values[child] in value
    assert values[core.labels["near"]].startswith("min([")
    assert values[core.labels["apart"]].startswith("max([")


def test_values_are_dropped_after_their_last_use() -> None:
    core = _core()
    dead, freed = last_uses(core), list[str]()
    whole, values = fold(core.nodes, _Text()), fold(core.nodes, _Text(), dead=dead, free=freed.append)
    assert freed == [whole[child] for children_ in dead for child in children_]
    assert [values[node] for node in core.labels.values()] == [whole[node] for node in core.labels.values()]
    assert all(value is None for node, value in enumerate(values) if node not in core.labels.values())


def test_a_check_breaks_off_before_a_node() -> None:
    core, algebra = _core(), _Text()
    left = iter(range(3))

    def check() -> None:
        if next(left, None) is None:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        fold(core.nodes, algebra, before=check)
    assert algebra.seen == [0, 1, 2]


def test_an_algebra_may_see_the_values_so_far() -> None:
    values: list[str] = []
    assert fold(_core().nodes, _Text(), values=values) is values


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


SPECS = {
    "boxes": "object a[9] = box(9 cm, 4 cm, 5 cm)\nrequire noOverlap()\ntask: closeTo(a[1], a[2])",
    "a margin": "object a[9] = box(9 cm, 4 cm, 5 cm)\ntask: forall p, q in a: gap(p, q) >= 3 cm",
    "two shapes": "object a[8] = box(9 cm, 4 cm, 5 cm), b[4] = box(5 cm, 5 cm, 5 cm)\ntask: noOverlap()",
    "prisms": "object a[9] = prism([(1 cm, 1 cm), (9 cm, 2 cm), (3 cm, 7 cm)], 5 cm)\ntask: noOverlap()",
}


def scenes_gap(spec, count, width, seed=0):
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-width, width, (3 * len(spec.objects), count))
    rows[2::3] *= math.pi / width
    return list(rows)


def both_gap(spec, rows):
    core = gate(spec.checked.core)
    all_of_them = evaluate(core, rows, NUMPY)
    few = evaluate(core, rows, NUMPY, needed=core.labels.values())
    assert sum(value is None for value in few) == len(find_groups(core, core.labels.values()).skipped) > 0
    return [(all_of_them[node], few[node]) for node in core.labels.values()]


@pytest.mark.parametrize("count", [2, 300, 2048 + 5])
@pytest.mark.parametrize("width", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("name", SPECS)
def test_the_same_to_the_bit(name, width, count):
    spec = parse(SPECS[name])
    for one, other in both_gap(spec, scenes_gap(spec, count, width)):
        assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize("count", [20, 2048])
def test_places_that_are_none_give_none(count):
    spec = parse(SPECS["boxes"])
    rows = scenes_gap(spec, count, 0.3)
    rows[3][7], rows[0][9], rows[5][11] = math.nan, math.inf, math.nan
    with np.errstate(all="ignore"):
        for one, other in both_gap(spec, rows):
            np.testing.assert_array_equal(one, other)


def test_what_is_needed_is_computed():
    core = gate(parse(SPECS["boxes"]).checked.core)
    everything = find_groups(core, core.labels.values()).skipped
    one = min(everything)
    negated = parse(SPECS["boxes"] + "\nother: !noOverlap()").checked.core  # reads all gaps, of which it takes the most
    assert not find_groups(gate(negated), gate(negated).labels.values()).skipped
    assert one not in find_groups(core, [*core.labels.values(), one]).skipped


def test_few_gaps_and_one_scene_are_computed_as_they_are():
    few = parse("object a[4] = box(9 cm, 4 cm, 5 cm)\ntask: noOverlap()")
    assert not find_groups(few.checked.core, few.checked.core.labels.values()).by_node
    spec = parse(SPECS["boxes"])
    core = gate(spec.checked.core)
    values = evaluate(core, scenes_gap(spec, 1, 0.3), NUMPY, needed=core.labels.values())
    assert not any(value is None for value in values)


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


A, B = (0.25, 0.5, 0.0), (0.75, 0.125, 0.0)


def test_and_binds_tighter_than_or():
    """SpaTiaL gives both one precedence, so that the order of writing decides."""
    for formula in (
        "leftOf(a, b) | belowOf(a, b) & closeTo(a, b, 0)",
        "closeTo(a, b, 0) & belowOf(a, b) | leftOf(a, b)",
    ):
        assert worth(f"object a, b\ntask: {formula}", A, B) == max(0.5, min(-0.375, -0.625))
        words = formula.replace("|", "or").replace("&", "and")
        assert alike(f"object a, b\ntask: {formula}", f"object a, b\ntask: {words}")
    assert worth("object a, b\ntask: (leftOf(a, b) | belowOf(a, b)) & closeTo(a, b, 0)", A, B) == min(0.5, -0.625)


@pytest.mark.long
@pytest.mark.parametrize("depth", [10_000, 19_000])
def test_nested_parentheses(depth):
    """RTAMT and py-metric-temporal-logic end in RecursionError at 10,000."""
    assert alike("(" * depth + "leftOf(a, b)" + ")" * depth, "leftOf(a, b)")


@pytest.mark.parametrize("between", ["\n", "\n\n# a remark\n", "\t", "\r\n", "\u00a0", "  "])
def test_no_conjunct_is_dropped(between):
    """RTAMT drops what follows a character that it does not know."""
    text = f"leftOf(a, b){between}&{between}belowOf(a, b){between}&{between}closeTo(a, b, 0)"
    assert worth(text, A, B) == -0.625
    assert len(check_text(text).core.nodes[-1].args) == 3


def test_a_scene_with_a_number_missing_is_refused():
    """With NaN in a min the order of the conjuncts would decide."""
    phi = Robustness(check_text("leftOf(a, b) & aboveOf(a, b)").core)
    for value in (math.nan, math.inf):
        poses = torch.tensor(np.array([[A, (0.75, value, 0.0)]]))
        with pytest.raises(ValueError, match=r"(?i)nan|finite|infinit"):
            phi(poses)


def test_reversed_ends_that_are_meant():
    """A heading may run through zero: that is no reversed bound."""
    assert worth("angle(a, -10 deg, 20 deg)", (0.0, 0.0, math.radians(355))) == pytest.approx(math.radians(15))
