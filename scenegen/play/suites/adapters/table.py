"""Any spec of boxes and cylinders as a robosuite table-top environment with a Panda: the world `table`.

An episode succeeds when the hand has let go, all objects are at rest, and phi of the task's success label, read back
from the simulation, is 0 or more. Physics is cheap: no pictures, none of robosuite's sensors, ten actions a second.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE
from scenegen.geometry import Box, Circle
from scenegen.needs import need
from scenegen.play.frame import TableFrame
from scenegen.play.robosuite import Placement
from scenegen.play.suites.adapters.arms import ArmWorld, Begun
from scenegen.sampling.grasps import robots_of
from scenegen.things.bodies import DENSITY

if TYPE_CHECKING:
    from scenegen.play.suites.suite import GradedStart, SuiteTask

TABLE_HEIGHT = 0.8  # metres: the height of robosuite's tables
TABLE_TURN = -math.pi / 2.0  # the robot looks along the spec's y axis
SOLREF = [0.02, 1.0]  # MuJoCo's own; robosuite's cylinders are springs that never come to rest
DAMPING = "0.002"  # N m s, of what turns: MuJoCo's cylinders stand on few points, and rock for long
ACTIONS_PER_SECOND, TABLE_HORIZON = 10.0, 200  # actions of an episode
PHYSICS_STEP = 0.004  # seconds
ROBOT_TOLERANCE = 0.01  # metres and radians by which a spec's robot may be off the world's
TORQUE_STEPS = 4  # steps of physics for which the controller's torques stay: it is most of the work


def make(task: SuiteTask) -> ArmWorld:
    """Raises RequestError for objects that are neither boxes nor cylinders, for robots elsewhere than the Panda is, and
    where robosuite is missing."""
    solids, (frame, size) = solids_of(task.spec), table_of(task.spec)
    need("robosuite", "for the world of a table")
    from robosuite.models.objects import BoxObject, CylinderObject

    fixed = {task.spec.objects[which] for which in task.spec.checked.fixed}
    free = [{"type": "free", "damping": DAMPING}]
    models = {
        name: (CylinderObject if len(half) == 2 else BoxObject)(
            name, half, density=DENSITY, solref=SOLREF, joints=None if name in fixed else free
        )
        for name, half in solids.items()
    }
    given: Any = SimpleNamespace(start=None, take=lambda: given.start)  # the start that the next reset is to have
    placement = Placement(
        task.spec, given, reference_pos=frame.origin, turn=TABLE_TURN, mujoco_objects=list(models.values())
    )
    env = _environment(models, placement, given, size)
    _check_robots(task.spec, frame, env)

    def begin(start: GradedStart) -> Begun:
        given.start = start
        env.reset()
        return start.objects, start.poses, {}

    def judge(world: ArmWorld) -> bool:
        return world.at_rest() and placement.phi_in(env.sim)[task.success] >= 0.0 and world.let_go()

    return ArmWorld(task, env, frame, models, begin, judge, TABLE_HORIZON)


def solids_of(spec: Spec) -> dict[str, list[float]]:
    """Half the sizes of each object but robots: of a box three, of a cylinder radius and half its height. Raises
    RequestError."""
    found, robots = {}, robots_of(spec.checked)
    for name, shape in zip(spec.objects, spec.checked.shapes, strict=True):
        footprint = shape.footprint
        if name in robots:
            continue
        if isinstance(footprint, Circle) and shape.asset == "cylinder":
            found[name] = [footprint.radius, shape.height / 2.0]
        elif isinstance(footprint, Box) and shape.asset in ("box", "block"):
            found[name] = [*(side / 2.0 for side in footprint.extent), shape.height / 2.0]
        else:
            wanted = "a box or a cylinder: other shapes are not in this world"
            raise RequestError(WRONG_VALUE(argument=name, value=f"of the shape `{shape.asset}`", wanted=wanted))
    stands = [(spec.objects[which], one.name) for which, one in spec.checked.supports.items()]
    stands += [(spec.objects[which], one.name) for which, some in spec.checked.choices.items() for one in some.options]
    used = {surface for name, surface in stands if name not in robots}
    mounts = {surface for name, surface in stands if name in robots} - used
    for board in (one for one in spec.checked.regions if one.height and one.name not in mounts):
        raise RequestError(WRONG_VALUE(argument=board.name, value="a board", wanted="no height: there are none here"))
    return found


def _check_robots(spec: Spec, frame: TableFrame, env: Any) -> None:
    """Raises RequestError for a robot of the spec that is not the world's own, or not where that is."""
    body = env.sim.model.body_name2id(env.robots[0].robot_model.root_body)
    at = env.sim.data.body_xpos[body]
    own = *frame.pose(at, env.sim.data.body_xquat[body]), float(at[2]) - frame.origin[2]
    heights = spec.checked.heights or (0.0,) * len(spec.objects)
    for which, shape in enumerate(spec.checked.shapes):
        if shape.arm is None:
            continue
        here = *spec.checked.fixed.get(which, (math.inf,) * 3), heights[which]
        if shape.arm.name != "panda" or not np.allclose(np.array(here, dtype=np.float64), own, atol=ROBOT_TOLERANCE):
            x, y, z = (round(one, 3) + 0.0 for one in (own[0], own[1], own[3]))
            wanted = f"the place of this world's panda: at ({x:g}, {y:g}, {math.degrees(own[2]):.3g} deg), {z:g} m high"
            raise RequestError(
                WRONG_VALUE(argument=spec.objects[which], value="another robot, or elsewhere", wanted=wanted)
            )


def table_of(spec: Spec) -> tuple[TableFrame, tuple[float, float, float]]:
    """The spec's frame, with the middle of its workspace over the middle of the table, and the table's size along the
    world's x, y and z."""
    (left, right), (near, far) = spec.checked.workspace.x, spec.checked.workspace.y
    x, y = TableFrame((0.0, 0.0, 0.0), TABLE_TURN).place([(left + right) / 2, (near + far) / 2, 0, 1, 0, 0, 0])[0][:2]
    size = max(0.8, far - near + 0.2), max(0.8, right - left + 0.2), 0.05
    return TableFrame((-x, -y, TABLE_HEIGHT), TABLE_TURN), size


def _environment(models: dict[str, Any], placement: Placement, given: Any, size: tuple[float, float, float]) -> Any:
    from mujoco import mjtEnableBit
    from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
    from robosuite.models.arenas import TableArena
    from robosuite.models.tasks import ManipulationTask

    class SpecTable(ManipulationEnv):  # type: ignore[misc]
        substep = 0

        def _load_model(self) -> None:
            super()._load_model()
            robot = self.robots[0].robot_model
            robot.set_base_xpos(robot.base_xpos_offset["table"](size[0]))
            arena = TableArena(table_full_size=size, table_offset=(0.0, 0.0, TABLE_HEIGHT))
            arena.set_origin([0.0, 0.0, 0.0])
            self.model = ManipulationTask(arena, [robot], list(models.values()))

        def initialize_time(self, control_freq: float) -> None:
            super().initialize_time(control_freq)
            self.model_timestep = self.sim.model.opt.timestep = PHYSICS_STEP
            self.sim.model.opt.enableflags |= mjtEnableBit.mjENBL_MULTICCD  # else cylinders wobble on one contact

        def _pre_action(self, action: Any, policy_step: bool = False) -> None:
            self.substep = 0 if policy_step else self.substep + 1
            if self.substep % TORQUE_STEPS == 0:
                super()._pre_action(action, policy_step)

        def _setup_observables(self) -> dict[str, Any]:
            return {}

        def _reset_internal(self) -> None:
            super()._reset_internal()
            if given.start is None:  # while the environment is made
                return
            for at, quaternion, model in placement.sample().values():
                if model.joints:
                    self.sim.data.set_joint_qpos(model.joints[0], np.concatenate([at, quaternion]))
                else:
                    body = self.sim.model.body_name2id(model.root_body)
                    self.sim.model.body_pos[body], self.sim.model.body_quat[body] = at, quaternion

        def reward(self, action: Any) -> float:
            return 0.0

    return SpecTable(
        "Panda", initialization_noise=None, control_freq=ACTIONS_PER_SECOND, ignore_done=True, hard_reset=False,
        use_camera_obs=False, has_renderer=False, has_offscreen_renderer=False, renderer="mujoco",
    )  # fmt: skip
