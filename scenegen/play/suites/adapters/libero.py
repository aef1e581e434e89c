"""A task of LIBERO, judged by LIBERO's own `check_success`: the world `libero`, or `libero-pictures`.

The name of the suite's task is that of LIBERO's task. If its spec is that of the environment (`scenegen libero` writes
it), things are put where the start has them, and settle. Else the start in row k of the task's scenes begins from row k
of its init states, which are found as LIBERO finds them: LIBERO_CONFIG_PATH says where.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.play.frame import TableFrame
from scenegen.play.libero.files import libero_paths, make_environment, tasks_of
from scenegen.play.libero.init_files import read_states
from scenegen.play.libero.spec import spec_of
from scenegen.play.libero.states import settled_scenes
from scenegen.play.suites.adapters.arms import ArmWorld, Begun
from scenegen.validation import as_point

if TYPE_CHECKING:
    from scenegen.play.suites.suite import GradedStart, SuiteTask

LIBERO_HORIZON, SETTLE_STEPS = 600, 10  # steps of an episode; steps in which things settle first
LIBERO_SEED = 0  # of what LIBERO draws itself


def make(task: SuiteTask, pictures: bool = False) -> ArmWorld:
    """Raises RequestError where LIBERO is missing or has no such task, and for starts beyond the init states."""
    found = tasks_of(task.name)[0]
    folder = Path(libero_paths()["init_states"]) / found.suite
    env = make_environment(found, LIBERO_SEED, pictures=pictures)
    models = dict(env.env.objects_dict)
    own = spec_of(env)
    settled = settled_scenes(env, own) if set(task.spec.objects) == set(own.spec.objects) else None
    states = read_states(folder / f"{task.name}.pruned_init") if settled is None else np.empty((0, 0))

    def begin(start: GradedStart) -> Begun:
        if settled is None and start.row >= len(states):
            wanted = f"fewer than the {len(states)} init states in {folder}"
            raise RequestError(OUT_OF_RANGE(argument="start", value=start.row, wanted=wanted))
        env.seed(LIBERO_SEED)  # what LIBERO draws itself, such as the places of fixtures, is the same each time
        env.reset()
        env.set_init_state(states[start.row] if settled is None else settled(start.poses))
        env.robots[0].gripper.current_action[:] = 0.0  # which robosuite 1.4 keeps from the last episode
        for _ in range(SETTLE_STEPS):
            own = env.step([0.0] * 6 + [-1.0])[0]
        return tuple(models), standing(env.sim, models, frame), own

    frame = TableFrame(as_point("workspace_offset", env.env.workspace_offset))
    return ArmWorld(task, env, frame, models, begin, lambda world: bool(env.check_success()), LIBERO_HORIZON)


def seeing(task: SuiteTask) -> ArmWorld:
    """The same with the pictures of LIBERO's cameras in observations. It needs a GPU, or MUJOCO_GL=osmesa."""
    return make(task, pictures=True)


def standing(sim: Any, models: dict[str, Any], frame: TableFrame) -> Array:
    """(N, 7): where bodies' origins are in the frame, upright, each with the heading nearest to its attitude."""
    found = np.zeros((len(models), 7))
    for row, model in zip(found, models.values(), strict=True):
        body = sim.model.body_name2id(model.root_body)
        x, y, heading = frame.pose(sim.data.body_xpos[body], sim.data.body_xquat[body])
        height = sim.data.body_xpos[body][2] - frame.origin[2]
        row[:] = x, y, height, np.cos(heading / 2.0), 0.0, 0.0, np.sin(heading / 2.0)
    return found
