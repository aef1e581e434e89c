"""Cameras: the statement, what names they take, and what their relations say of scenes; shares against pictures."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import scenegen
from scenegen.geometry import NUMPY, Circle, Polygon
from scenegen.geometry.footprint import Stack, corners, edges
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.lang.sights import sights_of
from scenegen.learn.robustness import Robustness
from scenegen.looks.camera import from_place
from scenegen.search.contract import contract_box
from scenegen.search.effort import Effort
from scenegen.search.tape import make_tape
from scenegen.things.library import ASSETS, Shape
from scenegen.things.outline import corners_of
from scenegen.things.sight import visible_body

from ..laws import examples

LIBRARY = "object mug, carton, bottle, wedge = teapot\n"  # all but the carton are stacks
CAMERA = "camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3\n"
THINGS = """object mug = cylinder(4 cm, 9 cm), carton = box(8 cm, 6 cm, 20 cm), bottle = cylinder(3.5 cm, 25 cm)
object wedge = prism([(-0.1, -0.05), (0.1, -0.05), (0, 0.1)], 6 cm)
"""


def worth(text, rows):
    return phi(check_text(CAMERA + THINGS + text).core, list(rows), NUMPY)["task"]


def scenes(count, seed=0, objects=4):
    rng = np.random.default_rng(seed)
    rows = rng.uniform(size=(3 * objects, count))
    rows[2::3] *= 2.0 * math.pi
    return rows


def test_the_words_of_a_camera_are_names_elsewhere():
    spec = check_text(CAMERA + "object camera, fov, looks\ntask: inView(camera, front) & leftOf(fov, looks)")
    assert spec.objects == ("camera", "fov", "looks") and [one.name for one in spec.cameras] == ["front"]
    front = spec.cameras[0]
    assert front.field == pytest.approx(math.pi / 3.0) and front.aspect == pytest.approx(4.0 / 3.0)
    assert front.ahead == (0.0, 1.0) and front.slope == pytest.approx(
        (0.7 / math.hypot(1, 0.7), 1 / math.hypot(1, 0.7))
    )


def test_a_camera_may_be_there_for_pictures_alone():
    assert check_text(CAMERA + "leftOf: leftOf(a, b)").warnings == ()


@pytest.mark.parametrize(
    ("eye", "target", "blind"),
    [
        ("(0.5, -0.6, 0.7)", "(0.5, 0.4, 0)", False),
        ("(0.5, -0.6, 0.7)", "(0.5, -2, 0)", True),  # behind it
        ("(0.5, 0.5, 0.7)", "(0.5, 0.5, 2)", True),  # up
        ("(0.5, -0.6, 0.7)", "(3, 1.2, 0)", False),  # a corner of the table is at the side of the picture
        ("(0.5, -0.6, 0.7)", "(3, -0.5, 0)", True),
        ("(0.5, -0.6, 0.02)", "(0.5, 0.4, 0.6)", False),  # tall things reach into the picture
        ("(0.5, -0.6, 0.7)", "(0.5, 0.4, 1.7)", True),
    ],
)
def test_a_camera_that_looks_away_from_everything_is_noticed(eye, target, blind):
    """No object is within its picture in any of 20,000 scenes, and where nothing is said, one is."""
    text = f"camera one = at {eye} looks at {target} fov 40 deg, 4:3\n{THINGS}task: leftOf(mug, carton)\n"
    spec = check_text(text)
    assert [one.code for one in spec.warnings] == ["blind-camera"] * blind
    seen = sights_of(spec).views(scenes(20_000))
    assert any(one.any.any() for one in seen) == (not blind)


def test_definitions_take_cameras_and_replace_those_of_the_prelude():
    text = CAMERA + "object mug, cup\ndef seen(a, eye) = unhidden(a, eye) & inView(a, eye)\ntask: seen(mug, front)"
    assert check_text(text).labels == ("task",)
    assert check_text("def visible(a) = leftOf(a, (0.5, 0.5))\ntask: visible(mug)").labels == ("task",)


def test_a_camera_straight_above():
    text = "camera top = at (0.5, 0.5, 2) looks at (0.5, 0.5, 0) fov 60 deg, 1:1\n"
    text += "object a = cylinder(5 cm, 5 cm) at (0.5, 0.5), b = cylinder(5 cm, 5 cm)\n"
    core = check_text(text + "task: unhidden(b, top)").core
    # the copies of a are around the same middle, the larger one 2 / 1.95 times as large
    assert phi(core, [0.5, 0.5, 0.0, 0.7, 0.5, 0.0])["task"] == pytest.approx(0.2 - 0.05 - 0.05 * 2 / 1.95)


def test_a_share_of_what_is_alone_is_constant_and_why_is_said():
    with pytest.raises(scenegen.errors.SpecError, match="there is nothing that can hide `mug`"):
        check_text(CAMERA + "object mug\ntask: visible(mug, front, 30 %, 50 %)")


@pytest.mark.parametrize("crate", ["box(20 cm, 20 cm, 80 cm)", "cylinder(10 cm, 80 cm)", "prism"])
def test_a_body_around_the_camera_hides_all(crate):
    """Also what is behind the camera."""
    shape = "prism([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)], 80 cm)" if crate == "prism" else crate
    text = CAMERA.replace("-0.6", "0.3") + f"object mug = cylinder(4 cm, 9 cm), crate = {shape}\n"
    text += "clear: unhidden(mug, front)\nshare: visibleShare(mug, front) >= 0"
    core = check_text(text).core
    rows = np.random.default_rng(0).uniform(size=(6, 500))
    rows[3], rows[4] = 0.35, 0.25  # beside it
    outside = phi(core, list(rows), NUMPY)
    assert (outside["share"] >= 0.0).mean() > 0.7
    rows[3], rows[4] = 0.52, 0.33
    inside = phi(core, list(rows), NUMPY)
    assert (inside["share"] == -1.0).all() and (inside["clear"] < 0.0).all()


@pytest.mark.parametrize("pose", [(0.5, 0.1, 0.0), (0.55, 0.1, 0.5)])
def test_scenes_with_a_camera_in_what_is_held_around_it_are_proved_away(pose):
    spec = scenegen.parse(
        "camera front = at (0.5, 0.1, 0.1) looks at (0.5, 0.6, 0) fov 60 deg, 4:3\n"
        "object crate = box(20 cm, 20 cm, 20 cm), mug = cylinder(4 cm, 9 cm)\ntask: visible(mug, front, 50 %)"
    )
    with pytest.raises(scenegen.errors.RequestError, match="no scene can have phi"):
        scenegen.sample(spec, {"task": (0.0, None)}, fix={"crate": pose}, n=1)


BOARD = """camera top = at (0.5, 0.5, 1) looks at (0.5, 0.5, 0) fov 60 deg, 1:1
camera low = at (0.5, -0.5, 0.05) looks at (0.5, 0.5, 0.05) fov 40 deg, 1:1
region shelf = rect(0.4, 0.4, 0.6, 0.6) at 20 cm
"""


def test_a_board_hides_what_is_below_it():
    core = check_text(
        BOARD + "object can = cylinder(3 cm, 10 cm)\nclear: unhidden(can, top)\nshare: visibleShare(can, top) >= 0\n"
        "own: shadowGap(can, shelf, top) >= 0"
    ).core
    rows = np.array([[0.5, 0.5 + 0.1 / 0.8 - 0.03, 0.8], [0.5] * 3, [0.0] * 3])
    found = phi(core, list(rows), NUMPY)
    # the table is 1 m below the eye and the top of the board 0.8 m
    assert found["clear"] == pytest.approx([-0.1 / 0.8 - 0.03, -0.06, 0.3 - 0.1 / 0.8 - 0.03])
    assert np.array_equal(found["clear"], found["own"])
    assert found["share"][0] < 0.0 and found["share"][2] == pytest.approx(1.0 + found["clear"][2] / 0.1)
    # at the height of its top the edge hides up to 0.1125 m: what is left of the disc around 0.095 m is a segment, of
    # a silhouette that is the hull of this disc and the lower one, which is 0.9 times as large from there
    angle = 2.0 * math.acos(0.0175 / 0.03)
    silhouette = math.pi / 2.0 * (0.03**2 + 0.027**2) + (0.03 + 0.027) * 0.0095
    assert found["share"][1] == pytest.approx(0.03**2 / 2.0 * (angle - math.sin(angle)) / silhouette, abs=0.005)


def test_a_board_hides_what_stands_on_it_from_below_alone():
    text = BOARD + "object can = cylinder(3 cm, 10 cm) on any of [workspace, shelf]\n"
    text += "above: unhidden(can, top)\nbelow: unhidden(can, low)\nshare: visibleShare(can, low) >= 0"
    core = check_text(text).core
    # the switch of the surface is the last object's x: at the ends of its range are both surfaces
    rows = np.array([[0.5, 0.5], [0.5, 0.5], [0.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    found = phi(core, list(rows), NUMPY)
    assert (found["above"] >= 0.0).tolist() == [False, True]
    assert (found["below"] >= 0.0).tolist() == [True, False]
    assert found["share"][0] >= 1.0 > found["share"][1] > 0.0  # its foot is behind the edge of the board


def test_boards_are_hiders_and_flat_regions_are_none():
    text = BOARD + "region mat = rect(0, 0, 0.3, 0.3)\nobject can, mug\n"
    core = check_text(text + "task: forall q in hiders(can): shadowGap(can, q, top) >= 0").core
    other = check_text(text + "task: shadowGap(can, mug, top) >= 0 & shadowGap(can, shelf, top) >= 0").core
    rows = scenes(200, objects=2)
    assert np.array_equal(*(phi(one, list(rows), NUMPY)["task"] for one in (core, other)))
    with pytest.raises(scenegen.errors.SpecError, match="a region at a height"):
        check_text(text + "task: shadowGap(can, mat, top) >= 0")


def test_a_camera_inside_a_board_is_refused():
    text = "camera top = at (0.5, 0.5, 0.195) looks at (0.5, 0.5, 0) fov 60 deg, 1:1\n"
    text += "region shelf = rect(0.4, 0.4, 0.6, 0.6) at {}\nobject can\ntask: inView(can, top)"
    with pytest.raises(scenegen.errors.SpecError, match="`shelf`"):
        check_text(text.format("20 cm"))
    assert check_text(text.format("19 cm")).labels == ("task",)


def test_the_view_is_that_of_pictures():
    """A body is in view where all of its corners fall into the picture of the renderer's camera."""
    rows = scenes(400)
    margin = worth("task: inView(carton, front) | x(mug) + x(bottle) + x(wedge) <= -9", rows)
    eye, target = np.array([0.5, -0.6, 0.7]), np.array([0.5, 0.4, 0.0])
    for k in range(rows.shape[1]):
        x, y, theta = rows[3:6, k]
        cos, sin = math.cos(theta), math.sin(theta)
        points = [
            (x + cos * u - sin * v, y + sin * u + cos * v, z)
            for u in (-0.04, 0.04)
            for v in (-0.03, 0.03)
            for z in (0, 0.2)
        ]
        pixels = from_place(np.array(points), (400, 300), eye, target, 60.0).project(points)
        inside = (pixels >= 0).all() and (pixels <= [400, 300]).all()
        assert inside == (margin[k] >= 0.0)


@pytest.mark.parametrize("things", [THINGS, LIBRARY], ids=["prisms", "stacks"])
def test_torch_and_slopes(things):
    text = "task: visible(mug, front, 30 %, 60 %)"
    rows = scenes(3000)
    core = check_text(CAMERA + things + text).core
    numbers = phi(core, list(rows), NUMPY)["task"]
    tensor = torch.from_numpy(rows).requires_grad_()
    value = Robustness(core).rows(tensor)
    assert np.abs(value.detach().numpy() - numbers).max() < 1e-12
    (slope,) = torch.autograd.grad(value.sum(), tensor)
    assert torch.isfinite(slope).all()
    step = 1e-7
    direction = np.random.default_rng(1).normal(size=rows.shape)
    along = (
        phi(core, list(rows + step * direction), NUMPY)["task"]
        - phi(core, list(rows - step * direction), NUMPY)["task"]
    ) / (2 * step)
    close = np.abs(along - (slope.numpy() * direction).sum(0)) < 1e-4 * (1.0 + np.abs(along))
    assert close.mean() > 0.99  # the rest are at a kink


def test_a_share_has_a_slope_where_the_picture_does_not_change():
    """Ahead of all shadows, and deep in one."""
    text = CAMERA + "object cup = cylinder(2 cm, 5 cm), wall = box(30 cm, 10 cm, 40 cm) at (0.5, 0.3, 0)\n"
    share = check_text(text + "task: visibleShare(cup, front) >= 0").core
    rows = np.array([[0.95, 0.5, 0.52], [0.6, 0.5, 0.5], [0, 0, 0], [0.5] * 3, [0.3] * 3, [0] * 3])
    found = phi(share, list(rows), NUMPY)["task"]
    assert found[0] > 1.0 > 0.0 > found[2] > found[1] >= -1.0


LABELS = """all: inView(mug, front) & unhidden(carton, front)
some: visible(mug, front, 30 %, 60 %)
share: 2 * visibleShare(wedge, front) >= 1
"""


@settings(deadline=None, max_examples=examples(40))
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, 1e-6, 0.05, 0.4, 1.0]),
    st.sampled_from([0.0, 1e-3, 0.2]),
    st.sampled_from([THINGS, LIBRARY]),
)
def test_contraction_loses_no_planted_scene(seed, width, slack, things):
    """Whatever box a scene lies in: bounds hold its phi, and what is left of the box where that is wanted holds it."""
    core = check_text(CAMERA + things + LABELS).core
    rng = np.random.default_rng(seed)
    row = scenes(1, seed)[:, 0]
    low, high = row - width * rng.uniform(size=12), row + width * rng.uniform(size=12)
    tape = make_tape(core, low, high)
    worth = phi(core, list(row[:, None]), NUMPY)
    for name, value in worth.items():
        number = float(np.ravel(value)[0])
        free = contract_box(tape, low, high, {}, Effort(), 1)
        at = tape.where[core.labels[name]]
        assert free.lo[at] - 1e-9 <= number <= free.hi[at] + 1e-9
        left = contract_box(tape, low, high, {core.labels[name]: (number - slack, number + slack)}, Effort(), 4)
        assert left.alive
        for place, node in tape.rows.items():
            assert left.lo[node] <= row[place] <= left.hi[node]


def nearest_bodies(spec, row, size):
    """Which body each pixel of a picture of the camera shows first, -1 for none, and whether it would show the first
    body if that was alone: by rays, cut with half-planes and discs one by one."""
    camera = spec.cameras[0]
    view = from_place(np.zeros((1, 3)), size, np.array(camera.eye), np.array(camera.target), math.degrees(camera.field))
    columns, rows = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    origin, way = view.rays(columns, rows)
    nearest, which, alone = (
        np.full(columns.shape, np.inf),
        np.full(columns.shape, -1),
        np.zeros(columns.shape, dtype=bool),
    )
    pieces = []
    for number, shape in enumerate(spec.shapes):
        body = visible_body(shape)
        prisms = body.pieces if isinstance(body, Stack) else ((body, 0.0, shape.height),)
        pieces += [(number, *one) for one in prisms]
    for number, footprint, bottom, top in pieces:
        x, y, theta = row[3 * number : 3 * number + 3]
        cos, sin = math.cos(theta), math.sin(theta)
        start = np.stack(
            [
                cos * (origin[..., 0] - x) + sin * (origin[..., 1] - y),
                cos * (origin[..., 1] - y) - sin * (origin[..., 0] - x),
            ]
        )
        step = np.stack([cos * way[..., 0] + sin * way[..., 1], cos * way[..., 1] - sin * way[..., 0]])
        low, high = np.full(columns.shape, 1e-9), np.full(columns.shape, np.inf)
        planes = [(way[..., 2], top - origin[..., 2]), (-way[..., 2], origin[..., 2] - bottom)]
        if isinstance(footprint, Circle):
            a, b, c = (step**2).sum(0), (start * step).sum(0), (start**2).sum(0) - footprint.radius**2
            root = np.sqrt(np.maximum(b * b - a * c, 0.0))
            low, high = np.maximum(low, (-b - root) / a), np.where(b * b > a * c, (-b + root) / a, -np.inf)
        else:
            for (nx, ny), offset, *_ in edges(Polygon(corners(footprint))):
                planes.append((nx * step[0] + ny * step[1], offset - nx * start[0] - ny * start[1]))
        for rate, room in planes:  # rate * t <= room
            limit = room / np.where(rate == 0.0, 1e-300, rate)
            low, high = (
                np.where(rate < 0.0, np.maximum(low, limit), low),
                np.where(rate > 0.0, np.minimum(high, limit), high),
            )
        hit = low < high
        alone |= hit & (number == 0)
        nearer = hit & (low < nearest)
        nearest, which = np.where(nearer, low, nearest), np.where(nearer, number, which)
    return which, alone


@pytest.mark.parametrize("name", ASSETS)
def test_slices_are_within_the_prism(name):
    """But for the rounding of outlines: so what no shadow reaches is not hidden."""
    asset = ASSETS[name]
    body = visible_body(Shape(name, asset.footprint, asset.height))
    if not isinstance(body, Stack):
        assert body == asset.footprint
        return
    ends = [(low, high) for _, low, high in body.pieces]
    assert ends[0][0] >= 0.0 and ends[-1][1] <= asset.height + 1e-9
    assert all(high == low for (_, high), (low, _) in pairwise(ends))
    reach = np.array(asset.footprint.extent) / 2.0
    for outline, _, _ in body.pieces:
        assert (np.abs(corners_of(outline, 24)).max(axis=0) <= 1.04 * reach + 1e-3).all()


def test_a_neck_hides_less_than_a_prism():
    """Behind the neck of a bottle a tall thing is seen at both sides."""
    text = "camera front = at (0.5, -1, 0.2) looks at (0.5, 0.5, 0.2) fov 40 deg, 1:1\n"
    text += "object tower = box(8 cm, 8 cm, 23 cm), {}\ntask: visibleShare(tower, front) >= 0 %"
    shares = []
    for thing in ("bottle", "pillar = cylinder(3.6 cm, 23 cm)"):
        core = check_text(text.format(thing)).core
        shares.append(phi(core, [np.array([one]) for one in (0.5, 0.6, 0.0, 0.5, 0.4, 0.0)], NUMPY)["task"][0])
    assert shares[0] > shares[1] + 0.15


@pytest.mark.long
@pytest.mark.parametrize("target", ["mug", "carton", "wedge", "teapot"])
def test_shares_are_those_of_pictures(target):
    """Against pictures by rays: the pixels that show the thing, over those that show it where it is alone."""
    if target == "teapot":
        compare_with_pictures(target, "object teapot, bottle, cup, mug\n", 10, (400, 300))
        return
    order = [target, *(name for name in ("mug", "carton", "bottle", "wedge") if name != target)]
    lines = {
        line.split(" = ")[0]: line
        for line in THINGS.replace("object ", "")
        .replace(", carton", "\ncarton")
        .replace(", bottle", "\nbottle")
        .splitlines()
    }
    compare_with_pictures(target, "object " + ", ".join(lines[name] for name in order) + "\n")


def compare_with_pictures(target, things, count=30, size=(1200, 900)):
    spec = scenegen.parse(CAMERA + things + f"require noOverlap()\ntask: visible({target}, front, 2 %, 98 %)")
    drawn = scenegen.sample(spec, phi={"task": (0, None)}, n=count, seed=3)
    core = check_text(CAMERA + things + f"task: visibleShare({target}, front) >= 0").core
    shares = phi(core, list(drawn.poses.reshape(len(drawn), -1).T), NUMPY)["task"]
    errors = []
    for row, share in zip(drawn.poses.reshape(len(drawn), -1), shares, strict=True):
        which, alone = nearest_bodies(spec.checked, row, size)
        errors.append(abs(share - (which == 0).sum() / alone.sum()))
    assert max(errors) < 0.02 and np.mean(errors) < 0.005, (max(errors), np.mean(errors))
