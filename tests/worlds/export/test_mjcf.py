"""MJCF in the hands of MuJoCo: it loads, objects are where the scene says, and they stay there. Centre and moments of
meshes, against formulas of textbooks. Looks of simulators' files: those of the pictures with the same seed.
"""

import itertools
import json
import math

import mujoco
import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.errors import RequestError
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.resources import shipped_specs
from scenegen.scenes.data import footprint_of
from scenegen.things import shape_of
from scenegen.things.bodies import parts_of
from scenegen.things.mesh import box, disc, revolve
from scenegen.worlds.export.world import TALL, inertia
from tests.looks.pictures import four_colors
from tests.worlds.export.worlds import crates, library, scenes_of, tower


def load(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model)


def poses(model, data, names):
    """x, y, z, theta of bodies that stand upright."""
    where = []
    for name in names:
        body = data.body(name)
        w, x, y, z = body.xquat
        assert abs(x) < 1e-12 and abs(y) < 1e-12
        where.append([*body.xpos, 2.0 * math.atan2(z, w) % math.tau])
    return np.array(where)


def shifts(model, data, seconds=1.0):
    """(bodies,): how far each gets from where it is, at most, within the time; its tips are looked at as well."""
    tips = np.concatenate([np.zeros((1, 3)), 0.1 * np.eye(3)])

    def corners():
        return data.xpos[:, None] + tips @ data.xmat.reshape(-1, 3, 3).transpose(0, 2, 1)

    mujoco.mj_forward(model, data)
    start, worst = corners(), np.zeros(model.nbody)
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        worst = np.maximum(worst, np.linalg.norm(corners() - start, axis=2).max(axis=1))
    return worst


HEIGHTS = [[0.0, 0.007, 0.02, 0.07, 0.0], [0.0] * 5]  # plate, mug, two blocks and the tray of `tower`


@pytest.mark.parametrize("together", [True, False])
def test_objects_are_where_the_scene_says(together, tmp_path):
    scenes = tower()
    files = scenes.export(tmp_path / ("all.xml" if together else "all"), to="mjcf")
    assert [path.name for path in files] == (["all.xml"] if together else ["scene_0001.xml", "scene_0002.xml"])
    for k, heights in enumerate(HEIGHTS):
        model, data = load(files[0 if together else k])
        assert model.nkey == (2 if together else 0)  # one scene is as it is loaded
        mujoco.mj_resetData(model, data)
        if together:
            mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_kinematics(model, data)
        found = poses(model, data, scenes.objects)
        np.testing.assert_allclose(found[:, [0, 1, 3]], scenes.poses[k], atol=1e-9)
        np.testing.assert_allclose(found[:, 2], heights, atol=1e-9)


def test_bodies_are_what_the_library_says(tmp_path):
    (path,) = tower().export(tmp_path / "all.xml")
    model, data = load(path)
    assert [model.body(name).jntnum[0] for name in ("plate", "mug", "tray")] == [1, 1, 0]
    assert model.body("mug").mass == pytest.approx(0.35) and model.body("block[2]").mass == pytest.approx(0.08)
    np.testing.assert_allclose(model.body("block[2]").inertia, 0.08 * 0.05**2 / 6, rtol=1e-8)
    np.testing.assert_allclose(model.body("block[2]").ipos, [0.0, 0.0, 0.025], atol=1e-12)
    mujoco.mj_resetDataKeyframe(model, data, 1)
    mujoco.mj_step(model, data, 50)
    pairs = {tuple(model.geom_bodyid[[one.geom1, one.geom2]]) for one in data.contact}
    mug, table = model.body("mug").id, model.body("table").id
    assert (min(mug, table), max(mug, table)) in pairs
    sliding = {float(one.friction[0]) for one in data.contact if mug in model.geom_bodyid[[one.geom1, one.geom2]]}
    assert sliding == {0.45}


@pytest.mark.long
def test_the_whole_library_stands_still(tmp_path):
    scenes = library()
    (path,) = scenes.export(tmp_path / "all.xml")
    model, data = load(path)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    moved = dict(
        zip(scenes.objects, shifts(model, data)[[model.body(name).id for name in scenes.objects]], strict=True)
    )
    assert max(moved.values()) < 1e-3, moved


@pytest.mark.long
def test_towers_stand_still(tmp_path):
    (path,) = tower().export(tmp_path / "all.xml")
    model, data = load(path)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert shifts(model, data).max() < 2e-3


def test_what_is_seen_is_what_the_library_draws(tmp_path):
    """The corners of everything drawn, as MuJoCo places them, are the library's at the scene's poses."""
    scenes = tower()
    (path,) = scenes.export(tmp_path / "all.xml")
    model, data = load(path)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    for name, shape in (("mug", shape_of("mug")), ("block[2]", shape_of("block")), ("plate", shape_of("plate"))):
        body = model.body(name)
        (x, y, theta), z = scenes.poses[0, scenes.objects.index(name)], data.body(name).xpos[2]
        geoms = [body.geomadr[0] + k for k in range(body.geomnum[0])]
        drawn = [geom for geom in geoms if model.geom_group[geom] == 2]
        parts = parts_of(shape, (1.0, 0.0, 0.0))
        assert len(drawn) == len(parts)
        for geom, part in zip(drawn, parts, strict=True):
            mesh = model.mesh(model.geom_dataid[geom])
            local = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
            seen = local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            cos, sin = math.cos(theta), math.sin(theta)
            turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
            wanted = part.mesh.vertices @ turn.T + (x, y, z)
            far = np.linalg.norm(wanted[:, None] - seen[None], axis=2)
            assert max(far.min(axis=0).max(), far.min(axis=1).max()) < 1e-6


@pytest.mark.parametrize(
    "shape",
    ["cylinder(0.000001, 0.000001)", "box(0.0001, 0.0001, 0.0001)", "box(0.3, 0.0005, 0.001)", "box(90, 90, 9)"],
)
def test_specks_and_giants_load(shape, tmp_path):
    places = {"mug": (-100.0, 0.1, 0.0), "thing": (0.5, 0.5, 1.0)}
    text = f"workspace [-100, 100] x [-100, 100]\nobject mug, thing = {shape}\ntask: leftOf(mug, thing)"
    (path,) = scenes_of(text, places).export(tmp_path / "all.xml")
    model, data = load(path)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert shifts(model, data, 0.2).max() < 0.01


def test_golden(golden, tmp_path):
    (path,) = crates().export(tmp_path / "all.xml")
    golden("worlds/export/crates.xml", path.read_text())


def settled(scenes, path):
    """(scenes,): whether no object gets further than a centimetre in a second."""
    (file,) = scenes.export(path)
    model, data = load(file)
    still = []
    for k in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, k)
        still.append(shifts(model, data).max() < 0.01)
    return np.array(still)


def clear(scenes):
    """(scenes,): no two objects overlap, or one is wholly within the other's outline and so stands on it."""
    prints = [footprint_of(one.shape.footprint) for one in scenes.header.objects]
    good = np.ones(len(scenes), dtype=bool)
    gap, room = PRIMITIVES["gap"].evaluate, PRIMITIVES["room"].evaluate
    for a, b in itertools.combinations(range(len(prints)), 2):
        (first, one), (second, two) = (prints[a], scenes.poses[:, a].T), (prints[b], scenes.poses[:, b].T)
        good &= (
            (gap(NUMPY, first, second, *one, *two) >= 0.0)
            | (room(NUMPY, first, second, *one, *two) >= 0.0)
            | (room(NUMPY, second, first, *two, *one) >= 0.0)
        )
    return good


@pytest.mark.long
@pytest.mark.parametrize("name", ["breakfast", "sushi_plate"])
def test_scenes_settle(name, tmp_path):
    scenes = scenegen.sample(scenegen.load(shipped_specs()[name]), {"task": (0.0, None)}, n=4, seed=1)
    assert clear(scenes).all() and settled(scenes, tmp_path / "all.xml").all()


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_specs())
def test_a_hundred_scenes_of_every_spec_settle(name, tmp_path):
    scenes = scenegen.sample(scenegen.load(shipped_specs()[name]), n=100, seed=3)
    declared = any(one.support is not None for one in scenes.header.objects)  # and noCollision is required
    good = np.ones(len(scenes), dtype=bool) if declared else clear(scenes)
    assert good.sum() >= 10 and settled(scenes, tmp_path / "all.xml")[good].mean() >= 0.95


ARM = """<mujoco{model}>{before}<worldbody><body name="arm" pos="-1 0 0" euler="0 0 90">
  <joint name="turn" type="hinge" range="-90 90" limited="true"/><geom name="link" type="capsule" size=".02 .1"/>
  <geom type="mesh" mesh="hand"/></body></worldbody>
  <asset><mesh name="hand" file="{hand}"/></asset>{after}</mujoco>"""


def robot_file(folder, hand, **parts):
    (folder / "parts").mkdir(exist_ok=True)
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1))
    sides = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    (folder / "parts/hand.obj").write_text(corners + "".join(f"f {' '.join(map(str, side))}\n" for side in sides))
    path = folder / "robot.xml"
    path.write_text(ARM.format(**{"model": "", "before": "", "after": "", "hand": hand, **parts}))
    return path


def facts_of(model):
    """What a robot is, whatever stands around it."""
    arm, link = model.body("arm"), model.geom("link")
    solver = [*link.solref, *link.solimp, *link.friction, *link.margin, link.group[0], link.conaffinity[0]]
    joint = model.joint("turn")
    return [*joint.range, *arm.quat, *arm.pos, *arm.mass, *arm.inertia, *solver, *joint.damping, *joint.armature]


@pytest.mark.parametrize(  # each pair of two of these, once
    ("looks", "where", "compiler"),
    [
        (None, "before", ""),
        ("random", "after", ""),
        ("random", "before", '<compiler angle="degree"/>'),
        (None, "after", '<compiler angle="degree"/>'),
    ],
)
def test_a_scene_that_is_included_changes_nothing_of_a_robot(tmp_path, looks, where, compiler):
    scenes = tower()
    (tmp_path / "scenes").mkdir()
    scenes.export(tmp_path / "scenes/kitchen", to="mjcf", **({"looks": looks, "seed": 1} if looks else {}))
    alone, _ = load(robot_file(tmp_path, "parts/hand.obj", before=compiler))
    include = '<include file="scenes/kitchen/scene_0002.xml"/>'  # in another folder
    parts = {"before": compiler + include} if where == "before" else {"before": compiler, "after": include}
    model, data = load(robot_file(tmp_path, "parts/hand.obj", **parts))
    np.testing.assert_array_equal(facts_of(model), facts_of(alone))
    np.testing.assert_allclose(model.joint("turn").range, [-math.pi / 2, math.pi / 2])
    assert model.opt.timestep == alone.opt.timestep and model.nkey == 0
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(poses(model, data, scenes.objects)[:, [0, 1, 3]], scenes.poses[1], atol=1e-9)
    assert data.qpos[model.joint("turn").qposadr[0]] == 0.0


def test_one_scene_in_one_file_has_no_keyframe_to_mislead_a_robot_that_includes_it(tmp_path):
    scenes = tower()
    scenes[1:2].export(tmp_path / "one.xml")
    model, data = load(robot_file(tmp_path, "parts/hand.obj", after='<include file="one.xml"/>'))
    assert model.nkey == 0
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(poses(model, data, scenes.objects)[:, [0, 1, 3]], scenes.poses[1], atol=1e-9)


def test_defaults_of_a_robot_change_nothing_of_an_included_scene(tmp_path):
    scenes = tower()
    scenes.export(tmp_path / "scenes", to="mjcf")
    defaults = '<default><mesh scale="0.5 0.5 0.5"/><geom contype="2" conaffinity="2" margin="0.05"/></default>'
    robot = robot_file(tmp_path, "parts/hand.obj", before=defaults, after='<include file="scenes/scene_0001.xml"/>')
    included, alone = load(robot)[0], load(tmp_path / "scenes" / "scene_0001.xml")[0]

    def geoms(model, body):
        first, count = int(model.body(body).geomadr[0]), int(model.body(body).geomnum[0])
        facts = (model.geom_contype, model.geom_conaffinity, model.geom_margin, model.geom_rbound)
        return np.stack([one[first : first + count] for one in facts])

    for name in scenes.objects:
        np.testing.assert_allclose(geoms(included, name), geoms(alone, name), rtol=1e-6)


@pytest.mark.parametrize("together", [True, False])
def test_a_scene_that_is_attached_to_a_robot(tmp_path, together):
    """The recipe of docs/formats.md; the robot's file has a folder of meshes of its own."""
    scenes = tower()
    files = scenes.export(tmp_path / ("all.xml" if together else "all"), to="mjcf")
    path = robot_file(tmp_path, "hand.obj", before='<compiler angle="degree" meshdir="parts"/>')
    alone, _ = load(path)
    robot, scene = mujoco.MjSpec.from_file(str(path)), mujoco.MjSpec.from_file(str(files[-1]))
    robot.option.cone, robot.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10
    robot.attach(scene, frame=robot.worldbody.add_frame(), prefix="scene/")
    model = robot.compile()
    data = mujoco.MjData(model)
    np.testing.assert_array_equal(facts_of(model), facts_of(alone))
    assert model.nkey == (2 if together else 0)
    if together:
        mujoco.mj_resetDataKeyframe(model, data, 1)
    mujoco.mj_kinematics(model, data)
    found = poses(model, data, [f"scene/{name}" for name in scenes.objects])
    np.testing.assert_allclose(found[:, [0, 1, 3]], scenes.poses[1], atol=1e-9)
    assert data.qpos[model.joint("turn").qposadr[0]] == 0.0
    assert model.geom_solref[model.body("scene/mug").geomadr[0]] == pytest.approx([0.004, 2.0])


def test_a_box_anywhere():
    found = inertia([box(0.3, 0.2, 0.1).shift(1.0, -2.0, 5.0)])
    np.testing.assert_allclose(found.center, [1.0, -2.0, 5.05], atol=1e-12)
    moments = np.array([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2]) / 12
    np.testing.assert_allclose(found.moments, np.diag(moments), atol=1e-12)


def test_a_box_in_parts():
    parts = [box(0.1, 0.2, 0.1).shift(x=0.1 * k) for k in (-1, 0, 1)]
    whole = inertia([box(0.3, 0.2, 0.1)])
    np.testing.assert_allclose(inertia(parts).moments, whole.moments, atol=1e-12)


def test_round_things():
    sides = 400
    found = inertia([disc(0.05, 0.0, 0.2, sides)])
    np.testing.assert_allclose(found.center, [0.0, 0.0, 0.1], atol=1e-9)
    radial, axial = 0.05**2 / 4 + 0.2**2 / 12, 0.05**2 / 2
    np.testing.assert_allclose(np.diag(found.moments), [radial, radial, axial], rtol=1e-3)
    arc = [math.pi * k / 200 for k in range(201)]
    ball = revolve(
        [(abs(0.1 * math.sin(a)) if 0 < k < 200 else 0.0, -0.1 * math.cos(a)) for k, a in enumerate(arc)], sides
    )
    np.testing.assert_allclose(inertia([ball]).moments, 0.4 * 0.1**2 * np.eye(3), rtol=1e-3, atol=1e-9)


def test_products_have_the_right_sign():
    """Two cubes on the line x = y: the moment about that line is the smallest."""
    pair = [box(0.1, 0.1, 0.1).shift(d, d) for d in (-1.0, 1.0)]
    moments = inertia(pair).moments
    assert moments[0, 1] == pytest.approx(-1.0)
    along = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    assert along @ moments @ along == pytest.approx(np.linalg.eigvalsh(moments)[0])


CONFIG = """
[table]
texture = {choice = ["wood", "textures/four.png", "checker"]}
texture_size = 0.2
[ground]
texture = "speckle"
[walls]
distance = {uniform = [0.3, 0.9]}
color = "pink"
texture = {choice = ["plain", "stripes"]}
[objects]
hue = {uniform = [-0.5, 0.5]}
[light]
azimuth = {uniform = [-180, 180]}
elevation = {uniform = [40, 85]}
color = "#ffeedd"
[camera]
azimuth = {uniform = [-40, 40]}
fov = {uniform = [30, 60]}
roll = 5
"""


@pytest.fixture
def looks_looks(tmp_path):
    four_colors(tmp_path, "textures/four.png")
    (tmp_path / "looks.toml").write_text(CONFIG)
    return tmp_path / "looks.toml"


def records(folder):
    return [json.loads(line) for line in (folder / "looks.jsonl").read_text().splitlines()]


def frame_of(record):
    """(4, 4): from the camera's frame of a record, y down and z ahead, to the world."""
    return np.linalg.inv(np.array(record["world_to_camera"]))


def shines(look):
    turn, rise = np.radians(look["light_azimuth"]), np.radians(look["light_elevation"])
    return -np.array([np.sin(turn) * np.cos(rise), -np.cos(turn) * np.cos(rise), np.sin(rise)])


@pytest.mark.long
def test_the_looks_of_worlds_are_those_of_pictures(looks_looks, tmp_path):
    scenes = tower()
    scenes.render(tmp_path / "pictures", size=None, looks=looks_looks, seed=4)
    scenes.export(tmp_path / "worlds", "mjcf", looks=looks_looks, seed=4)
    drawn, exported = records(tmp_path / "pictures"), records(tmp_path / "worlds")
    assert [one["file"] for one in exported] == ["scene_0001.xml", "scene_0002.xml"]
    for one, other in zip(drawn, exported, strict=True):
        del one["pictures"], other["file"]
        assert one == other


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_mujoco_has_the_camera_the_light_the_colours_and_the_walls(looks_looks, tmp_path, seed):
    scenes = tower()
    files = scenes.export(tmp_path / "worlds", "mjcf", looks=looks_looks, seed=seed)
    plain = mujoco.MjModel.from_xml_path(str(scenes.export(tmp_path / "plain", "mjcf")[0]))
    for path, record in zip(files, records(tmp_path / "worlds"), strict=True):
        look = record["look"]
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        frame = frame_of(record)
        np.testing.assert_allclose(data.camera("look").xpos, frame[:3, 3], atol=1e-6)
        turned = data.camera("look").xmat.reshape(3, 3) * [1.0, -1.0, -1.0]  # MuJoCo's has y up and z behind
        np.testing.assert_allclose(turned, frame[:3, :3], atol=1e-6)
        assert model.camera("look").fovy[0] == pytest.approx(look["camera_fov"])
        np.testing.assert_allclose(data.light_xdir[0], shines(look), atol=1e-6)
        np.testing.assert_allclose(model.light_diffuse[0], look["light_intensity"] * np.array(look["light_color"]))
        np.testing.assert_allclose(model.material("table").rgba[:3], look["table_color"], atol=1e-6)
        np.testing.assert_allclose(model.material("wall_1").rgba[:3], look["walls_color"], atol=1e-6)
        tints = {
            geom: tuple(rgba) for geom, rgba in enumerate(model.geom_rgba[model.geom_bodyid > 1].round(6).tolist())
        }
        assert set(tints.values()) != {tuple(rgba) for rgba in plain.geom_rgba[plain.geom_bodyid > 1].round(6).tolist()}
        # What collides, and how, is as without looks.
        solid = model.geom_contype > 0
        assert solid.sum() == (plain.geom_contype > 0).sum()
        np.testing.assert_array_equal(model.geom_size[solid], plain.geom_size[plain.geom_contype > 0])
        np.testing.assert_array_equal(model.body_mass, plain.body_mass)
        np.testing.assert_array_equal(model.key_qpos, plain.key_qpos if path == files[0] else model.key_qpos)


def test_walls_face_inwards_and_let_the_light_onto_the_table(looks_looks, tmp_path):
    """A ray from each corner of the table to the sun passes above every wall."""
    scenes = tower()
    for seed in range(2):
        files = scenes.export(tmp_path / str(seed), "mjcf", looks=looks_looks, seed=seed)
        for path, record in zip(files, records(tmp_path / str(seed)), strict=True):
            model = mujoco.MjModel.from_xml_path(str(path))
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            top = next(k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_BOX)
            center, half = data.geom_xpos[top], model.geom_size[top]
            corners = center + np.array([[x, y, 1.0] for x in (-1, 1) for y in (-1, 1)]) * half
            walls = [k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_PLANE][1:]
            assert len(walls) == 4
            towards = -shines(record["look"])
            for wall in walls:
                normal = data.geom_xmat[wall].reshape(3, 3)[:, 2]
                assert normal @ (center - data.geom_xpos[wall]) > 0.29
                height = data.geom_xpos[wall][2] + model.geom_size[wall][1]
                assert data.geom_xpos[wall][2] - model.geom_size[wall][1] == pytest.approx(-TALL)
                for corner in corners:
                    slope = normal @ towards
                    if slope < 0.0:
                        meets = corner + towards * (normal @ (data.geom_xpos[wall] - corner) / slope)
                        assert meets[2] > height - 1e-6


def test_textures_are_as_large_as_they_should_be(looks_looks, tmp_path):
    scenes = tower()
    for seed in range(8):
        (path, _) = scenes.export(tmp_path / str(seed), "mjcf", looks=looks_looks, seed=seed)
        if records(tmp_path / str(seed))[0]["look"]["table_texture"] == "textures/four.png":
            break
    else:
        pytest.fail("no seed has the texture")
    model = mujoco.MjModel.from_xml_path(str(path))
    top = next(k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_BOX)
    across, along, _ = 2.0 * model.geom_size[top]
    assert not model.material("table").texuniform[0]
    np.testing.assert_allclose(model.material("table").texrepeat, [across / 0.2, along / 0.1], rtol=1e-6)
    with Image.open(path.parent / "textures" / "four.png") as image:
        assert image.size == (64, 32)


def test_usd_has_the_camera_the_light_and_textures_that_are_there(looks_looks, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Gf, UsdGeom, UsdLux, UsdShade

    from tests.worlds.export.stages import faults, frame, opened, things

    scenes = tower()
    files = scenes.export(tmp_path / "stages", "usd", looks=looks_looks, seed=4)
    before = opened(scenes.export(tmp_path / "plain", "usd")[0])
    for path, record in zip(files, records(tmp_path / "stages"), strict=True):
        stage, look = opened(path), record["look"]
        assert faults(stage) == []
        camera = UsdGeom.Camera(stage.GetPrimAtPath("/Environment/look"))
        np.testing.assert_allclose(
            frame(camera.GetPrim())[:3, :3] * [1.0, -1.0, -1.0], frame_of(record)[:3, :3], atol=1e-9
        )
        np.testing.assert_allclose(frame(camera.GetPrim())[:3, 3], frame_of(record)[:3, 3], atol=1e-9)
        seen = camera.GetCamera().GetFieldOfView(Gf.Camera.FOVVertical)
        assert seen == pytest.approx(look["camera_fov"], abs=1e-4)
        sun = UsdLux.DistantLight(stage.GetPrimAtPath("/Environment/sun"))
        np.testing.assert_allclose(frame(sun.GetPrim())[:3, :3] @ [0.0, 0.0, -1.0], shines(look), atol=1e-6)
        np.testing.assert_allclose(sun.GetColorAttr().Get(), look["light_color"], atol=1e-6)
        textures = [
            UsdShade.Shader(prim).GetInput("file").Get()
            for prim in stage.TraverseAll()
            if prim.GetTypeName() == "Shader" and UsdShade.Shader(prim).GetIdAttr().Get() == "UsdUVTexture"
        ]
        assert textures and all(one.resolvedPath for one in textures)
        assert (
            len([prim for prim in stage.TraverseAll() if prim.GetName().startswith("wall_") and prim.IsA(UsdGeom.Mesh)])
            == 4
        )
        assert things(stage).keys() == things(before).keys()


def test_looks_are_refused_where_they_cannot_be(looks_looks, tmp_path):
    scenes = tower()
    with pytest.raises(RequestError, match="goes with mjcf and usd"):
        scenes.export(tmp_path / "a", "sdf", looks=looks_looks)
    with pytest.raises(RequestError, match="a file of its own"):
        scenes.export(tmp_path / "all.xml", looks=looks_looks)
    with pytest.raises(RequestError, match="seed"):
        scenes.export(tmp_path / "a", "mjcf", looks=looks_looks, seed=-1)
    assert not list(tmp_path.glob("a*"))
