"""Scenes in MuJoCo: where their objects come to rest. The only module that imports mujoco."""

from __future__ import annotations

import math

import mujoco

from scenegen.geometry.workspace import Floats, standing
from scenegen.worlds.physics.bodies import NEAR, TABLE, Contact, gathered


class MujocoWorld:
    """Drops scenes of one model: an infinite table, then the objects as bodies 1 to N (see `export.mjcf.bench`)."""

    def __init__(self, model: str) -> None:
        self._model = mujoco.MjModel.from_xml_string(model)
        self._data = mujoco.MjData(self._model)
        self._fixed = [body for body in range(1, self._model.nbody) if not self._model.body_jntnum[body]]
        self._joints = [
            (body - 1, self._model.jnt_qposadr[self._model.body_jntadr[body]])
            for body in range(1, self._model.nbody)
            if self._model.body_jntnum[body]
        ]

    def rest(self, places: Floats, seconds: float) -> tuple[Floats, tuple[Contact, ...]]:
        """Where the objects are after a time, (objects, 7): place and quaternion, w first; and what touched before.

        `places` (objects, 4) are x, y, theta and the height of what the object stands on; the time is rounded up to
        steps.
        """
        model, data = self._model, self._data
        poses = standing(places)
        mujoco.mj_resetData(model, data)
        for body in self._fixed:
            model.body_pos[body], model.body_quat[body] = poses[body - 1, :3], poses[body - 1, 3:]
        for which, start in self._joints:
            data.qpos[start : start + 7] = poses[which]
        contacts = self._contacts()
        mujoco.mj_step(model, data, math.ceil(seconds / model.opt.timestep - 1e-9))
        for which, start in self._joints:
            poses[which] = data.qpos[start : start + 7]
        return poses, contacts

    def _contacts(self) -> tuple[Contact, ...]:
        """What touches where the objects are. MuJoCo finds what is within its margin, which is 0 when it simulates."""
        model, data = self._model, self._data
        model.geom_margin[:] = NEAR
        model.body_margin[:] = NEAR
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        model.geom_margin[:] = 0.0
        model.body_margin[:] = 0.0
        pairs = model.geom_bodyid[data.contact.geom].reshape(-1, 2) - 1  # the table is body 0
        assert TABLE == -1
        return gathered(
            (int(a), int(b), float(apart)) for (a, b), apart in zip(pairs, data.contact.dist.ravel(), strict=True)
        )
