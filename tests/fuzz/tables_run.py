"""`make fuzz-tables`: python -m tests.fuzz.tables_run [--count 100] [--seed 0] [--timeout 20] [--workers 1] [--wide]

Samples 100 scenes of each random table with `auto`. Each must be answered in time: with scenes that verify, a proof
that there are none, or how far it got. Where no scenes come, plain rejection tries for a while: finding any is a
fault, too. Prints the shares; faults are kept in OUT. Exit status 1 if there is any. `--number K` prints table K and
judges it alone. With `--wide`, tables have up to 60 objects, choices of surfaces, numbers of things or time; of the
last two it is only judged whether they are answered in time. On a busy machine, `--timeout` gives fewer CPU seconds
than on an idle one: see both in the output.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import scenegen
from scenegen.api.scenes import evaluate, requirement
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.lang.formula.interpret import phi

from .tables import Table, table

SCENES = 100
LATE = 1.0  # seconds that an answer may take beyond --timeout, on an idle core
MEMORY = 1.5e9  # bytes
STUCK = 120.0  # seconds beyond --timeout after which a run is ended
PLAIN = 3.0  # CPU seconds of plain rejection where no scenes came
CHUNK = 8192

SCENES_CAME, PROOF, FULL, FAR, SHORT = "scenes", "proof", "no room found", "told how far", "fell short"
ANSWERS = {  # codes of the answers that are not scenes, or how they begin
    "no-such-scene": PROOF,
    "beyond-bounds": PROOF,
    "table-too-full": PROOF,
    "no-room": FULL,
    "no-time-to-grow": FAR,
    "too-improbable": SHORT,
    "no-number-possible": SHORT,
    "too-few-": SHORT,
    "no-time-": SHORT,
}


@dataclass(frozen=True, slots=True)
class Run:
    """What came of one table. `kind` is one of the five above, or "fault"; `said` is the first line of the answer."""

    number: int
    kind: str
    method: str
    wall: float
    cpu: float
    memory: int
    said: str
    fault: str = ""

    def __str__(self) -> str:
        cost = f"{self.wall:5.1f} s wall, {self.cpu:5.1f} s CPU, {self.memory / 1e6:4.0f} MB"
        fault = f"  FAULT: {self.fault}" if self.fault else ""
        return f"{self.number:4d} {self.kind:13s} {self.method:9s} {cost}  {self.said}{fault}"


def run(seed: int, number: int, timeout: float, wide: bool = False) -> Run:
    """Sample one table in a process of its own and judge the answer."""
    case = table(seed, number, wide)
    with tempfile.TemporaryDirectory() as folder:
        spec, out, said = (Path(folder) / name for name in ("table.spec", "scenes.json", "said.txt"))
        spec.write_text(case.text, encoding="utf-8")
        words = [sys.executable, "-m", "scenegen", "sample", str(spec), *case.options]
        words += ["-n", str(SCENES), "--timeout", f"{timeout:g}", "--workers", "1", "--out", str(out)]
        begun = time.monotonic()
        with said.open("wb") as stream:
            process = subprocess.Popen(words, stdout=stream, stderr=stream)
        status, used, memory = _wait(process, begun + timeout + STUCK)
        wall = time.monotonic() - begun
        cpu = used.ru_utime + used.ru_stime
        text = said.read_text(encoding="utf-8", errors="replace")
        kind, method, fault = "fault", "-", ""
        lines = text.splitlines() or [""]
        first = next((line for line in lines if line.startswith("error")), lines[0])
        if "Traceback" in text or "itself failed" in first or status not in (0, 1):
            fault = f"a crash, status {status}"
        elif status == 0:
            kind, (method, fault) = SCENES_CAME, _verify(case, out) if case.plain else ("-", "")
        else:
            kind = next((kind for code, kind in ANSWERS.items() if f"[{code}" in first), "fault")
            fault = "an unknown answer" if kind == "fault" else _plain(case) if case.plain else ""
    # a busy machine stretches the second after the deadline as it stretches everything
    if wall > timeout + LATE * max(1.0, wall / max(cpu, 0.1)):
        fault = fault or "the answer came late"
    if memory > MEMORY:
        fault = fault or "too much memory"
    return Run(number, kind, method, wall, cpu, memory, first, fault)


def _wait(process: subprocess.Popen[bytes], until: float) -> tuple[int, resource.struct_rusage, int]:
    """The exit status, what the process used, and its largest memory in bytes; one that does not end is killed.

    The peak of `wait4` is at least that of the process that started it, which may be larger than it ever gets."""
    memory = 0
    while True:
        memory = max(memory, _peak(process.pid))
        pid, status, used = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode, used, memory
        if time.monotonic() > until:
            process.kill()
            until = float("inf")
        time.sleep(0.02)


def _peak(pid: int) -> int:
    """The largest memory of a process so far, in bytes; 0 where it is not told."""
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    except OSError:
        return 0
    lines = [line for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(lines[0].split()[1]) * 1024 if lines else 0


def _verify(case: Table, out: Path) -> tuple[str, str]:
    """The method that was taken, and what is wrong with the scenes."""
    spec, scenes = scenegen.parse(case.text), scenegen.read_scenes(out)
    method = str(scenes.header.sampler["method"])
    if len(scenes.poses) != SCENES:
        return method, f"{len(scenes.poses)} scenes"
    for name, values in evaluate(spec.checked, scenes).items():
        if name in case.ranges:
            low, high = case.ranges[name]
            if (low is not None and values.min() < low) or (high is not None and values.max() > high):
                return method, f"phi of {name} is out of range"
    required = requirement(spec.checked, scenes)
    if required is not None and required.min() < 0.0:
        return method, "a scene does not meet what the spec requires"
    if len(np.unique(scenes.poses.reshape(SCENES, -1), axis=0)) < SCENES:
        return method, "a scene came twice"
    return method, ""


def _plain(case: Table) -> str:
    """Uniform scenes for a while: whether any is in range after all."""
    checked = scenegen.parse(case.text).checked
    core, rng = gate(checked.core), np.random.default_rng(0)
    low, high = (end[:, None] for end in checked.box())
    ranges = {**case.ranges, REQUIRE: (0.0, None)}
    begun, drawn = time.process_time(), 0
    while time.process_time() - begun < PLAIN:
        rows = low + rng.random((len(low), CHUNK)) * (high - low)
        values = phi(core, list(rows), NUMPY)
        good = np.ones(CHUNK, dtype=bool)
        for name, (least, most) in ranges.items():
            if name in values:
                good &= values[name] >= (-np.inf if least is None else least)
                good &= values[name] <= (np.inf if most is None else most)
        drawn += CHUNK
        if good.any():
            return f"plain rejection finds {np.count_nonzero(good)} scenes in {drawn:,}"
    return ""


def judge(seed: int, numbers: range, timeout: float, workers: int, wide: bool) -> Iterator[Run]:
    """Each table's run, in order."""
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(lambda number: run(seed, number, timeout, wide), numbers)


def summary(runs: list[Run]) -> str:
    """Shares by kind and by method, and the slow ones."""
    kinds, methods = Counter(run.kind for run in runs), Counter(run.method for run in runs if run.method != "-")
    lines = [f"{count} of {len(runs)} {kind}" for kind, count in kinds.most_common()]
    lines.append("scenes by method: " + ", ".join(f"{name} {count}" for name, count in methods.most_common()))
    slow = sorted(runs, key=lambda run: -run.cpu)[:5]
    lines.append("slowest: " + ", ".join(f"{run.number} ({run.cpu:.1f} s CPU)" for run in slow))
    lines.append(f"faults: {', '.join(str(run.number) for run in runs if run.fault) or 'none'}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--timeout", type=float, default=20.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--number", type=int, default=None, help="print this table and judge it alone")
    parser.add_argument("--wide", action="store_true", help="tables of up to 60 objects, of all kinds")
    parser.add_argument("--out", type=Path, default=Path("fuzz-out"))
    options = parser.parse_args()
    numbers = range(options.count)
    if options.number is not None:
        numbers = range(options.number, options.number + 1)
        case = table(options.seed, options.number, options.wide)
        print(f"{case.text}{' '.join(case.options)}")
    runs = []
    for one in judge(options.seed, numbers, options.timeout, options.workers, options.wide):
        print(one, flush=True)
        runs.append(one)
        if one.fault:
            options.out.mkdir(parents=True, exist_ok=True)
            case, name = table(options.seed, one.number, options.wide), f"table-{options.seed}-{one.number}.spec"
            (options.out / name).write_text(f"# {' '.join(case.options)}\n{case.text}", encoding="utf-8")
    print(summary(runs))
    return 1 if any(one.fault for one in runs) else 0


if __name__ == "__main__":
    sys.exit(main())
