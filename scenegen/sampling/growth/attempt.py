"""Trying new poses: which scenes may take them, scored by what touches the objects that move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.sampling.growth.insert import MANY
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.touch import within

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


def attempt(
    particles: Particles,
    things: Sequence[int],
    new: Mapping[int, Array],
    allowed: Bool | None = None,
    *,
    places: bool = True,
) -> Bool:
    """Move `things` to the rows' new values, (P,) each, in the scenes in which all clauses in force stay met, and say
    in which that was so. `places`: the values are new to the scene, not those of another of its objects."""
    machine, cell = particles.machine, particles.cell
    graph = machine.graph
    good = np.ones(particles.count, dtype=bool) if allowed is None else allowed.copy()
    brought: dict[int, Array] = {}
    for row, value in new.items():
        low, high = graph.low[row], graph.high[row]
        least, most = (low[0], high[0]) if len(low) == 1 else (low[cell], high[cell])
        if machine.circular(row):
            lowest, highest = machine.problem.lowest[row], machine.problem.highest[row]
            value = value - (highest - lowest) * np.floor((value - lowest) / (highest - lowest))
            value = np.where(value >= highest, lowest, value)
        good &= (value >= least) & (value <= most)
        brought[row] = value
    if len(things) == 1:
        rows, trial = list(particles.scenes), particles.scenes  # the others stay: their rows are read as they are
    else:
        trial = particles.scenes.copy()
        for row, value in brought.items():
            trial[row] = value
        rows = list(trial)
    for row, value in brought.items():
        rows[row] = value
    _holds(particles, things, rows, trial, good)
    met = _ways_met(particles, things, rows, good)
    for row, value in brought.items():
        np.copyto(particles.scenes[row], value, where=good)
    for index, (which, held) in met.items():
        table = particles.met[index]
        assert table is not None
        table[which] = np.where(good, held, table[which])
    for thing in things if places else ():
        if 3 * thing in brought or 3 * thing + 1 in brought or 3 * thing not in graph.rows:
            particles.fresh[thing] |= good
    return good


def _holds(particles: Particles, things: Sequence[int], rows: Sequence[Array], trial: Array, good: Bool) -> None:
    """Take out of `good` (P,) the scenes that do not meet the clauses in force that touch `things`. `rows` are the
    tried rows, and `trial` (3N, P) the tried scenes, in which a single thing may stand as before."""
    machine, cell, stage = particles.machine, particles.cell, particles.stage
    for thing in things:
        touch = machine.touch[thing]
        met = touch.meets(rows, cell, stage)
        if met is not None:
            good &= met
            machine.count(len(touch.values(len(touch.in_force(stage)), ()).steps), len(good))
        for one in touch.way_clauses_in_force(stage):
            if machine.ends[one.choice] <= stage:
                continue
            some = np.flatnonzero(good & (particles.chosen[one.choice] == one.way))
            if len(some):
                values = touch.values(("way", one.clause.node), [one.clause.node])
                inside = within(values([row[some] for row in rows])[0], one.clause, cell[some])
                machine.count(len(values.steps), len(some))
                if inside is not None:
                    good[some] &= inside
    for thing in things:
        touch = machine.touch[thing]
        if touch.layers and good.any():
            x, y, theta = (rows[3 * thing + axis] for axis in range(3))
            machine.count(6 * stage, len(good))
            if good.mean() > MANY:
                touch.clear((x, y, theta), trial, cell, stage, good)
            else:
                some = np.flatnonzero(good)
                clear = np.ones(len(some), dtype=bool)
                touch.clear((x[some], y[some], theta[some]), trial, cell[some], stage, clear, some)
                good[some] = clear


def _ways_met(
    particles: Particles, things: Sequence[int], rows: Sequence[Array], good: Bool
) -> dict[int, tuple[Index, Bool]]:
    """For every choice whose objects are all placed and of which some way touches `things`: those ways, and which hold
    now. Takes scenes out of `good` in which no way is left."""
    machine, cell = particles.machine, particles.cell
    found: dict[int, tuple[Index, Bool]] = {}
    for index, table in enumerate(particles.met):
        if table is None:
            continue
        numbers = sorted({number for thing in things for number in machine.touch[thing].ways.get(index, ())})
        if not numbers:
            continue
        ways = [machine.graph.choices[index].ways[number] for number in numbers]
        touch = machine.touch[things[0]]
        values = touch.values(("met", index, *numbers), [way.whole.node for way in ways])
        machine.count(len(values.steps), len(good))
        held = np.ones((len(ways), len(good)), dtype=bool)
        for row, way, value in zip(held, ways, values(rows), strict=True):
            inside = within(value, way.whole, cell)
            if inside is not None:
                row &= inside
        which = np.array(numbers, dtype=np.intp)
        good &= table.sum(axis=0) - table[which].sum(axis=0) + held.sum(axis=0) > 0
        found[index] = which, held
    return found
