"""robosuite's Stack, started ever farther from the goal (`pip install "scenegen-dsl[robosuite]"`).

    python examples/08_robosuite.py

A strategy chooses phi of each start. No arm moves here: the episode succeeds if the cubes happen to start near enough.
"""

from importlib.util import find_spec

import numpy as np

import scenegen
from scenegen.play.strategies import strategy
from scenegen.robosuite import Placement, phi_space

SPEC = scenegen.parse("""
    workspace [-0.15, 0.15] x [-0.15, 0.15]
    object cubeA = box(4 cm, 4 cm, 4 cm), cubeB = box(5 cm, 5 cm, 5 cm)
    require noOverlap()
    task: closeTo(cubeA, cubeB, 12 cm)
""")
RESETS = 10


def main() -> None:
    if find_spec("robosuite") is None:
        print('robosuite is not installed: pip install "scenegen-dsl[robosuite]"')
        return
    import robosuite

    lessons = strategy("linear", phi_space(SPEC), np.random.default_rng(0), episodes=RESETS)
    start = Placement(SPEC, lessons, reference_pos=(0.0, 0.0, 0.8), z_offset=0.01)
    env = robosuite.make(
        "Stack",
        robots="Panda",
        placement_initializer=start,
        hard_reset=False,  # the same model for all episodes: sixty times faster
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
    )
    for episode in range(RESETS):
        env.reset()
        task, phi = start.start.task, start.phi_in(env.sim)["task"]
        print(f"episode {episode}: wanted phi {task.low[0]:.3f} to {task.high[0]:.3f}, the simulator has {phi:.3f}")
        start.report(success=phi > -0.05)


if __name__ == "__main__":
    main()
