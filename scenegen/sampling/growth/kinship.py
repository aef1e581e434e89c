"""How much scenes with a common ancestor are alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.frame import frame_of
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.mixing import Statistics

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]


@dataclass(slots=True)
class _View:
    """Scenes as the statistics of chains read them."""

    rows: list[Array]
    phi: list[Array]
    families: list[Index]

    @property
    def count(self) -> int:
        return len(self.families[0])


class Kinship:
    """The design effect of common ancestors: by how much the mean of a statistic varies more than that of independent
    scenes. Watched are the statistics of `mixing`, and those of all objects of one kind together, which stay when they
    take each other's places."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._frame = frame_of(machine.problem)
        self._statistics = Statistics(self._frame)

    def __call__(self, particles: Particles) -> float:
        """1 where scenes of one ancestor are as different as any; the worst statistic counts, and the remembered
        generation of ancestors in which it is worst. What chance makes of some hundred statistics is taken off."""
        values = np.concatenate([self._single(particles), self._collective(particles)])
        worst = 1.0
        for family in particles.families:
            sizes = np.bincount(family)
            pairs = float((sizes * (sizes - 1.0)).sum())
            if pairs <= 0.0:
                continue
            sums = np.stack([np.bincount(family, weights=row, minlength=len(sizes)) for row in values])
            alike = ((sums * sums).sum(axis=1) - (values * values).sum(axis=1)) / pairs
            correlation = float(alike.max(initial=0.0)) - 3.0 * np.sqrt(2.0 / pairs)
            worst = max(worst, 1.0 + max(0.0, correlation) * pairs / particles.count)
        return worst

    def _single(self, particles: Particles) -> Array:
        scenes = particles.scenes
        rows = [scenes[row] for row in self._frame.rows]
        return self._statistics(_View(rows, list(self._machine.problem.phi(scenes)), particles.families))

    def _collective(self, particles: Particles) -> Array:
        """Means over the objects of a kind, (S, P), standardised."""
        found: list[Array] = []
        for kin in self._machine.kin:
            x, y = (particles.scenes[[3 * block[0] + axis for block in kin]] for axis in range(2))
            found += [x.mean(axis=0), y.mean(axis=0)]
            found += [x.var(axis=0), y.var(axis=0), ((x - x.mean(axis=0)) * (y - y.mean(axis=0))).mean(axis=0)]
        table = np.array(found).reshape(len(found), particles.count)
        table -= table.mean(axis=1, keepdims=True)
        spread = np.sqrt((table * table).mean(axis=1, keepdims=True))
        out: Array = table * np.where(spread > 1e-12, 1.0 / np.maximum(spread, 1e-300), 0.0)
        return out
