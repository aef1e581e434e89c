"""Two checkouts, compared by the bytes of all that they write: `make compare OLD=/path/to/an/older/checkout`.

    python tests/compare_checkouts.py OLD NEW [--specs sort_3,sort_5] [--few] [--jobs 2]
    python tests/compare_checkouts.py --record OLD.json OLD

For every shipped spec that both have: samples in all formats, by all methods, in memory and streamed, on 1 and 2
processes; fmt, check and export. Status, standard output and files have to be equal; standard error is compared with
--said. OLD may also be a file that --record wrote. Takes minutes, so `make test` does not run it. Exit status 1 if
something differs.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

METHODS = ("auto", "rejection", "growth", "splitting")
FEW = ("breakfast", "mug_left_of_plate", "sort_3", "table_setting")


@dataclass(frozen=True)
class Outcome:
    """What a command did: exit status, hashes of its standard output and of the files it wrote, what it said."""

    status: int
    out: str
    files: dict[str, str]
    said: str


def commands(spec: str, label: str) -> list[list[str]]:
    """The command lines for a spec; each finds what the ones before it have written."""
    narrow = ["--phi", f"{label}=-0.1:0.1"]
    lines = [["sample", spec, "--satisfied", "-n", "40", "--seed", "3", "--method", method] for method in METHODS]
    lines += [
        ["sample", spec, *narrow, "-n", "300", "--out", "memory.json"],
        ["sample", spec, *narrow, "-n", "300", "--workers", "2", "--out", "memory.jsonl"],
        ["sample", spec, *narrow, "-n", "300", "--resume", "--out", "streamed.json"],
        ["sample", spec, *narrow, "-n", "300", "--resume", "--workers", "2", "--out", "streamed.jsonl"],
        ["sample", spec, *narrow, "-n", "300", "--resume", "--out", "streamed.parquet"],
        ["sample", spec, "--violated", "--spread", "base", "-n", "100", "--out", "memory.parquet"],
        ["sample", spec, "--satisfied", "--settle", "-n", "8", "--keep-partial", "--out", "settled.json"],
        ["fmt", "copy.spec"],
        ["fmt", "--diff", "copy.spec"],
        ["check", spec],
        ["check", spec, "--full"],
        ["check", spec, "--json"],
        ["eval", spec, "memory.json"],
        ["export", "memory.json", "--out", "worlds.xml"],
        ["export", "memory.json", "--out", "worlds.sdf"],
        ["export", "streamed.parquet", "--out", "exported.json"],
        ["export", "memory.json", "--to", "jsonl", "--out", "exported.jsonl"],
    ]
    # time must not cut a run short: that would depend on the machine
    return [[*line, "--timeout", "600"] if line[0] == "sample" else line for line in lines]


def child(spec: str) -> None:
    """Runs in a process of its own, with the checkout on PYTHONPATH: prints an outcome for every command of a spec."""
    from scenegen.api.spec import load
    from scenegen.cli.app import run
    from scenegen.resources import shipped_specs

    path = shipped_specs()[spec]
    Path("copy.spec").write_bytes(path.read_bytes())
    before = _files()
    for line in commands(spec, load(path).labels[0]):
        out, said = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
            status = run(line)
            out.flush()
            said.flush()
        after = _files()
        changed = {name: what for name, what in after.items() if before.get(name) != what}
        before = after
        made = Outcome(status, _hash(out.buffer.getvalue()), changed, said.buffer.getvalue().decode())
        print(json.dumps([" ".join(line), asdict(made)]), flush=True)


def _files() -> dict[str, str]:
    return {str(path): _hash(path.read_bytes()) for path in sorted(Path().rglob("*")) if path.is_file()}


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def outcomes(checkout: Path, spec: str) -> dict[str, Outcome]:
    """By command line, what a checkout makes of a spec."""
    words = [sys.executable, str(Path(__file__).resolve()), "--child", spec]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    env = {**os.environ, **threads, "PYTHONPATH": str(checkout.resolve()), "COLUMNS": "110"}
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True)
    if run.returncode:
        raise SystemExit(f"{checkout} fails at {spec}:\n{run.stderr}")
    return {line: Outcome(**made) for line, made in map(json.loads, run.stdout.splitlines())}


def shipped(checkout: Path) -> set[str]:
    """The names of a checkout's specs."""
    return {path.stem for path in (checkout / "specs").glob("*.spec")}


def recorded(file: Path) -> dict[str, dict[str, Outcome]]:
    """What --record wrote, by spec and command line."""
    found = json.loads(file.read_text())
    return {spec: {line: Outcome(**made) for line, made in lines.items()} for spec, lines in found.items()}


def differences(old: dict[str, Outcome], new: dict[str, Outcome], *, said: bool) -> list[str]:
    """What differs, a line each."""
    found = [f"{line}: only one of them runs it" for line in sorted(set(old) ^ set(new))]
    for line in [line for line in old if line in new]:
        a, b = old[line], new[line]
        if a.status != b.status:
            found.append(f"{line}: exit status {a.status}, then {b.status}\n{b.said}")
        if a.out != b.out:
            found.append(f"{line}: standard output")
        names = sorted(name for name in {*a.files, *b.files} if a.files.get(name) != b.files.get(name))
        found += [f"{line}: {name}" for name in names]
        if said and a.said != b.said:
            found.append(f"{line}: standard error\n--- old\n{a.said}--- new\n{b.said}")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, nargs="?")
    parser.add_argument("new", type=Path, nargs="?")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--record", type=Path, metavar="FILE", help="write down what OLD does, and compare nothing")
    parser.add_argument("--specs", type=lambda text: text.split(","), help="these alone: sort_3,sort_5")
    parser.add_argument("--few", action="store_true", help="four specs that are quick")
    parser.add_argument("--said", action="store_true", help="compare standard error, too")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    if options.child:
        child(options.child)
        return 0
    if options.old is None or (options.new is None and options.record is None):
        parser.error("name two checkouts")
    before = recorded(options.old) if options.old.is_file() else None
    old = shipped(options.old) if before is None else set(before)
    new = old if options.record else shipped(options.new)
    print("".join(f"{spec}: only one of them has it\n" for spec in sorted(old ^ new)), end="", flush=True)
    specs = options.specs or [spec for spec in sorted(old & new) if not options.few or spec in FEW]

    def both(spec: str) -> tuple[str, dict[str, Outcome], dict[str, Outcome]]:
        old = outcomes(options.old, spec) if before is None else before[spec]
        return spec, old, {} if options.record else outcomes(options.new, spec)

    kept: dict[str, dict[str, object]] = {}
    count = different = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for spec, old, new in pool.map(both, specs):
            kept[spec] = {line: asdict(made) for line, made in old.items()}
            count += len(old)
            found = [] if options.record else differences(old, new, said=options.said)
            different += len(found)
            failed = sum(made.status != 0 for made in old.values())
            print(f"{spec}: {len(old)} commands ({failed} of them with an error), {len(found)} differences", flush=True)
            print("".join(f"  {line}\n" for line in found), end="", flush=True)
    if options.record:
        options.record.write_text(json.dumps(kept, indent=1))
        return 0
    print(f"{count} commands, {different} differences")
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
