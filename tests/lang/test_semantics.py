"""What phi is worth, on scenes worked out on paper: formula, poses of the objects in their order, phi."""

import math

import pytest

from scenegen.errors import SpecError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi

PI = math.pi
A, B = (0.25, 0.5, 0.0), (0.75, 0.125, 0.0)  # dx = 0.5, dy = -0.375, dist = sqrt(0.25 + 0.140625) = 0.625
C = (1.0, 1.0, 0.0)


def worth(text, *poses, label="task"):
    return phi(check_text(text).core, [value for pose in poses for value in pose])[label]


RELATIONS = [
    ("leftOf(a, b)", 0.5),  # 0.75 - 0.25
    ("rightOf(a, b)", -0.5),
    ("belowOf(a, b)", -0.375),  # 0.125 - 0.5
    ("aboveOf(a, b)", 0.375),
    ("closeTo(a, b, 1)", 0.375),  # 1 - 0.625
    ("closeTo(a, b)", -0.375),  # 0.25 - 0.625
    ("farFrom(a, b, 0.5)", 0.125),
    ("farFrom(a, b)", 0.375),
    ("!closeTo(a, b, 0.25)", 0.375),
    ("leftOf(a, b) & belowOf(a, b)", -0.375),
    ("leftOf(a, b) | belowOf(a, b)", 0.5),
    ("leftOf(a, b) -> belowOf(a, b)", -0.375),  # max(-0.5, -0.375)
    ("belowOf(a, b) -> false | leftOf(a, b)", 0.5),
    ("rightOf(a, b) -> belowOf(a, b)", 0.5),
    ("leftOf(a, b) & belowOf(a, b) | aboveOf(a, b)", 0.375),
    ("leftOf(a, (0.5, 9)) & aboveOf(b, (9, 0.5))", -0.375),  # min(0.25, 0.125 - 0.5)
    ("closeTo((0.75, 0.5), b, 1) & x(a) <= 9", 0.625),  # straight above b by 0.375
    ("dist(a, (x(b), y(a))) <= 1", 0.5),  # dx alone
    ("closeTo(b = a, a = b, e = 1)", 0.375),
    ("x(a) + y(a) * 2 <= x(b) - -1", 0.5),  # 1.75 - (0.25 + 1)
    ("(x(b) - y(b)) / 2 >= x(a)", 0.0625),  # 0.3125 - 0.25
    ("abs(y(b) - y(a)) <= 50 cm", 0.125),
    ("min(x(a), y(a), x(b)) >= max(y(b), -1)", 0.125),  # 0.25 - 0.125
    ("0 <= x(a) <= x(b)", 0.25),  # min(0.25 - 0, 0.75 - 0.25)
    ("x(a) < x(b)", 0.5),  # `<` is `<=`
    ("x(a) > x(b)", -0.5),
    ("x(b) >= x(a) <= y(a) >= 0", 0.25),  # min(0.5, 0.25, 0.5)
]


@pytest.mark.parametrize(("formula", "expected"), RELATIONS)
def test_relations(formula, expected):
    assert worth(f"object a, b\ntask: {formula}", A, B) == expected


ANGLES = [
    ("angle(a, NORTH)", PI / 2, 0.2),
    ("angle(a, EAST)", 0.0, 0.2),
    ("angle(a, WEST, 0.5)", PI - 0.25, 0.25),
    ("angle(a, EAST, 0.5)", 2 * PI - 0.125, 0.375),  # across 2 pi: off by 0.125, not by 6.16
    ("angle(a, SOUTH, 0)", 1.5 * PI + 0.25, -0.25),
    ("angle(a, EAST)", PI, 0.2 - PI),  # the furthest away there is
    ("angle(a, -90 deg, 0)", 1.5 * PI, 0.0),
    ("angle(a, 0.25 turn, 90 deg)", 0.0, 0.0),
    ("angle(a, 0.75 turn, 0.25 turn)", 1.5 * PI - 1.0, PI / 2 - 1.0),
    ("angle(a, 10 * NORTH, 0)", PI - 0.5, -0.5),  # 2.5 turns
    ("!angle(a, EAST, 0.5)", 0.25, -0.25),
    ("theta(a) - NORTH <= 0", 2 * PI, -1.5 * PI),  # by hand nothing wraps
    ("sin(theta(a)) <= 0.25", PI / 2, -0.75),
    ("cos(theta(a)) >= 0", PI, -1.0),
]


@pytest.mark.parametrize(("formula", "theta", "expected"), ANGLES)
def test_angles(formula, theta, expected):
    assert worth(formula, (0.0, 0.0, theta)) == pytest.approx(expected, abs=1e-14)


def test_wrap_goes_to_half_open_minus_pi_pi():
    assert worth("wrap(theta(a)) >= 0", (0.0, 0.0, PI)) == PI
    assert worth("wrap(theta(a)) >= 0", (0.0, 0.0, -PI)) == PI
    assert worth("wrap(theta(a)) >= 0", (0.0, 0.0, -0.5)) == -0.5
    assert worth("wrap(theta(a)) >= 0", (0.0, 0.0, 3 * PI - 1.0)) == pytest.approx(PI - 1.0, abs=1e-14)


@pytest.mark.parametrize(
    ("quantity", "value"),
    [("25 cm", 0.25), ("250 mm", 0.25), ("0.25 m", 0.25), ("7 cm", 0.07), ("3 mm", 0.003), ("2.5e1 cm", 0.25)],
)
def test_lengths_are_in_metres_to_the_last_bit(quantity, value):
    assert worth(f"x(a) <= {quantity}", (0.0, 0.0, 0.0)) == value


@pytest.mark.parametrize(
    ("quantity", "value"),
    [("90 deg", PI / 2), ("180deg", PI), ("0.25 turn", PI / 2), ("1 turn", 2 * PI), ("1.5 rad", 1.5), ("1.5", 1.5)],
)
def test_angles_are_in_radians_to_the_last_bit(quantity, value):
    assert worth(f"theta(a) <= {quantity}", (0.0, 0.0, 0.0)) == value


def test_a_spec_takes_the_place_of_default_constants():
    text = "const EPS_CLOSE = 1 m\nconst EPS_FAR = 50 cm\n"
    text += "task: closeTo(a, b)\nfar: farFrom(a, b)\nnear: closeTo(a, b, 0.5)"
    assert worth(text, A, B) == 0.375  # 1 - 0.625
    assert worth(text, A, B, label="far") == 0.125
    assert worth(text, A, B, label="near") == -0.125
    turned = (0.0, 0.0, 0.75)
    assert worth("const EPS_ANGLE = 0.5\ntask: angle(a, EAST)", turned) == -0.25
    # metres per radian: 0.1 * 0.2 - 0.1 * 0.75
    assert worth("const ANGLE_SCALE = 0.1\ntask: angle(a, EAST)", turned) == pytest.approx(-0.055, abs=1e-15)
    assert worth("const NORTH = 0.5\ntask: angle(a, NORTH, 0)", turned) == -0.25


def test_definitions_defaults_labels_and_constants():
    text = """
    const STEP = 2 * HALF          # used before it is defined
    const HALF = 0.125
    const HOME = (HALF, 0.5)
    def near(a, b, e = STEP) = dist(a, b) <= e & leftOf(b, a)
    task: near(mug, HOME)
    wide: near(mug, HOME, e = 1)
    all: task & !late
    late: rightOf(mug, (0.5, 0))
    """
    # mug at (0.25, 0.5), HOME at (0.125, 0.5): their distance is 0.125, and so is how far HOME is to the left
    assert worth(text, A) == min(0.25 - 0.125, 0.125)
    assert worth("const STEP = 0.5\n" + text.replace("const STEP = 2 * HALF", ""), A, label="wide") == 0.125
    assert worth(text.replace("2 * HALF", "HALF / 2"), A) == 0.0625 - 0.125
    assert worth(text, A, label="late") == -0.25
    assert worth(text, A, label="all") == min(0.125, 0.25)


def test_a_parameter_hides_every_other_name():
    text = "object mug, plate\nconst e = 9\ndef f(plate, e) = x(plate) <= e\ntask: f(mug, 0.5)"
    assert worth(text, A, B) == 0.25


def test_objects_are_inferred_in_the_order_in_which_the_text_names_them():
    text = "def f(p) = leftOf(p, plate)\ntask: closeTo(mug, NORTHEAST)\nsafe: f(fork) & leftOf(x, mug)"
    assert check_text(text).objects == ("plate", "mug", "NORTHEAST", "fork", "x")
    assert check_text("object b, a\ntask: leftOf(a, b)").objects == ("b", "a")
    assert check_text("object a, spare\ntask: x(a) <= 1").objects == ("a", "spare")


def test_the_workspace():
    space = check_text("const W = 2\nworkspace [-50 cm, W] x [0, 2 * W]\ntask: leftOf(a, b)").workspace
    assert (space.x, space.y) == ((-0.5, 2.0), (0.0, 4.0))
    default = check_text("leftOf(a, b)").workspace
    assert (default.x, default.y) == ((0.0, 1.0), (0.0, 1.0))


def test_a_definition_that_nobody_calls_is_checked_without_made_up_mistakes():
    check_text("def f(p, k) = x(p) / (k - 1) <= 2 / k\ndef g(p) = angle(p, theta(p))\ntask: leftOf(a, b)")
    with pytest.raises(SpecError, match="must be a formula, not a number"):
        check_text("def f(p) = 3 & leftOf(p, (0, 0))\ntask: leftOf(a, b)")
