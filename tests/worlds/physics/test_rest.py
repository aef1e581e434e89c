"""Where scenes come to rest: in both simulators, in files of every format, on any number of processes. `apart` against
MuJoCo's distances between geoms: random pairs of boxes, cylinders and prisms at random heights. Rigid bodies of
footprints: mass, centre and inertia against sampling. PyBullet takes 16 pieces of a body at once; bodies with more
have all of theirs. Every round thing of the library on every other that the language lets it stand on: it stays
where it is planned. On plates and in bowls, everything.
"""

import json
import math
from functools import cache

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from shapely.geometry import Polygon as Region

import scenegen
from scenegen.errors import RequestError, SpecError
from scenegen.geometry import NUMPY, Box, Circle, Polygon
from scenegen.geometry.workspace import standing, turn_between, upright
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.things import ASSETS, Shape, shape_of
from scenegen.things.mesh import box, disc, prism
from scenegen.things.surfaces import nesting_surface
from scenegen.worlds.export import mjcf, sdf
from scenegen.worlds.export.world import world_of
from scenegen.worlds.physics.bodies import (
    DENSITY,
    MAX_ARRAY_PIECES,
    PRISM_SIDES,
    TABLE,
    Contact,
    InertialBody,
    board_of,
    contacts,
    piece_files,
    prism_of,
    whole_of,
)
from scenegen.worlds.physics.bullet import PybulletWorld
from scenegen.worlds.physics.rest import settle_file
from scenegen.worlds.physics.simulation import FINE_STEP, SIMULATORS, MujocoSetup, PybulletSetup, RestJob
from tests.worlds.export.worlds import scenes_of, tower

from ...laws import examples

BOXES = "object base = box(0.1, 0.1, 0.1) at (0.5, 0.5, 0), near = box(0.1, 0.1, 0.1), far = box(0.04, 0.06, 0.02)\n"
BASE = {"base": (0.5, 0.5, 0.0)}
AWAY = {"near": (0.7, 0.5, 0.0), "far": (0.9, 0.9, 1.0)}
DEEP = {"near": (0.595, 0.5, 0.0), "far": (0.9, 0.9, 1.0)}


def boxes():
    """Two scenes: boxes apart, and the same with one of them 5 mm deep in a box that is held in place."""
    return scenes_of(f"{BOXES}task: leftOf(base, near)\nturned: angle(far, EAST, 10 deg)", BASE | AWAY, BASE | DEEP)


@pytest.fixture(params=SIMULATORS)
def simulator_rest(request):
    if request.param == "mujoco":
        pytest.importorskip("mujoco", reason="mujoco is not installed (pip install 'scenegen-dsl[mujoco]')")
    return request.param


def rested(scenes, simulator, seconds):
    """What becomes of scenes, in this process."""
    world = world_of(scenes.header, next(scenes.blocks()))
    places = world.poses[..., [0, 1, 3, 2]]
    if simulator == "mujoco":
        return RestJob(MujocoSetup(mjcf.bench(world).decode()), seconds)(places)
    bodies = [*map(whole_of, world.bodies), *(board_of(board, sdf.TABLE_FRICTION) for board in world.boards)]
    with piece_files(bodies) as files:
        return RestJob(PybulletSetup(bodies, files, len(world.boards), step=FINE_STEP), seconds)(places)


def test_what_stands_in_and_on_things_rests(simulator_rest):
    """A mug in the hollow of a plate, a block on a block on a tray that is held."""
    found = rested(tower(), simulator_rest, 0.5)
    assert found.shift.max() < 5e-4 and found.turn.max() < 0.5
    assert max(touch.depth for one in found.contacts for touch in one) < 1e-6
    names = tower().objects
    pairs = {(names[touch.a] if touch.a != TABLE else "", names[touch.b]) for touch in found.contacts[0]}
    assert {("plate", "mug"), ("block[1]", "block[2]"), ("", "plate")} <= pairs and ("", "mug") not in pairs


BOARDS = """region low = rect(0.2, 0.2, 0.6, 0.5) at 30 cm
region high = circle((0.8, 0.3), 0.1) at 50 cm
object can[2] on any of [low, high, workspace]
task: closeTo(can[1], can[2], 2 m)
"""


def test_what_stands_on_boards_rests(simulator_rest):
    """A can on a rectangular board and one on a round board: neither falls, and the boards count as the table."""
    spec = scenegen.parse(BOARDS)
    scenes = scenegen.sample(spec, None, 12, seed=2, fix={"can[1]": (0.4, 0.3), "can[2]": (0.8, 0.3)}, workers=1)
    assert {(1.0, 2.0), (1.0, 3.0), (3.0, 2.0)} <= {(a, b) for a, b in scenes.on.tolist()}
    found = rested(scenes, simulator_rest, 0.3)
    assert found.planned[..., 2].max() == 0.5 and found.shift.max() < 5e-4 and found.turn.max() < 0.5
    pairs = {(touch.a, touch.b) for one in found.contacts for touch in one}
    assert pairs == {(TABLE, 0), (TABLE, 1)}


def test_depths_before_and_shifts_after_are_those_of_the_boxes(simulator_rest):
    found = rested(boxes(), simulator_rest, 0.5)
    apart, deep = found.contacts
    assert [(touch.a, touch.b) for touch in apart] == [(TABLE, 1), (TABLE, 2)]
    assert [touch.depth for touch in deep if touch.a == 0] == pytest.approx([0.005], abs=3e-5)
    assert found.shift[0].max() < 1e-4 and found.shift[1, 0] < 2e-5
    assert 0.002 < found.shift[1, 1] < 0.1 and found.shift[1, 2] < 1e-4


def test_scenes_do_not_affect_each_other(simulator_rest):
    """So which process simulates a scene, and after which other, does not matter."""
    both, alone = rested(boxes(), simulator_rest, 0.1), rested(boxes()[1:], simulator_rest, 0.1)
    assert (both.poses[1] == alone.poses[0]).all() and both.contacts[1] == alone.contacts[0]


def test_gathered_keeps_the_deepest_point_of_each_pair_and_drops_what_is_far():
    points = [(2, 0, -0.001), (0, 2, -0.003), (TABLE, 1, 5e-5), (1, 2, 0.02)]
    assert contacts(points) == (Contact(TABLE, 1, 0.0), Contact(0, 2, 0.003))


def test_attitudes_agree_with_scipy():
    draw = np.random.default_rng(3)
    yaw, tilt, axis = draw.uniform((0, 0, 0), (math.tau, 3.0, math.tau), (50, 3)).T
    lying = Rotation.from_rotvec(tilt[:, None] * np.stack([np.cos(axis), np.sin(axis), 0 * axis], axis=1))
    turned = lying * Rotation.from_rotvec(yaw[:, None] * [[0.0, 0.0, 1.0]])
    poses = np.concatenate([np.zeros((50, 3)), np.roll(turned.as_quat(), 1, axis=1)], axis=1)
    assert np.abs(np.remainder(upright(poses)[:, 2] - yaw + 1.0, math.tau) - 1.0).max() < 1e-12
    plan = standing(np.stack([0 * yaw, 0 * yaw, yaw, 0 * yaw], axis=1))
    np.testing.assert_allclose(turn_between(plan[:, 3:], poses[:, 3:]), np.degrees(tilt), atol=1e-10)
    assert turn_between(plan[:, 3:], -plan[:, 3:]).max() < 1e-12  # a quaternion and its negative are one attitude


@pytest.fixture(scope="module")
def settled():
    return scenegen.settle(boxes(), "pybullet", seconds=0.25, workers=1)


def test_scenes_that_moved_are_marked_and_phi_is_scored_again(settled):
    scenes = boxes()
    assert settled.settled.tolist() == [True, False] and settled.moved[1].tolist() == [False, True, False]
    assert settled.deepest.tolist() == pytest.approx([0.0, 0.005], abs=3e-5)
    x = settled.poses[:, :, 0]
    assert settled.phi["task"] == pytest.approx(x[:, 1] - x[:, 0], abs=1e-12)
    assert settled.poses[:, 0, :2].tolist() == scenes.poses[:, 0, :2].tolist()  # what is held, to the last bit
    assert "1 of 2 scenes settled (pybullet, 0.25 s); in 1 an object moved too far: `near` in 1" in repr(settled)


def test_files_of_every_format_hold_the_same(settled, tmp_path):
    boxes().save(tmp_path / "scenes.json")
    summary = settle_file(tmp_path / "scenes.json", tmp_path / "s.jsonl", "pybullet", seconds=0.25, workers=1)
    assert (summary.scenes, summary.far) == (2, 1)
    header, *lines = map(json.loads, (tmp_path / "s.jsonl").read_text().splitlines())
    whole = json.loads(settled.save(tmp_path / "s.json").read_text())
    assert whole == header | {"scenes": lines}
    assert (header["format"], header["version"], header["max_shift_mm"]) == ("scenegen/settled", 1, 2.0)
    assert [(one["scene"], one["settled"], one["moved"]) for one in lines] == [(1, True, []), (2, False, ["near"])]
    assert list(lines[1]["objects"]["near"].values())[:7] == settled.poses[1, 1].tolist()
    assert lines[1]["contacts"][0]["a"] is None and lines[1]["objects"]["near"]["shift_mm"] > 2.0
    table = pandas.read_parquet(settled.save(tmp_path / "s.parquet"))
    assert table["near.qw"].tolist() == settled.poses[:, 1, 3].tolist()
    assert table["settled"].tolist() == [True, False] and table["moved"][1].tolist() == ["near"]
    assert table["phi.task"].tolist() == settled.phi["task"].tolist()
    assert [dict(one) for one in table["contacts"][1]] == lines[1]["contacts"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"simulator": "bullet"}, "unknown simulator `bullet`"),
        ({"seconds": 0}, "`seconds`"),
        ({"max_shift": -1.0}, "`max_shift`"),
        ({"max_turn": "2deg"}, "`max_turn`"),
        ({"workers": 0}, "`workers`"),
    ],
)
def test_wrong_arguments_are_refused(arguments, words):
    with pytest.raises(RequestError, match=words):
        scenegen.settle(boxes(), **{"simulator": "pybullet"} | arguments)


def test_no_scenes_are_refused_and_a_missing_simulator_is_named(monkeypatch):
    with pytest.raises(RequestError, match="no scenes"):
        scenegen.settle(boxes()[:0], "pybullet")
    monkeypatch.setattr("scenegen.needs.is_installed", lambda package: package != "mujoco")
    with pytest.raises(RequestError, match="mujoco") as error:
        scenegen.settle(boxes(), "mujoco")
    assert 'pip install "scenegen-dsl[mujoco]"' in str(error.value)


def test_what_diverges_is_null_and_has_not_settled(tmp_path):
    """A simulation that leaves NaN: the file says so."""
    from scenegen.lang.checker import check_text
    from scenegen.worlds.physics.rest import _header, _settled_block
    from scenegen.worlds.physics.simulation import RestResult

    scenes = boxes()
    header = _header(scenes.header, "pybullet", 2.0, 0.002, 2.0)
    world = world_of(scenes.header, next(scenes.blocks()))
    planned = standing(world.poses[..., [0, 1, 3, 2]])
    poses = planned.copy()
    poses[0, 1] = np.nan
    spec = check_text(scenes.header.spec.source)
    block = _settled_block(
        spec, scenes.header, header, world, RestResult(planned, poses, ((), ())), scenes.poses, np.empty((2, 0))
    )
    assert block.moved.tolist() == [[False, True, False], [False] * 3]
    assert np.isnan(block.phi[:, 0]).all() and np.isfinite(block.phi[:, 1]).all()
    from scenegen.scenes.formats.settled import write_settled

    write_settled(tmp_path / "s.json", header, [block])
    first = json.loads((tmp_path / "s.json").read_text())["scenes"][0]
    assert first["phi"]["task"] is None and first["objects"]["near"]["x"] is None and not first["settled"]


mujoco = pytest.importorskip(
    "mujoco", reason="mujoco, the oracle, is not installed (pip install 'scenegen-dsl[mujoco]')"
)

POSES = 20  # of each pair of shapes
NEAR = 1e-6  # metres
MODEL = """<mujoco><option ccd_tolerance="1e-12" ccd_iterations="400"/><asset>{meshes}</asset>
<worldbody>{geoms}</worldbody></mujoco>"""


def shape_of_apart(draw, kind):
    """A shape as a spec has it."""
    height = draw.uniform(0.01, 0.2)
    if kind == "box":
        return f"box({draw.uniform(0.02, 0.3)!r}, {draw.uniform(0.02, 0.3)!r}, {height!r})"
    if kind == "cylinder":
        return f"cylinder({draw.uniform(0.01, 0.15)!r}, {height!r})"
    turns = np.sort(draw.uniform(0.0, math.tau, int(draw.integers(3, 9)))).tolist()
    wide, long = draw.uniform(0.03, 0.15, 2).tolist()
    corners = ", ".join(f"({long * math.cos(turn)!r}, {wide * math.sin(turn)!r})" for turn in turns)
    return f"prism([{corners}], {height!r})"


def geom_of(shape, name):
    """The same shape as a geom of MuJoCo and the mesh that it may need; its frame is in the middle of its height."""
    half = shape.height / 2.0
    match shape.footprint:
        case Box(length, width):
            return f'<geom type="box" size="{length / 2.0!r} {width / 2.0!r} {half!r}"/>', ""
        case Circle(radius):
            return f'<geom type="cylinder" size="{radius!r} {half!r}"/>', ""
        case outline:
            corners = " ".join(map(repr, prism(outline.vertices, -half, half).vertices.ravel().tolist()))
            return f'<geom type="mesh" mesh="{name}"/>', f'<mesh name="{name}" vertex="{corners}"/>'


def compared(seed, pairs):
    """(pairs * POSES, 2): `apart` and what MuJoCo says, and how many of the pairs were beside, above, in each other."""
    draw = np.random.default_rng(seed)
    found, kinds = [], np.zeros(3, dtype=int)
    for _ in range(pairs):
        one, other = (shape_of_apart(draw, str(draw.choice(["box", "cylinder", "prism"]))) for _ in range(2))
        stands = [f"box(1, 1, {draw.uniform(0.01, 0.25)!r})" for _ in range(2)]
        spec = check_text(
            f"object low = {stands[0]}, high = {stands[1]}, a = {one} on low, b = {other} on high\n"
            "task: apart(a, b) >= 0"
        )
        poses = draw.uniform((-0.15, -0.15, 0.0), (0.15, 0.15, math.tau), (POSES, 4, 3))
        ours = phi(spec.core, list(poses.reshape(POSES, 12).T), NUMPY)["task"]
        parts = [geom_of(shape, name) for shape, name in zip(spec.shapes[2:], "ab", strict=True)]
        geoms, meshes = ("".join(some) for some in zip(*parts, strict=True))
        model = mujoco.MjModel.from_xml_string(MODEL.format(geoms=geoms, meshes=meshes))
        data = mujoco.MjData(model)
        local = [(model.geom_pos[k].copy(), model.geom_quat[k].copy()) for k in range(2)]
        for pose, apart in zip(poses[:, 2:], ours.tolist(), strict=True):
            place(data, local, pose, [spec.heights[k] + spec.shapes[k].height / 2.0 for k in (2, 3)])
            ends = np.zeros(6)
            distance = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, ends)
            x, y, z = np.abs(ends[3:] - ends[:3])
            beside, above = math.hypot(x, y), float(z)
            found.append((apart, distance if distance < 0.0 else max(beside, above)))
            kinds[2 if distance < 0.0 else int(above > beside)] += 1
    return np.array(found), kinds


def place(data, local, poses, heights):
    """Put both geoms where their objects are; meshes have a frame of their own, which MuJoCo chose."""
    for k, ((x, y, theta), z) in enumerate(zip(poses, heights, strict=True)):
        turn = np.array([math.cos(theta / 2.0), 0.0, 0.0, math.sin(theta / 2.0)])
        offset, quat = np.zeros(3), np.zeros(4)
        mujoco.mju_rotVecQuat(offset, local[k][0], turn)
        mujoco.mju_mulQuat(quat, turn, local[k][1])
        data.geom_xpos[k] = offset + np.array([x, y, z])
        mujoco.mju_quat2Mat(data.geom_xmat[k], quat)


def check(seed, pairs):
    found, kinds = compared(seed, pairs)
    assert kinds.min() > 0.03 * len(found), kinds
    worst = np.abs(found[:, 0] - found[:, 1]).argmax()
    np.testing.assert_allclose(found[:, 0], found[:, 1], atol=NEAR, err_msg=f"pair {worst // POSES} of seed {seed}")


def test_two_hundred_pairs():
    check(1, 10)


@pytest.mark.slow
def test_ten_thousand_pairs():
    check(2, 500)


WEDGE = Polygon(((0.0, 0.0), (0.3, 0.0), (0.25, 0.1), (0.05, 0.03)))


def outline(body):
    """The corners (x, y) of a prism's top."""
    return body.corners[len(body.corners) // 2 :, :2].tolist()


@pytest.mark.parametrize(
    ("shape", "inertia"),
    [
        (Shape("box", Box(0.2, 0.1), 0.3), (0.1**2 + 0.3**2, 0.2**2 + 0.3**2, 0.2**2 + 0.1**2)),
        (Shape("cylinder", Circle(0.1), 0.3), (3 * 0.1**2 + 0.3**2, 3 * 0.1**2 + 0.3**2, 6 * 0.1**2)),
    ],
)
def test_boxes_and_cylinders_have_the_inertia_of_the_textbook(shape, inertia):
    """m/12 (w^2 + h^2) and so on; a cylinder within what 32 sides leave out."""
    body = prism_of(shape)
    volume = 0.2 * 0.1 * 0.3 if shape.asset == "box" else math.pi * 0.1**2 * 0.3
    slack = 1e-12 if shape.asset == "box" else 0.02
    assert body.mass == pytest.approx(DENSITY * volume, rel=slack)
    assert body.inertia == pytest.approx([body.mass * part / 12.0 for part in inertia], rel=slack)
    assert np.allclose(body.center, (0.0, 0.0, 0.15), atol=1e-15)


@given(
    corners=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), min_size=3, max_size=8),
    height=st.floats(0.01, 0.5),
)
@settings(max_examples=examples(30), deadline=None)
def test_the_inertia_of_a_prism_is_that_of_its_triangles(corners, height):
    """Oracle: shapely's hull in triangles, whose second moments about a point are exact by the midpoint rule.
    Corners that stand out by less than a millionth are left out of bodies, which costs a few such parts."""
    hull = Region(corners).convex_hull if len(set(corners)) > 2 else None
    if hull is None or hull.geom_type != "Polygon" or hull.area < 1e-3:
        return
    ring = np.array(hull.exterior.coords)[:-1]
    ring = ring if hull.exterior.is_ccw else ring[::-1]
    body = prism_of(Shape("prism", Polygon(tuple(map(tuple, ring.tolist()))), height))
    center = np.array([hull.centroid.x, hull.centroid.y])
    second = np.zeros((2, 2))
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        sides = [(a + b) / 2 - center, (b - center) / 2, (a - center) / 2]
        area = ((a - center)[0] * (b - center)[1] - (a - center)[1] * (b - center)[0]) / 2
        second += area / 3 * sum(np.outer(side, side) for side in sides)
    assert np.allclose(body.center[:2], center, atol=1e-6)
    axis = np.array([math.cos(body.turn), math.sin(body.turn)])
    cross = np.array([-axis[1], axis[0]])
    along, across = axis @ second @ axis, cross @ second @ cross
    assert abs(axis @ second @ cross) < 1e-5 * np.trace(second)
    mass = DENSITY * hull.area * height
    tall = mass * height**2 / 12
    weight = DENSITY * height
    expected = (weight * across + tall, weight * along + tall, weight * (along + across))
    assert body.inertia == pytest.approx(expected, rel=1e-5)


def test_the_outline_lies_where_the_footprint_does():
    body = prism_of(Shape("prism", WEDGE, 0.1))
    cos, sin = math.cos(body.turn), math.sin(body.turn)
    back = [(body.center[0] + cos * x - sin * y, body.center[1] + sin * x + cos * y) for x, y in outline(body)]
    assert np.allclose(back, WEDGE.vertices, atol=1e-12)


def test_a_round_body_stays_inside_its_footprint():
    """So that round things that just do not overlap are not pushed apart."""
    body = prism_of(Shape("cylinder", Circle(0.1), 0.1))
    assert len(outline(body)) == PRISM_SIDES
    assert max(math.hypot(x, y) for x, y in outline(body)) <= 0.1 * (1 + 1e-12)


def test_fixed_bodies_have_no_mass():
    body = prism_of(Shape("box", Box(0.2, 0.1), 0.3), fixed=True)
    assert (body.mass, body.inertia) == (0.0, (0.0, 0.0, 0.0))


SIDE = 0.05


def body(pieces, mass):
    moment = mass * SIDE**2 / 6.0
    return InertialBody(tuple(pieces), (0.0, 0.0, 0.0), 0.0, mass, (moment,) * 3, 0.7)


@pytest.mark.parametrize("piece", [box(SIDE, SIDE, SIDE), disc(SIDE / 2, 0.0, SIDE, 8)], ids=["box", "hull"])
@pytest.mark.parametrize("count", [MAX_ARRAY_PIECES, MAX_ARRAY_PIECES + 1, 40])
def test_the_last_piece_of_a_body_carries(piece, count):
    row = [piece.shift(x=0.2 * k, z=0.1 - SIDE) for k in range(count)]
    block = box(SIDE, SIDE, SIDE).shift(z=-SIDE / 2)
    bodies = [body(row, 0.0), body([block], 0.1)]
    with piece_files(bodies) as files, PybulletWorld(bodies, files, friction=0.7) as world:
        places = np.array([(0.0, 0.0, 0.0, 0.0), (0.2 * (count - 1), 0.0, 0.0, 0.1 + SIDE / 2)])
        found, _ = world.rest(places, 0.2)
    assert found[1, 2] == pytest.approx(0.1 + SIDE / 2, abs=1e-3)


ROUND = [name for name, asset in ASSETS.items() if isinstance(asset.footprint, Circle)]
CRATES = ["tray", "carton", "bin"]
SPACING = 0.8  # metres


@cache
def carried(lower):
    """What `a on b` lets stand on an object: round things, and in shallow vessels all."""
    found = []
    for upper in ASSETS if lower in ("plate", "bowl") else ROUND:
        try:
            check_text(f"object {lower}_1, {upper}_2 on {lower}_1\ntask: x({upper}_2) >= 0 m")
        except SpecError:
            continue
        found.append(upper)
    return found


def scenes_of_nesting(lower, n):
    """n scenes of all pairs, side by side."""
    lines, rules = [], []
    for number, upper in enumerate(carried(lower)):
        under, over = f"{lower}_{2 * number + 1}", f"{upper}_{2 * number + 2}"
        place = f"({SPACING * (number % 6 + 0.5)}, {SPACING * (number // 6 + 0.5)}, {25 * number} deg)"
        lines.append(f"object {under} at {place}, {over} on {under}")
        rules.append(f"apart({over}, {under}) >= 0 & stable([{over}])")
    side = 6.0 * SPACING
    text = "\n".join([f"workspace [0, {side}] x [0, {side}]", *lines, f"require {' & '.join(rules)}"])
    return scenegen.sample(scenegen.parse(f"{text}\ntask: x({carried(lower)[0]}_2) >= 0 m"), n=n, seed=3)


@pytest.mark.long
@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
@pytest.mark.parametrize("lower", [name for name in [*ROUND, *CRATES] if carried(name)])
def test_pairs_settle_where_they_are_planned(lower, simulator):
    pytest.importorskip(simulator)
    settled = scenegen.settle(scenes_of_nesting(lower, 3), simulator, seconds=1.0, workers=1)
    worst = settled.shift[:, 1::2].max(axis=0)
    assert settled.deepest.max() < 1e-3
    assert worst.max() < 2e-3, dict(zip(carried(lower), worst, strict=True))
    assert settled.turn.max() < 2.0


def test_vessels_take_what_is_narrower_where_they_are_narrow():
    assert "bowl" in carried("plate") and "plate" in carried("plate") and "bowl" in carried("bowl")
    for lower in ("plate", "bowl", "pot", "basket"):
        assert len(carried(lower)) > 10, lower


def test_equal_plates_touch_with_their_feet_and_equal_bowls_with_their_walls():
    plate, bowl = shape_of("plate"), shape_of("bowl")
    assert nesting_surface(plate, plate).height == 0.007
    # a bowl's knee (61 mm wide, 21 mm high) meets the wall between its knee (52 mm at 21 mm) and rim (76 mm at 60 mm)
    meets = 0.021 + 0.039 * (0.061 - 0.052) / 0.024
    assert 0.0 <= nesting_surface(bowl, bowl).height - (meets - 0.021) < 0.0015


def test_what_would_roll_or_tilt_on_a_wall_is_refused():
    for upper in ("pen", "marker", "mouse"):
        assert nesting_surface(shape_of("bowl"), shape_of(upper)) is None
    for upper in ("lemon", "block"):
        assert nesting_surface(shape_of("bowl"), shape_of(upper)) is not None


def test_handles_that_would_lie_on_a_wall_are_refused():
    assert nesting_surface(shape_of("bowl"), shape_of("mug")) is None
    assert nesting_surface(shape_of("cup"), shape_of("cup")) is None
    assert nesting_surface(shape_of("mug"), shape_of("mug")).name == "rim"
