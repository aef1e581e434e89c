"""An environment for a spec over time: rewards sum up to phi of the motion, and a curriculum chooses the starts."""

import gymnasium
import numpy as np

import scenegen
from scenegen.curriculum import Curriculum
from scenegen.play.strategies import strategy

spec = scenegen.parse("""
object mug
time 6 steps
require speed(mug) <= 20 cm/s
task: (eventually closeTo(mug, (0.3, 0.5), 10 cm)) & (finally closeTo(mug, (0.7, 0.5), 10 cm))
""")
motions = scenegen.sample_motions(spec, phi=(-0.3, 0.05), n=200, seed=0)
env = gymnasium.make("scenegen.curriculum:scenegen/Motion-v0", spec=spec, source=motions, phi=(None, None))
print("actions:", env.unwrapped.moves.names, " observations:", env.unwrapped.names)
env = Curriculum(env, strategy("self_paced", env.unwrapped.space, np.random.default_rng(0)))

# a hand-written policy: to the first place, and when that was near enough to the second
ACTIONS = {name: number for number, name in enumerate(env.unwrapped.moves.names)}
seen, info = env.reset(seed=0)
for _ in range(3):
    over, total, been = False, 0.0, False
    while not over:
        x, y, _ = env.unwrapped.motion[-1, 0]
        been = been or np.hypot(x - 0.3, y - 0.5) <= 0.1
        away = np.array([(0.7 if been else 0.3) - x, 0.5 - y])
        axis = int(np.abs(away).argmax())
        action = "wait" if abs(away[axis]) < 0.1 else f"mug {'xy'[axis]} {'+' if away[axis] > 0 else '-'}"
        seen, reward, over, _, info = env.step(ACTIONS[action])
        total += reward
    print(f"from a motion of phi {info['start']['task']:+.3f}: rewards {total:+.3f}, phi {info['phi']['task']:+.3f}")
    env.reset()
