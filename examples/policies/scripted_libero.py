"""The scripted policy in tasks of LIBERO in which one thing is put somewhere: it makes the spec from the environment.

    scenegen suite run SUITE --policy examples/policies/scripted_libero.py:Scripted --world libero

Drawers, doors and knobs are beyond it, and so is what its fingers do not go around: bowls and plates.
"""

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

import scenegen
from scenegen.libero import spec_of

sys.path.insert(0, str(Path(__file__).parent))

import scripted


class Scripted(scripted.Scripted):
    """One for each world, which is reset."""

    def __init__(self, env: Any, see: float = 0.0, put: float = 0.0) -> None:
        env.env.reset()
        self.own = spec_of(env.env)
        super().__init__(SimpleNamespace(task=SimpleNamespace(spec=self.own.spec, success="goal")), see, put)

    def moves(self, poses: np.ndarray) -> scripted.Moves:
        """With all that the goal does not move held where it is: starts need not be where the spec has starts."""
        lines = []
        for line in self.own.text.splitlines():
            found = re.match(r"(object (\w+) = .*\)) on \w+$", line)
            if found and found[2] in self.own.spec.objects:
                x, y, theta = poses[self.own.spec.objects.index(found[2])]
                line = f"{found[1]} at ({x:.6f}, {y:.6f}, {theta:.6f})"
            if not line.startswith("require") or "apart" in line:
                lines.append(line)
        return scripted.plan(scenegen.parse("\n".join(lines)), self.label, poses)

    def things(self) -> np.ndarray:
        """LIBERO's places are those of bodies, the spec's those of lowest points; the ground may be lower than its
        workspace; fixtures and joints are no bodies of their own."""
        there = dict(zip(self.seen["names"], self.seen["objects"], strict=True))
        found = np.zeros((len(self.own.spec.objects), 7))
        found[:, 3] = 1.0
        for which, name in enumerate(self.own.spec.objects):
            if name in there:
                found[which] = there[name]
                found[which, 2] += self.own.prisms[name].bottom
            elif which in self.own.spec.checked.fixed:
                x, y, theta = self.own.spec.checked.fixed[which]
                found[which] = x, y, 0.0, np.cos(theta / 2.0), 0.0, 0.0, np.sin(theta / 2.0)
        return found
