"""Trying new poses: which scenes may take them, scored by what touches the objects that move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.pose import FLAT, row_of
from scenegen.sampling.growth.insert import MANY
from scenegen.sampling.growth.outlook import chance
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.ways import held_of_all

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]


def attempt(
    particles: Particles,
    things: Sequence[int],
    new: Mapping[int, Array],
    allowed: Bool | None = None,
) -> Bool:
    """Move `things` to the rows' new values, (P,) each, in the scenes in which all clauses in force stay met, and say
    in which that was so. Where what begun choices promise changes, moves are taken in proportion to that."""
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
    held = _ways_held(particles, things, rows, good)
    for row, value in brought.items():
        np.copyto(particles.scenes[row], value, where=good)
    for index, (table, chances) in held.items():
        known = particles.held[index]
        assert known is not None
        np.copyto(known, table, where=good)
        np.copyto(particles.chances[index], chances, where=good)
    return good


def _holds(particles: Particles, things: Sequence[int], rows: Sequence[Array], trial: Array, good: Bool) -> None:
    """Take out of `good` (P,) the scenes that do not meet the clauses in force that touch `things`. `rows` are the
    tried rows, and `trial` (3N, P) the tried scenes, in which a single thing may stand as before."""
    machine, cell, stage = particles.machine, particles.cell, particles.stage
    for thing in things:
        touch = machine.touch[thing]
        met = touch.meets(rows, cell, stage, machine.effort.check)
        if met is not None:
            good &= met
            machine.count(len(touch.values(len(touch.in_force(stage)), ()).steps), len(good))
    for thing in things:
        touch = machine.touch[thing]
        if touch.layers and good.any():
            x, y, theta = (rows[row_of(thing, axis)] for axis in FLAT)
            machine.count(6 * stage, len(good))
            if good.mean() > MANY:
                touch.clear((x, y, theta), trial, cell, stage, good)
            else:
                some = np.flatnonzero(good)
                clear = np.ones(len(some), dtype=bool)
                touch.clear((x[some], y[some], theta[some]), trial, cell[some], stage, clear, some)
                good[some] = clear


def _ways_held(
    particles: Particles, things: Sequence[int], rows: Sequence[Array], good: Bool
) -> dict[int, tuple[Bool, Array]]:
    """For every choice of which some way touches `things`: which ways hold now (W, P), and the chance of the choice
    (P,). Takes scenes out of `good` as often as their chances have become worse."""
    machine, cell, stage = particles.machine, particles.cell, particles.stage
    found: dict[int, tuple[Bool, Array]] = {}
    touched = particles.touching(things)
    for index, held in zip(touched, held_of_all(machine, touched, rows, cell, stage), strict=True):
        known = particles.held[index]
        assert known is not None
        table = known.copy()
        table[list(touched[index])] = held
        chances = chance(table, machine.outlooks[index][:, stage], cell)
        good &= particles.rng.random(len(good)) * particles.chances[index] < chances
        found[index] = table, chances
    return found
