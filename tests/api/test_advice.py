"""What a model's user is told: by the figures of its file, and of raw scenes what they break."""

from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.learn.faults import concerned, faults
from scenegen.learn.model import advice
from scenegen.learn.models.card import LabelData, QualityData, RangeData
from scenegen.sampling.request import Range


def at(coverage=0.95, error=0.001, **wanted):
    rest = {"truth": 0.97, "ks": 0.05, "sliced": 0.06, "energy": 0.0, "required": 1.0}
    return QualityData(wanted=wanted, coverage=coverage, error=error, **rest)


def test_good_figures_say_nothing():
    assert faults([at(task=0.0), at(0.85, 0.02, task=0.1)]) == []


def test_what_is_left_out_and_what_misses():
    left_out, far = (fault.title for fault in faults([at(0.5, task=0.0), at(0.4, 0.05, task=0.1), at(task=0.2)]))
    assert "0.40 at task 0.1; 0.50 at task 0 (exact" in left_out and "0.050 at task 0.1 on average" in far
    assert "; 2 more" in faults([at(0.1 * number, task=0.1 * number) for number in range(5)])[0].title


def test_a_request_is_judged_by_the_figures_of_its_labels():
    figures = [at(0.5, task=-0.5), at(task=0.0), at(0.6, task=0.1), at(0.1, safe=0.0), at(0.2, task=0.0, safe=0.0)]
    assert concerned(figures, {"task": (-0.01, 0.05)}) == [figures[1]]
    assert concerned(figures, {"task": (0.2, 0.3)}) == [figures[2]]  # the nearest
    assert concerned(figures, {"task": (-1.0, None)}) == figures[:3]
    assert concerned(figures, {"task": (-0.1, 0.1), "safe": (-0.1, 0.1)}) == [figures[4]]
    assert concerned(figures, {}) == figures


TEXT = """object a = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1)
require noOverlap()
task: leftOf(a, b)
"""


def table(*phi):
    return np.array([[-np.inf, np.inf, *phi]])


EVEN = (table(*np.linspace(-1.0, 0.2, 121)),)


def stub(spec=None, ranges=None, regions=EVEN):
    labels = [LabelData(name="task", lowest=-1.0, highest=0.2)]
    card = SimpleNamespace(quality=[at(0.5, task=0.0)], ranges=ranges, labels=labels, scenegen="0.1")
    trained = SimpleNamespace(label_ranges={"task": (-1.0, 0.2)}, card=card, regions=regions)
    made = SimpleNamespace(trained=trained, spec=spec or scenegen.parse(TEXT))
    made.each = (({}, made),)
    return made


@pytest.mark.parametrize(("raw", "said"), [(False, 1), (True, 3)])
def test_raw_scenes_are_told_of_more(raw, said):
    rows = np.array([[0.1, 0.5], [0.5, 0.5], [0.0, 0.0], [0.9, 0.55], [0.5, 0.5], [0.0, 0.0]])
    found = advice(stub(), {"task": Range(-0.1, 0.3)}, rows, raw)
    assert len(found) == said and all(one.severity == "warning" for one in found)
    assert "cover 0.50 at task 0" in found[0].title
    if raw:
        assert "from -1 to 0.2; beyond it guesses" in found[1].title
        assert found[2].title == "1 of 2 raw scenes do not meet what the spec requires"


def test_models_of_drawn_numbers_are_told_of_by_their_numbers():
    spec = scenegen.parse(
        "object a[1..2] = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1) require noOverlap() task: leftOf(a[1], b)"
    )
    family = SimpleNamespace(spec=spec, each=tuple((numbers, stub(member)) for numbers, member in spec.members))
    x, y = np.array([[0.1, 0.1, 0.1], [np.nan, 0.9, 0.15], [0.5, 0.5, 0.5]]), 0.5  # the last one: a[2] stands on a[1]
    rows = np.array([row for one in x for row in (one, y + 0 * one, 0 * one)])
    found = [one.title for one in advice(family, {"task": Range(0.0, 0.1)}, rows, True)]
    assert len(found) == 3, found
    assert [one.partition(":")[0] for one in found] == ["with a[1]", "with a[2]", "with a[2]"]
    assert found[2].endswith("1 of 2 raw scenes do not meet what the spec requires")


def in_range(coverage=0.96, phi=0.03, **wanted):
    return RangeData(wanted=wanted, phi=phi, coverage=coverage, truth=0.97, ks=0.05, sliced=0.06, energy=0.0)


def codes(made, **ends):
    return [one.code for one in advice(made, {label: Range(*both) for label, both in ends.items()}, None, False)]


def test_a_range_that_was_not_measured_is_told():
    """Where a card was made, and neither a value in the range nor a good part of a measured range is asked for."""
    near = {"task": (0.0, None)}
    made = stub(ranges=[in_range(**near)])
    made.trained.card.quality = [at(task=-0.5)]
    assert codes(made, task=(0.0, None)) == [] and codes(made, task=(-0.6, -0.4)) == []
    assert codes(made, task=(0.05, 0.2)) == []
    assert codes(made, task=(-0.4, -0.1)) == ["not-measured"] == codes(made, task=(0.19, 0.2))
    [said] = advice(made, {"task": Range(-0.4, -0.1)}, None, False)
    assert said.title == "how good the model is at task=-0.4:-0.1 was not measured" and "'task': " not in said.title
    crowded = stub(ranges=[in_range(**near)], regions=(table(*np.linspace(0.0, 0.02, 95), 0.03, 0.1, 0.15, 0.2),))
    crowded.trained.card.quality = []
    assert codes(crowded, task=(0.005, 0.2)) == [] and codes(crowded, task=(0.02, 0.2)) == ["not-measured"]
    unmeasured = stub(ranges=[])
    unmeasured.trained.card.quality = []
    assert codes(unmeasured, task=(0.0, None)) == ["not-measured"]
    unmeasured.trained.card.ranges = None  # no card was made
    assert codes(unmeasured, task=(0.0, None)) == []


@pytest.mark.parametrize("poor", [{"coverage": 0.7}, {"phi": 0.5}])
def test_a_range_where_the_model_is_unlike_exact_scenes_is_told(poor):
    made = stub(ranges=[in_range(**poor, task=(0.0, None))])
    made.trained.card.quality = [at(task=0.0), at(task=-0.5)]
    assert codes(made, task=(0.0, None)) == ["poor-model"] == codes(made, task=(-0.1, 0.1))
    assert codes(made, task=(-0.6, -0.4)) == []


def test_a_file_without_a_table_of_phi_says_what_it_lacks():
    made = stub(regions=())
    made.trained.card.quality = []
    assert codes(made, task=(0.0, None)) == ["no-table-of-phi"] and codes(made, task=(0.0, 0.1)) == []
