"""Laws that relations keep in every scene: mirrors, turns and shifts, and what follows from what."""

import math
from functools import cache

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi

from ..laws import examples

CUP, BOOK, TILE = "cylinder(0.06, 0.1)", "box(0.2, 0.1, 0.1)", "box(0.3, 0.3, 0.1)"
WEDGE = "prism([(-0.1, -0.1), (0.2, 0), (-0.1, 0.1)], 0.1)"
TRIPLES = [(CUP, BOOK, WEDGE), (WEDGE, TILE, CUP), (TILE, CUP, BOOK), (CUP, CUP, CUP), (BOOK, TILE, BOOK), (WEDGE,) * 3]
CLOSE = 1e-9
PI = math.pi

places = st.floats(0.0, 1.0)
poses = st.tuples(places, places, st.floats(0.0, 2 * PI))
scenes = st.tuples(poses, poses, poses)
shapes = st.sampled_from(TRIPLES)
several = st.tuples(shapes, scenes)  # footprints of a, b, c, and where they stand


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
@given(st.tuples(st.just((CUP, "box(0.6, 0.5, 0.1)", WEDGE)), scenes))
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
