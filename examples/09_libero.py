"""Start states of a LIBERO task, that miss its goal, in the form that LIBERO's evaluation reads.

    python examples/09_libero.py TASK.bddl OUT.pruned_init

Needs LIBERO (github.com/Lifelong-Robot-Learning/LIBERO) with its assets. Without it this only says so.
"""

import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import scenegen
from scenegen.robosuite import Placement, init_states
from scenegen.worlds.planning import import_problem

PHI = {"goal": (None, 0.0), "start": (0.0, None)}  # (-0.3, 0.0): at most 30 cm from the goal
STATES = 50  # LIBERO's number


def make(task: Path, out: Path) -> None:
    """Write the states."""
    from libero.libero.envs import OffScreenRenderEnv

    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "task.spec"
        text.write_text(import_problem(task).text)
        spec = scenegen.load(text)
    env = OffScreenRenderEnv(bddl_file_name=str(task), camera_heights=128, camera_widths=128)
    objects = [one for name, one in env.env.objects_dict.items() if name in spec.objects]
    start = Placement(spec, PHI, reference_pos=env.env.workspace_offset, mujoco_objects=objects, z_offset=0.01)
    made = init_states(env, start, STATES)
    print(f"{len(made.states)} states of {made.states.shape[1]} numbers: {made.save(out)}")
    show(env, out)


def show(env: object, path: Path) -> None:
    """What LIBERO's evaluation does with the file: row i is the start of episode i."""
    import torch

    states = torch.load(path, weights_only=False)  # torch from 2.6 on refuses arrays by default
    for state in states:
        env.reset()  # type: ignore[attr-defined]
        env.set_init_state(state)  # type: ignore[attr-defined]
        found = env.get_sim_state()  # type: ignore[attr-defined]
        assert np.array_equal(found[1:], state[1:]), "the simulation has another state"


if __name__ == "__main__":
    if find_spec("libero") is None:
        print("LIBERO is not installed: see github.com/Lifelong-Robot-Learning/LIBERO")
    elif len(sys.argv) != 3:
        sys.exit(__doc__)
    else:
        make(Path(sys.argv[1]), Path(sys.argv[2]))
