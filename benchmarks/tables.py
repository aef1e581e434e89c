"""Tables that people set: 1,000 scenes of each by `auto`, beside a plain placer; and what growth costs as tables grow.

    python benchmarks/tables.py [--scenes 1000] [--only NAME ...] [--timeout 60] [--no-growth] [--out FILE]

One core. `wall` and `CPU` are seconds of the whole command, start and files included: on a busy machine only CPU
seconds say something. The baseline, the plain placer, is written by hand in numpy: objects one after another, each at
the first of 4,000 random poses that meets what stands there already; where there is none, the scene is begun anew, and
given up after 50 times. Its scenes are valid but not uniform, and nothing is known of their probability. `fill` is the
share of the area that footprints take, of the workspace or of the tray in which they must lie.

The second table is for discs that fill 15 % of the table: the CPU seconds of 1,000 scenes by growth, plan included, and
the exponent e of the power N^e that fits them best (least squares of the logarithms; bar: at most 2).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import numpy.typing as npt

import scenegen
from scenegen.geometry import NUMPY
from scenegen.geometry.clearance import gap, room
from scenegen.geometry.footprint import Box, Footprint
from scenegen.lang.formula.core import gate
from scenegen.lang.formula.interpret import phi
from scenegen.sampling.growth.packing import area

Array = npt.NDArray[np.float64]
Draw = Callable[[int, Array, np.random.Generator, int], Array]

HERE = Path(__file__).parent / "tables"
BARS = {"boxes40_long": 15, "discs100": 20}  # wall seconds; all others: 10
PLACED = 10  # scenes that the plain placer makes
POSES, RESTARTS, PATIENCE = 4000, 50, 20.0  # poses for an object, times that a scene is begun, CPU seconds
FILL, SIZES = 0.15, (10, 20, 40, 80)


def _uniform(low: tuple[float, float], high: tuple[float, float], rng: np.random.Generator, count: int) -> Array:
    """Poses in a rectangle, (3, count), any heading."""
    ends = np.array([*low, 0.0]), np.array([*high, 2.0 * np.pi])
    return ends[0][:, None] + rng.random((3, count)) * (ends[1] - ends[0])[:, None]


def _around(centre: Array, reach: float, rng: np.random.Generator, count: int) -> Array:
    """Poses in a disc around a centre, (3, count)."""
    distance, angle = reach * np.sqrt(rng.random(count)), 2.0 * np.pi * rng.random(count)
    heading = 2.0 * np.pi * rng.random(count)
    return np.stack([centre[0] + distance * np.cos(angle), centre[1] + distance * np.sin(angle), heading])


def _blocks(thing: int, placed: Array, rng: np.random.Generator, count: int) -> Array:
    return _around(placed[0], 0.3, rng, count) if thing == 1 else _uniform((0.0, 0.0), (1.0, 1.0), rng, count)


def _in_tray(right: float, top: float) -> Draw:
    return lambda thing, placed, rng, count: _uniform((0.2, 0.2), (right, top), rng, count)


def _bins(thing: int, placed: Array, rng: np.random.Generator, count: int) -> Array:
    poses = _uniform((0.03, 0.03), (0.22, 0.22), rng, count)
    poses[:2] += np.array([[0.0, 0.4, 0.75], [0.0, 0.0, 0.6]])[:, rng.integers(3, size=count)]
    return poses


def _dinner(thing: int, placed: Array, rng: np.random.Generator, count: int) -> Array:
    """Plates are objects 0 to 3, then forks, knives and glasses."""
    if thing < 4:
        return _uniform((0.0, 0.0), (1.0, 1.0), rng, count)
    plate = placed[thing % 4]
    if thing < 12:
        side = -1.0 if thing < 8 else 1.0
        poses = plate[:, None] + np.stack(
            [side * 0.22 * rng.random(count), 0.04 * (2.0 * rng.random(count) - 1.0), np.zeros(count)]
        )
        poses[2] = 0.5 * np.pi + math.radians(15.0) * (2.0 * rng.random(count) - 1.0)
        return poses[:, np.hypot(*(poses[:2] - plate[:2, None])) <= 0.22]
    poses = _around(plate, 0.25, rng, count)
    return poses[:, poses[1] >= plate[1]]


def _corridor(thing: int, placed: Array, rng: np.random.Generator, count: int) -> Array:
    """Cans in pairs, each with its second within 20 cm (sum of both ways): that is stricter than the spec."""
    poses = _uniform((0.0, 0.0), (1.0, 1.0), rng, count)
    if thing % 2:
        mate = placed[thing - 1]
        poses = _around(mate, 0.2, rng, count)
        poses = poses[:, np.abs(poses[:2] - mate[:2, None]).sum(axis=0) <= 0.2]
    x, y = poses[:2]
    beside = np.hypot(x - 0.1, y - 0.5) + np.hypot(x - 0.9, y - 0.5) >= 0.8 + 0.1
    inside = (x >= 0.0) & (x <= 1.0) & (y >= 0.0) & (y <= 1.0)
    return poses[:, beside & inside]


@dataclass(frozen=True, slots=True)
class Row:
    """A spec of this name; how the plain placer draws poses; the rectangle (left, bottom, right, top) that fill is the
    share of, and whether footprints must lie inside it."""

    name: str
    draw: Draw
    within: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    inside: bool = True


ROWS = (
    Row("dinner4", _dinner),
    Row("bins", _bins, inside=False),
    Row("boxes20", _blocks),
    Row("boxes40", _blocks),
    Row("discs60", _blocks),
    Row("coins14", _in_tray(0.7, 0.7), (0.2, 0.2, 0.7, 0.7)),
    Row("parts9", _in_tray(0.6, 0.6), (0.2, 0.2, 0.6, 0.6)),
    Row("parts12", _in_tray(0.6, 0.6), (0.2, 0.2, 0.6, 0.6)),
    Row("discs100", _blocks),
    Row("corridor", _corridor, inside=False),
    Row("boxes40_long", _blocks),
    Row("squares12", _in_tray(0.7, 0.6), (0.2, 0.2, 0.7, 0.6)),
)


def placer(row: Row, spec: scenegen.Spec) -> str:
    """CPU seconds that the plain placer takes for 1,000 scenes, from a few of them; or that it finds none."""
    checked, rng = spec.checked, np.random.default_rng(0)
    shapes = [shape.footprint for shape in checked.shapes]
    begun, made = time.process_time(), 0
    for _ in range(RESTARTS * PLACED):
        if made == PLACED or time.process_time() - begun > PATIENCE:
            break
        poses = _place_all(row, shapes, dict(checked.fixed), rng)
        if poses is not None:
            made += 1
            values = phi(gate(spec.checked.core), list(poses.reshape(-1, 1)), NUMPY).values()
            assert min(map(np.min, values)) >= -1e-9, f"the plain placer is wrong: {row.name}"
    spent = time.process_time() - begun
    return f"{1000.0 * spent / made:.1f}" if made else f"none in {spent:.0f} s"


def _place_all(
    row: Row, shapes: list[Footprint], fixed: dict[int, tuple[float, float, float]], rng: np.random.Generator
) -> Array | None:
    placed = np.zeros((len(shapes), 3))
    there = list(fixed)
    for thing, pose in fixed.items():
        placed[thing] = pose
    left, bottom, right, top = row.within
    frame = Box(right - left, top - bottom)
    middle = (0.5 * (left + right), 0.5 * (bottom + top), 0.0)
    for thing, shape in enumerate(shapes):
        if thing in fixed:
            continue
        for tried in (8, 64, 512, POSES):  # most objects find a place at once
            poses = row.draw(thing, placed, rng, tried)
            good = np.ones(poses.shape[1], dtype=bool)
            if row.inside:
                good &= room(NUMPY, shape, frame, *poses, *middle) >= 0.0
            for other in there:
                mine = np.flatnonzero(good)
                if not len(mine):
                    break
                good[mine] = gap(NUMPY, shape, shapes[other], *poses[:, mine], *placed[other]) >= 0.0
            found = np.flatnonzero(good)
            if len(found):
                placed[thing] = poses[:, found[0]]
                there.append(thing)
                break
        else:
            return None
    return placed


def command(path: Path, scenes: int, timeout: float) -> tuple[dict[str, object] | None, str, float, float]:
    """What the scene file says of the run, or None and the error; wall and CPU seconds."""
    with tempfile.TemporaryDirectory() as folder:
        out, said = Path(folder) / "scenes.json", Path(folder) / "said"
        words = [sys.executable, "-m", "scenegen", "sample", str(path), "--satisfied", "-n", str(scenes)]
        words += ["--workers", "1", "--timeout", str(timeout), "--out", str(out)]
        begun = time.monotonic()
        with said.open("wb") as stream:
            process = subprocess.Popen(words, stdout=stream, stderr=stream)
        _, status, used = os.wait4(process.pid, 0)
        wall, cpu = time.monotonic() - begun, used.ru_utime + used.ru_stime
        if status:
            return None, said.read_text(encoding="utf-8").splitlines()[0], wall, cpu
        return json.loads(out.read_text(encoding="utf-8"))["sampler"], "", wall, cpu


def measure(row: Row, scenes: int, timeout: float) -> str:
    path = HERE / f"{row.name}.spec"
    spec = scenegen.load(path)
    left, bottom, right, top = row.within
    free = [shape for thing, shape in enumerate(spec.checked.shapes) if thing not in spec.checked.fixed]
    fill = sum(area(shape.footprint) for shape in free) / ((right - left) * (top - bottom))
    info, error, wall, cpu = command(path, scenes, timeout)
    bar = BARS.get(row.name, 10)
    if info is None:
        middle = f"- | - | - | {error}"
    else:
        log, width = info.get("log10_probability"), info.get("log10_error")
        odds = "-" if log is None else f"{log:.2f} ± {width:.2f}" if width is not None else f"{log:.2f}"
        middle = f"{odds} | {info['method']} | {info.get('effective_share', 1.0):.2f} | {wall:.1f} / {cpu:.1f} ({bar})"
    return f"| {row.name} | {len(free)} | {fill:.0%} | {middle} | {placer(row, spec)} |"


def at_constant_fill(size: int, scenes: int, timeout: float) -> float:
    """CPU seconds of scenes of so many discs by growth, plan included."""
    radius = math.sqrt(FILL / (math.pi * size))
    spec = scenegen.parse(
        f"object disc[{size}] = cylinder({radius:.5f}, 0.05)\nrequire noOverlap() & insideWorkspace()\n"
        "task: closeTo(disc[1], disc[2], 30 cm)\n"
    )
    begun = time.process_time()
    scenegen.sample(spec, {"task": (0.0, None)}, scenes, method="growth", timeout=timeout)
    return time.process_time() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--timeout", type=float, default=60.0)
    parser.add_argument("--only", nargs="*", default=None, help="these tables alone")
    parser.add_argument("--no-growth", action="store_true", help="leave the second table out")
    parser.add_argument("--out", type=Path, default=None, help="write the tables there, too")
    options = parser.parse_args()
    lines: list[str] = []

    def say(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    columns = (
        "table", "N", "fill", "log10 of the probability", "method", "effective share",
        f"{options.scenes:,} scenes: wall / CPU s (bar, wall)", "plain placer, CPU s for 1,000",
    )  # fmt: skip
    say(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for row in ROWS:
        if options.only is None or row.name in options.only:
            say(measure(row, options.scenes, options.timeout))
    if not options.no_growth:
        at_constant_fill(5, 100, options.timeout)  # imports are not what is measured
        costs = [at_constant_fill(size, options.scenes, options.timeout) for size in SIZES]
        exponent = np.polyfit(np.log(SIZES), np.log(costs), 1)[0]
        say(f"\n| N, {FILL:.0%} full | {' | '.join(map(str, SIZES))} | exponent (bar 2) |\n{'|---' * 6}|")
        say(f"| CPU s, {options.scenes:,} scenes | {' | '.join(f'{cost:.2f}' for cost in costs)} | {exponent:.2f} |")
    if options.out is not None:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
