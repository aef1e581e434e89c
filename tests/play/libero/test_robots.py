"""Robots and cameras of small models as statements of a spec."""

import math
from types import SimpleNamespace

import pytest

import scenegen
from scenegen.play.libero.measure import LiveModel
from scenegen.play.libero.robots import robot_statements
from scenegen.play.libero.sight import still_cameras

HALF = math.sqrt(0.5)
MODEL = """
<mujoco><worldbody>
  <geom type="plane" size="5 5 0.1" group="1"/>
  <camera name="front" pos="2 0 1" xyaxes="0 1 0 0 0 1"/>
  <camera name="top" pos="0 0 3"/>
  <camera name="turned" pos="0 0 3" xyaxes="0 1 0 -1 0 0"/>
  <camera name="rolled" pos="2 0 1" xyaxes="0 0.9 0.1 0 -0.1 0.9"/>
  <camera name="upside_down" pos="2 0 1" xyaxes="0 -1 0 0 0 -1"/>
  <camera name="left eye" pos="2 0 1" xyaxes="0 1 0 0 0 1"/>
  <body name="base" pos="-0.5 0.1 0.912" quat="{half} 0 0 {half}"><camera name="wrist"/><geom size="0.1"/></body>
</worldbody></mujoco>
"""


class OnTheGroundPanda(SimpleNamespace):
    """A robot's model by the name of one of LIBERO's."""


class Sawyer(SimpleNamespace):
    """One that does not come along."""


def live(*kinds):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(MODEL.format(half=HALF))
    sim = SimpleNamespace(model=SimpleNamespace(_model=model), data=SimpleNamespace(_data=mujoco.MjData(model)))
    sim.model.body_name2id = lambda name: model.body(name).id
    mujoco.mj_forward(model, sim.data._data)
    robots = [SimpleNamespace(robot_model=kind(root_body="base")) for kind in kinds]
    return LiveModel(SimpleNamespace(sim=sim, model=SimpleNamespace(mujoco_objects=[]), robots=robots))


def test_a_robot_stands_on_a_board_where_its_base_is():
    found = robot_statements(live(OnTheGroundPanda), (0.1, 0.0, 0.8), ())
    assert found[1] == f"robot arm = panda on arm_mount at (-0.6, 0.1, {math.pi / 2:.6f} rad)"
    text = "\n".join([*found, "object can", "require noOverlap()", "task: graspable(can, arm)"])
    spec = scenegen.parse(text)
    made = scenegen.sample(spec, (None, None), n=1, seed=0)
    assert made.poses7()[0, 0, :3] == pytest.approx([-0.6, 0.1, 0.112])
    (level,) = robot_statements(live(OnTheGroundPanda), (0.0, 0.0, 0.912), ("arm",))
    assert level == f"robot arm_ = panda at (-0.5, 0.1, {math.pi / 2:.6f} rad)"


def test_robots_that_a_spec_cannot_have_are_named():
    (lower,) = robot_statements(live(OnTheGroundPanda), (0.0, 0.0, 1.0), ())
    (unknown,) = robot_statements(live(Sawyer), (0.0, 0.0, 0.8), ())
    assert lower.startswith("# The robot OnTheGroundPanda is left out: it stands lower")
    assert unknown.startswith("# The robot Sawyer is left out: it is no arm")
    assert [
        one.split()[1] for one in robot_statements(live(OnTheGroundPanda, Sawyer, OnTheGroundPanda), (0, 0, 0), ())
    ] == ["arm_mount", "arm", "The", "arm__mount", "arm_"]


def test_cameras_that_stand_still_and_are_level():
    found = still_cameras(live())
    assert [one.name for one in found] == ["front", "top"]
    text = "\n".join(one.statement((0.0, 0.0, 0.0)) for one in found)
    assert scenegen.parse(f"{text}\ntask: inView(mug, front) & inView(mug, top)").labels == ("task",)


def test_a_floor_that_is_drawn_and_collides_is_the_ground():
    """LIBERO's own point of the floor scenes is 3.5 cm below it."""
    assert live().ground((0.0, 0.0, -0.035)) == pytest.approx(0.0, abs=1e-9)
