"""robosuite's environments, 1.4 and 1.5, and so LIBERO's, with the calls of a Gymnasium environment.

What a policy sees is in the spec's frame: an object's pose in an observation is what `SceneSet.poses7` calls it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE
from scenegen.play.frame import TableFrame, inverse, rotate, times

if TYPE_CHECKING:
    from scenegen.play.suites.suite import GradedStart, SuiteTask

Begun: TypeAlias = tuple[Sequence[str], Array, Mapping[str, Any]]
REST_SPEEDS = 0.01, 0.1  # m/s and rad/s below which an object is at rest
HEIGHT_TOLERANCE, LEAN_TOLERANCE = 0.01, 0.2  # metres and radians by which an object may be off the start's


class ArmWorld:
    """An arm at a table. `task` and `frame`, the spec's frame in the world, are there for policies that look ahead.

    `begin` puts a start into the environment, and gives names and poses of the objects as they then are, and the
    environment's own observation; `judge` says whether the task is done; `models` has robosuite's model of each object
    that is a body of its own. An episode ends with success, or after `horizon` steps.

    Observations: `names` (N), `objects` (N, 7) and `hand` (7,) as x, y, z, qw, qx, qy, qz in the spec's frame,
    `fingers` (2,) in metres, `joints` (7,) in radians, `turn`, the angle from the robot's x axis to the spec's, and
    what the environment itself observes; the first one of a start with a grasp also its `goal` (N, 7) and `yaws` (N,),
    as a start has them. The hand's z axis points out of it, and the fingers close along its x axis.
    Actions: robosuite's OSC_POSE, seven numbers in [-1, 1] along the robot's axes.
    """

    def __init__(
        self,
        task: SuiteTask,
        env: Any,
        frame: TableFrame,
        models: Mapping[str, Any],
        begin: Callable[[GradedStart], Begun],
        judge: Callable[[ArmWorld], bool],
        horizon: int,
    ) -> None:
        self.task, self.env, self.frame, self.horizon = task, env, frame, horizon
        self._models, self._begin, self._judge = models, begin, judge
        self.names: tuple[str, ...] = ()
        self._poses, self._steps = np.empty((0, 7)), 0

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin the episode of `options["start"]`: the same start gives the same state, bit for bit. The seed is not
        used: nothing is drawn here. Raises RequestError without a start."""
        start = (options or {}).get("start")
        if start is None:
            raise RequestError(WRONG_VALUE(argument="options", value=repr(options), wanted='{"start": suite[i]}'))
        self._steps = 0
        names, poses, own = self._begin(start)
        self.names, self._poses = tuple(names), np.array(poses, dtype=np.float64)
        self._stand()
        if start.goal is not None:
            own = {**own, "goal": start.goal, "yaws": start.yaws}
        return self._observation(own), {"success": self._judge(self)}

    def step(self, action: npt.ArrayLike) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One control step, whatever the action: numbers beyond [-1, 1] count as the ends."""
        own = self.env.step(np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0))[0]
        self._steps += 1
        success = self._judge(self)
        return self._observation(own), float(success), success, self._steps >= self.horizon, {"success": success}

    def close(self) -> None:
        self.env.close()

    @property
    def action_space(self) -> Any:
        """A Box (7,) of Gymnasium."""
        from gymnasium.spaces import Box

        return Box(-1.0, 1.0, (7,))

    @property
    def sim(self) -> Any:
        return self.env.sim

    def objects(self) -> Array:
        """(N, 7): where the objects of the spec are, in its frame: where they began, moved as their bodies have moved.
        What is no body of its own is where it began."""
        found = self._poses.copy()
        for which, (foot, attitude) in self._feet.items():
            at, turned = self._body(which)
            found[which] = self._in_spec_frame(at + rotate(turned, foot), times(turned, attitude))
        return found

    def _stand(self) -> None:
        """Remember what each body's foot and attitude are to the body, as the start says where they are."""
        self._feet: dict[int, tuple[Array, Array]] = {}
        for which, name in enumerate(self.names):
            if name in self._models:
                at, turned = self._body(which)
                foot, attitude = self.frame.place(self._poses[which].tolist())
                self._feet[which] = rotate(inverse(turned), foot - at), times(inverse(turned), attitude)

    def _body(self, which: int) -> tuple[Array, Array]:
        body = self.sim.model.body_name2id(self._models[self.names[which]].root_body)
        return np.array(self.sim.data.body_xpos[body]), np.array(self.sim.data.body_xquat[body])

    def at_rest(self) -> bool:
        """Whether every object stands still, as upright and as high as in the start."""
        for model in self._models.values():
            for joint in model.joints:
                speed = np.asarray(self.sim.data.get_joint_qvel(joint))
                if np.linalg.norm(speed[:3]) > REST_SPEEDS[0] or np.linalg.norm(speed[3:]) > REST_SPEEDS[1]:
                    return False
        now = self.objects()
        level = np.abs(now[:, 2] - self._poses[:, 2]) < HEIGHT_TOLERANCE
        return bool(level.all() and (lean(now) < LEAN_TOLERANCE).all())

    def let_go(self) -> bool:
        """Whether the hand touches none of the objects."""
        things = [name for model in self._models.values() for name in model.contact_geoms]
        return not self.env.check_contact(_gripper(self.env), things)

    def _in_spec_frame(self, at: Array, quaternion: Array) -> Array:
        """A pose of the world in the spec's frame."""
        x, y, _ = self.frame.pose(at, quaternion)
        half = -0.5 * self.frame.turn
        return np.array(
            [x, y, at[2] - self.frame.origin[2], *times((np.cos(half), 0.0, 0.0, np.sin(half)), quaternion)]
        )

    def _observation(self, own: Mapping[str, Any]) -> dict[str, Any]:
        robot, data = self.env.robots[0], self.sim.data
        site = robot.eef_site_id["right"] if isinstance(robot.eef_site_id, Mapping) else robot.eef_site_id
        hand = times(data.body_xquat[self.sim.model.site_bodyid[site]], self.sim.model.site_quat[site])
        fingers = [data.get_joint_qpos(joint) for joint in _gripper(self.env).joints]
        return {
            **own,
            "names": self.names,
            "objects": self.objects(),
            "hand": self._in_spec_frame(data.site_xpos[site], hand),
            "fingers": np.array(fingers),
            "joints": np.array([data.qpos[k] for k in robot._ref_joint_pos_indexes]),
            "turn": self.frame.turn,
        }


def _gripper(env: Any) -> Any:
    gripper = env.robots[0].gripper
    return gripper["right"] if isinstance(gripper, Mapping) else gripper


def lean(poses: Array) -> Array:
    """(N,): by how many radians poses (N, 7) are off the vertical."""
    leaning: Array = np.arccos(np.clip(1.0 - 2.0 * (poses[:, 4] ** 2 + poses[:, 5] ** 2), -1.0, 1.0))
    return leaning
