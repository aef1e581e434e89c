"""What resets and steps cost beside what a learner costs: microseconds of CPU time, and shares of a training run.

    python benchmarks/curriculum.py [--resets 20000] [--out FILE]

One process, one core. `reset` is the whole call with a request for phi, `deal` only what hands the scene out, draws
included; `fixed` asks for one band again and again, `moving` for another every time, each a twentieth of the range that
a curriculum goes through. `first` is the first reset, which draws the library (milliseconds). `step` is of one table on
a grid, `of 64` per table of a batch of 64. The second table is a run of a tabular Q-learner and one of DQN
(Stable-Baselines3, 2 x 32 units), by a profile: what share of their time goes into `deal`, `reset` and `step`.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from scenegen.curriculum import TableTop, TableTopVector
from scenegen.play.environments.library import Draws, Sampler
from scenegen.resources import shipped_specs

SPECS = ("first", "mug_left_of_plate", "table_setting", "sort_3", "sort_7")
STEPS = 3000
BATCH = 64


def each(count: int, action: Callable[[int], Any]) -> float:
    """Microseconds of one call."""
    start = time.process_time()
    for number in range(count):
        action(number)
    return (time.process_time() - start) / count * 1e6


def measure(name: str, resets: int) -> str:
    path = str(shipped_specs()[name])
    env = TableTop(path)
    start = time.process_time()
    env.reset(seed=0)
    first = 1e3 * (time.process_time() - start)
    library = env.starts.library
    hard = library.hard
    width = -0.05 * hard
    rng = np.random.default_rng(0)
    fixed = {"phi": (0.4 * hard, 0.4 * hard + width)}
    moving = [{"phi": (end, end + width)} for end in rng.uniform(hard, -width, resets).tolist()]
    times = []
    for options in ([fixed] * resets, moving):
        env.reset(seed=1)
        library.more = Draws(Sampler(env.rules.target))  # which forgets what was drawn
        whole = each(resets, lambda k, options=options: env.reset(options=options[k]))  # type: ignore[misc]
        library.more = Draws(Sampler(env.rules.target))
        asks = [env.starts.read(one) for one in options]
        stream = env.starts.stream(rng)
        times += [whole, each(resets, lambda k, asks=asks, stream=stream: env.starts.draw(stream, asks[k]))]  # type: ignore[misc]
    env.reset(options=moving[0])
    actions = rng.integers(len(env.moves.names), size=(STEPS, BATCH))

    def step(number: int) -> None:
        if env.step(actions[number, 0])[2]:
            env.reset()

    single = each(STEPS, step)
    envs = TableTopVector(BATCH, path, max_episode_steps=100)
    envs.reset(seed=0)
    batch = each(STEPS // 10, lambda k: envs.step(actions[k])) / BATCH
    numbers = " | ".join(f"{value:.1f}" for value in (*times, single, batch))
    return f"| {name} | {first:.0f} | {numbers} |"


def share(learner: str, run: Callable[[], None]) -> str:
    """What a profile says of a run: percent of its time."""
    profile = cProfile.Profile()
    profile.runcall(run)
    stats = pstats.Stats(profile)
    spent = {"deal": 0.0, "reset": 0.0, "step": 0.0}
    for (file, _, function), (_, _, _, cumulative, _) in stats.stats.items():  # type: ignore[attr-defined]
        place = {"tabletop.py": ("draw",), "env.py": ("reset", "step")}.get(Path(file).name, ())
        if "curriculum" in file and function in place:
            spent["deal" if function == "draw" else function] += cumulative
    total = stats.total_tt  # type: ignore[attr-defined]
    shares = " | ".join(f"{100.0 * value / total:.1f} %" for value in spent.values())
    return f"| {learner} | {total:.1f} | {shares} |"


def tabular(episodes: int = 3000) -> None:
    """Q-learning over a grid of offsets, self-made; starts anew with every episode."""
    env = TableTop(str(shipped_specs()["first"]), move="mug")
    rng = np.random.default_rng(0)
    table = np.zeros((41, 41, 4))

    def state(seen: Any) -> tuple[int, int]:
        return int((seen[2] - seen[0]) * 10.0) + 20, int((seen[3] - seen[1]) * 10.0) + 20

    env.reset(seed=0)
    for _ in range(episodes):
        seen, _ = env.reset(options={"phi": (-0.3, 0.0)})
        at = state(seen)
        for _ in range(40):
            action = int(rng.integers(4)) if rng.random() < 0.1 else int(table[at].argmax())
            seen, reward, over, _, _ = env.step(action)
            then = state(seen)
            table[at][action] += 0.2 * (reward + (0.0 if over else 0.95 * table[then].max()) - table[at][action])
            at = then
            if over:
                break


def deep(steps: int = 6000) -> None:
    from stable_baselines3 import DQN

    env = TableTop(str(shipped_specs()["first"]), move="mug", phi=(-0.3, -0.01))
    DQN("MlpPolicy", env, policy_kwargs={"net_arch": [32, 32]}, learning_starts=200, seed=0).learn(steps)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resets", type=int, default=20_000)
    parser.add_argument("--out", type=Path, default=None, help="write the tables there, too")
    options = parser.parse_args()
    TableTop("leftOf(mug, plate)").reset(seed=0)  # imports are not what is measured
    heads = ("spec", "first, ms", "reset, fixed", "deal", "reset, moving", "deal", "step", f"step of {BATCH}")
    lines = [f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|"]
    lines += [measure(name, options.resets) for name in SPECS]
    heads = ("learner", "seconds under the profiler", "deal", "reset", "step")
    lines.append(f"\n| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    lines += [share("tabular Q-learning", tabular), share("DQN", deep)]
    print("\n".join(lines))
    if options.out is not None:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
