"""What needs no LIBERO: prisms of points, attitudes, floors and walls in a small model, files of states."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.libero import set_scene, spec_of
from scenegen.play.frame import times, upright
from scenegen.play.libero.files import LiberoTask, StatesJob, tasks_of
from scenegen.play.libero.init_files import write_states
from scenegen.play.libero.measure import LiveModel, heading_of, matrix, prism_of
from scenegen.play.libero.spec import _Task
from scenegen.play.libero.states import SettledStates, _quarters

HALF = math.sqrt(0.5)


def about_z(angle):
    return np.array([math.cos(angle / 2), 0, 0, math.sin(angle / 2)])


@pytest.mark.parametrize(
    ("axis", "standing", "heading"),
    [(0, [1, 0, 0, 0], math.pi / 2), (1, [HALF, 0, -HALF, 0], math.pi), (2, [HALF, HALF, 0, 0], math.pi)],
    ids=["x", "y", "z"],
)
def test_liberos_rotations_are_taken_from_the_pose_after_the_reset(axis, standing, heading):
    """LIBERO hands x, y, z, w to what wants w, x, y, z: a quarter of a turn about x is one about the vertical."""
    quaternion = np.zeros(4)  # as LIBERO makes it
    quaternion[axis] = quaternion[3] = HALF
    assert upright(quaternion) == pytest.approx(standing, abs=1e-12)
    assert heading_of(quaternion) == pytest.approx(heading)
    assert times(about_z(heading), standing) == pytest.approx(quaternion, abs=1e-12)


def test_matrices_are_those_of_quaternions():
    assert matrix(about_z(math.pi / 2)) @ (1, 0, 0) == pytest.approx([0, 1, 0])
    lying = times(about_z(0.3), (HALF, HALF, 0, 0))
    assert matrix(lying) @ matrix(lying).T == pytest.approx(np.eye(3))
    assert len(_quarters()) == 24 and {round(float(np.abs(matrix(one)).max()), 6) for one in _quarters()} == {1.0}


def test_prisms_are_the_hulls_of_points_at_an_attitude():
    rng = np.random.default_rng(1)
    points = rng.uniform((-0.02, -0.03, -0.01), (0.02, 0.05, 0.2), (500, 3))
    points = np.concatenate(
        [points, np.array(np.meshgrid((-0.02, 0.02), (-0.03, 0.05), (-0.01, 0.2))).reshape(3, -1).T]
    )
    stands = prism_of(points, np.array([1.0, 0, 0, 0]))
    assert sorted(stands.corners) == [(-0.02, -0.03), (-0.02, 0.05), (0.02, -0.03), (0.02, 0.05)]
    assert (stands.bottom, stands.top) == pytest.approx((-0.01, 0.2))
    assert stands.reach == pytest.approx(math.hypot(0.02, 0.05))
    lies = prism_of(points, np.array([HALF, HALF, 0, 0]))  # y is up, z is -y
    assert sorted(lies.corners) == [(-0.02, -0.2), (-0.02, 0.01), (0.02, -0.2), (0.02, 0.01)]
    spec = scenegen.parse(f"object mug = {lies.text()}, box\ntask: gap(mug, box) >= 0")
    assert spec.checked.shapes[0].height == pytest.approx(0.08)
    turn = np.linspace(0, 2 * np.pi, 400)
    round_ = prism_of(np.c_[np.cos(turn), np.sin(turn), turn], np.array([1.0, 0, 0, 0]))
    assert len(round_.corners) == 12


MODEL = """
<mujoco><worldbody>
  <geom type="plane" size="2 2 0.1" pos="0 0 0.82"/>
  <body name="arm"><joint name="arm" type="hinge"/><geom type="sphere" size="0.05" pos="0.9 0.9 1.5"/></body>
  <body name="chest" pos="0.3 0.1 0.82">
    <geom type="box" size="0.1 0.1 0.005" pos="0 0 0.005"/><geom type="box" size="0.1 0.005 0.05" pos="0 0.1 0.05"/>
    <geom type="box" size="0.005 0.1 0.05" pos="-0.1 0 0.05"/><geom type="box" size="0.005 0.1 0.05" pos="0.1 0 0.05"/>
    <site name="inside" pos="0 0 0.05" size="0.08 0.08 0.04" type="box"/>
    <body name="drawer" pos="0 0 0.2"><joint name="slide" type="slide" axis="0 1 0" range="-0.16 0.01"/>
      <geom type="box" size="0.05 0.05 0.01" mass="1"/></body>
    <body name="door" pos="0.2 0 0.2"><joint name="hinge" type="hinge" axis="0 0 1" range="-2 0"/>
      <geom type="box" size="0.15 0.01 0.05" pos="0.15 0 0" mass="1"/></body>
  </body>
  <body name="can" pos="0 0 0.9" quat="0.5 0.5 0.5 0.5"><freejoint/>
    <geom type="cylinder" size="0.03 0.05" mass="1"/></body>
</worldbody><actuator><motor joint="arm"/></actuator></mujoco>
"""


@pytest.fixture(scope="module")
def table():
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sim = SimpleNamespace(model=SimpleNamespace(_model=model), data=SimpleNamespace(_data=data))
    sim.model.body_name2id = lambda name: model.body(name).id
    things = [SimpleNamespace(name=name, root_body=name) for name in ("can", "chest")]
    sampler = SimpleNamespace(
        reference_pos=(0.1, 0, 0.8), x_range=(-0.2, 0.2), y_range=(-0.1, 0.1), mujoco_objects=things[:1]
    )
    return SimpleNamespace(sim=sim, model=SimpleNamespace(mujoco_objects=things), placement_initializer=sampler)


def test_a_model_is_measured(table):
    live = LiveModel(table)
    assert list(live.movers) == ["can"] and live.fixtures == ["chest"] and live.owners[1] == "the robot"
    assert live.ground((0, 0, 0.8)) == pytest.approx(0.82)
    floor = live.floor("inside", np.array([0.08, 0.08, 0.04]), "chest", {})
    assert floor.height == pytest.approx(0.83)
    assert floor.rectangle == pytest.approx((0.22, 0.02, 0.38, 0.18), abs=2e-3)
    left, bottom, right, top = floor.free  # between walls on three sides, open in front
    assert (left, right, top) == pytest.approx((0.205, 0.395, 0.195), abs=1e-6) and bottom < -0.15
    assert live.parts["slide"].lever == 1.0 and live.parts["hinge"].lever == pytest.approx(0.3, abs=1e-3)
    assert live.accepted_range(live.parts["slide"], lambda value: value < -0.14) == pytest.approx(
        (-0.16, -0.14), abs=1e-3
    )
    assert live.accepted_range(live.parts["slide"], lambda value: False) is None
    attitude, heading = live.attitude("can")
    assert heading == pytest.approx(math.pi / 2) and heading_of(attitude) == pytest.approx(0)
    before = live.data.qpos.copy()
    with live.without_movers({"slide": -0.1}):
        assert live.data.qpos[live.movers["can"]] == 20 and live.data.qpos[live.parts["slide"].address] == -0.1
    assert (live.data.qpos == before).all()


@pytest.fixture
def restored(table):
    """The model that all tests share, with its fixtures put back."""
    live = LiveModel(table)
    yield live
    live.stand(live.fixed)


def test_fixtures_are_part_of_the_model_and_a_scene_has_them(table, restored, tmp_path):
    sim, before = table.sim, restored.data.qpos.copy()
    size = len(before) + restored.model.nv
    env = SimpleNamespace(**vars(table), get_sim_state=lambda: np.zeros(size))
    env.set_init_state = lambda state: (restored.data.qpos.__setitem__(slice(None), state[: len(before)]), "seen")[1]
    states = np.arange(2.0 * size).reshape(2, size)
    env.bddl_file_name = "suite/open_the_chest.bddl"
    there = {"chest": np.array([0.4, 0.3, 0.2, 0.0, 0.0, 0.0, 1.0])}
    path = write_states(tmp_path / "task.pruned_init", states, there, "open_the_chest")
    assert set_scene(env, f"{path}.npz", 1) == "seen"
    chest = sim.model._model.body("chest")
    assert chest.pos == pytest.approx([0.4, 0.3, 0.2]) and chest.quat == pytest.approx([0, 0, 0, 1])
    assert np.array_equal(restored.data.qpos, states[1, : len(before)])
    restored.data.qpos[:] = before
    for row in (2, -1):
        with pytest.raises(RequestError, match="0 to 1"):
            set_scene(env, f"{path}.npz", row)
    write_states(path, states, there, "close_the_chest")  # of a task with the same things
    with pytest.raises(RequestError, match=r"states of close_the_chest\n.*task, open_the_chest"):
        set_scene(env, f"{path}.npz", 1)
    assert np.array_equal(restored.data.qpos, before)
    write_states(path, states, {"stove": np.zeros(7)}, "open_the_chest")  # of another form
    chest = {"fixture chest": np.zeros(7)}
    for change in ({}, {"states": states}, {"states": states[:, 1:], **chest}, {"more": 1, "states": states, **chest}):
        if change:
            np.savez(f"{path}.npz", **change)
        with pytest.raises(RequestError, match="states with fixtures of this task"):
            set_scene(env, f"{path}.npz", 0)


def test_what_a_region_leaves_of_a_fixtures_floor(restored):
    """The chest stands at (0.3, 0.1): its region goes 1 and 2 cm to the left and 3 cm to the right, 2 cm up."""
    task = object.__new__(_Task)
    task.live, task.origin = restored, (0.1, 0.0, 0.82)
    task.facts = [("on", "chest", "corner"), ("on", "can", "corner"), ("open", "chest_top")]
    ranges = [[0.19, 0.1, 0.23, 0.12], [0.18, 0.1, 0.2, 0.11]]
    task.problem = {"regions": {"corner": {"ranges": ranges, "yaw_rotation": [-0.1, 0.1]}}}
    task.zones = {"corner": (0.19, 0.1, 0.23, 0.12)}
    task.ends = task._ends()
    ends = task.ends["chest"]
    assert list(task.ends) == ["chest"] and ends.shape == (8, 7) and (ends[:, 2] == 0.82).all()
    assert {tuple(one) for one in ends[:, :2].round(9).tolist()} == {(x, y) for x in (0.28, 0.33) for y in (0.1, 0.12)}
    assert sorted({round(float(heading_of(one[3:])), 9) for one in ends}) == [-0.1, 0.1]
    box = (0.2, 0.0, 0.4, 0.2)  # of the chest, where it stands
    assert task._everywhere(box, "chest") == pytest.approx((0.23, 0.02, 0.38, 0.2))
    assert task._everywhere(box, "chest", 0.005) == pytest.approx((0.225, 0.015, 0.385, 0.2))
    assert task._everywhere((0.29, 0.0, 0.31, 0.2), "chest") == pytest.approx((0.3045, 0.02, 0.3055, 0.2))
    task.ends = {}
    assert task._everywhere(box, "chest", 0.005) == pytest.approx(box)


def test_the_spec_of_an_environment_of_robosuites_kind(table):
    made = spec_of(table, "task: x(can) <= 0 m")
    assert made.spec.objects == ("can",) and made.spec.labels == ("task",)
    assert made.spec.workspace.x == pytest.approx((-0.2, 0.2)) and made.origin == pytest.approx((0.1, 0, 0.82))
    assert made.spec.checked.shapes[0].height == pytest.approx(0.06, abs=1e-3)  # it lies
    with pytest.raises(RequestError) as error:
        spec_of(SimpleNamespace(**{**vars(table), "placement_initializer": None}))
    assert error.value.diagnostics[0].code == "wrong-value"


def test_files_of_a_task(tmp_path):
    task = LiberoTask("suite", "task", tmp_path / "task.bddl")
    job = StatesJob(tmp_path / "home", ("goal=0:",), n=2)
    spec = SimpleNamespace(text="goal: x(mug) <= 0 m\n", live=SimpleNamespace(fixed={}, task="task"))
    one = {"goal": np.array([0.1, 0.2])}
    made = SettledStates(np.arange(6.0).reshape(2, 3), one, one, np.zeros(2), spec, 3, 2, 2, {"falls": 1})
    report = job.write(task, made)
    assert job(task) == "2 states of 3 scenes, phi of goal 0.1 to 0.2; left out: falls (1)"  # it is there
    files = sorted(str(one.relative_to(tmp_path / "home")) for one in (tmp_path / "home").rglob("*.*"))
    assert files == [
        *("init_files/suite/task.pruned_init", "init_files/suite/task.pruned_init.npz"),
        *("reports/suite/task.json", "specs/suite/task.spec"),
    ]
    with np.load(tmp_path / "home" / files[1], allow_pickle=False) as read:
        assert np.array_equal(read["states"], made.states) and read["states"].dtype == np.float64
    assert job.load_report(task) == report
    assert StatesJob(tmp_path / "home", ("goal=0:",), n=3).load_report(task) is None
    short = StatesJob(tmp_path / "home", ("goal=0:",), n=3)
    short.write(task, made)
    with pytest.raises(RequestError) as error:
        short(task)
    assert error.value.diagnostics[0].facts["found"] == 2
    assert json.loads((tmp_path / "home" / files[2]).read_text())["refused"] == {"falls": 1}


def test_without_libero_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setattr("scenegen.needs.is_installed", lambda package: False)
    with pytest.raises(RequestError) as error:
        tasks_of("libero_spatial")
    assert error.value.diagnostics[0].code == "not-installed"
