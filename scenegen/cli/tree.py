"""Outlines of formulas on the terminal, for `check` and `eval --explain`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenegen.api.outline import Line

WIDEST = 60  # columns that a formula and its margin may each take before the next column moves


def tree(lines: Sequence[Line], more: int) -> Iterator[str]:
    """One line of text per sub-formula: its text, its margin, and its bounds or its value with its unit."""
    texts = [f"{'  ' * line.depth}{line.text}" for line in lines]
    wide, wider = (min(WIDEST, max(map(len, column))) for column in (texts, [line.margin for line in lines]))
    for line, text in zip(lines, texts, strict=True):
        unit = f" {line.unit}" if line.unit else ""
        what = f"[{line.low:.4g}, {line.high:.4g}]" if line.value is None else f"{line.value:+.6f}"
        mark = "  <- decides" if line.decides else ""
        yield f"    {text:<{wide}}  {line.margin:<{wider}}  {what}{unit}{mark}".rstrip()
    if more:
        yield f"    ... and {more} more"
