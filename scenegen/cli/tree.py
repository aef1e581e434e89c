"""Outlines of formulas on the terminal, for `check` and `eval --explain`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenegen.api.outline import Line

WIDEST = 60  # columns that a formula and its margin may each take before the next column moves
LEAST = 12  # columns that are left of a margin where lines are cut to a width


def tree(lines: Sequence[Line], more: int = 0, width: int | None = None) -> Iterator[str]:
    """One line of text per sub-formula: its text, its margin, and its bounds or its value with its unit.

    With a `width`, texts and margins are shortened to it, and marked with three dots.
    """
    wide, wider = (
        min(WIDEST, max(map(len, column), default=0))
        for column in ([_text(line) for line in lines], [line.margin for line in lines])
    )
    if width is not None:
        ends = max((len(_end(line)) for line in lines), default=0)
        wider = min(wider, max(LEAST, width - 4 - wide - 2 - 2 - ends))
        lines = [_cut(line, wide, wider) for line in lines]
    for line in lines:
        yield f"    {_text(line):<{wide}}  {line.margin:<{wider}}  {_end(line)}".rstrip()
    if more:
        yield f"    ... and {more} more"


def _text(line: Line) -> str:
    return f"{'  ' * line.depth}{line.text}"


def _end(line: Line) -> str:
    if line.low != line.low:  # NaN: a line that stands for others
        return ""
    unit = f" {line.unit}" if line.unit else ""
    what = f"[{line.low:.4g}, {line.high:.4g}]" if line.value is None else f"{line.value:+.6f}"
    return f"{what}{unit}{'  <- decides' if line.decides else ''}"


def _cut(line: Line, wide: int, wider: int) -> Line:
    return replace(line, text=_shortened(line.text, wide - 2 * line.depth), margin=_shortened(line.margin, wider))


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else text[: max(0, most - 3)] + "..."
