"""The same distributions as programs of Scenic 3.1.1, and their scenes by its rejection sampler.

Run by the Python of an environment that has Scenic (`pip install scenic==3.1.1`); nothing of scenegen is imported:

    PYTHON experiments/priors/scenic_scenes.py DIR NAME ... [--scenes 20000] [--seconds 150] [--seed 0]

One file NAME.scenic.npz each: `rows` (3N, n) of x, y and heading, `tries`, `seconds` of CPU time.

Scenic's `Normal` has no ends, and what it requires, the workspace included, it requires of the whole scene. So a
relative normal that is cut by a requirement makes places near the edge rarer; `TruncatedNormal` with a random mean is
cut for each mean by itself, as scenegen's is. `relative_joint` is the former, to show by how much they differ.
"""

import argparse
import math
import random
import time
from pathlib import Path
from typing import Any

import numpy as np

PRELUDE = """
import math
from shapely.geometry import Point as Spot, Polygon
deg = math.pi / 180
workspace = Workspace(RectangularRegion(0.5 @ 0.5, 0, 1, 1))
ego = new Object at 5 @ 5, with allowCollisions True, with regionContainedIn everywhere
def cut(x, y, deviation):
    return (TruncatedNormal(x, deviation, 0, 1), TruncatedNormal(y, deviation, 0, 1))
def anywhere():
    return (Range(0, 1), Range(0, 1))
def circle():
    return Range(0, 2 * math.pi)
def around(mean, deviation):
    return mean + TruncatedNormal(0, deviation, -math.pi, math.pi)
def dist(a, b):
    return math.hypot(a[0] - b[0], a[1] - b[1])
def off(heading, wanted):
    return abs(math.remainder(heading - wanted, 2 * math.pi))
def box(a, heading, length, width):
    c, s = math.cos(heading), math.sin(heading)
    ends = [(u * length / 2, v * width / 2) for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return Polygon([(a[0] + u * c - v * s, a[1] + u * s + v * c) for u, v in ends])
def clear(disc, radius, outline):
    return outline.distance(Spot(disc[0], disc[1])) >= radius
"""

PROGRAMS = {
    "narrow": """
mug, plate = cut(0.4, 0.3, 0.005), anywhere()
param mug = (mug[0], mug[1], circle()), plate = (plate[0], plate[1], circle())
require 0 <= min(plate[0] - mug[0], 0.25 - dist(mug, plate)) <= 0.1
""",
    "wide": """
mug, plate = cut(1.1, 0.5, 0.3), cut(0.3, 0.6, 0.4)
param mug = (mug[0], mug[1], circle()), plate = (plate[0], plate[1], circle())
require 0 <= min(0.3 - dist(mug, plate), plate[1] - mug[1]) <= 0.1
""",
    "headings": """
knife, fork, mug = around(90 * deg, 10 * deg), Range(-20 * deg, 25 * deg), around(0, 80 * deg)
a, b, c = anywhere(), anywhere(), anywhere()
param knife = (a[0], a[1], knife), fork = (b[0], b[1], fork), mug = (c[0], c[1], mug)
require 0 <= min(15 * deg - off(knife, 80 * deg), 20 * deg - off(fork, 0), 60 * deg - off(mug, 150 * deg)) <= 0.1
""",
    "mixture": """
near, far = cut(0.6, 0.2, 0.05), cut(0.6, 0.25, 0.04)
butter = Discrete({Range(0, 0.4) @ Range(0, 1): 7, near[0] @ near[1]: 3})
plate = Discrete({Range(0, 1) @ Range(0, 1): 1, far[0] @ far[1]: 1})
turned = circle()
param butter = (butter.x, butter.y, turned), plate = (plate.x, plate.y, circle())
require 0 <= 0.3 - dist(butter, plate) <= 0.15
require clear(plate, 0.125, box(butter, turned, 0.05, 0.05))
""",
    "relative": """
saucer = anywhere()
cup = cut(saucer[0], saucer[1], 0.03)
param saucer = (saucer[0], saucer[1], circle()), cup = (cup[0], cup[1], circle())
require 0 <= min(saucer[0] - cup[0], 0.06 - dist(saucer, cup)) <= 0.02
""",
    "relative_joint": """
saucer = anywhere()
cup = (Normal(saucer[0], 0.03), Normal(saucer[1], 0.03))
param saucer = (saucer[0], saucer[1], circle()), cup = (cup[0], cup[1], circle())
require 0 <= cup[0] <= 1 and 0 <= cup[1] <= 1
require 0 <= min(saucer[0] - cup[0], 0.06 - dist(saucer, cup)) <= 0.02
""",
    "setting": """
plate = cut(0.5, 0.35, 0.1)
fork, knife = cut(plate[0] - 0.17, plate[1], 0.02), cut(plate[0] + 0.17, plate[1], 0.02)
first, second = around(90 * deg, 10 * deg), around(90 * deg, 10 * deg)
param plate = (plate[0], plate[1], circle()), fork = (fork[0], fork[1], first), knife = (knife[0], knife[1], second)
def margin(fork, first, knife, second):
    turned = min(20 * deg - off(first, 90 * deg), 20 * deg - off(second, 90 * deg))
    return min(turned, 0.03 - abs(fork[1] - knife[1]))
require 0 <= margin(fork, first, knife, second) <= 0.02
require clear(plate, 0.125, box(fork, first, 0.19, 0.028))
require clear(plate, 0.125, box(knife, second, 0.22, 0.022))
require not box(fork, first, 0.19, 0.028).intersects(box(knife, second, 0.22, 0.022))
""",
    "relative_mixture": """
plate, tray = anywhere(), anywhere()
near, upon = cut(plate[0], plate[1], 0.12), cut(tray[0], tray[1], 0.05)
mug = Discrete({near[0] @ near[1]: 7, upon[0] @ upon[1]: 3})
spoon = cut(mug.x, mug.y, 0.1)
param spoon = (spoon[0], spoon[1], circle()), mug = (mug.x, mug.y, circle())
param plate = (plate[0], plate[1], circle()), tray = (tray[0], tray[1], circle())
require 0 <= min(tray[0] - plate[0], 0.15 - dist(mug, spoon), dist(mug, plate) - 0.08) <= 0.05
""",
    "relative_heading": """
plate, turned = anywhere(), circle()
fork, knife = cut(plate[0] - 0.17, plate[1], 0.02), anywhere()
follows = around(turned, 15 * deg)
against = around(follows + math.pi, 40 * deg)
param plate = (plate[0], plate[1], turned), fork = (fork[0], fork[1], follows), knife = (knife[0], knife[1], against)
require 0 <= min(20 * deg - off(follows, turned), 90 * deg - off(against, 90 * deg), knife[0] - fork[0]) <= 0.2
""",
    "kernels": """
row = Uniform(((0.2, 0.3, 0), (0.25, 0.35, 90)), ((0.7, 0.7, 180), (0.62, 0.7, 10)),
              ((0.71, 0.69, 200), (0.3, 0.3, 0)), ((0.995, 0.5, 350), (0.9, 0.5, 0)))
def moved(middle):
    return Range(max(middle - 0.01, 0), min(middle + 0.01, 1))
mug, saucer, spoon = (moved(row[0][0]), moved(row[0][1])), (moved(row[1][0]), moved(row[1][1])), anywhere()
param mug = (mug[0], mug[1], (row[0][2] + Range(-5, 5)) * deg)
param saucer = (saucer[0], saucer[1], (row[1][2] + Range(-5, 5)) * deg), spoon = (spoon[0], spoon[1], circle())
require 0 <= min(0.12 - dist(mug, saucer), 0.4 - dist(spoon, mug)) <= 0.04
""",
    "outside": """
mug, plate = cut(0.2, 0.5, 0.08), cut(0.5, 0.5, 0.1)
param mug = (mug[0], mug[1], circle()), plate = (plate[0], plate[1], circle())
require mug[0] >= 0.45
require 0 <= 0.2 - dist(mug, plate) <= 0.1
""",
}
ORDER = {
    "narrow": ("mug", "plate"),
    "wide": ("mug", "plate"),
    "headings": ("knife", "fork", "mug"),
    "mixture": ("butter", "plate"),
    "relative": ("saucer", "cup"),
    "relative_joint": ("saucer", "cup"),
    "setting": ("plate", "fork", "knife"),
    "relative_mixture": ("spoon", "mug", "plate", "tray"),
    "relative_heading": ("plate", "fork", "knife"),
    "kernels": ("mug", "saucer", "spoon"),
    "outside": ("mug", "plate"),
}


def scenes(name: str, wanted: int, seconds: float, seed: int) -> tuple[Any, int, float]:
    """(3N, n) rows, how many scenes were tried, and seconds of CPU time."""
    import scenic

    random.seed(seed)
    np.random.seed(seed)
    scenario = scenic.scenarioFromString(PRELUDE + PROGRAMS[name], mode2D=True)
    rows: list[list[float]] = []
    tries, began = 0, time.process_time()
    while len(rows) < wanted and time.process_time() - began < seconds:
        scene, iterations = scenario.generate(maxIterations=10**9)
        tries += iterations
        rows.append([number for thing in ORDER[name] for number in scene.params[thing]])
    found = np.array(rows).T
    found[2::3] = np.mod(found[2::3], 2.0 * math.pi)
    return found, tries, time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="+")
    parser.add_argument("--scenes", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=150.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in given.names:
        rows, tries, seconds = scenes(name, given.scenes, given.seconds, given.seed)
        np.savez_compressed(given.folder / f"{name}.scenic.npz", rows=rows, tries=tries, seconds=seconds)
        print(f"{name}: {rows.shape[1]} scenes of {tries:,} in {seconds:.0f} s", flush=True)


if __name__ == "__main__":
    main()
