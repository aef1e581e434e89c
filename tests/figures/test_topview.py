"""Top views: well-formed, the same bytes for the same scene, and lines as long as what they say."""

import math
import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scenegen.geometry import MATH, POINT, Box, Circle, Polygon
from scenegen.geometry.clearance import gap, room
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.show.figures.dimensions import (
    Dimension,
    FigureObject,
    FigureScene,
    Guide,
    Turn,
    dimensions,
    gap_segment,
    room_segment,
    short,
)
from scenegen.show.figures.topview import Labels, Rect, topview

from ..laws import examples

SVG = "{http://www.w3.org/2000/svg}"
WEDGE = Polygon(((-0.1, -0.1), (0.2, 0.0), (-0.1, 0.1)))
footprints = st.sampled_from([POINT, Circle(0.1), Box(0.2, 0.1), Box(0.4, 0.4), WEDGE])
places = st.floats(-0.5, 0.5)
poses = st.tuples(places, places, st.floats(0.0, 6.28))


def length(segment):
    return math.dist(*segment)


@settings(max_examples=examples(300))
@given(footprints, poses, footprints, poses)
def test_lines_are_as_long_as_the_clearance(a, a_pose, b, b_pose):
    segment = gap_segment(a, a_pose, b, b_pose)
    assert length(segment) == pytest.approx(abs(gap(MATH, a, b, *a_pose, *b_pose)), abs=1e-9)
    segment = room_segment(a, a_pose, b, b_pose)
    if b != POINT or a != POINT:
        assert length(segment) == pytest.approx(abs(room(MATH, a, b, *a_pose, *b_pose)), abs=1e-9)


@settings(max_examples=examples(100))
@given(footprints, poses, footprints, poses)
def test_the_ends_of_a_gap_lie_on_the_footprints(a, a_pose, b, b_pose):
    assume(gap(MATH, a, b, *a_pose, *b_pose) > 0.0)
    for (x, y), one, pose in zip(gap_segment(a, a_pose, b, b_pose), (a, b), (a_pose, b_pose), strict=True):
        assert gap(MATH, POINT, one, x, y, 0.0, *pose) <= 1e-9


def marks(text, *scene):
    core = check_text(text).core
    rows = [number for pose in scene for number in pose]
    values = evaluate(core, rows)
    return dimensions(core, deciding_atom(core, next(iter(core.labels)), values), rows)


MUG, PLATE = (0.2, 0.3, 0.0), (0.5, 0.7, 0.0)
OBJECTS = "object mug = cylinder(0.05, 0.1), plate = cylinder(0.1, 0.02)\n"


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("dist(mug, plate) <= 10 cm", [Dimension((0.2, 0.3), (0.5, 0.7), "0.5 m", False)]),
        ("x(mug) <= 0.45", [Dimension((0.2, 0.3), (0.45, 0.3), "0.25 m")]),
        ("0.05 <= x(mug)", [Dimension((0.05, 0.3), (0.2, 0.3), "0.15 m")]),
        ("y(plate) + 1 <= 1.2", [Dimension((0.5, 0.7), (0.5, 1.2 - 1), "0.5 m", False)]),
        (
            "x(mug) <= x(plate) - 1",
            [
                Guide((0.2, 0.3), (0.2, 0.5)),
                Guide((0.5, 0.7), (0.5, 0.5)),
                Dimension((0.2, 0.5), (0.5, 0.5), "0.3 m", False),
            ],
        ),
        ("abs(x(mug) - 0.3) <= 1 cm", [Dimension((0.3, 0.3), (0.2, 0.3), "0.1 m", False)]),
        ("theta(mug) <= 1", []),
        ("x(mug) * y(mug) <= 1", []),
        ("x(mug) + x(plate) <= 1", []),
        ("x(mug) + y(mug) <= 1", []),
        ("2 * x(mug) <= 1", []),
    ],
)
def test_what_an_atom_measures(formula, expected):
    found = marks(f"{OBJECTS}task: {formula}", MUG, PLATE)
    assert [type(mark) for mark in found] == [type(mark) for mark in expected]
    for mark, wanted in zip(found, expected, strict=True):
        assert (*mark.start, *mark.end) == pytest.approx((*wanted.start, *wanted.end))
        if isinstance(mark, Dimension):
            assert (mark.text, mark.good) == (wanted.text, wanted.good)


def test_edges_are_measured_from_edges():
    (left, right, line) = marks(f"{OBJECTS}task: fullyLeftOf(mug, plate)", MUG, PLATE)
    assert (line.start, line.end) == (pytest.approx((0.25, 0.5)), pytest.approx((0.4, 0.5)))
    assert (left.start, right.start) == (pytest.approx((0.25, 0.3)), pytest.approx((0.4, 0.7)))


def test_an_angle_turns_from_the_heading_that_was_wanted():
    (turn,) = marks(f"{OBJECTS}task: angle(mug, NORTH)", (0.2, 0.3, 1.0), PLATE)
    assert (turn.center, turn.start, turn.stop) == ((0.2, 0.3), pytest.approx(math.pi / 2), 1.0)
    assert (turn.text, turn.good) == ("0.571 rad", False)


VIEW = FigureScene(
    [
        FigureObject("mat & <co>", Box(0.4, 0.2), (0.5, 0.1, 0.0), zone=True),
        FigureObject("mug", Circle(0.05), (0.2, 0.3, 1.0)),
        FigureObject("wedge", WEDGE, (0.7, 0.6, 0.5), tint="#abcdef"),
    ],
    marks=[
        Dimension((0.2, 0.3), (0.7, 0.6), "0.583 m", False),
        Turn((0.2, 0.3), 0.0, 1.0, "1 rad"),
        Guide((0, 0), (1, 1)),
    ],
    caption=["closeTo(mug, wedge)", "phi = \N{MINUS SIGN}0.333"],
    good=False,
)


def test_a_view_is_well_formed_and_the_same_every_time():
    text = topview(VIEW)
    assert text == topview(VIEW)
    root = ET.fromstring(text)
    assert [one.text for one in root.iter(f"{SVG}text")][-2:] == list(VIEW.caption)
    assert {"mat & <co>", "mug", "wedge", "0.583 m", "1 rad"} <= {one.text for one in root.iter(f"{SVG}text")}
    assert root.get("width") == "240"


def test_views_stand_side_by_side():
    root = ET.fromstring(topview(VIEW, VIEW, VIEW, width=300))
    assert root.get("width") == "900"
    assert [group.get("transform") for group in root.iter(f"{SVG}g")] == [None, "translate(300 0)", "translate(600 0)"]


def test_y_points_upwards():
    low, high = (topview(FigureScene([FigureObject("a", Circle(0.05), (0.5, y, 0.0))])) for y in (0.2, 0.8))
    assert float(circle(low).get("cy")) > float(circle(high).get("cy"))


def circle(text):
    return next(ET.fromstring(text).iter(f"{SVG}circle"))


def test_what_sticks_out_is_drawn_in_full_unless_it_is_far_away():
    near = circle(topview(FigureScene([FigureObject("a", Circle(0.1), (1.05, 0.5, 0.0))])))
    assert float(near.get("cx")) + float(near.get("r")) <= 240.0
    far = circle(topview(FigureScene([FigureObject("a", Circle(0.1), (9.0, 0.5, 0.0))])))
    assert float(far.get("cx")) > 240.0


def test_what_reaches_over_the_frame_is_cut_off_there():
    """Else a region would run under the caption, and into the view beside."""
    over = FigureScene([FigureObject("reach", Circle(0.6), (0.5, 0.0, 0.0), zone=True)], caption=["a", "b"])
    root = ET.fromstring(topview(over, VIEW))
    (frame,) = root.iter(f"{SVG}clipPath")
    (group,) = (one for one in root.iter(f"{SVG}g") if one.get("clip-path") == f"url(#{frame.get('id')})")
    assert len(list(group.iter(f"{SVG}circle"))) == 1 and not list(group.iter(f"{SVG}text"))
    (rect,) = frame
    bottom = float(rect.get("y")) + float(rect.get("height"))
    captions = [float(one.get("y")) for one in root.iter(f"{SVG}text") if one.text in ("a", "b")]
    assert min(captions) - 11 >= bottom - 2.0
    assert "clip" not in topview(VIEW)


@pytest.mark.parametrize("far", [1e4, 1e7, 1e300])
def test_marks_may_end_anywhere(far):
    """A line of 1e300 pixels is as quickly kept clear of labels as any other, and drawn in numbers that can be read."""
    marks = [Dimension((0.2, 0.3), (far, 0.6), "far", False), Guide((-far, far), (far, 0.0))]
    text = topview(FigureScene([FigureObject("mug", Circle(0.05), (far, 0.3, 1.0))], marks=marks))
    numbers = [abs(float(one)) for one in re.findall(r"[ML]([-\d.]+)", text)]
    assert len(numbers) >= 4 and max(numbers) <= 20_010.0 and len(text) < 5000


def test_a_workspace_of_any_size():
    for size in (1e-3, 1.0, 7.0, 1e6):
        text = topview(
            FigureScene(
                [FigureObject("a", Circle(size / 10), (size / 2, size / 2, 0.0))], x=(0.0, size), y=(0.0, 2 * size)
            )
        )
        assert ET.fromstring(text).get("height") == "456" and len(text) < 3000


def test_labels_keep_off_each_other_and_in_the_frame():
    labels = Labels(Rect(0.0, 0.0, 100.0, 50.0))
    assert labels.place([(50.0, 25.0), (50.0, 40.0)], 40.0, 10.0) == (50.0, 25.0)
    assert labels.place([(50.0, 25.0), (50.0, 40.0)], 40.0, 10.0) == (50.0, 40.0)
    assert labels.place([(99.0, 0.0)], 40.0, 10.0) == (80.0, 5.0)


def test_short_numbers():
    assert [short(value) for value in (0.1, -0.25, -1e-9, 1.0, 0.12345)] == [
        "0.1",
        "\N{MINUS SIGN}0.25",
        "0",
        "1",
        "0.123",
    ]


def test_furniture_shows_its_cells():
    from scenegen.things import shape_of
    from scenegen.things.surfaces import cells_of

    shapes = {name: shape_of(name) for name in ("rack", "cabinet", "bin", "mug")}
    for name, cells in {"rack": 6, "cabinet": 1, "bin": 1, "mug": 0}.items():
        thing = FigureObject(name, shapes[name].footprint, (0.5, 0.5, 0.3), inside=cells_of(shapes[name]))
        assert topview(FigureScene([thing])).count('stroke-width="0.6"') == cells
