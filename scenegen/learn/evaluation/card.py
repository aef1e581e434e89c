"""The model card: what a model is and how good it is, as Markdown with a picture, written beside the model file."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

from scenegen.learn.evaluation.describe import Model, describe, faults
from scenegen.learn.evaluation.measure import ALL, LABELS, SCENES, Measured, measure
from scenegen.learn.models.card import QualityData, RangeData
from scenegen.learn.models.checkpoint import save_model
from scenegen.scenes.files import check_writable, write_whole


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
        from scenegen.show.figures.calibration import Panel, calibration

        panels = [
            Panel(curve.label, curve.wanted, curve.reached, f"mean |phi - wanted| {curve.error:.4g}")
            for curve in measured.curves
        ]
        write_whole(picture, calibration(panels))
        written.append(picture)
    write_whole(text, card_text(model, path, measured).encode())
    return written


def quality(measured: Measured) -> list[QualityData]:
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


def ranges(measured: Measured) -> list[RangeData]:
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


def card_text(model: Model, path: Path, measured: Measured) -> str:
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


def _figures(measured: Measured, labels: int) -> list[str]:
    if not measured.levels and not measured.ranges:
        return ["No exact scenes were found to compare with.", *_missing(measured)]
    lines = [f"**Warning:** {fault.title}." for fault in faults(quality(measured), ranges(measured))]
    lines += [*([""] if lines else []), *_returned(measured)]
    if measured.levels:
        lines += [*([""] if lines else []), *_raw(measured)]
    if labels > LABELS:
        lines += ["", f"The first {LABELS} of {labels} labels were measured."]
    return [*lines, *_missing(measured)]


def _missing(measured: Measured) -> list[str]:
    if not measured.missing:
        return []
    missing = "; ".join(measured.missing)
    return ["", f"Not measured, since the exact samplers found too few scenes there in seconds: {missing}."]


def _returned(measured: Measured) -> list[str]:
    if not measured.ranges:
        return []
    lines = [
        f"What `scenegen sample` returns for ranges of phi, as it occurs there, against up to {SCENES:,} exact scenes:",
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


def _raw(measured: Measured) -> list[str]:
    corrected = measured.levels[0].alone is not None
    lines = [
        f"The model's raw scenes against {SCENES:,} fresh exact scenes around each value of phi, in the coordinates",
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
