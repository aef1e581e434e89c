"""How much scenes with a common ancestor are alike."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from scenegen.pose import PLACE, is_angle, row_of
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.values import make_values

Array = npt.NDArray[np.float64]

T = TypeVar("T")

PAIRS = 24  # pairs of objects whose differences are watched
CLAUSES = 48  # clauses, and ways of choices, whose margins are watched


class Kinship:
    """The design effect of common ancestors: by how much the mean of a statistic varies more than that of independent
    scenes.

    Watched are all coordinates, signed and unsigned differences of pairs of objects, margins of clauses other than
    pairs, and means, variances and covariance of the places of all objects of one kind together, which stay when these
    trade places; all relative to the mean of the scene's cell.
    """

    def __init__(self, machine: Machine) -> None:
        graph = machine.graph
        self._machine = machine
        self._rows = sorted(graph.rows)
        clauses = [clause.node for clause in graph.clauses]
        ways = [way.whole.node for choice in graph.choices for way in choice.ways]
        self._margins = make_values(graph.core, [*_some(clauses, CLAUSES), *_some(ways, CLAUSES)])
        order = machine.order
        pairs = [(order[a], order[b]) for a in range(len(order)) for b in range(a)]
        self._pairs = _some(pairs, PAIRS)

    def __call__(self, particles: Particles) -> float:
        """1 where scenes of one ancestor are as different as any; the worst statistic counts, and the remembered
        generation of ancestors in which it is worst. What chance makes of some hundred statistics is taken off."""
        values = self._statistics(particles)
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

    def _statistics(self, particles: Particles) -> Array:
        """(S, P), standardised; those that are the same in all scenes are 0."""
        scenes, found = particles.scenes, list[Array]()
        for row in self._rows:
            found += [np.cos(scenes[row]), np.sin(scenes[row])] if is_angle(row) else [scenes[row]]
        for first, second in self._pairs:
            for axis in PLACE:
                apart = scenes[row_of(first, axis)] - scenes[row_of(second, axis)]
                found += [apart, np.abs(apart)]
        found += [np.broadcast_to(value, particles.count) for value in self._margins(list(scenes))]
        for kin in self._machine.kin:
            x, y = (scenes[[row_of(block[0], axis) for block in kin]] for axis in PLACE)
            found += [x.mean(axis=0), y.mean(axis=0), x.var(axis=0), y.var(axis=0)]
            found += [((x - x.mean(axis=0)) * (y - y.mean(axis=0))).mean(axis=0)]
        table = np.nan_to_num(np.array(found).reshape(len(found), particles.count))
        middle = table.mean(axis=1, keepdims=True)
        table -= middle
        if self._machine.cells > 1:
            # Scenes of one ancestor are of one cell. That cells differ is not kinship: each gets its share.
            counts = np.bincount(particles.cell, minlength=self._machine.cells)
            for row in table:
                row -= (np.bincount(particles.cell, weights=row, minlength=len(counts)) / np.maximum(counts, 1))[
                    particles.cell
                ]
        spread = np.sqrt((table * table).mean(axis=1, keepdims=True))
        out: Array = table * np.where(spread > 1e-9 * (1.0 + np.abs(middle)), 1.0 / np.maximum(spread, 1e-300), 0.0)
        return out


def _some(items: list[T], most: int) -> list[T]:
    """At most so many of the items, evenly over all."""
    return items[:: max(1, -(-len(items) // most))]
