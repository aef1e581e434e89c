"""How good a model is, beside the truth: what its card says.

The truth comes from the exact samplers, fresh each time, never from training scenes. For a value of a label some scenes
in a narrow band around it are drawn. The phi of half of them is what the model is asked for, of this label alone, so
that its scenes ought to be distributed as the other half is. The same for two labels together. A model that has to be
told every label gets all of them, as true scenes have them.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.evaluation.fidelity import Fidelity, fidelity
from scenegen.evaluation.model import Model
from scenegen.lang.core import REQUIRE, gated

if TYPE_CHECKING:
    from scenegen.models.trained import TrainedModel

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
    """Wanted values of one label or two, and how the model's scenes compare: the mean of |phi - wanted phi| of the
    label that is furthest off, in the unit of phi; the figures of the model's scenes and of other true ones; the share
    that meets what the spec requires. `alone` are error and share of the network without its correction, where the
    model has one."""

    wanted: Mapping[str, float]
    error: float
    made: Fidelity
    truth: Fidelity
    required: float
    alone: tuple[float, float] | None = None

    def __str__(self) -> str:
        return ", ".join(f"{label} {value:.4g}" for label, value in self.wanted.items())


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
    """Accuracy and distribution at a handful of values of each label and of each two labels that follow each other, and
    calibration over all of a label's range. Takes some seconds, half a minute or `seconds` where scenes are rare. It is
    the model's raw output: nothing is refined."""
    until = time.monotonic() + min(seconds, ALL)
    levels: list[Level] = []
    curves: list[Curve] = []
    missing: list[str] = []
    ranges = dict(list(model.trained.label_ranges.items())[:LABELS])
    names = list(ranges)

    def look(wanted: Mapping[str, float]) -> Array | None:
        """The phi of true scenes there, (L, n)."""
        try:
            rows, phi = _truth(model, _bands(wanted, ranges), 2 * SCENES, until)
        except RequestError:
            missing.append("near " + ", ".join(f"{label} {value:.4g}" for label, value in wanted.items()))
            return None
        levels.append(level(model, wanted, rows, phi))
        return phi

    for index, (label, (low, high)) in enumerate(ranges.items()):
        for place, value in enumerate(values(low, high)):
            phi = look({label: value})
            if phi is not None and place % 2 and index + 1 < len(names):
                other = names[index + 1]
                look({label: value, other: float(np.median(phi[model.spec.labels.index(other)]))})
        try:
            _, phi = _truth(model, {label: (low, high)}, CURVE, until)
        except RequestError:
            missing.append(f"{label} over its range")
            continue
        curves.append(Curve(label, phi[index], _reached(model, _made(model.trained, phi, [label]))[label]))
    return Measured(tuple(levels), tuple(curves), tuple(missing))


def level(model: Model, wanted: Mapping[str, float], rows: Array, phi: Array) -> Level:
    """How the model compares with true scenes (3N, 2n) whose phi is (L, 2n): with the first half, when it is asked for
    the phi that the second half has of the `wanted` labels."""
    from scenegen.models.layout import depends_on

    half = rows.shape[1] // 2
    true, fresh, asked = rows[:, :half], rows[:, half:], phi[:, half:]
    depends = depends_on(model.spec.checked.core)
    made = _made(model.trained, asked, list(wanted))
    error, required = _off(model, made, asked, wanted)
    alone = None
    if model.trained.correction is not None:
        alone = _off(model, _made(model.trained.network, asked, list(wanted)), asked, wanted)
    return Level(dict(wanted), error, fidelity(true, made, depends), fidelity(true, fresh, depends), required, alone)


def _off(model: Model, rows: Array, asked: Array, wanted: Mapping[str, float]) -> tuple[float, float]:
    """The error of phi of scenes (3N, n), and the share that meets what is required."""
    reached = _reached(model, rows)
    errors = [float(np.abs(reached[name] - asked[model.spec.labels.index(name)]).mean()) for name in wanted]
    return max(errors), float((reached[REQUIRE] >= 0.0).mean()) if REQUIRE in reached else 1.0


def _bands(wanted: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    found = {}
    for label, value in wanted.items():
        low, high = ranges[label]
        half = min(BAND, NARROW * (high - low))
        found[label] = max(low, value - half), min(high, value + half)
    return found


def values(low: float, high: float) -> list[float]:
    """Five values of a label to look at: from hopeless to as good as solved, closer where both meet."""
    if low < 0.0 < high:
        return [0.75 * low, 0.25 * low, 0.0, high / 3.0, 2.0 * high / 3.0]
    return [low + share * (high - low) for share in (0.1, 0.3, 0.5, 0.7, 0.9)] if low < high else []


def _truth(model: Model, ranges: Mapping[str, tuple[float, float]], count: int, until: float) -> tuple[Array, Array]:
    """Exact scenes (3N, n) and their phi (L, n), in random order. Raises RequestError where there are too few, or they
    take too long; the clock decides whether a band is measured, never what is measured there."""
    from scenegen.engine.run import draw
    from scenegen.sampling.problem import Budget, make_problem
    from scenegen.sampling.request import Range, SampleRequest

    wanted = {label: Range(*ends) for label, ends in ranges.items()}
    request = SampleRequest(wanted, count, SEED, spread="base" if count > CURVE else "flat")
    budget = Budget(max(0.0, min(PATIENCE, until - time.monotonic())))
    found = draw(make_problem(model.spec.checked, request, budget), budget)
    if found.shortfall is not None:
        raise RequestError(found.shortfall)
    order = np.random.default_rng(SEED).permutation(found.count)
    return found.rows[:, order], found.phi[:, order]


def _made(trained: TrainedModel, phi: Array, labels: list[str]) -> Array:
    """The model's scenes (3N, n) for the phi (L, n) of some labels; a model that cannot leave labels free gets all."""
    import torch

    generator = torch.Generator().manual_seed(SEED)
    wanted = trained.asked(torch.from_numpy(phi).to(torch.float32), labels)
    rows: Array = trained.propose(wanted, generator).double().numpy()
    return rows


def _reached(model: Model, rows: Array) -> dict[str, Array]:
    """phi (n,) of scenes by the exact spec, of each label and of what is required."""
    from scenegen.lang.interpret import phi as score
    from scenegen.primitives import NUMPY

    found = score(gated(model.spec.checked.core), list(rows), NUMPY)
    return {name: np.broadcast_to(np.asarray(value, dtype=np.float64), rows.shape[1]) for name, value in found.items()}
