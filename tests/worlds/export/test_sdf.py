"""SDF worlds: by the specification's rules, and in the hands of PyBullet. Objects from files of one's own have their
own bodies in simulators, or it is said why not.
"""

import re
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.things import shape_of
from scenegen.things.bodies import collision_of
from scenegen.things.mesh import box, revolve
from scenegen.things.meshfile import vertices
from scenegen.worlds.export.meshes import stl
from scenegen.worlds.export.world import world_of
from scenegen.worlds.own_body import own_bodies_of
from tests.worlds.export.sdf_facts import faults
from tests.worlds.export.worlds import crates, library, tower


@pytest.mark.long
@pytest.mark.parametrize("make", [tower, library])
def test_by_the_rules_of_the_specification(make, tmp_path):
    """And the meshes are there, named relatively."""
    (path,) = make().export(tmp_path / "all.sdf")
    root = ElementTree.parse(path).getroot()
    assert root.get("version") == "1.7" and faults(root) == []
    named = {uri.text for uri in root.iter("uri")}
    assert named == {f"all_meshes/{file.name}" for file in (tmp_path / "all_meshes").iterdir()}
    assert all(re.fullmatch(r"all_meshes/\w+\.obj", name) for name in named)


def test_the_rules_can_be_broken(tmp_path):
    (path,) = tower().export(tmp_path / "all.sdf")
    text = path.read_text()
    for change in (
        ("<gravity>0 0 -9.81</gravity>", ""),
        ("<gravity>0 0 -9.81</gravity>", "<gravity>0 0</gravity>"),
        ('<model name="mug">', '<model name="plate">'),
        ('<model name="mug">', "<model>"),
        ("<static>1</static>", "<static>yes</static>"),
        ("<mass>0.35</mass>", "<weight>0.35</weight>"),
        ("<geometry>", "<geometry>words"),
    ):
        assert change[0] in text
        assert len(faults(ElementTree.fromstring(text.replace(*change)))) >= 1, change


@pytest.mark.parametrize("together", [True, False])
def test_objects_are_where_the_scene_says(together, tmp_path):
    scenes = tower()
    files = scenes.export(tmp_path / ("all.world" if together else "all"), to="sdf")
    assert [path.name for path in files] == (["all.world"] if together else ["scene_0001.sdf", "scene_0002.sdf"])
    worlds = [world for path in files for world in ElementTree.parse(path).getroot()]
    assert [world.get("name") for world in worlds] == ["scene_0001", "scene_0002"]
    for k, world in enumerate(worlds):
        models = {model.get("name"): model for model in world.findall("model")}
        assert list(models) == ["floor", "table", *scenes.objects]
        found = np.array([[float(x) for x in models[name].findtext("pose").split()] for name in scenes.objects])
        np.testing.assert_allclose(found[:, [0, 1, 5]], scenes.poses[k], atol=1e-12)
        assert [name for name in models if models[name].findtext("static") == "1"] == ["floor", "table", "tray"]


@pytest.mark.parametrize("scene", [0, 1])
def test_pybullet_loads_it(scene, tmp_path, bullet):
    scenes = tower()
    path = scenes.export(tmp_path / "all", to="sdf")[scene]
    numbers = pybullet.loadSDF(str(path), physicsClientId=bullet.client)
    names = [pybullet.getBodyInfo(number, physicsClientId=bullet.client)[1].decode() for number in numbers]
    assert names == ["floor", "table", *scenes.objects]
    for number, name, (x, y, theta) in zip(numbers[2:], scenes.objects, scenes.poses[scene], strict=True):
        where, turned = bullet.frame(number)
        np.testing.assert_allclose([*where[:2], turned % (2 * np.pi)], [x, y, theta], atol=1e-6, err_msg=name)
    before = [bullet.frame(number)[0] for number in numbers]
    pybullet.setGravity(0, 0, -9.81, physicsClientId=bullet.client)
    for _ in range(240):
        pybullet.stepSimulation(physicsClientId=bullet.client)
    after = [bullet.frame(number)[0] for number in numbers]
    assert np.linalg.norm(np.subtract(after, before), axis=1).max() < 0.01


def test_pieces_read_back(tmp_path):
    """What collides: boxes written out, and OBJ files or, for PyBullet, STL files of the library's convex pieces."""
    tower().export(tmp_path / "all.sdf")
    pieces = collision_of(shape_of("mug"))
    boxes = 0
    for number, piece in enumerate(pieces, start=1):
        path = tmp_path / "all_meshes" / f"mug_hull_{number}.obj"
        boxes += not path.exists()
        if path.exists():
            np.testing.assert_allclose(vertices(path.name, path.read_bytes()), piece.vertices, atol=1e-9)
        corners = vertices("x.stl", stl(piece)).reshape(-1, 3, 3)
        np.testing.assert_allclose(corners, piece.vertices[piece.faces], atol=1e-7)
    assert boxes == 3  # the bars of the handle


def test_golden(golden, tmp_path):
    (path,) = crates().export(tmp_path / "all.sdf")
    golden("worlds/export/crates.sdf", path.read_text())


ROBOT = """<robot name="r"><link name="a"><inertial><mass value="0.7"/></inertial>
<contact><lateral_friction value="0.9"/></contact>
<collision><origin xyz="0 0 1"/><geometry><box size="0.1 0.1 0.2"/></geometry></collision>
<collision><origin xyz="0 0 1.15"/><geometry><box size="0.05 0.05 0.1"/></geometry></collision></link></robot>"""
SPEC = 'object r = urdf("r.urdf"), c = mesh("c.dae", box(9 cm, 9 cm, 9 cm))\ntask: leftOf(r, c)'


def obj(mesh):
    lines = ["v {:.9f} {:.9f} {:.9f}".format(*point) for point in mesh.vertices]
    return "\n".join([*lines, *("f {} {} {}".format(*face) for face in mesh.faces + 1)])


@pytest.fixture
def scenes(tmp_path):
    (tmp_path / "r.urdf").write_text(ROBOT)
    (tmp_path / "s.spec").write_text(SPEC)
    return scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.1, None)}, n=1, seed=3)


def test_pieces_mass_and_friction_are_the_files(scenes, tmp_path):
    (block,) = scenes.blocks()
    robot, other = world_of(scenes.header, block, own_bodies_of(scenes.file(), tmp_path)).bodies
    assert (robot.mass, robot.friction) == (0.7, 0.9)
    assert [piece.box[0][2] for piece in robot.form.pieces] == pytest.approx([0.1, 0.25])
    assert len(robot.colors) == len(robot.form.parts) == 2
    bare = world_of(scenes.header, block).bodies
    assert len(bare[0].form.pieces) == 1 and bare[1].mass == other.mass == pytest.approx(500 * 0.09**3)
    for to, mass in (("mjcf", 'mass="0.7"'), ("sdf", "<mass>0.7</mass>")):
        (path,) = scenes.export(tmp_path / to, to, meshes=tmp_path)
        assert mass in path.read_text()


def test_an_asset_is_scaled_and_turned_and_weighs_what_its_index_says(tmp_path):
    (tmp_path / "assets.toml").write_text(
        '[[asset]]\nname = "block"\nfile = "block.obj"\nscale = 0.01\nroll = 90\nmass = 0.3\nfriction = 0.2'
    )
    (tmp_path / "block.obj").write_text(obj(box(10.0, 5.0, 2.0)))
    (tmp_path / "s.spec").write_text('object b = asset("block"), mug\ntask: leftOf(b, mug)')
    scenes = scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.1, None)}, n=1, seed=3)
    body = own_bodies_of(scenes.file(), tmp_path)["b"]
    assert (body.mass, body.friction) == (0.3, 0.2)
    (piece,) = body.pieces
    low, high = piece.vertices.min(axis=0), piece.vertices.max(axis=0)
    assert low[2] == pytest.approx(0.0, abs=1e-9) and high - low == pytest.approx((0.1, 0.02, 0.05))


def test_files_that_give_no_body_are_refused(scenes, tmp_path):
    def refused(code, words, **given):
        with pytest.raises((DataError, RequestError), match=words) as caught:
            scenes.export(tmp_path / "out", **({"to": "mjcf", "meshes": tmp_path} | given))
        assert caught.value.diagnostics[0].code == code
        assert not (tmp_path / "out").exists()

    (tmp_path / "r.urdf").write_text(ROBOT.replace('"0.7"', '"-1"'))
    refused("unusable-model", r"r.urdf, the file of `r`, gives it no body: line 1, <mass>: value=\"-1\" is negative")
    (tmp_path / "r.urdf").write_text(ROBOT.replace("0.05 0.05 0.1", "0.05 0.05 0.2"))
    refused("unusable-model", "its outline is not that of the scenes")
    refused("unusable-model", "no such file", meshes=tmp_path / "elsewhere")
    refused("out-of-place", "gives bodies to simulators", to="pddl")
    scenes = scenegen.sample(scenegen.parse("task: leftOf(mug, plate)"), {"task": (0.0, None)}, n=1, seed=1)
    with pytest.raises(DataError, match="from a mesh, an asset"):
        scenegen.settle(scenes, "pybullet", meshes=tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("simulator", ["pybullet", "mujoco"])
def test_an_apple_settles_in_a_bowl_and_stays_on_its_outline(tmp_path, tmp_path_factory, monkeypatch, simulator):
    pytest.importorskip("coacd")
    pytest.importorskip(simulator)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp()))  # cut once
    inside = [(0.082, 0.07), (0.068, 0.032), (0.04, 0.008), (0.0, 0.008)]
    bowl = revolve([(0.0, 0.0), (0.04, 0.0), (0.076, 0.03), (0.09, 0.07), *inside], 12)
    (tmp_path / "bowl.obj").write_text(obj(bowl))
    (tmp_path / "s.spec").write_text('object basin = mesh("bowl.obj"), apple\ntask: leftOf(apple, basin)')
    drawn = scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.0, None)}, n=1, seed=1)
    places = np.array([[(0.5, 0.5, 0.0), (0.51, 0.5, 0.0)], [(0.5, 0.5, 0.0), (0.495, 0.505, 1.0)]])
    scenes = scenegen.SceneSet(places, {}, drawn.header)
    held = scenegen.settle(scenes, simulator, meshes=tmp_path, workers=1)
    basin, apple = held.poses[:, 0, :3], held.poses[:, 1, :3]
    assert (np.abs(basin - (0.5, 0.5, 0.0)) < 0.005).all()
    assert (apple[:, 2] < 0.05).all() and (np.hypot(*(apple - basin)[:, :2].T) < 0.05).all()
    assert held.moved[:, 1].all()  # the plan had it on top
    outline = scenegen.settle(scenes, simulator, workers=1)
    assert (outline.poses[:, 1, 2] > 0.069).all() and not outline.moved.any()
