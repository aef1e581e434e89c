"""What declarations mean: arrays, lists, regions, objects held in place, requirements, labels in labels."""

import math

import pytest

from scenegen.errors import Source
from scenegen.geometry import Box, Circle, Polygon
from scenegen.lang.checker import check_module, check_text
from scenegen.lang.syntax.parse import parse

from .worth import alike, problems, worth

A, B, C = (0.25, 0.5, 0.0), (0.75, 0.125, 0.5), (0.5, 1.0, math.pi)
THREE = "object block[3]\n"


def test_elements_are_objects_in_storage_order():
    spec = check_text("object mug, block[3], cup[1]\ntask: leftOf(block[2], cup[1])")
    assert spec.objects == ("mug", "block[1]", "block[2]", "block[3]", "cup[1]")
    assert worth(f"{THREE}task: leftOf(block[1], block[3])", A, B, C) == 0.5 - 0.25
    assert worth(f"{THREE}task: leftOf(block[1 + 1], block.last)", A, B, C) == 0.5 - 0.75
    assert worth(f"{THREE}task: x(block.first) * block.count <= 1", A, B, C) == 1 - 0.25 * 3
    assert worth(f"object mug\n{THREE}task: leftOf(objects[1], objects.last)", A, B, B, C) == 0.5 - 0.25


def test_the_number_of_elements_is_a_constant_expression():
    spec = check_text(
        "const N = 2\nobject block[2 * N + 1] = box(N * 1 cm, 4 cm, 5 cm)\ntask: leftOf(block[5], block[1])"
    )
    assert len(spec.objects) == 5
    assert {looks.footprint for looks in spec.shapes} == {Box(0.02, 0.04)}
    assert problems("object block[n]\nconst n = block.count\ntask: leftOf(block[1], block[2])") == [
        "`block` is not a constant"
    ]


@pytest.mark.parametrize("count", ["0", "-1", "2.5", "3 cm", "x(mug)", "1e308", "1e400", "block", '"3"', "true"])
def test_what_cannot_count(count):
    assert len(problems(f"object mug, block[{count}]\ntask: leftOf(mug, block[1])")) == 1


def test_lists_hold_anything_and_nest():
    lists = "object a[2], b[2]\nconst ROWS = [a, b]\n"
    assert alike(f"{lists}task: leftOf(ROWS[1][2], ROWS.last.first)", "object a[2], b[2]\ntask: leftOf(a[2], b[1])")
    each = f"{lists}task: forall row in ROWS: forall p, q in row: leftOf(p, q)"
    assert alike(each, "object a[2], b[2]\ntask: leftOf(a[1], a[2]) & leftOf(b[1], b[2])")
    numbers = "object a, b\nconst STEPS = [10 cm, 0.2, 2 * 15 cm]\ntask: closeTo(a, b, STEPS[3]) & x(a) <= sum(STEPS)"
    assert alike(numbers, "object a, b\ntask: closeTo(a, b, 30 cm) & x(a) <= 10 cm + 0.2 + 30 cm")
    places = "object a\nconst CORNERS = [(0, 0), (1, 1)]\ntask: forall c in CORNERS: farFrom(a, c, 0.1)"
    assert alike(places, "object a\ntask: farFrom(a, (0, 0), 0.1) & farFrom(a, (1, 1), 0.1)")
    formulas = "object a, b\ndef all(items) = forall f in items: f\ntask: all([leftOf(a, b), aboveOf(a, b)])"
    assert alike(formulas, "object a, b\ntask: leftOf(a, b) & aboveOf(a, b)")


def test_folds_take_numbers_or_a_list():
    assert worth("object a, b\ntask: mean([x(a), x(b), 1]) <= max(x(a), y(a))", A, B) == 0.5 - (0.25 + 0.75 + 1) / 3
    assert worth("object a[3]\ntask: min(gaps(a)) >= -1", A, B, C) == pytest.approx(
        1 + min(check_gap(A, B), check_gap(B, C)), abs=1e-12
    )


def check_gap(one, other):
    """Of two things that the library does not know and that stand far apart: blocks of 5 cm. By brute force."""

    def outline(pose):
        corners = [(0.025, 0.025), (-0.025, 0.025), (-0.025, -0.025), (0.025, -0.025)]
        turned = [
            (x * math.cos(pose[2]) - y * math.sin(pose[2]), x * math.sin(pose[2]) + y * math.cos(pose[2]))
            for x, y in corners
        ]
        return [(pose[0] + x, pose[1] + y) for x, y in turned]

    def to_segment(p, a, b):
        along = ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / math.dist(a, b) ** 2
        along = min(max(along, 0.0), 1.0)
        return math.dist(p, (a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])))

    first, second = outline(one), outline(other)
    ways = [(p, side) for p in first for side in zip(second, second[1:] + second[:1], strict=True)]
    ways += [(p, side) for p in second for side in zip(first, first[1:] + first[:1], strict=True)]
    return min(to_segment(p, *side) for p, side in ways)


MEMBERS = [
    ("mat.left", (0.25, 0.5)),
    ("mat.right", (0.75, 0.5)),
    ("mat.top", (0.5, 0.75)),
    ("mat.bottom", (0.5, 0.25)),
    ("mat.center", (0.5, 0.5)),
    ("mat", (0.5, 0.5)),
    ("mat.topLeft", (0.25, 0.75)),
    ("mat.bottomRight", (0.75, 0.25)),
    ("mat.corners[3]", (0.75, 0.75)),
    ("mat.corners.first", (0.25, 0.25)),
    ("disc.left", (0.25, 0.25)),
    ("disc.top", (0.5, 0.5)),
    ("disc", (0.5, 0.25)),
    ("wedge.right", (1.0, 0.25)),
    ("wedge.top", (0.5, 0.5)),
    ("wedge", (1.0 / 3.0, 0.5 / 3.0)),
    ("wedge.corners[2]", (1.0, 0.0)),
    ("workspace.topRight", (2.0, 1.0)),
    ("workspace", (0.5, 0.5)),
]
PLACES = """workspace [-1, 2] x [0, 1]
region mat = rect(0.25, 0.25, 0.75, 0.75)
region disc = circle((0.5, 0.25), 25 cm)
region wedge = polygon([(0, 0), (1, 0), (0, 0.5)])
object a
"""


@pytest.mark.parametrize(("place", "where"), MEMBERS)
def test_places_of_regions(place, where):
    assert worth(f"{PLACES}task: x(a) <= x({place})", A) == where[0] - A[0]
    assert worth(f"{PLACES}task: y(a) <= y({place})", A) == where[1] - A[1]


def test_sizes_of_regions():
    assert worth(f"{PLACES}task: x(a) <= wedge.width + 2 * disc.height + workspace.width", A) == 5.0 - 0.25
    spec = check_text(f"{PLACES}task: inside(a, mat)")
    assert [(one.name, one.footprint) for one in spec.regions[:2]] == [("mat", Box(0.5, 0.5)), ("disc", Circle(0.25))]
    assert isinstance(spec.regions[2].footprint, Polygon) and spec.regions[0].pose == (0.5, 0.5, 0.0)


def test_regions_may_be_built_from_regions():
    text = "region b = rect(a.left2, 0, 1, 1)\nregion a = circle((0.5, 0.5), 0.1)\ntask: leftOf(m, b)"
    assert problems(text.replace("left2", "nowhere")) == ["`a` has no `.nowhere`"]
    built = "region b = circle(a.topLeft, a.width / 4)\nregion a = rect(0.25, 0.25, 0.75, 0.75)\ntask: inside(m, b)"
    assert alike(
        built, "region b = circle((0.25, 0.75), 0.125)\nregion a = rect(0.25, 0.25, 0.75, 0.75)\ntask: inside(m, b)"
    )


def test_objects_held_in_place_are_constants():
    text = "object tray at (0.5, 0.75, 90 deg), mug, wall at (0.125, 0.25)\n"
    spec = check_text(f"{text}task: leftOf(mug, tray) & angle(mug, theta(tray))")
    assert spec.fixed == {0: (0.5, 0.75, math.pi / 2), 2: (0.125, 0.25, 0.0)}
    free = "object tray, mug, wall\n"
    for task in (
        "leftOf(mug, tray)",
        "closeTo(tray, mug, 0.3)",
        "angle(mug, theta(tray))",
        "gap(mug, tray) >= dist(wall, tray)",
    ):
        held = worth(f"{text}task: {task}", (9.0, 9.0, 9.0), A, (9.0, 9.0, 9.0))
        assert held == worth(f"{free}task: {task}", (0.5, 0.75, math.pi / 2), A, (0.125, 0.25, 0.0)), task


def test_an_array_is_held_by_a_list_of_places():
    spec = check_text(
        "const SPOTS = [(0.25, 0.5), (0.75, 0.5)]\nobject leg[2] at SPOTS, mug\ntask: leftOf(leg[1], mug)"
    )
    assert spec.fixed == {0: (0.25, 0.5, 0.0), 1: (0.75, 0.5, 0.0)}
    spec = check_text("object leg[2] at [(0.25, 0.5, 450 deg), workspace.center], mug\ntask: leftOf(leg[1], mug)")
    assert spec.fixed[1] == (0.5, 0.5, 0.0) and spec.fixed[0][2] == pytest.approx(math.pi / 2)


def test_what_is_required_is_no_part_of_phi():
    text = "object a, b\nrequire leftOf(a, b)\nrequire aboveOf(a, b) | y(b) >= 1\ntask: closeTo(a, b, 1)"
    assert worth(text, A, B) == 1 - 0.625
    assert worth(text, A, B, label="require") == min(0.5, max(0.375, -0.875))
    assert check_text("require true\ntask: leftOf(a, b)").core.requirement is None
    assert problems(
        "object a at (0, 0), b at (1, 1), c\nrequire rightOf(a, b)\nrequire leftOf(a, c)\ntask: leftOf(c, b)"
    ) == ["this can never hold"]


def test_labels_in_labels_through_definitions():
    text = (
        "object a, b\nboth: near() & left\ndef near(e = SLACK) = closeTo(a, b, e)\nconst SLACK = 1\nleft: leftOf(a, b)"
    )
    assert worth(text, A, B, label="both") == min(1 - 0.625, 0.5)
    circle = "a1: f()\ndef f() = g(mug)\ndef g(p) = leftOf(p, plate) & a2\na2: !a1"
    assert problems(circle) == ["`f` is defined by itself"]
    assert problems("region r = circle(p(), 0.1)\ndef p() = r.center\ntask: leftOf(a, r)") == [
        "`r` is defined by itself"
    ]


def test_defaults_are_evaluated_where_the_definition_stands():
    text = "object e, a\nconst STEP = 0.5\ndef f(p, e = STEP) = x(p) <= e\ntask: f(a)\nother: f(a, e = 1)"
    assert worth(text, B, A) == 0.25 and worth(text, B, A, label="other") == 0.75
    # a parameter of the caller is not seen by the default of the called
    inner = "def g(p, STEP) = f(p)\nconst STEP = 0.5\ndef f(p, e = STEP) = x(p) <= e\ntask: g(a, 9)"
    assert worth(inner, A) == 0.25


@pytest.mark.parametrize(
    "name", "None True self __class__ leftOf sub neg add min x theta sin gap box rect import_".split()
)
def test_no_name_of_the_program_is_special_to_an_object(name):
    assert alike(
        f"object {name}, other\ntask: leftOf({name}, other)", f"object {name}, other\ntask: x({name}) <= x(other)"
    )


@pytest.mark.parametrize("name", ["add", "sub", "mul", "div", "neg"])
def test_operators_have_no_names(name):
    assert problems(f"task: {name}(x(a), x(b)) <= 1") == [f"unknown relation `{name}`"]
    assert worth(f"def {name}(a, b) = x(a) <= x(b)\ntask: {name}(a, b)", A, B) == 0.5


def test_elements_of_arrays_have_places_in_a_row() -> None:
    found: list[dict[str, int]] = []
    module = parse(Source("<spec>", "object a, b[3], c\nlabel: leftOf(a, c) & leftOf(b[1], b[3]) & leftOf(b[2], c)"))
    check_module(module, None, lambda lowering: found.append(dict(lowering.scope.objects)))
    assert found == [{"a": 0, "b[1]": 1, "b[2]": 2, "b[3]": 3, "c": 4}]
