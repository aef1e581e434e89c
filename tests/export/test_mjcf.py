"""MJCF in the hands of MuJoCo: it loads, objects are where the scene says, and they stay there."""

import itertools
import math

import mujoco
import numpy as np
import pytest

import scenegen
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.resources import shipped_specs
from scenegen.scenes.data import footprint_of
from scenegen.things import shape_of
from scenegen.things.bodies import parts_of
from tests.export.worlds import crates, library, scenes_of, tower


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
    golden("export/crates.xml", path.read_text())


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


@pytest.mark.parametrize("looks", [None, "random"])
@pytest.mark.parametrize("where", ["before", "after"])
@pytest.mark.parametrize("compiler", ["", '<compiler angle="degree"/>'])
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
