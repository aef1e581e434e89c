"""The relations of the prelude on scenes that were worked out on paper, and what each golden file has to show. Laws
that relations keep in every scene: mirrors, turns and shifts, and what follows from what. What phi is worth, on
scenes worked out on paper: formula, poses of the objects in their order, phi.
"""

import math
import re
from functools import cache

import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scenegen.errors import Source, SpecError
from scenegen.geometry import Box
from scenegen.lang.check.scope import prelude
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply
from scenegen.lang.formula.interpret import phi
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.lang.syntax.parse import parse
from scenegen.learn.robustness import Robustness

from ..laws import examples
from .relation_scenes import FOLDER, read

DEFINITIONS = {one.name.id: one for one in prelude().statements if isinstance(one, ast.Definition)}
FILES = sorted(FOLDER.glob("*.txt"))
SCENES = {path.stem: read(path)[1] for path in FILES}
CASES = [(name, scene) for name, scenes in SCENES.items() for scene in scenes]
EXACT = 1e-12
RIGHT = math.pi / 2.0
NUMBERS = {"leftEdge", "rightEdge", "bottomEdge", "topEdge", "mirrorImage"}  # no formulas: true of nothing


def label(case):
    return f"{case[0]}: {case[1].title}"


def test_each_definition_has_a_golden_file_and_each_file_a_definition():
    assert set(SCENES) == set(DEFINITIONS)


@pytest.mark.parametrize(("name", "scene"), CASES, ids=map(label, CASES))
def test_phi_by_hand(name, scene):
    assert phi(scene.spec().core, scene.rows)["task"] == pytest.approx(scene.phi, abs=EXACT, rel=0.0)
    if len(scene.poses) > 1:  # constants are folded when the spec is checked
        assert phi(scene.held().core, scene.rows)["task"] == pytest.approx(scene.phi, abs=EXACT, rel=0.0)


@pytest.mark.parametrize("name", SCENES)
def test_phi_by_hand_in_torch(name):
    for scene in SCENES[name]:
        rows = torch.tensor(scene.rows, dtype=torch.float64)[:, None]
        got = Robustness(scene.spec().core).rows(rows)
        assert got.item() == pytest.approx(scene.phi, abs=EXACT, rel=0.0), scene.title


def calls(scene, name):
    """How many arguments each call of the relation in a scene's task is given."""
    stack, counts = [parse(Source("task", scene.task)).bare], []
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Call) and node.function.id == name:
            counts.append(len(node.arguments))
        stack.extend(traversal.children(node))
    return counts


@pytest.mark.parametrize("name", SCENES)
def test_what_a_golden_file_shows(name):
    scenes = SCENES[name]
    assert len({scene.title for scene in scenes}) == len(scenes) >= 3
    given = [count for scene in scenes for count in calls(scene, name)]
    assert len(given) >= len(scenes)
    parameters = DEFINITIONS[name].parameters
    needed = sum(one.default is None for one in parameters)
    if needed < len(parameters):
        assert needed in given, "no scene leaves out what has a default"
        assert max(given) > needed, "no scene gives what has a default"
    if name not in NUMBERS:
        assert [scene.title for scene in scenes[:2]] == ["satisfied", "violated"]  # the pictures
        assert scenes[0].phi > 0.0 > scenes[1].phi
        assert any(abs(scene.phi) <= EXACT for scene in scenes), "no scene is at the limit"


def measures_footprints(scene):
    return any(isinstance(node, Apply) and node.shapes for node in scene.spec().core.nodes)


def askew(scene):
    """Whether a box stands at no multiple of a right angle."""
    shapes = [shape.footprint for shape in scene.spec().shapes]
    turns = [theta % RIGHT for _, _, theta in scene.poses]
    return any(isinstance(one, Box) and 0.1 < turn < RIGHT - 0.1 for one, turn in zip(shapes, turns, strict=True))


@pytest.mark.parametrize("name", [name for name, scenes in SCENES.items() if measures_footprints(scenes[0])])
def test_what_the_golden_file_of_a_footprint_relation_shows(name):
    scenes = SCENES[name]
    assert any("cylinder" in scene.text and "box" not in scene.text for scene in scenes), "no circles"
    assert any(map(askew, scenes)), "no box that stands askew"
    assert any(
        re.search(r"region|workspace|\([.\d]+, [.\d]+\)", re.sub(r"object.*", "", scene.text)) for scene in scenes
    ), "no region or point"


CUP, BOOK, TILE = "cylinder(0.06, 0.1)", "box(0.2, 0.1, 0.1)", "box(0.3, 0.3, 0.1)"
WEDGE = "prism([(-0.1, -0.1), (0.2, 0), (-0.1, 0.1)], 0.1)"
TRIPLES = [(CUP, BOOK, WEDGE), (WEDGE, TILE, CUP), (TILE, CUP, BOOK), (CUP, CUP, CUP), (BOOK, TILE, BOOK), (WEDGE,) * 3]
CLOSE = 1e-9
PI = math.pi

places = st.floats(0.0, 1.0)
poses = st.tuples(places, places, st.floats(0.0, 2 * PI))
scenes_laws = st.tuples(poses, poses, poses)
shapes = st.sampled_from(TRIPLES)
several = st.tuples(shapes, scenes_laws)  # footprints of a, b, c, and where they stand


@cache
def core(shapes, formula):
    objects = ", ".join(f"{name} = {shape}" for name, shape in zip("abc", shapes, strict=True))
    return check_text(f"object {objects}\nregion mat = rect(0.2, 0.3, 0.8, 0.7)\ntask: {formula}").core


def worth(formula, scene):
    """phi of a formula over a, b and c."""
    shapes, poses = scene
    return phi(core(shapes, formula), [number for pose in poses for number in pose])["task"]


def moved(scene, move):
    shapes, poses = scene
    return shapes, tuple(move(*pose) for pose in poses)


def same(one, other):
    assert one == pytest.approx(other, abs=CLOSE)


BESIDE = {"leftOf": "rightOf", "fullyLeftOf": "fullyRightOf", "partlyLeftOf": "partlyRightOf"}
BEHIND = {"belowOf": "aboveOf", "fullyBelowOf": "fullyAboveOf", "partlyBelowOf": "partlyAboveOf"}
TURNED = dict(zip(BESIDE, BEHIND, strict=True))
SOLID = (  # unchanged however all things are moved together
    "closeTo(a, b)",
    "farFrom(a, b)",
    "closerThan(a, b, c)",
    "between(a, b, c)",
    "overlaps(a, b)",
    "partlyOverlaps(a, b)",
    "clearOf(a, b, 3 cm)",
    "touching(a, b)",
    "inside(a, b)",
    "partlyInside(a, b)",
    "on(a, b)",
    "evenlySpaced([a, b, c])",
    "noOverlap()",
)
TURNING = ("facing(a, b)", "sameHeading(a, b)")  # angles jump where they meet pi
IN_THE_SQUARE = (
    "nearEdge(a)",
    "inCorner(a)",
    "insideWorkspace()",
    "mirrored(a, b)",
    "inside(a, mat)",
    "nearEdge(a, mat)",
)


@pytest.mark.long
@settings(deadline=None, max_examples=examples(60))
@given(several)
def test_a_mirror_exchanges_left_and_right(scene):
    image = moved(scene, lambda x, y, theta: (1.0 - x, y, PI - theta))
    for left, right in BESIDE.items():
        same(worth(f"{left}(a, b)", image), worth(f"{right}(a, b)", scene))
    for formula in (*(f"{name}(a, b)" for name in BEHIND), "alignedX(a, b)", "alignedY(a, b)", *SOLID, *IN_THE_SQUARE):
        same(worth(formula, image), worth(formula, scene))
    same(worth("ordered([a, b, c], WEST)", image), worth("ordered([a, b, c])", scene))


@settings(deadline=None, max_examples=examples(60))
@given(several)
def test_a_mirror_exchanges_near_and_far(scene):
    image = moved(scene, lambda x, y, theta: (x, 1.0 - y, -theta))
    for below, above in BEHIND.items():
        same(worth(f"{below}(a, b)", image), worth(f"{above}(a, b)", scene))
    for formula in (*(f"{name}(a, b)" for name in BESIDE), *IN_THE_SQUARE, "ordered([a, b, c])"):
        same(worth(formula, image), worth(formula, scene))


@settings(deadline=None, max_examples=examples(40))
@given(several)
def test_a_quarter_turn_takes_left_to_below(scene):
    turned = moved(scene, lambda x, y, theta: (1.0 - y, x, theta + PI / 2))
    for left, below in TURNED.items():
        same(worth(f"{below}(a, b)", turned), worth(f"{left}(a, b)", scene))
    same(worth("alignedY(a, b)", turned), worth("alignedX(a, b)", scene))
    same(worth("ordered([a, b, c], NORTH)", turned), worth("ordered([a, b, c])", scene))
    same(worth("mirrored(a, b, heading = EAST)", turned), worth("mirrored(a, b)", scene))


@settings(deadline=None, max_examples=examples(60))
@given(several, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-4.0, 4.0))
def test_only_where_things_are_to_each_other_counts(scene, dx, dy, turn):
    shifted = moved(scene, lambda x, y, theta: (x + dx, y + dy, theta))
    names = (*BESIDE, *BESIDE.values(), *BEHIND, *BEHIND.values(), "alignedX", "alignedY")
    for formula in (*(f"{name}(a, b)" for name in names), "angle(a, NORTH)", "ordered([a, b, c], 30 deg)"):
        same(worth(formula, shifted), worth(formula, scene))
    cos, sin = math.cos(turn), math.sin(turn)
    turned = moved(scene, lambda x, y, theta: (dx + cos * x - sin * y, dy + sin * x + cos * y, theta + turn))
    for formula in SOLID:
        same(worth(formula, turned), worth(formula, scene))
    (ax, ay, _), (bx, by, _), _ = scene[1]
    assume(math.hypot(ax - bx, ay - by) > 1e-3)
    for formula in TURNING:
        same(worth(formula, turned), worth(formula, scene))


@settings(deadline=None, max_examples=examples(100))
@given(several)
def test_what_follows_from_what(scene):
    """Margins, not truths alone: the weaker relation never has the smaller phi."""
    gap = worth("gap(a, b) >= 0", scene)
    for side in ("Left", "Right", "Below", "Above"):
        fully = worth(f"fully{side}Of(a, b)", scene)
        assert fully <= worth(f"partly{side}Of(a, b)", scene) + CLOSE
        assert fully <= worth(f"{side.lower()}Of(a, b)", scene) + CLOSE  # centres lie in their footprints
        assert fully <= gap + CLOSE
    inside = worth("inside(a, b)", scene)
    assert worth("on(a, b)", scene) <= worth("overlaps(a, b)", scene) + CLOSE
    assert min(worth("partlyInside(a, b)", scene), inside) <= 0.0
    assert worth("partlyOverlaps(a, b)", scene) <= worth("partlyInside(a, b)", scene)
    assert worth("insideWorkspace()", scene) <= worth("inside(a, workspace)", scene)


@settings(deadline=None, max_examples=examples(100))
@given(st.tuples(st.just((CUP, "box(0.6, 0.5, 0.1)", WEDGE)), scenes_laws))
def test_what_lies_in_a_thing_is_on_it_and_overlaps_it(scene):
    """phi too, once it lies in it; far outside, `inside` measures across one side and the others round the corner."""
    for one in ("a", "c"):
        inside, on, overlaps = (worth(f"{name}({one}, b)", scene) for name in ("inside", "on", "overlaps"))
        assert inside < 0.0 or inside <= on + CLOSE
        assert inside < 0.0 or inside <= overlaps + CLOSE
        assert (inside >= 0.0) <= (min(on, overlaps) >= 0.0)


@settings(deadline=None, max_examples=examples(60))
@given(several, st.integers(0, 30))
def test_clearances(scene, percent):
    gap = worth("gap(a, b) >= 0", scene)
    same(worth(f"clearOf(a, b, {percent} cm)", scene), gap - percent / 100)
    same(worth(f"touching(a, b, {percent} cm)", scene), percent / 100 - abs(gap))
    same(worth("overlaps(a, b)", scene), -gap)
    pairs = [worth(f"gap({pair}) >= 0", scene) for pair in ("a, b", "a, c", "b, c")]
    assert worth("noOverlap()", scene) == worth("noOverlap([a, b, c])", scene) == min(pairs)
    assert worth("noOverlap([c, a])", scene) == pairs[1]
    rooms = [worth(f"room({one}, workspace) >= 0", scene) for one in "abc"]
    assert worth("insideWorkspace()", scene) == min(rooms)


@pytest.mark.long
@settings(deadline=None, max_examples=examples(60))
@given(several)
def test_relations_that_work_both_ways(scene):
    for name in ("closeTo", "farFrom", "alignedX", "alignedY", "overlaps", "partlyOverlaps", "touching", "clearOf"):
        same(worth(f"{name}(b, a)", scene), worth(f"{name}(a, b)", scene))
    same(worth("between(a, c, b)", scene), worth("between(a, b, c)", scene))
    same(worth("evenlySpaced([c, b, a])", scene), worth("evenlySpaced([a, b, c])", scene))
    same(worth("ordered([c, b, a], WEST)", scene), worth("ordered([a, b, c])", scene))
    for mirror in ("", ", heading = 30 deg", ", mat.left, 100 deg"):
        same(worth(f"mirroredPlace(b, a{mirror})", scene), worth(f"mirroredPlace(a, b{mirror})", scene))
        same(worth(f"mirrored(b, a{mirror})", scene), worth(f"mirrored(a, b{mirror})", scene))
    for one, other in (("leftOf", "rightOf"), ("belowOf", "aboveOf"), ("closerThan", "closerThan")):
        last = ", c" if one == "closerThan" else ""
        swapped = "a, c, b" if last else "a, b"
        same(worth(f"{other}({swapped})", scene), -worth(f"{one}(a, b{last})", scene))
    for side in ("LeftOf", "BelowOf"):
        opposite = {"LeftOf": "RightOf", "BelowOf": "AboveOf"}[side]
        same(worth(f"fully{opposite}(b, a)", scene), worth(f"fully{side}(a, b)", scene))
        same(
            worth(f"partly{opposite}(a, b)", moved(scene, lambda x, y, theta: (-x, -y, theta + PI))),
            worth(f"partly{side}(a, b)", scene),
        )


@settings(deadline=None, max_examples=examples(40))
@given(shapes, poses, st.integers(0, 179))
def test_the_image_of_an_image(shapes, pose, degrees):
    mirror = f"(0.3, 0.6), {degrees} deg"
    scene = (shapes, (pose, pose, pose))
    same(worth(f"dist(a, mirrorImage(mirrorImage(a, {mirror}), {mirror})) <= 0", scene), 0.0)
    x, y = (worth(f"{axis}(mirrorImage(a, {mirror})) >= 0", scene) for axis in "xy")
    # Halfway between them is the mirror, and the way across is at a right angle to it.
    heading = math.radians(degrees)
    mx, my = (x + pose[0]) / 2 - 0.3, (y + pose[1]) / 2 - 0.6
    same(mx * math.sin(heading) - my * math.cos(heading), 0.0)
    same((x - pose[0]) * math.cos(heading) + (y - pose[1]) * math.sin(heading), 0.0)
    image = (x, y, 2 * heading - pose[2])
    same(worth(f"mirrored(b, a, {mirror}, 5 cm)", (shapes, (pose, image, pose))), 0.05)


@settings(deadline=None, max_examples=examples(60))
@given(shapes, poses, st.floats(0.3, 1.0), st.floats(0.0, 6.2))
def test_even_rows_are_even(shapes, pose, step, heading):
    """The same thing three times at equal steps in one direction."""
    row = tuple(
        (pose[0] + k * step * math.cos(heading), pose[1] + k * step * math.sin(heading), pose[2]) for k in range(3)
    )
    scene = ((shapes[0],) * 3, row)
    same(worth("evenlySpaced([a, b, c], 7 cm)", scene), 0.07)
    same(worth("ordered([a, b, c])", scene), step * math.cos(heading))
    same(worth("ordered([a, b, c], NORTH)", scene), step * math.sin(heading))
    same(worth("between(b, a, c)", scene), 0.02)
    same(worth("sameHeading(a, c)", scene), 0.2)


@settings(deadline=None, max_examples=examples(60))
@given(several)
def test_what_looks_at_a_thing_faces_it(scene):
    shapes, ((ax, ay, _), b, c) = scene
    assume(math.hypot(b[0] - ax, b[1] - ay) > 1e-3)
    towards = math.atan2(b[1] - ay, b[0] - ax)
    same(worth("facing(a, b)", (shapes, ((ax, ay, towards), b, c))), 0.2)
    same(worth("facing(a, b)", (shapes, ((ax, ay, towards - 0.15 + 4 * PI), b, c))), 0.05)


A, B = (0.25, 0.5, 0.0), (0.75, 0.125, 0.0)  # dx = 0.5, dy = -0.375, dist = sqrt(0.25 + 0.140625) = 0.625
C = (1.0, 1.0, 0.0)


def worth_semantics(text, *poses, label="task"):
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
    assert worth_semantics(f"object a, b\ntask: {formula}", A, B) == expected


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
    assert worth_semantics(formula, (0.0, 0.0, theta)) == pytest.approx(expected, abs=1e-14)


def test_wrap_goes_to_half_open_minus_pi_pi():
    assert worth_semantics("wrap(theta(a)) >= 0", (0.0, 0.0, PI)) == PI
    assert worth_semantics("wrap(theta(a)) >= 0", (0.0, 0.0, -PI)) == PI
    assert worth_semantics("wrap(theta(a)) >= 0", (0.0, 0.0, -0.5)) == -0.5
    assert worth_semantics("wrap(theta(a)) >= 0", (0.0, 0.0, 3 * PI - 1.0)) == pytest.approx(PI - 1.0, abs=1e-14)


@pytest.mark.parametrize(
    ("quantity", "value"),
    [("25 cm", 0.25), ("250 mm", 0.25), ("0.25 m", 0.25), ("7 cm", 0.07), ("3 mm", 0.003), ("2.5e1 cm", 0.25)],
)
def test_lengths_are_in_metres_to_the_last_bit(quantity, value):
    assert worth_semantics(f"x(a) <= {quantity}", (0.0, 0.0, 0.0)) == value


@pytest.mark.parametrize(
    ("quantity", "value"),
    [("90 deg", PI / 2), ("180deg", PI), ("0.25 turn", PI / 2), ("1 turn", 2 * PI), ("1.5 rad", 1.5), ("1.5", 1.5)],
)
def test_angles_are_in_radians_to_the_last_bit(quantity, value):
    assert worth_semantics(f"theta(a) <= {quantity}", (0.0, 0.0, 0.0)) == value


def test_a_spec_takes_the_place_of_default_constants():
    text = "const EPS_CLOSE = 1 m\nconst EPS_FAR = 50 cm\n"
    text += "task: closeTo(a, b)\nfar: farFrom(a, b)\nnear: closeTo(a, b, 0.5)"
    assert worth_semantics(text, A, B) == 0.375  # 1 - 0.625
    assert worth_semantics(text, A, B, label="far") == 0.125
    assert worth_semantics(text, A, B, label="near") == -0.125
    turned = (0.0, 0.0, 0.75)
    assert worth_semantics("const EPS_ANGLE = 0.5\ntask: angle(a, EAST)", turned) == -0.25
    # metres per radian: 0.1 * 0.2 - 0.1 * 0.75
    assert worth_semantics("const ANGLE_SCALE = 0.1\ntask: angle(a, EAST)", turned) == pytest.approx(-0.055, abs=1e-15)
    assert worth_semantics("const NORTH = 0.5\ntask: angle(a, NORTH, 0)", turned) == -0.25


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
    assert worth_semantics(text, A) == min(0.25 - 0.125, 0.125)
    assert worth_semantics("const STEP = 0.5\n" + text.replace("const STEP = 2 * HALF", ""), A, label="wide") == 0.125
    assert worth_semantics(text.replace("2 * HALF", "HALF / 2"), A) == 0.0625 - 0.125
    assert worth_semantics(text, A, label="late") == -0.25
    assert worth_semantics(text, A, label="all") == min(0.125, 0.25)


def test_a_parameter_hides_every_other_name():
    text = "object mug, plate\nconst e = 9\ndef f(plate, e) = x(plate) <= e\ntask: f(mug, 0.5)"
    assert worth_semantics(text, A, B) == 0.25


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
