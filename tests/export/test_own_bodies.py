"""Objects from files of one's own have their own bodies in simulators, or it is said why not."""

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.things.mesh import box, revolve
from scenegen.worlds.export.world import world_of
from scenegen.worlds.own_body import own_bodies_of

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
