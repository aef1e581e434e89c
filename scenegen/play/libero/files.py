"""States of whole suites: a folder that the evaluations of LIBERO and LeRobot read as their home."""

from __future__ import annotations

import gc
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.request import Phi
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.errors.worlds import PLACEMENT
from scenegen.needs import need
from scenegen.play.libero.measure import silence
from scenegen.play.libero.states import SettledStates, init_states
from scenegen.sampling.request import parse_phi
from scenegen.scenes.files import ensure_folder, write_whole

LIBERO_SUITES = ("libero_spatial", "libero_object", "libero_goal", "libero_10", "libero_90")
SPEC_LABELS = "goal", "start", "visible"
CONFIG_PATHS = "benchmark_root", "bddl_files", "init_states", "datasets", "assets"  # what LIBERO's config.yaml names


@dataclass(frozen=True, slots=True)
class LiberoTask:
    """A task of LIBERO: its suite, its name, and its BDDL file."""

    suite: str
    name: str
    file: Path


def tasks_of(name: str) -> list[LiberoTask]:
    """The tasks of a suite, the task of a name, or that of a BDDL file. Raises RequestError."""
    path = Path(name)
    if path.suffix == ".bddl" and path.is_file():
        return [LiberoTask(path.resolve().parent.name, path.stem, path.resolve())]
    folder = Path(libero_paths()["bddl_files"])
    found = [
        LiberoTask(one.parent.name, one.stem, one)
        for suite in ((name,) if (folder / name).is_dir() and name else LIBERO_SUITES)
        for one in sorted((folder / suite).glob("*.bddl"))
        if name in (suite, one.stem)
    ]
    if not found:
        raise RequestError(UNKNOWN_CHOICE(what="suite or task of LIBERO's", name=name, known=LIBERO_SUITES))
    return found if name in LIBERO_SUITES or (folder / name).is_dir() else found[:1]


def libero_paths() -> dict[str, str]:
    """Where LIBERO has its files, by the names of its config.yaml."""
    need("libero", "for its suites and tasks")
    with silence():
        from libero.libero import get_libero_path

        return {key: str(get_libero_path(key)) for key in CONFIG_PATHS}


def make_environment(task: LiberoTask, seed: int = 0, *, pictures: bool = False) -> Any:
    """LIBERO's environment of a task, reset; with `pictures` its cameras are in observations."""
    need("libero", "to simulate its tasks")
    with silence():
        from libero.libero.envs.env_wrapper import ControlEnv

        env = ControlEnv(
            bddl_file_name=str(task.file),
            use_camera_obs=pictures,
            has_renderer=False,
            has_offscreen_renderer=pictures,
            hard_reset=False,
        )
        env.seed(seed)
        env.reset()
    return env


@dataclass(frozen=True, slots=True)
class StatesJob:
    """Makes the states of a task, and writes them below `out`, with a report; where the report of the same request is,
    nothing is made. `phi` are ranges as they are typed, by default of starts that miss."""

    out: Path
    phi: tuple[str, ...] = ()
    n: int = 50
    seed: int = 0
    settle: float = 1.0

    def __call__(self, task: LiberoTask) -> str:
        """What was made, in words. Raises RequestError, also where there are fewer states than wanted, which are
        written all the same."""
        report = self.load_report(task) or self.make(task)
        left = ", ".join(f"{reason} ({count})" for reason, count in report["refused"].items())
        if report["states"] < self.n:
            raise RequestError(PLACEMENT(found=report["states"], wanted=self.n, reasons=left or "there are none"))
        goal, seen = report["phi"]["goal"], report["visible"]
        said = f"{self.n} states of {report['drawn']} scenes, phi of goal {min(goal):.3g} to {max(goal):.3g}"
        said += f", visible {min(seen):.3g} to {max(seen):.3g}" if seen else ""
        return said + (f"; left out: {left}" if left else "")

    def request(self) -> dict[str, object]:
        return {"phi": list(self.phi), "n": self.n, "seed": self.seed, "settle": self.settle, "fixtures": "anywhere"}

    def make(self, task: LiberoTask) -> dict[str, Any]:
        wanted: Phi | None = parse_phi(self.phi, SPEC_LABELS) or None
        env = make_environment(task, self.seed)
        try:
            made = init_states(env, wanted, self.n, settle=self.settle, seed=self.seed)
        finally:
            env.close()
            del env
            gc.collect()  # or its models would pile up
        return self.write(task, made)

    def write(self, task: LiberoTask, made: SettledStates) -> dict[str, Any]:
        report = {"task": task.name, "request": self.request(), "states": len(made.states), "drawn": made.drawn}
        report |= {"judged": made.judged, "agreed": made.agreed, "refused": dict(made.refused)}
        report |= {"phi": {label: one.tolist() for label, one in made.phi.items()}, "moved": made.moved.tolist()}
        report["visible"] = made.read.get("visible", np.zeros(0)).tolist()
        states, specs, reports = (self.out / one / task.suite for one in ("init_files", "specs", "reports"))
        for folder in (self.out, *(one for each in (states, specs, reports) for one in (each.parent, each))):
            ensure_folder(folder)
        if len(made.states):
            made.save(states / f"{task.name}.pruned_init")
        write_whole(specs / f"{task.name}.spec", made.spec.text.encode())
        write_whole(reports / f"{task.name}.json", (json.dumps(report, indent=1) + "\n").encode())
        return report

    def load_report(self, task: LiberoTask) -> dict[str, Any] | None:
        """The report of a task that was made before, by the same request, if its states are still there."""
        try:
            found = json.loads((self.out / "reports" / task.suite / f"{task.name}.json").read_text())
        except (OSError, ValueError):
            return None
        same = isinstance(found, dict) and found.get("request") == self.request()
        there = (self.out / "init_files" / task.suite / f"{task.name}.pruned_init").exists()
        return found if same and (there or not found["states"]) else None


def write_home(out: Path) -> Path:
    """The file by which LIBERO finds the states: `LIBERO_CONFIG_PATH=OUT`. Raises OutputError."""
    paths = {**libero_paths(), "init_states": str(out.resolve() / "init_files")}
    ensure_folder(out)
    text = "".join(f"{key}: {json.dumps(path)}\n" for key, path in paths.items())
    write_whole(out / "config.yaml", text.encode())
    return out / "config.yaml"
