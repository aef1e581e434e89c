"""A Gymnasium environment from a spec: start as hard as asked for, learn by doing."""

import gymnasium
import numpy as np

# "scenegen.curriculum:" has gymnasium import what makes the environment known
NAME = "scenegen.curriculum:scenegen/TableTop-v0"

env = gymnasium.make(NAME, spec="leftOf(mug, plate) & aboveOf(mug, plate)", move="mug")
print("actions:", env.unwrapped.moves.names, " observations:", env.unwrapped.views.names)

# one episode by a hand-written policy, from a scene that misses the goal by 30 to 40 cm
observation, info = env.reset(seed=0, options={"phi": (-0.4, -0.3)})
done, total = False, 0.0
while not done:
    mug_x, _, plate_x, _ = observation
    observation, reward, terminated, truncated, info = env.step(1 if mug_x > plate_x else 2)
    done, total = terminated or truncated, total + reward
print(f"reward {total:g}, phi {info['phi']['task']:+.3f}, success {info['is_success']}")

# 64 tables at once: how far do random moves get, by how hard the start was?
envs = gymnasium.make_vec(NAME, 64, spec=env.unwrapped.scenes, move="mug", autoreset_mode="SameStep")
for low, high in ((-0.1, 0.0), (-0.3, -0.2), (-0.5, -0.4)):
    envs.reset(seed=0, options={"phi": (low, high)})
    first = np.full(64, -1.0)  # how each table's first episode went
    while (first < 0).any():
        *_, infos = envs.step(envs.action_space.sample())
        ended = infos.get("_final_info", np.zeros(64, dtype=bool)) & (first < 0)
        if ended.any():
            first[ended] = infos["final_info"]["is_success"][ended]
    print(f"random moves from phi {low:+.1f} to {high:+.1f}: {first.mean():.0%} succeed")
