"""The model card: what a model is and how good it is, as Markdown with a picture, written beside the model file."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.learn.evaluation.describe import describe
from scenegen.learn.evaluation.fidelity import Fidelity, fidelity, ks_distance
from scenegen.learn.faults import faults
from scenegen.learn.models.card import QualityData, RangeData
from scenegen.learn.models.checkpoint import save_model
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest, parse_phi
from scenegen.scenes.files import check_writable, write_whole
from scenegen.search.effort import GRACE_SECONDS, Budget, StoppedError

if TYPE_CHECKING:
    from scenegen.learn.model import Model
    from scenegen.learn.models.checkpoint import TrainedModel


# How good a model is, beside the truth: what its card says.
#
# The truth comes from the exact samplers, fresh each time, never from training scenes. For a value of a label some
# scenes in a narrow band around it are drawn. The phi of half of them is what the model is asked for, of this label
# alone, so that its scenes ought to be distributed as the other half is. The same for two labels together. A model
# that has to be told every label gets all of them, as true scenes have them. Beside these raw scenes, those that
# `sample` returns are measured for what most people ask for: satisfied, just below, and where the model was trained.
#
# Time is counted in seconds of CPU: how busy a machine is does not decide what is measured.


HALF_SCENES = 1000  # of each half
CURVE_SCENES = 1500  # scenes of a calibration curve
BAND = 0.0125  # half the width of a band: the paper's tolerance, less where a label's range is small
BAND_SHARE = 0.02  # of the label's range
HALF = 0.6  # of ALL, at most, for what `sample` returns
TRUTH_SEED = 20_231_001  # of the truth and of the model's noise
MAX_MEASURED_LABELS = 8  # that are measured one by one; a spec may have thousands
PATIENCE, ALL = 6.0, 40.0  # seconds of CPU for the truth of one band, and of all: what takes longer is left out


@dataclass(frozen=True, slots=True)
class TargetFidelity:
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
class RangeFidelity:
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
class EvaluationResult:
    """`missing` names the bands for which no truth was found."""

    levels: tuple[TargetFidelity, ...]
    curves: tuple[Curve, ...]
    missing: tuple[str, ...]
    ranges: tuple[RangeFidelity, ...] = ()


@dataclass(frozen=True, slots=True)
class CpuBudget(Budget):
    """So many seconds of CPU, `allowed`, within a time limit; infinite for no limit. Where it is not `firm`, what is
    under way when they are over may go on, up to the time limit."""

    began: float = field(default_factory=time.process_time)
    allowed: float = math.inf
    firm: bool = True

    @property
    def is_spent(self) -> bool:
        return time.process_time() - self.began >= self.allowed or time.monotonic() >= self.ends

    @property
    def overdrawn(self) -> bool:
        return self.is_spent if self.firm else time.monotonic() >= self.ends + GRACE_SECONDS

    def portion(self, seconds: float) -> CpuBudget:
        """A part of what is left."""
        left = self.allowed - (time.process_time() - self.began)
        return CpuBudget(self.seconds, self.started, allowed=max(0.0, min(seconds, left)))


def measure(model: Model, seconds: float = ALL) -> EvaluationResult:
    """Accuracy and distribution at a handful of values of each label and of each two labels that follow each other, and
    calibration over all of a label's range; all this of the model's raw output. Also what `sample` returns in the
    ranges of `asked_for`. Takes some seconds, ALL or `seconds` where scenes are rare."""
    budget = CpuBudget(math.inf, allowed=min(seconds, ALL))
    levels: list[TargetFidelity] = []
    curves: list[Curve] = []
    missing: list[str] = []
    reaches: list[RangeFidelity] = []
    first = budget.portion(HALF * budget.allowed)
    for ends in asked_for(model):
        try:
            reaches.append(measure_range(model, ends, first.portion(2.0 * PATIENCE)))
        except (RequestError, StoppedError):
            missing.append(", ".join(f"{label} {one}" for label, one in ends.items()))
    ranges = dict(list(model.trained.label_ranges.items())[:MAX_MEASURED_LABELS])
    names = list(ranges)

    def look(wanted: Mapping[str, float]) -> Array | None:
        """The phi of true scenes there, (L, n)."""
        try:
            rows, phi = _truth(model, _bands(wanted, ranges), 2 * HALF_SCENES, budget.portion(PATIENCE))
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
            _, phi = _truth(model, {label: Range(low, high)}, CURVE_SCENES, budget.portion(PATIENCE))
        except (RequestError, StoppedError):
            missing.append(f"{label} over its range")
            continue
        curves.append(Curve(label, phi[index], _score_rows(model, _propose_scenes(model.trained, phi, [label]))[label]))
    return EvaluationResult(tuple(levels), tuple(curves), tuple(missing), tuple(reaches))


def level(model: Model, wanted: Mapping[str, float], rows: Array, phi: Array) -> TargetFidelity:
    """How the model compares with true scenes (3N, 2n) whose phi is (L, 2n): with the first half, when it is asked for
    the phi that the second half has of the `wanted` labels."""
    from scenegen.learn.models.card import depends_on

    half = rows.shape[1] // 2
    true, fresh, asked = rows[:, :half], rows[:, half:], phi[:, half:]
    depends = depends_on(model.spec.checked.core)
    made = _propose_scenes(model.trained, asked, list(wanted))
    error, required = _error_and_share(model, made, asked, wanted)
    alone = None
    if model.trained.correction is not None:
        alone = _error_and_share(model, _propose_scenes(model.trained.network, asked, list(wanted)), asked, wanted)
    return TargetFidelity(
        dict(wanted), error, fidelity(true, made, depends), fidelity(true, fresh, depends), required, alone
    )


def _error_and_share(model: Model, rows: Array, asked: Array, wanted: Mapping[str, float]) -> tuple[float, float]:
    """The error of phi of scenes (3N, n), and the share that meets what is required."""
    reached = _score_rows(model, rows)
    errors = [float(np.abs(reached[name] - asked[model.spec.labels.index(name)]).mean()) for name in wanted]
    return max(errors), float((reached[REQUIRE] >= 0.0).mean()) if REQUIRE in reached else 1.0


def _bands(wanted: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]) -> dict[str, Range]:
    found = {}
    for label, value in wanted.items():
        low, high = ranges[label]
        half = min(BAND, BAND_SHARE * (high - low))
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
    for label, (low, high) in list(both.items())[:MAX_MEASURED_LABELS]:
        found += [{label: Range(0.0, None)}, {label: Range(max(low, -high), 0.0)}]
    return [ends for place, ends in enumerate(found) if ends not in found[:place]]


def measure_range(model: Model, ends: Mapping[str, Range], budget: Budget) -> RangeFidelity:
    """How the scenes compare that `sample` returns as they occur in these ranges. Raises RequestError and StoppedError
    where there is no truth, or no scene of the model, within the budget."""
    from scenegen.learn.models.card import depends_on

    rows, phi = _truth(model, ends, 2 * HALF_SCENES, budget)
    request = SampleRequest(dict(ends), HALF_SCENES, TRUTH_SEED, spread="base", workers=1)
    made, told = sample_model(model, request, budget)
    half = rows.shape[1] // 2
    depends = depends_on(model.spec.checked.core)
    off = [ks_distance(phi[place], told[place]) for place in map(model.spec.labels.index, ends)]
    true, fresh = rows[:, :half], rows[:, half:]
    return RangeFidelity(dict(ends), max(off), fidelity(true, made[:, :half], depends), fidelity(true, fresh, depends))


def sample_model(model: Model, request: SampleRequest, budget: Budget) -> tuple[Array, Array]:
    """The scenes (3N, n) that a model gives for a request, and their phi (L, n). Raises RequestError."""
    from scenegen.learn.guided import make_plan
    from scenegen.sampling.engine.run import in_memory

    checked = model.spec.checked
    proposer = model.proposer_of(checked, request.phi)
    found = in_memory(make_plan(make_problem(checked, request), budget, proposer), budget)
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
    from scenegen.sampling.plans import draw

    request = SampleRequest(dict(ranges), count, TRUTH_SEED, spread="base" if count > CURVE_SCENES else "flat")
    found = draw(make_problem(model.spec.checked, request, budget), budget)
    if found.shortfall is not None and 2 * found.count < count:
        raise RequestError(found.shortfall)
    order = np.random.default_rng(TRUTH_SEED).permutation(found.count)
    return found.rows[:, order], found.phi[:, order]


def _propose_scenes(trained: TrainedModel, phi: Array, labels: list[str]) -> Array:
    """The model's scenes (3N, n) for the phi (L, n) of some labels; a model that cannot leave labels free gets all."""
    import torch

    generator = torch.Generator().manual_seed(TRUTH_SEED)
    wanted = trained.with_free_labels(torch.from_numpy(phi).to(torch.float32), labels)
    rows: Array = trained.propose(wanted, generator).double().numpy()
    return rows


def _score_rows(model: Model, rows: Array) -> dict[str, Array]:
    """phi (n,) of scenes by the exact spec, of each label and of what is required."""
    from scenegen.geometry import NUMPY
    from scenegen.lang.formula.interpret import phi as score

    found = score(gate(model.spec.checked.core), list(rows), NUMPY)
    return {name: np.broadcast_to(np.asarray(value, dtype=np.float64), rows.shape[1]) for name, value in found.items()}


def card_paths(model: Path) -> tuple[Path, Path]:
    """The paths of a model file's card: the text and its picture."""
    return model.with_name(f"{model.name}.md"), model.with_name(f"{model.name}.png")


def check_card(model: Path, *inputs: Path) -> None:
    """Raises OutputError, before any work is done, if the card cannot be written, or would overwrite an input."""
    for path in card_paths(model):
        check_writable(path, *inputs)


def write_card(model: Model, path: Path, seconds: float = ALL) -> list[Path]:
    """Measure a model whose file is `path`, and write its card beside it, each file whole or not at all. Returns the
    written paths: the text, and the picture if there was anything to draw. The same model gives the same card, except
    that rare targets may be left out on a slow machine or with little time (`seconds`). Raises OutputError."""
    text, picture = card_paths(path)
    measured = measure(model, seconds)
    record(model, path, quality(measured), ranges(measured))
    written = [text]
    if measured.curves:
        from scenegen.learn.evaluation.calibration import CalibrationPanel, calibration  # Pillow

        panels = [
            CalibrationPanel(curve.label, curve.wanted, curve.reached, f"mean |phi - wanted| {curve.error:.4g}")
            for curve in measured.curves
        ]
        write_whole(picture, calibration(panels))
        written.append(picture)
    write_whole(text, card_text(model, path, measured).encode())
    return written


def quality(measured: EvaluationResult) -> list[QualityData]:
    """What the model file keeps of it."""
    return [
        QualityData(
            wanted=dict(one.wanted),
            error=one.error,
            truth=one.truth.coverage,
            required=one.required,
            **asdict(one.made),
        )
        for one in measured.levels
    ]


def ranges(measured: EvaluationResult) -> list[RangeData]:
    """What the model file keeps of the scenes that `sample` returns."""
    return [
        RangeData(
            wanted={label: (ends.low, ends.high) for label, ends in one.wanted.items()},
            phi=one.phi,
            truth=one.truth.coverage,
            **asdict(one.made),
        )
        for one in measured.ranges
    ]


def record(model: Model, path: Path, found: list[QualityData], returned: list[RangeData]) -> None:
    """Write the figures into the model file, where `sample` finds them. Raises OutputError."""
    card = model.trained.card.model_copy(update={"quality": found, "ranges": returned})
    save_model(path, model.trained.model, card, model.trained.regions)
    model.trained = replace(model.trained, card=card)


def card_text(model: Model, path: Path, measured: EvaluationResult) -> str:
    """The card as Markdown."""
    card = model.trained.card
    lines = [f"# {card.model} for {Path(card.spec.name).name}", ""]
    if card.spec.title:
        lines += [card.spec.title, ""]
    lines += [
        f"A model file of scenegen {card.scenegen}: it draws scenes for a wanted phi. Phi is the margin, in metres and",
        "radians, by which a scene satisfies a formula of the spec.",
        "",
        "```spec",
        card.spec.source.rstrip("\n"),
        "```",
        "",
        "| | |",
        "|---|---|",
    ]
    lines += [f"| {name} | {_cell(value)} |" for name, value in describe(model, path)]
    lines += ["", "## How good it is", "", *_figures(measured, len(model.spec.labels))]
    if measured.curves:
        lines += ["", f"![wanted phi against reached phi]({card_paths(path)[1].name})"]
    lines += [
        "",
        "## Use",
        "",
        "```",
        f"scenegen sample {path.name} --phi {model.spec.labels[0]}=LO:HI -n 100 --out scenes.json",
        "```",
        "",
        "`scenegen sample` moves scenes onto their target and verifies each by the spec; their distribution is only",
        "approximate, as the table says. Sampling the spec itself gives exact scenes.",
        "",
    ]
    return "\n".join(lines)


def _figures(measured: EvaluationResult, labels: int) -> list[str]:
    if not measured.levels and not measured.ranges:
        return ["No exact scenes were found to compare with.", *_missing(measured)]
    lines = [f"**Warning:** {fault.title}." for fault in faults(quality(measured), ranges(measured))]
    lines += [*([""] if lines else []), *_range_lines(measured)]
    if measured.levels:
        lines += [*([""] if lines else []), *_target_lines(measured)]
    if labels > MAX_MEASURED_LABELS:
        lines += ["", f"The first {MAX_MEASURED_LABELS} of {labels} labels were measured."]
    return [*lines, *_missing(measured)]


def _missing(measured: EvaluationResult) -> list[str]:
    if not measured.missing:
        return []
    missing = "; ".join(measured.missing)
    return ["", f"Not measured, since the exact samplers found too few scenes there in seconds: {missing}."]


def _range_lines(measured: EvaluationResult) -> list[str]:
    if not measured.ranges:
        return []
    lines = [
        "What `scenegen sample` returns for ranges of phi, as it occurs there, against up to "
        f"{HALF_SCENES:,} exact scenes:",
        "the KS distance of phi, the share of the exact scenes that are covered, the KS distance of the worst",
        "coordinate and of the worst direction, and the energy distance; in brackets what other exact scenes score.",
        "",
        "| range of phi | phi: KS | covered | KS | sliced KS | energy |",
        "|---|---|---|---|---|---|",
    ]
    for one in measured.ranges:
        made, truth = one.made, one.truth
        lines.append(
            f"| {_cell(str(one))} | {one.phi:.3f} | {made.coverage:.3f} ({truth.coverage:.3f}) | {made.ks:.3f} "
            f"({truth.ks:.3f}) | {made.sliced:.3f} ({truth.sliced:.3f}) | {made.energy:.4f} ({truth.energy:.4f}) |"
        )
    return lines


def _target_lines(measured: EvaluationResult) -> list[str]:
    corrected = measured.levels[0].alone is not None
    lines = [
        f"The model's raw scenes against {HALF_SCENES:,} fresh exact scenes around each value of phi, in the "
        "coordinates",
        "that phi depends on: the mean of |phi - target phi|, the share of the exact scenes that are covered, the KS",
        "distance of the worst coordinate, and of the worst direction, sum, difference or product of coordinates",
        "(sliced), the energy distance, and the share of the scenes that meet what the spec requires; in brackets what",
        "other exact scenes score.",
        *(["The last columns are of the network alone, before its scenes are corrected."] if corrected else []),
        "",
        "| target phi | error | covered | KS | sliced KS | energy | required |"
        + " alone: error | required |" * corrected,
        "|---|---|---|---|---|---|---|" + "---|---|" * corrected,
    ]
    for one in measured.levels:
        made, truth = one.made, one.truth
        alone = "" if one.alone is None else f" {one.alone[0]:.4f} | {one.alone[1]:.3f} |"
        lines.append(
            f"| {_cell(str(one))} | {one.error:.4f} | {made.coverage:.3f} ({truth.coverage:.3f}) | {made.ks:.3f} "
            f"({truth.ks:.3f}) | {made.sliced:.3f} ({truth.sliced:.3f}) | {made.energy:.4f} ({truth.energy:.4f}) | "
            f"{one.required:.3f} |{alone}"
        )
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
