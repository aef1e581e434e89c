"""A simulated arm that starts from our scenes: panda-gym pushes a block into a dock (`pip install ".[robots]"`).

    python examples/07_robot.py [SCENES.json [PICTURE.png]]

The recipe for a simulator of one's own has three parts: `reset` puts a scene's objects into the world, the poses that
the simulator reports go back into phi, and phi says how well the task is solved. Without a file, scenes are drawn.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import torch
from numpy.typing import NDArray
from panda_gym.envs.core import RobotTaskEnv, Task
from panda_gym.envs.robots.panda import Panda
from panda_gym.pybullet import PyBullet
from PIL import Image

import scenegen

# metres, in the arm's own frame: its base stands at x = -0.6
SPEC = scenegen.parse("""
    workspace [-0.15, 0.15] x [-0.2, 0.2]
    object block = box(0.05, 0.05, 0.05)
    object mug
    region dock = rect(-0.15, 0.1, 0.15, 0.2)
    require noOverlap() & !closeTo(mug, block, 0.12)
    task: aboveOf(block, dock.bottom)
""")
Array = NDArray[Any]


class ReachPhi(Task):
    """Solved where the spec is: what is achieved is phi, what is desired is 0, for learners that know goals."""

    def __init__(self, sim: PyBullet, scenes: scenegen.SceneSet) -> None:
        super().__init__(sim)
        self.scenes, self.turn = scenes, 0
        self.bodies: dict[str, int] = {}
        self.phi = SPEC.robustness()
        self.goal = np.zeros(1)
        sim.create_plane(z_offset=-0.4)
        sim.create_table(length=1.1, width=0.7, height=0.4, x_offset=-0.3)

    def reset(self) -> None:
        """Part one: the old objects go, those of the next scene come."""
        client = self.sim.physics_client
        for body in self.bodies.values():
            client.removeBody(body)
        self.bodies = scenegen.load_pybullet(self.scenes[self.turn % len(self.scenes)], client, table=False)
        self.turn += 1

    def get_obs(self) -> Array:
        """Part two: x, y and heading of each object. PyBullet speaks of centres of mass, phi of footprints."""
        client, rows = self.sim.physics_client, []
        for body in self.bodies.values():
            where, turn = client.getBasePositionAndOrientation(body)
            frame = client.invertTransform(*client.getDynamicsInfo(body, -1)[3:5])
            where, turn = client.multiplyTransforms(where, turn, *frame)
            rows += [*where[:2], pybullet.getEulerFromQuaternion(turn)[2]]
        return np.array(rows)

    def get_achieved_goal(self) -> Array:
        """Part three: phi."""
        return self.phi(torch.from_numpy(self.get_obs()).reshape(1, -1, 3)).numpy().reshape(1)

    def is_success(self, achieved_goal: Array, desired_goal: Array, info: object = None) -> Any:
        return (achieved_goal >= desired_goal)[..., 0]

    def compute_reward(self, achieved_goal: Array, desired_goal: Array, info: object = None) -> Any:
        return np.minimum(achieved_goal - desired_goal, 0.0)[..., 0]


class PandaScenes(RobotTaskEnv):
    """Each reset takes the next scene, or that of `options={"scene": 3}`."""

    def __init__(self, scenes: scenegen.SceneSet) -> None:
        sim = PyBullet(render_mode="rgb_array")
        robot = Panda(sim, block_gripper=True, base_position=np.array([-0.6, 0.0, 0.0]))
        super().__init__(robot, ReachPhi(sim, scenes))

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        if options and "scene" in options:
            self.task.turn = int(options["scene"])
        return super().reset(seed=seed or 0)  # panda-gym would take one from the system


def push(tip: Array, block: Array, behind: Array) -> Array:
    """An action that takes the gripper over the place behind the block, down, and then away from the viewer."""
    if tip[2] > 0.05 and abs(tip[:2] - behind).max() > 0.02:
        goal = np.array([*behind, 0.12])
    elif tip[2] > 0.03:
        goal = np.array([*behind, 0.01])
    else:
        goal = np.array([block[0], tip[1] + 0.03, 0.02])
    return np.clip((goal - tip) / 0.08, -1.0, 1.0).astype(np.float32)


def run(file: Path, picture: Path | None) -> None:
    env = PandaScenes(scenegen.read_scenes(file))
    for _ in range(3):
        seen, _ = env.reset()
        behind, before = seen["observation"][6:8] - [0.0, 0.08], seen["achieved_goal"][0]
        steps, done = 0, False
        while not done and steps < 100:
            seen, _, done, _, _ = env.step(push(seen["observation"][:3], seen["observation"][6:8], behind))
            steps += 1
        print(f"phi {before:+.3f}, after {steps} steps {seen['achieved_goal'][0]:+.3f}", flush=True)
    shown = env.render()
    print(f"a picture of {shown.shape[1]} x {shown.shape[0]} pixels")
    if picture:
        Image.fromarray(shown[..., :3]).save(picture)
    env.close()


if len(sys.argv) > 1:
    run(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
else:
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, "scenes.json")
        scenegen.sample(SPEC, phi={"task": (-0.12, -0.04)}, n=3, seed=4).save(made)
        run(made, None)
