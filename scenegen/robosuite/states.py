"""Start states for evaluation: what LIBERO reads as its init states.

A state is what robosuite's `sim.get_state().flatten()` gives: the time, then qpos, then qvel. LIBERO keeps an array
(n, D) of them for each task, in float64, in a file of `torch.save`; its evaluation takes row i for episode i.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.placing import OBJECT_WITHOUT_JOINT
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.formats.files import whole_file
from scenegen.needs import need
from scenegen.robosuite.placement import Placement
from scenegen.validation import as_int, as_path

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class InitStates:
    """`states` (n, D), and phi of each by label, (n,): as the scene was verified to have it, and read back from the
    simulation with the state set."""

    states: Array
    phi: Mapping[str, Array]
    read: Mapping[str, Array]

    def save(self, path: str | Path) -> Path:
        """Write the states as LIBERO has them (`TASK.pruned_init`); the file appears whole or not at all. Raises
        OutputError, and RequestError where torch is not installed."""
        need("torch", "to write init states")
        import torch

        path = as_path("path", path)
        with whole_file(path) as file:
            torch.save(self.states, file)
        return path


def init_states(env: Any, placement: Placement, n: int) -> InitStates:
    """n states of an environment of robosuite or LIBERO, with the objects where the placement wants them.

    The environment is reset once; what the placement does not place stays as it is then. Give the placement the
    environment's objects: for LIBERO, mujoco_objects=list(env.env.objects_dict.values()). Raises RequestError, also for
    an object of the spec that has no free joint.
    """
    n = as_int("n", n)
    if n < 1:
        raise RequestError(OUT_OF_RANGE(argument="n", value=n, wanted="1 or more"))
    env.reset()
    sim = env.sim
    begun = sim.get_state()
    states, phi, read = [], [], []
    for _ in range(n):
        sim.set_state(begun)
        for at, quaternion, model in placement.sample().values():
            joints = list(model.joints)
            if joints:
                sim.data.set_joint_qpos(joints[0], np.concatenate([at, quaternion]))
                sim.data.set_joint_qvel(joints[0], np.zeros(6))
            elif model.name in placement.names.values():
                raise RequestError(OBJECT_WITHOUT_JOINT(name=model.name))
        sim.forward()
        states.append(sim.get_state().flatten())
        phi.append(placement.phi)
        read.append(placement.phi_in(sim))
    return InitStates(np.array(states, dtype=np.float64), _columns(phi), _columns(read))


def _columns(rows: list[dict[str, float]]) -> dict[str, Array]:
    return {label: np.array([row[label] for row in rows]) for label in rows[0]}
