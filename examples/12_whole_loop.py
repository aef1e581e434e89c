"""The whole loop in one file: a spec, a frozen suite of graded starts, two policies on it, and the report.

The world is a table without physics, so that this runs anywhere; worlds with physics have the same four methods
(docs/policies.md). Nothing is left behind.
"""

import contextlib
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.cli.app import run
from scenegen.suites import SuiteTask

Observation = dict[str, np.ndarray]

SPEC = """# Put the red cube beside the blue cube.
workspace [-15 cm, 15 cm] x [-15 cm, 15 cm]
object red = box(4 cm, 4 cm, 4 cm), blue = box(4 cm, 4 cm, 4 cm)
require clearOf(red, blue, 1 cm)
goal: closeTo(red, blue, 75 mm)
"""


class Table:
    """A world: made for each task, an action moves the first object by at most 2 cm."""

    def __init__(self, task: SuiteTask) -> None:
        self.task = task

    def reset(self, *, seed: int, options: dict[str, Any]) -> tuple[Observation, dict[str, Any]]:
        self.poses = options["start"].poses.copy()  # (N, 7): x, y, z, qw, qx, qy, qz
        return self._observation(), {"success": self._success()}

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        self.poses[0, :2] += np.clip(action, -0.02, 0.02)
        success = self._success()
        return self._observation(), float(success), success, False, {"success": success}

    def close(self) -> None:
        pass

    def _observation(self) -> Observation:
        return {"objects": self.poses.copy()}

    def _success(self) -> bool:
        headings = 2.0 * np.arctan2(self.poses[:, 6], self.poses[:, 3])
        flat = np.column_stack([self.poses[:, :2], headings])
        return bool(self.task.spec.scenes(flat[None]).phi[self.task.success][0] >= 0.0)


def towards(observation: Observation, instruction: str) -> np.ndarray:
    """A policy: the first object goes straight to the second."""
    return observation["objects"][1, :2] - observation["objects"][0, :2]


def short_sighted(observation: Observation, instruction: str) -> np.ndarray:
    """Another: it sees 20 cm far."""
    way = towards(observation, instruction)
    return way if np.hypot(*way) < 0.2 else np.zeros(2)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("beside.spec").write_text(SPEC)
        here = Path(__file__).resolve()
        for words in (
            "check beside.spec",
            "suite new beside.spec --bands 3 -n 10 --out beside/",
            f"suite run beside --world {here}:Table --policy {here}:towards --steps 50 --out towards.jsonl",
            f"suite run beside --world {here}:Table --policy {here}:short_sighted --steps 50 --out short.jsonl",
            "suite report beside towards.jsonl short.jsonl --out report.md",
        ):
            print(f"$ scenegen {words.replace(str(here), here.name)}", flush=True)
            if status := run(words.split()):
                raise SystemExit(status)
        print(Path("report.md").read_text())


if __name__ == "__main__":
    main()
