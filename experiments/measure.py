"""What is measured of a set of scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import torch

from experiments.metrics import error_statistics, ks_screen
from experiments.problems import BAND, ORDERINGS, Problem
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.pose import X, Y, rows_along
from scenegen.scenes.coverage import coverage

Array = npt.NDArray[np.float64]
Values = dict[str, float]


def rows_of(scenes: SceneSet) -> Array:
    """(n, N, 3) poses as (3N, n) storage."""
    return np.ascontiguousarray(scenes.poses.reshape(len(scenes), -1).T)


def phi_of(spec: Spec, rows: Array) -> Array:
    """phi (L, n) of scenes (3N, n), exactly and in float64."""
    found: Array = spec.robustness().rows(torch.from_numpy(np.array(rows, order="C"))).numpy()
    return found


def accuracy(problem: Problem, spec: Spec, rows: Array) -> Values:
    """Errors of phi of the scenes (3N, n) against what was wanted, per label and for all at once."""
    wanted = np.array([problem.wanted[label] for label in spec.labels])
    found = error_statistics(phi_of(spec, rows), wanted, spec.labels)
    values: Values = {"within": found.within}
    for one in found.labels:
        values |= {f"mean:{one.label}": one.mean, f"std:{one.label}": one.std, f"error:{one.label}": one.mean_abs}
    return values


def in_range(problem: Problem, spec: Spec, rows: Array) -> float:
    """Share of the scenes (3N, n) whose phi lies within BAND of what was wanted, for every label. None: 0."""
    if not rows.shape[1]:
        return 0.0
    wanted = np.array([problem.wanted[label] for label in spec.labels])
    return float((np.abs(phi_of(spec, rows) - wanted[:, None]) <= BAND).all(axis=0).mean())


def covered(reference: Array, rows: Array) -> float:
    """Coverage of the reference (3N, R) by as many of the scenes (3N, n). No scenes cover nothing."""
    return coverage(reference, rows[:, : reference.shape[1]]) if rows.shape[1] else 0.0


def ks_distance(reference: Array, rows: Array) -> float:
    """The largest Kolmogorov-Smirnov (of headings: Kuiper) distance between a coordinate's, or a difference's,
    distribution in the reference (3N, R) and in the scenes (3N, n), in [0, 1]: what coverage does not see, scenes that
    are everywhere but too dense in places. No scenes are as far away as can be."""
    if not rows.shape[1]:
        return 1.0
    return max(column.statistic for column in ks_screen(reference, rows).columns)


def margins(rows: Array) -> Array:
    """(4, n): by how much the blocks of scenes (3N, n) are in each of ORDERINGS; the least step between neighbours."""
    steps_x, steps_y = np.diff(rows[rows_along(X)], axis=0), np.diff(rows[rows_along(Y)], axis=0)
    return np.stack([steps_x.min(axis=0), (-steps_x).min(axis=0), steps_y.min(axis=0), (-steps_y).min(axis=0)])


def shares(problem: Problem, rows: Array, prefix: str) -> Values:
    """The share of each ordering among the scenes (3N, n); nothing where the spec is not about orderings."""
    if not problem.blocks or not rows.shape[1]:
        return {}
    nearest = margins(rows).argmax(axis=0)
    return {f"{prefix}:{name}": float((nearest == place).mean()) for place, name in enumerate(ORDERINGS)}


def target(problem: Problem, labels: Sequence[str], count: int, **change: float) -> torch.Tensor:
    """(L, count) float32: the wanted phi, with the labels in `change` elsewhere."""
    return columns({**problem.wanted, **change}, labels, count)


def columns(wanted: Mapping[str, float], labels: Sequence[str], count: int) -> torch.Tensor:
    """(L, count) float32, the same phi in every column."""
    return torch.tensor([wanted[label] for label in labels])[:, None].expand(-1, count).contiguous()
