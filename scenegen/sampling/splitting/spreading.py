"""Weights under which chains visit all cells of a range about equally often, so that one descent serves every cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenegen.sampling.cells import Cells
from scenegen.sampling.splitting.chains import Chains, Region, which_cell
from scenegen.sampling.splitting.tuning import Tuner

Array = npt.NDArray[np.float64]

_PATIENCE = 48  # maximum number of rounds until the cells are balanced
_QUIET = 4  # after so many rounds without a new cell the others count as unreachable
_EVEN = 0.4  # the least visited cell must have this share of the mean
_LOOKS = 4  # counts of the chains in a round
_LEAP = 3.0  # maximum change of a log weight in a round


def even_out(chains: Chains, tuner: Tuner) -> Iterator[tuple[Region, int]]:
    """A sequence of regions whose weights balance the cells better and better, each with the moves that were made in
    it. The last one closes cells that no chain has entered, by weight 0. The chains end in the last region.

    A cell with too few chains gains weight; one without chains gets its neighbours' weight (multicanonical recursion,
    Berg and Neuhaus 1992).
    """
    cells, base = chains.cells, chains.region
    log_weight = np.zeros(cells.count)
    visited = np.zeros(cells.count, dtype=bool)
    quiet = 0
    for _ in range(_PATIENCE):
        counts, moves = np.zeros(cells.count), 0
        for _ in range(_LOOKS):
            moves += tuner.adapt()
            counts += np.bincount(which_cell(chains.phi, cells), minlength=cells.count)
        yield chains.region, moves
        known = counts > 0
        quiet = 0 if (known & ~visited).any() else quiet + 1
        visited |= known
        if quiet >= _QUIET and counts[visited].min() >= _EVEN * counts[visited].mean():
            break
        share = np.log(np.maximum(counts, 1.0) / counts[known].mean())
        log_weight -= np.where(known, np.clip(share, -_LEAP, _LEAP), 0.0)
        log_weight = np.where(visited, log_weight, _around(log_weight, visited, cells))
        chains.narrow(replace(base, weights=_weights(log_weight, visited)))
    chains.narrow(replace(base, weights=np.where(visited, _weights(log_weight, visited), 0.0)))
    yield chains.region, tuner.adapt()


def _weights(log_weight: Array, visited: npt.NDArray[np.bool_]) -> Array:
    out: Array = np.exp(np.clip(log_weight - log_weight[visited].max(), -600.0, 600.0))
    return out


def _around(log_weight: Array, visited: npt.NDArray[np.bool_], cells: Cells) -> Array:
    """For every cell, the mean log weight of the visited cells beside it; the smallest of all if there are none."""
    shape = tuple(len(edge) - 1 for edge in cells.edges)
    values, known = np.where(visited, log_weight, 0.0).reshape(shape), visited.reshape(shape).astype(np.float64)
    total, many = np.zeros(shape), np.zeros(shape)
    for axis in range(len(shape)):
        for here, there in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            before: tuple[slice, ...] = (slice(None),) * axis
            total[(*before, here)] += values[(*before, there)]
            many[(*before, here)] += known[(*before, there)]
    least = float(log_weight[visited].min())
    out: Array = np.where(many > 0, total / np.maximum(many, 1.0), least).ravel()
    return out
