"""Cameras of live environments in small models, and how a thing is hidden by what it may stand on."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.libero import spec_of
from scenegen.play.libero.measure import LiveModel
from scenegen.play.libero.sight import LiveCamera

# one metre over the ground a camera looks along -x at the box `far`, 2 m away, in front of which is `near`, 1 m away
MODEL = """
<mujoco><worldbody>
  <geom type="plane" size="5 5 0.1"/>
  <camera name="agentview" pos="2 0 1" xyaxes="0 1 0 0 0 1" fovy="45"/>
  <body name="far" pos="0 0 1"><freejoint/>
    <geom type="box" size="0.1 0.2 0.2" mass="1" group="0"/><geom type="box" size="0.1 0.2 0.2" group="1"/></body>
  <body name="near" pos="1 0 1"><freejoint/><geom type="box" size="0.01 0.1 0.5" mass="1" group="1"/></body>
</worldbody></mujoco>
"""
EDGE = math.tan(math.pi / 8.0)  # of the picture, one metre ahead
INNER, OUTER = (1.9 * EDGE - 0.2) / 2.1, EDGE + 0.2 / 1.9  # of the box there: from its back corner to its front corner


@pytest.fixture(scope="module")
def live():
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(MODEL)
    sim = SimpleNamespace(model=SimpleNamespace(_model=model), data=SimpleNamespace(_data=mujoco.MjData(model)))
    sim.model.body_name2id = lambda name: model.body(name).id
    things = [SimpleNamespace(name=name, root_body=name) for name in ("far", "near")]
    mujoco.mj_forward(model, sim.data._data)
    return LiveModel(SimpleNamespace(sim=sim, model=SimpleNamespace(mujoco_objects=things)))


@pytest.mark.parametrize(
    ("near", "far", "wanted"),
    [
        # its front, 40 cm wide, is 1.9 m away; what is 99 cm away hides 1.9 / 0.99 as much there
        ((1.0, 0.0), (0.0, 0.0), 1.0 - 0.2 * 1.9 / 0.99 / 0.4),
        ((1.0, 0.1), (0.0, 0.0), 0.5),  # from the middle to beyond the edge
        ((1.0, 0.5), (0.0, 0.0), 1.0),
        ((-1.0, 0.0), (0.0, 0.0), 1.0),  # behind it
        ((-1.0, 0.0), (0.0, 1.9 * EDGE), (EDGE - INNER) / (OUTER - INNER)),  # half of its front is out of the picture
    ],
    ids=["in front", "half", "beside", "behind", "at the edge"],
)
def test_a_share_is_that_of_the_picture(live, near, far, wanted):
    for name, at in (("near", near), ("far", far)):
        live.place(name, (*at, 1.0), (1.0, 0.0, 0.0, 0.0))
    live.mj.mj_forward(live.model, live.data)
    before = live.model.geom_group.copy()
    assert LiveCamera(live).visible_share("far") == pytest.approx(wanted, abs=0.03)
    assert (live.model.geom_group == before).all()


def test_the_statement_of_a_camera(live):
    camera = LiveCamera(live)
    statement = camera.statement((0.5, 0.0, 0.2))
    assert statement == "camera agentview = at (1.5, 0, 0.8) looks at (0.5, 0, 0.8) fov 45 deg, 1:1"
    assert scenegen.parse(f"{statement}\ntask: inView(mug, agentview)").labels == ("task",)
    down = math.sqrt(0.5)
    camera.turn = np.array([[0.0, -down, down], [1.0, 0.0, 0.0], [0.0, down, down]])
    assert (
        camera.statement((0.5, 0.0, 0.2)).split(" fov")[0].endswith("looks at (0.7, 0, 0)")
    )  # where it meets the ground
    with pytest.raises(RequestError, match="agentview"):
        LiveCamera(live, "frontview")


def test_shares_of_nothing_are_refused(live):
    sampler = SimpleNamespace(
        reference_pos=(0.0, 0.0, 0.0), x_range=(-1, 1), y_range=(-1, 1), mujoco_objects=live.env.model.mujoco_objects
    )
    env = SimpleNamespace(sim=live.sim, model=live.env.model, placement_initializer=sampler)
    with pytest.raises(RequestError, match="puts a thing somewhere"):
        spec_of(env, sight=True)


@pytest.mark.long
def test_what_a_thing_may_stand_on_hides_it_where_it_stands_elsewhere():
    spec = scenegen.parse(
        "camera front = at (0.5, -0.9, 0.3) looks at (0.5, 0.5, 0) fov 50 deg, 1:1\n"
        "object tray = box(30 cm, 20 cm, 20 cm) at (0.5, 0.4, 0 deg)\n"
        "object cup = cylinder(3 cm, 5 cm) on any of [workspace, tray]\n"
        "behind: visibleShare(cup, front) <= 0 % & y(cup) >= 0.6\n"
        "free: visibleShare(cup, front) >= 100 %\n"
    )
    hidden = scenegen.sample(spec, {"behind": (0.0, None)}, n=8, seed=1)
    assert {one["cup"] for one in carriers(hidden)} == {"workspace"}
    on_it = scenegen.sample(spec, {"free": (0.0, None)}, n=64, seed=1)
    assert "tray" in {one["cup"] for one in carriers(on_it)}


def carriers(scenes):
    return [{"cup": "tray" if heights[1] > 0.1 else "workspace"} for heights in scenes.poses7()[..., 2]]
