"""Placement in robosuite's own environments: 1,000 resets each, and phi where the simulator says that things are."""

import logging
import math
import time

import numpy as np
import pytest

import scenegen
from scenegen.libero import init_states, spec_of
from scenegen.robosuite import Placement

pytestmark = pytest.mark.robosuite

STACK = """
workspace [-0.15, 0.15] x [-0.15, 0.15]
object cubeA = box(4 cm, 4 cm, 4 cm), cubeB = box(5 cm, 5 cm, 5 cm)
require noOverlap()
task: closeTo(cubeA, cubeB, 12 cm) & leftOf(cubeA, cubeB)
"""
PICK_PLACE = """
workspace [-0.17, 0.17] x [-0.12, 0.12]
object Milk = box(4 cm, 4 cm, 14 cm), Bread = box(5 cm, 4 cm, 5 cm), Cereal = box(10 cm, 3 cm, 15 cm)
object Can = cylinder(2.7 cm, 8 cm)
require noOverlap()
task: closeTo(Milk, Can, 12 cm) & farFrom(Bread, Can, 10 cm)
"""
NUTS = """
workspace [-0.25, 0.25] x [-0.2, 0.05]
object SquareNut = box(16 cm, 9 cm, 2 cm), RoundNut = box(18 cm, 11 cm, 2 cm)
require noOverlap()
task: closeTo(SquareNut, RoundNut, 20 cm) & leftOf(SquareNut, RoundNut)
"""
# the name of the environment, its spec, what is its table, and how high above it robosuite's own samplers put things
ENVIRONMENTS = [
    ("Stack", STACK, "table_offset", 0.01),
    ("PickPlace", PICK_PLACE, "bin1_pos", 0.0),
    ("NutAssembly", NUTS, "table_offset", 0.02),
]
RESETS, LOW, HIGH = 1000, -0.1, 0.0
SETTLED = 0.005  # metres


@pytest.fixture
def make():
    suite = pytest.importorskip("robosuite", reason="needs robosuite: make test-robosuite installs it")
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)

    def made(name, **settings):
        quiet = {"has_renderer": False, "has_offscreen_renderer": False, "use_camera_obs": False}
        return suite.make(name, robots="Panda", **quiet, **settings)

    return made


def settle(env, seconds=1.0):
    """Physics for a while; the arm is held, so that only the objects move."""
    import mujoco

    model, data = env.sim.model._model, env.sim.data._data
    jointed = np.flatnonzero(model.jnt_type != mujoco.mjtJoint.mjJNT_FREE)
    places, speeds = model.jnt_qposadr[jointed], model.jnt_dofadr[jointed]
    held = data.qpos[places].copy()
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        data.qpos[places], data.qvel[speeds] = held, 0.0
    mujoco.mj_forward(model, data)


@pytest.mark.parametrize(("name", "text", "table", "above"), ENVIRONMENTS, ids=[one[0] for one in ENVIRONMENTS])
def test_a_thousand_resets(make, name, text, table, above):
    env = make(name, hard_reset=False)
    here = Placement(
        scenegen.parse(text), (LOW, HIGH), reference_pos=getattr(env, table), turn=-math.pi / 2, z_offset=above, seed=1
    )
    here.use_in(env)
    spent, plain = [], here.sample

    def timed():
        begin = time.process_time()
        placed = plain()
        spent.append(time.process_time() - begin)
        return placed

    here.sample = timed
    at_once, settled, seen = [], [], set()
    for _ in range(RESETS):
        env.reset()
        wanted = here.phi["task"]
        assert LOW <= wanted <= HIGH
        seen.add(wanted)
        at_once.append(abs(here.phi_in(env.sim)["task"] - wanted))
        settle(env)
        settled.append(abs(here.phi_in(env.sim)["task"] - wanted))
    milliseconds = 1e3 * np.array(spent)
    print(f"{name}: {len(seen)} starts; phi off by at most {max(at_once):.1e} at reset")
    print(f"after settling: {np.median(settled):.1e} (median), {max(settled):.1e} (most)")
    print(f"placement: {milliseconds.mean():.2f} ms (mean), {np.median(milliseconds):.2f} (median)")
    assert len(seen) == RESETS
    assert max(at_once) < 1e-9
    assert max(settled) < SETTLED
    assert milliseconds.mean() < 2.0


@pytest.mark.parametrize(("name", "text", "table", "above"), ENVIRONMENTS, ids=[one[0] for one in ENVIRONMENTS])
def test_hard_resets_make_new_models(make, name, text, table, above):
    env = make(name, hard_reset=True)
    here = Placement(scenegen.parse(text), (LOW, HIGH), reference_pos=getattr(env, table), z_offset=above)
    here.use_in(env)
    for _ in range(3):
        env.reset()
        assert here.phi_in(env.sim)["task"] == pytest.approx(here.phi["task"], abs=1e-9)


def test_as_an_argument(make):
    here = Placement(scenegen.parse(STACK), (0.0, None), reference_pos=(0.0, 0.0, 0.8), z_offset=0.01)
    env = make("Stack", placement_initializer=here)
    env.reset()
    assert here.phi_in(env.sim)["task"] == pytest.approx(here.phi["task"], abs=1e-9)
    assert here.phi["task"] >= 0.0


def test_objects_that_the_spec_does_not_have_are_placed_by_robosuite(make):
    env = make("PickPlace", hard_reset=False)
    spec = scenegen.parse("workspace [-0.1, 0.1] x [-0.1, 0.1]\nobject Milk, Can\ntask: closeTo(Milk, Can, 12 cm)\n")
    here = Placement(spec, (0.0, None), reference_pos=env.bin1_pos)
    here.use_in(env)
    for _ in range(5):
        placed = here.sample()
        assert set(placed) == {one.name for one in here.mujoco_objects} and len(placed) == 8
        assert math.dist(placed["Milk"][0][:2], placed["Can"][0][:2]) <= 0.12


@pytest.mark.parametrize(
    ("name", "goal", "sizes"),
    [
        ("Stack", "closeTo(cubeA, cubeB, 12 cm)", {"cubeA": 0.04, "cubeB": 0.05}),
        ("PickPlace", "closeTo(Milk, Can, 12 cm)", {"Milk": 0.144, "Can": 0.08}),
        ("NutAssembly", "closeTo(SquareNut, RoundNut, 20 cm)", {"SquareNut": 0.02}),
    ],
)
def test_specs_of_environments_have_their_sizes_and_states_come_to_rest(make, name, goal, sizes):
    env = make(name)
    env.reset()
    own = spec_of(env, f"goal: {goal}")
    heights = {one: shape.height for one, shape in zip(own.spec.objects, own.spec.checked.shapes, strict=True)}
    assert all(heights[one] == pytest.approx(height, abs=1e-3) for one, height in sizes.items())
    made = init_states(env, {"goal": (-0.1, -0.001)}, 5, spec=own, accept=lambda: False, seed=2)
    assert len(made.states) == 5 and made.moved.max() < 0.01
    assert np.abs(made.read["goal"] - made.phi["goal"]).max() < SETTLED
    here = Placement(own.spec, (-0.1, 0), reference_pos=own.origin)
    here.use_in(env)
    env.reset()
    assert here.phi_in(env.sim)["goal"] == pytest.approx(here.phi["goal"], abs=1e-9)
