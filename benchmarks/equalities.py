"""How far `auto` is from the best method where specs hold distances, headings, lines and gaps to tight tolerances.

    python benchmarks/equalities.py [--set tuning|held-out] [--count 20] [--scenes 16 200] [--cap 60] [--only K ...]

A seeded generator writes specs of 3 to 6 objects with 1 to 6 equalities of 0.01 mm to 1 cm (a hundredth of that in
radians for 1 cm at 1 m), all of which a scene planted beforehand meets. The held-out set has another seed, other shapes
and other kinds of equalities; no constant of the choice was set by it. Each request is drawn by `auto` and by
each of its methods, in a process of its own, on one core. Seconds are those of CPU after the modules are loaded
(`start`, printed once). A method is ended once it has taken longer than the best so far: then its figure has a `>`; `!`
is one that gave up. `ratio` is that of `auto` to the best of all four, `whole` that of whole commands, with `start`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from scenegen.cli.app import run

METHODS = "auto", "growth", "splitting", "rejection"
SETS = {"tuning": 1, "held-out": 2}  # seeds
SHAPES = {
    "tuning": ("", "", " = cylinder(3 cm, 5 cm)", " = box(6 cm, 4 cm, 5 cm)"),
    "held-out": (
        "",
        " = cylinder(2 cm, 10 cm)",
        " = box(9 cm, 3 cm, 5 cm)",
        " = prism([(0, 0), (0.05, 0), (0.02, 0.04)], 0.03)",
    ),
}
KINDS = {
    "tuning": ("distance", "distance", "column", "heading", "offset", "equal"),
    "held-out": ("distance", "row", "turned", "place", "equal", "sum"),
}
FINEST, COARSEST = 1e-5, 1e-2  # metres
BAR = 1.5  # how many times as long as the best method `auto` may take
PLAIN = 0.5  # share of specs of points
NEAREST = 0.12  # between the centres of planted objects


def make_spec(which: str, number: int) -> str:
    """Spec `number` of a set: always the same text."""
    rng = random.Random(f"{SETS[which]} {number}")
    names = "abcdef"[: rng.randint(3, 6)]
    poses: dict[str, tuple[float, float, float]] = {}
    while len(poses) < len(names):
        x, y, turn = rng.uniform(0.1, 0.9), rng.uniform(0.1, 0.9), rng.uniform(0.2, 6.0)
        if all(math.dist((x, y), pose[:2]) >= NEAREST for pose in poses.values()):
            poses[names[len(poses)]] = x, y, turn
    tolerance = math.exp(rng.uniform(math.log(FINEST), math.log(COARSEST)))
    asked: list[str] = []
    for _ in range(rng.randint(1, 6)):
        a, b, c = rng.sample(names, 3)
        asked.append(_equality(rng.choice(KINDS[which]), (a, b, c), poses, tolerance))
    plain = rng.random() < PLAIN
    shapes = ["" if plain else rng.choice(SHAPES[which]) for _ in names]
    objects = "\n".join(f"object {name}{shape}" for name, shape in zip(names, shapes, strict=True))
    apart = "require noOverlap()\n" if any(shapes) else ""
    return f"{objects}\n{apart}task: " + "\n    & ".join(dict.fromkeys(asked)) + "\n"


def _equality(
    kind: str, names: tuple[str, str, str], poses: dict[str, tuple[float, float, float]], within: float
) -> str:
    """An equality that the planted poses meet."""
    a, b, c = names
    (ax, ay, turn), (bx, by, other), (cx, cy, _) = (poses[name] for name in names)
    ab, bc = math.dist((ax, ay), (bx, by)), math.dist((bx, by), (cx, cy))
    held = {
        "distance": f"dist({a}, {b}) - {ab:.6f}",
        "column": f"x({a}) - x({b}) - {ax - bx:.6f}",
        "row": f"y({a}) - y({b}) - {ay - by:.6f}",
        "heading": f"theta({a}) - {turn:.6f}",
        "turned": f"theta({a}) - theta({b}) - {turn - other:.6f}",
        "offset": f"x({a}) + y({b}) - {ax + by:.6f}",
        "place": f"x({a}) - {ax:.6f}",
        "equal": f"dist({a}, {b}) - dist({b}, {c}) - {ab - bc:.6f}",
        "sum": f"dist({a}, {b}) + dist({b}, {c}) - {ab + bc:.6f}",
    }[kind].replace("- -", "+ ")
    return f"abs({held}) <= {within:.7f}"


def cpu_seconds(spec: Path, method: str, scenes: int, cap: float, out: Path) -> tuple[float, bool, str]:
    """What a request takes, whether it was fulfilled, and the method that was taken."""
    out.unlink(missing_ok=True)
    child = os.fork()
    if child == 0:
        limit = math.ceil(time.process_time() + cap)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        words = ["sample", str(spec), "--satisfied", "-n", str(scenes), "--workers", "1", "--timeout", "100000"]
        os._exit(run([*words, "--method", method, "--out", str(out)]))
    _, status, used = os.wait4(child, 0)
    taken = json.loads(out.read_text(encoding="utf-8"))["sampler"]["method"] if status == 0 else "-"
    return used.ru_utime + used.ru_stime, status == 0, taken


def main() -> None:
    """The table, and the median and the worst of its ratios."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--set", choices=sorted(SETS), default="held-out", dest="which")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--scenes", type=int, nargs="+", default=[16, 200])
    parser.add_argument("--cap", type=float, default=60.0, help="CPU seconds")
    parser.add_argument("--only", type=int, nargs="+")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:  # once each, so that all modules are there
        spec = Path(folder) / "spec.spec"
        spec.write_text("task: leftOf(a, b)\n", encoding="utf-8")
        for method in METHODS:
            run(["sample", str(spec), "--satisfied", "-n", "1", "--method", method, "--out", str(spec) + ".json"])
            if method == "growth":  # with what two methods take to draw a scene
                start = time.process_time()
    print(f"start: {start:.2f} s")
    print(f"{'spec':>4} {'n':>4}  " + " ".join(f"{name:>10}" for name in METHODS) + "  ratio  whole  auto took")
    ratios, whole = [], []
    with tempfile.TemporaryDirectory() as folder:
        spec, out = Path(folder) / "spec.spec", Path(folder) / "scenes.json"
        for number in given.only or range(given.count):
            spec.write_text(make_spec(given.which, number), encoding="utf-8")
            for scenes in given.scenes:
                best, mine, told, row = given.cap, math.inf, "-", []
                for method in METHODS:
                    used, good, taken = cpu_seconds(spec, method, scenes, best, out)
                    row.append(f"{used:10.2f}" if good else f"{'>' if used >= best else '!'}{used:9.2f}")
                    best = min(best, used) if good else best
                    if method == "auto":
                        mine, told = used, taken
                ratios.append(mine / best)
                whole.append((mine + start) / (best + start))
                print(
                    f"{number:4} {scenes:4}  {' '.join(row)}  {ratios[-1]:5.2f}  {whole[-1]:5.2f}  {told}", flush=True
                )
    for name, found in (("ratio", ratios), ("whole", whole)):
        over = sum(one > BAR for one in found)
        print(f"{name}: median {statistics.median(found):.2f}, worst {max(found):.2f}, above {BAR}: {over}")


if __name__ == "__main__":
    sys.exit(main())
