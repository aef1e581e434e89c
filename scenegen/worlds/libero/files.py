"""States of whole suites: a folder that the evaluations of LIBERO and LeRobot read as their home."""

from __future__ import annotations

import contextlib
import gc
import io
import json
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.request import Phi
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.errors.worlds import PLACEMENT
from scenegen.needs import need
from scenegen.sampling.request import parse_phi
from scenegen.scenes.files import ensure_folder, whole_file, write_whole
from scenegen.worlds.libero.spec import spec_of
from scenegen.worlds.libero.states import SettledStates, init_states

SUITES = ("libero_spatial", "libero_object", "libero_goal", "libero_10", "libero_90")
LABELS = "goal", "start"
PATHS = "benchmark_root", "bddl_files", "init_states", "datasets", "assets"  # what LIBERO's config.yaml names


@dataclass(frozen=True, slots=True)
class LiberoTask:
    """A task of LIBERO: its suite, its name, and its BDDL file."""

    suite: str
    name: str
    file: Path


@dataclass(frozen=True, slots=True)
class TaskReport:
    """What a request has made of a task: `states` of `wanted` ones, of `drawn` scenes. Of those that settled, in
    `agreed` of `judged` phi's sign was LIBERO's judgement; `refused` counts what was left out, by reason. `phi` is that
    of each state, `moved` how far anything moved in 20 steps of LIBERO's, in metres."""

    suite: str
    task: str
    request: Mapping[str, object]
    states: int
    wanted: int
    drawn: int
    judged: int
    agreed: int
    refused: Mapping[str, int]
    phi: Mapping[str, Sequence[float]]
    moved: Sequence[float]

    @property
    def line(self) -> str:
        """For people."""
        why = ", ".join(f"{count} {reason}" for reason, count in self.refused.items())
        goal = self.phi.get("goal", ())
        span = f", phi of goal {min(goal):.3g} to {max(goal):.3g}" if goal else ""
        return f"{self.states} states of {self.drawn} scenes{span}" + (f"; left out: {why}" if why else "")


def tasks_of(name: str) -> list[LiberoTask]:
    """The tasks of a suite, the task of a name, or that of a BDDL file. Raises RequestError."""
    path = Path(name)
    if path.suffix == ".bddl" and path.is_file():
        return [LiberoTask(path.resolve().parent.name, path.stem, path.resolve())]
    need("libero", "for its suites and tasks")
    folder = Path(_paths()["bddl_files"])
    found = [
        LiberoTask(one.parent.name, one.stem, one)
        for suite in ((name,) if (folder / name).is_dir() and name else SUITES)
        for one in sorted((folder / suite).glob("*.bddl"))
        if name in (suite, one.stem)
    ]
    if not found:
        raise RequestError(UNKNOWN_CHOICE(what="suite or task of LIBERO's", name=name, known=SUITES))
    return found if name in SUITES or (folder / name).is_dir() else found[:1]


def _paths() -> dict[str, str]:
    with _silence():
        from libero.libero import get_libero_path

        return {key: str(get_libero_path(key)) for key in PATHS}


def make_environment(task: LiberoTask, seed: int) -> Any:
    """LIBERO's environment of a task, without pictures, and reset."""
    need("libero", "to simulate its tasks")
    with _silence():
        from libero.libero.envs.env_wrapper import ControlEnv

        env = ControlEnv(
            bddl_file_name=str(task.file),
            use_camera_obs=False,
            has_renderer=False,
            has_offscreen_renderer=False,
            hard_reset=False,
        )
        env.seed(seed)
        env.reset()
    return env


@dataclass(frozen=True, slots=True)
class StatesJob:
    """Makes the states of a task, and writes them below `out`; a task whose states are there already is read.

    `phi` are ranges as they are typed, by default of starts that miss.
    """

    out: Path
    phi: tuple[str, ...] = ()
    n: int = 50
    seed: int = 0
    settle: float = 1.0

    @property
    def request(self) -> dict[str, object]:
        return {"phi": list(self.phi), "n": self.n, "seed": self.seed, "settle": self.settle}

    def __call__(self, task: LiberoTask) -> TaskReport:
        """Raises RequestError, also where there are fewer states than wanted, which are written all the same."""
        done = self.done(task)
        report = done if done is not None else self.make(task)
        if report.states < report.wanted:
            refused = ", ".join(f"{reason} ({count})" for reason, count in report.refused.items()) or "there are none"
            raise RequestError(PLACEMENT(found=report.states, wanted=report.wanted, reasons=refused))
        return report

    def make(self, task: LiberoTask) -> TaskReport:
        ranges: Phi | None = parse_phi(self.phi, LABELS) or None
        env = make_environment(task, self.seed)
        try:
            spec = spec_of(env)
            made = init_states(env, ranges, self.n, settle=self.settle, spec=spec, seed=self.seed)
        finally:
            with contextlib.suppress(Exception):
                env.close()
            del env
            gc.collect()  # or its models would pile up
        return self.write(task, made)

    def write(self, task: LiberoTask, made: SettledStates) -> TaskReport:
        report = TaskReport(
            task.suite, task.name, self.request, len(made.states), self.n, made.drawn, made.judged, made.agreed,
            made.refused, {label: made.phi[label].tolist() for label in made.phi}, made.moved.tolist(),
        )  # fmt: skip
        states, specs, reports = (self.out / one / task.suite for one in ("init_files", "specs", "reports"))
        for folder in (self.out, *(one for each in (states, specs, reports) for one in (each.parent, each))):
            ensure_folder(folder)
        if report.states:
            made.save(states / f"{task.name}.pruned_init")
            with whole_file(states / f"{task.name}.pruned_init.npz") as file:
                np.savez_compressed(file, states=made.states)
        write_whole(specs / f"{task.name}.spec", made.spec.text.encode())
        write_whole(reports / f"{task.name}.json", (json.dumps(asdict(report), indent=1) + "\n").encode())
        return report

    def done(self, task: LiberoTask) -> TaskReport | None:
        """The report of a task that was made before, by the same request."""
        try:
            found = json.loads((self.out / "reports" / task.suite / f"{task.name}.json").read_text())
            report = TaskReport(**found)
        except (OSError, ValueError, TypeError):
            return None
        return report if report.request == self.request else None


def write_home(out: Path) -> Path:
    """The file by which LIBERO finds the states: `LIBERO_CONFIG_PATH=OUT`. Raises OutputError."""
    paths = {**_paths(), "init_states": str(out.resolve() / "init_files")}
    ensure_folder(out)
    text = "".join(f"{key}: {json.dumps(path)}\n" for key, path in paths.items())
    write_whole(out / "config.yaml", text.encode())
    return out / "config.yaml"


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """robosuite and LIBERO print as they are imported and made."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        logging.disable(before)
