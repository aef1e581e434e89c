"""How good a model is, beside the truth: what its card says.

The truth comes from the exact samplers, fresh each time, never from training scenes. For a value of a label some scenes
in a narrow band around it are drawn. The phi of half of them, all labels, is what the model is asked for, so that its
scenes ought to be distributed as the other half is: that holds with several labels, too, of which not every
combination can be had.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.api.model import Model
from scenegen.errors import RequestError

Array = npt.NDArray[np.float64]

SCENES = 1000  # of each half
CURVE = 1500  # scenes of a calibration curve
BAND = 0.0125  # half the width of a band: the paper's tolerance, less where a label's range is small
NARROW = 0.02  # of the label's range
SEED = 20_231_001  # of the truth and of the model's noise
LABELS = 8  # that are measured one by one; a spec may have thousands
PATIENCE, ALL = 3.0, 30.0  # seconds for the truth of one band, and of all: what is too rare for that is left out


@dataclass(frozen=True, slots=True)
class Level:
    """A value of a label: the mean of |phi - wanted phi| of this label, in the unit of phi, the share of the true
    scenes that the model's scenes cover, and what other true scenes score there (scenegen.metrics.coverage)."""

    label: str
    wanted: float
    error: float
    covered: float
    truth: float


@dataclass(frozen=True, slots=True)
class Curve:
    """Wanted phi of a label, evenly over what the model was trained on, and the phi that it reached, (n,) each."""

    label: str
    wanted: Array
    reached: Array

    @property
    def error(self) -> float:
        return float(np.abs(self.reached - self.wanted).mean())


@dataclass(frozen=True, slots=True)
class Measured:
    """`missing` names the bands for which no truth was found."""

    levels: tuple[Level, ...]
    curves: tuple[Curve, ...]
    missing: tuple[str, ...]


def measure(model: Model, seconds: float = ALL) -> Measured:
    """Accuracy and coverage at a handful of values of each label, and calibration over all of its range. Takes about a
    second, half a minute or `seconds` where scenes are rare. Nothing is refined: it is the network's own output."""
    until = time.monotonic() + min(seconds, ALL)
    levels: list[Level] = []
    curves: list[Curve] = []
    missing: list[str] = []
    for index, (label, (low, high)) in enumerate(list(model.trained.label_ranges.items())[:LABELS]):
        for value in values(low, high):
            half = min(BAND, NARROW * (high - low))
            ends = max(low, value - half), min(high, value + half)
            try:
                rows, phi = _truth(model, label, ends, 2 * SCENES, until)
                levels.append(_level(model, index, value, rows, phi))
            except RequestError:
                missing.append(f"{label} near {value:.4g}")
        try:
            _, phi = _truth(model, label, (low, high), CURVE, until)
        except RequestError:
            missing.append(f"{label} over its range")
            continue
        curves.append(Curve(label, phi[index], _reached(model, _made(model, phi))[index]))
    return Measured(tuple(levels), tuple(curves), tuple(missing))


def values(low: float, high: float) -> list[float]:
    """Five values of a label to look at: from hopeless to as good as solved, closer where both meet."""
    if low < 0.0 < high:
        return [0.75 * low, 0.25 * low, 0.0, high / 3.0, 2.0 * high / 3.0]
    return [low + share * (high - low) for share in (0.1, 0.3, 0.5, 0.7, 0.9)] if low < high else []


def _truth(model: Model, label: str, ends: tuple[float, float], count: int, until: float) -> tuple[Array, Array]:
    """Exact scenes (3N, n) and their phi (L, n), in random order. Raises RequestError where there are too few, or they
    take too long; the clock decides whether a band is measured, never what is measured there."""
    from scenegen.engine.exact import draw
    from scenegen.sampling.problem import Budget, pose
    from scenegen.sampling.request import Range

    problem = pose(model.spec.checked, {label: Range(*ends)}, n=count, seed=SEED)
    found = draw(problem, Budget(max(0.0, min(PATIENCE, until - time.monotonic()))))
    if found.shortfall is not None:
        raise RequestError(found.shortfall)
    order = np.random.default_rng(SEED).permutation(found.count)
    return found.rows[:, order], found.phi[:, order]


def _level(model: Model, index: int, value: float, rows: Array, phi: Array) -> Level:
    from scenegen.metrics.coverage import coverage

    half = rows.shape[1] // 2
    made = _made(model, phi[:, half:])
    error = np.abs(_reached(model, made)[index] - phi[index, half:]).mean()
    truth = coverage(rows[:, :half], rows[:, half:])
    return Level(model.spec.labels[index], value, float(error), coverage(rows[:, :half], made), truth)


def _made(model: Model, phi: Array) -> Array:
    """The model's scenes (3N, n) for labels (L, n)."""
    import torch

    generator = torch.Generator().manual_seed(SEED)
    rows: Array = model.trained.propose(torch.from_numpy(phi).to(torch.float32), generator).double().numpy()
    return rows


def _reached(model: Model, rows: Array) -> Array:
    """phi (L, n) of scenes by the exact spec."""
    from scenegen.lang.interpret import phi as score
    from scenegen.primitives import NUMPY

    found = score(model.spec.checked.core, list(rows), NUMPY)
    return np.array([np.broadcast_to(found[label], rows.shape[1]) for label in model.spec.labels], dtype=np.float64)
