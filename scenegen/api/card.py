"""The model card: what a model is and how good it is, as Markdown with a picture, written beside the model file."""

from __future__ import annotations

from pathlib import Path

from scenegen.api.describe import describe
from scenegen.api.measure import ALL, LABELS, SCENES, Measured, measure
from scenegen.api.model import Model
from scenegen.formats.files import check_writable, write_whole


def card_paths(model: Path) -> tuple[Path, Path]:
    """Where the card of a model file lies: the text and its picture."""
    return model.with_name(f"{model.name}.md"), model.with_name(f"{model.name}.png")


def check_card(model: Path, *inputs: Path) -> None:
    """Raises OutputError, before any work is done, where the card cannot be written, or would overwrite an input."""
    for path in card_paths(model):
        check_writable(path, *inputs)


def write_card(model: Model, path: Path, seconds: float = ALL) -> list[Path]:
    """Measure a model whose file is `path`, and write its card beside it, each file whole or not at all. Returns what
    was written: the text, and the picture where there was anything to draw. The same model gives the same card, except
    that a slow machine, or little time (`seconds`), may leave out what is rare. Raises OutputError."""
    text, picture = card_paths(path)
    measured = measure(model, seconds)
    written = [text]
    if measured.curves:
        from scenegen.render.calibration import Panel, calibration

        panels = [
            Panel(curve.label, curve.wanted, curve.reached, f"mean |phi - wanted| {curve.error:.4g}")
            for curve in measured.curves
        ]
        write_whole(picture, calibration(panels))
        written.append(picture)
    write_whole(text, card_text(model, path, measured).encode())
    return written


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
        "Scenes that `scenegen sample` hands out are moved onto their phi and re-scored by the spec; they are only",
        "approximately distributed as true ones. Sampling the spec itself gives exact scenes, more slowly.",
        "",
    ]
    return "\n".join(lines)


def _figures(measured: Measured, labels: int) -> list[str]:
    if not measured.levels:
        return ["No exact scenes were found to compare with."]
    lines = [
        f"The network's own scenes, unrefined, against {SCENES:,} fresh exact scenes around each value of phi: the",
        "mean of |phi - wanted phi|, and the share of the exact scenes that are covered (last column: by other exact",
        "scenes).",
        "",
        "| label | wanted phi | error | covered | truth |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {_cell(one.label)} | {one.wanted:.4g} | {one.error:.4f} | {one.covered:.3f} | {one.truth:.3f} |"
        for one in measured.levels
    ]
    if labels > LABELS:
        lines += ["", f"The first {LABELS} of {labels} labels were measured."]
    if measured.missing:
        lines += [
            "",
            f"Not measured, since exact scenes are too rare there to be had in seconds: {', '.join(measured.missing)}.",
        ]
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
