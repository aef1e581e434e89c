"""How good a model is, beside the truth: what its card says.

The truth comes from the exact samplers, fresh each time, never from training scenes. For a value of a label some scenes
in a narrow band around it are drawn. The phi of half of them is what the model is asked for, of this label alone, so
that its scenes ought to be distributed as the other half is. The same for two labels together. A model that has to be
told every label gets all of them, as true scenes have them. Beside these raw scenes, those that `sample` returns are
measured for what most people ask for: satisfied, just below, and where the model was trained.

Time is counted in seconds of CPU: how busy a machine is does not decide what is measured.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.lang.formula.core import REQUIRE, gated
from scenegen.learn.evaluation.describe import Model
from scenegen.learn.evaluation.fidelity import Fidelity, fidelity, kolmogorov_smirnov
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest, parse_phi
from scenegen.search.effort import StoppedError

if TYPE_CHECKING:
    from scenegen.learn.models.trained import TrainedModel

Array = npt.NDArray[np.float64]

SCENES = 1000  # of each half
CURVE = 1500  # scenes of a calibration curve
BAND = 0.0125  # half the width of a band: the paper's tolerance, less where a label's range is small
NARROW = 0.02  # of the label's range
HALF = 0.6  # of ALL, at most, for what `sample` returns
SEED = 20_231_001  # of the truth and of the model's noise
LABELS = 8  # that are measured one by one; a spec may have thousands
PATIENCE, ALL = 6.0, 40.0  # seconds of CPU for the truth of one band, and of all: what takes longer is left out


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
class Reach:
    """What `sample` returns for ranges of phi, and how it compares: the KS distance of the phi that is furthest off,
    and the figures of the model's scenes and of other true ones."""

    wanted: Mapping[str, Range]
    phi: float
    made: Fidelity
    truth: Fidelity

    def __str__(self) -> str:
        return ", ".join(f"{label} {one}" for label, one in self.wanted.items())


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
    ranges: tuple[Reach, ...] = ()


@dataclass(frozen=True, slots=True)
class _Seconds(Budget):
    """So many seconds of CPU; infinite for no limit."""

    began: float = field(default_factory=time.process_time)
    allowed: float = math.inf

    @property
    def spent(self) -> bool:
        return time.process_time() - self.began >= self.allowed

    @property
    def overdrawn(self) -> bool:
        return self.spent

    def some(self, seconds: float) -> _Seconds:
        """A part of what is left."""
        left = self.allowed - (time.process_time() - self.began)
        return _Seconds(math.inf, allowed=max(0.0, min(seconds, left)))


def measure(model: Model, seconds: float = ALL) -> Measured:
    """Accuracy and distribution at a handful of values of each label and of each two labels that follow each other, and
    calibration over all of a label's range; all this of the model's raw output. Also what `sample` returns in the
    ranges of `asked_for`. Takes some seconds, ALL or `seconds` where scenes are rare."""
    budget = _Seconds(math.inf, allowed=min(seconds, ALL))
    levels: list[Level] = []
    curves: list[Curve] = []
    missing: list[str] = []
    reaches: list[Reach] = []
    first = budget.some(HALF * budget.allowed)
    for ends in asked_for(model):
        try:
            reaches.append(reached(model, ends, first.some(2.0 * PATIENCE)))
        except (RequestError, StoppedError):
            missing.append(", ".join(f"{label} {one}" for label, one in ends.items()))
    ranges = dict(list(model.trained.label_ranges.items())[:LABELS])
    names = list(ranges)

    def look(wanted: Mapping[str, float]) -> Array | None:
        """The phi of true scenes there, (L, n)."""
        try:
            rows, phi = _truth(model, _bands(wanted, ranges), 2 * SCENES, budget.some(PATIENCE))
        except (RequestError, StoppedError):
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
            _, phi = _truth(model, {label: Range(low, high)}, CURVE, budget.some(PATIENCE))
        except (RequestError, StoppedError):
            missing.append(f"{label} over its range")
            continue
        curves.append(Curve(label, phi[index], _reached(model, _made(model.trained, phi, [label]))[label]))
    return Measured(tuple(levels), tuple(curves), tuple(missing), tuple(reaches))


def level(model: Model, wanted: Mapping[str, float], rows: Array, phi: Array) -> Level:
    """How the model compares with true scenes (3N, 2n) whose phi is (L, 2n): with the first half, when it is asked for
    the phi that the second half has of the `wanted` labels."""
    from scenegen.learn.models.layout import depends_on

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


def _bands(wanted: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]) -> dict[str, Range]:
    found = {}
    for label, value in wanted.items():
        low, high = ranges[label]
        half = min(BAND, NARROW * (high - low))
        if low < 0.0 < high and abs(value) <= high:  # narrow beside what is satisfied, however little that is
            half = min(half, high / 6.0)
        found[label] = Range(max(low, value - half), min(high, value + half))
    return found


def asked_for(model: Model) -> list[dict[str, Range]]:
    """What most people ask for: that all labels are satisfied, each, each just not, and where the model was trained."""
    found: list[dict[str, Range]] = []
    told = model.trained.card.training.get("phi")
    if isinstance(told, dict) and told:
        found.append(parse_phi([f"{label}={one}" for label, one in told.items()], model.spec.labels))
    both = {label: ends for label, ends in model.trained.label_ranges.items() if ends[0] < 0.0 < ends[1]}
    if 1 < len(both) == len(model.spec.labels):
        found.append(dict.fromkeys(both, Range(0.0, None)))
    for label, (low, high) in list(both.items())[:LABELS]:
        found += [{label: Range(0.0, None)}, {label: Range(max(low, -high), 0.0)}]
    return [ends for place, ends in enumerate(found) if ends not in found[:place]]


def reached(model: Model, ends: Mapping[str, Range], budget: Budget) -> Reach:
    """How the scenes compare that `sample` returns as they occur in these ranges. Raises RequestError and StoppedError
    where there is no truth, or no scene of the model, within the budget."""
    from scenegen.learn.models.layout import depends_on

    rows, phi = _truth(model, ends, 2 * SCENES, budget)
    made, told = returned(model, ends, SCENES, budget)
    half = rows.shape[1] // 2
    depends = depends_on(model.spec.checked.core)
    off = [kolmogorov_smirnov(phi[place], told[place])[0] for place in map(model.spec.labels.index, ends)]
    true, fresh = rows[:, :half], rows[:, half:]
    return Reach(dict(ends), max(off), fidelity(true, made[:, :half], depends), fidelity(true, fresh, depends))


def returned(model: Model, ends: Mapping[str, Range], count: int, budget: Budget) -> tuple[Array, Array]:
    """`count` scenes (3N, count) that a model gives for ranges of phi, as they occur there, and their phi (L, count).
    Raises RequestError."""
    from scenegen.learn.guided import make_plan
    from scenegen.learn.models.proposer import make_proposer
    from scenegen.sampling.engine.run import in_memory

    request = SampleRequest(dict(ends), count, SEED, spread="base", workers=1)
    proposer = replace(make_proposer(model.trained), asked=tuple(ends))
    found = in_memory(make_plan(make_problem(model.spec.checked, request), budget, proposer), budget)
    if found.shortfall is not None:
        raise RequestError(found.shortfall)
    return found.rows, found.phi


def values(low: float, high: float) -> list[float]:
    """Five values of a label to look at: from hopeless to as good as solved, closer where both meet."""
    if low < 0.0 < high:
        return [0.75 * low, 0.25 * low, 0.0, high / 3.0, 2.0 * high / 3.0]
    return [low + share * (high - low) for share in (0.1, 0.3, 0.5, 0.7, 0.9)] if low < high else []


def _truth(model: Model, ranges: Mapping[str, Range], count: int, budget: Budget) -> tuple[Array, Array]:
    """Exact scenes (3N, n) and their phi (L, n), in random order, at least half of `count`. Raises RequestError and
    StoppedError where there are fewer within the budget; it decides whether a band is measured, and with how many
    scenes, never what is measured there."""
    from scenegen.sampling.engine.run import draw

    request = SampleRequest(dict(ranges), count, SEED, spread="base" if count > CURVE else "flat")
    found = draw(make_problem(model.spec.checked, request, budget), budget)
    if found.shortfall is not None and 2 * found.count < count:
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
    from scenegen.geometry import NUMPY
    from scenegen.lang.formula.interpret import phi as score

    found = score(gated(model.spec.checked.core), list(rows), NUMPY)
    return {name: np.broadcast_to(np.asarray(value, dtype=np.float64), rows.shape[1]) for name, value in found.items()}
