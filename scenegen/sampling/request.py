"""What is asked for: a range of phi for some labels, and how many scenes.

`LO:HI` is a bounded range, `LO:` and `:HI` are constraints only, a label that is not mentioned is
free.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from scenegen.errors import Diagnostic, RequestError, Source, Span, quoted, suggest

Spread = Literal["flat", "base"]
SPREADS: tuple[str, ...] = get_args(Spread)

BAND = 0.0125  # half the width of the band suggested in place of a single value: the paper's tolerance
MAX_SCENES = 1_000_000_000
LARGEST_PHI = 1e12
MAX_SEED = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Range:
    """phi from `low` to `high`, both inclusive; None is an open end. `span` is where it was typed, if it was."""

    low: float | None = None
    high: float | None = None
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def bounded(self) -> bool:
        return self.low is not None and self.high is not None

    def __str__(self) -> str:
        low, high = ("" if end is None else f"{end + 0.0:.10g}" for end in (self.low, self.high))
        return f"{low}:{high}"


@dataclass(frozen=True, slots=True)
class Request:
    """A checked request: only labels of the spec are mentioned, and no range is empty."""

    ranges: Mapping[str, Range]
    n: int
    seed: int = 0
    spread: Spread = "flat"
    warnings: tuple[Diagnostic, ...] = ()
    fixed: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # (x, y) or (x, y, theta)


def parse_ranges(options: Sequence[str], labels: Sequence[str]) -> dict[str, Range]:
    """The ranges of `--phi` options as typed, e.g. ["task=0.05:0.2", "safe=0:"]. Raises RequestError with a caret."""
    ranges: dict[str, Range] = {}
    for text in options:
        source = Source("--phi", text)
        name, equals, rest = text.partition("=")
        if not equals:
            if len(labels) > 1:
                help_ = f"say which label: --phi {labels[0]}={text}"
                title = f"this spec has {len(labels)} labels, {quoted(labels)}"
                raise RequestError(Diagnostic(title, Span(source, 0, len(text)), "of which label?", help_))
            name, rest = labels[0], text
        name = name.strip()
        offset = len(text) - len(rest)
        here = Span(source, 0, offset - 1 if equals else len(text))
        if name not in labels:
            raise RequestError(_unknown_label(name, labels, here))
        if name in ranges:
            help_ = "give one range per label"
            raise RequestError(Diagnostic(f"phi of `{name}` is asked for twice", here, "", help_))
        ranges[name] = _parse_range(rest, source, offset)
    return ranges


def _unknown_label(name: str, labels: Sequence[str], here: Span | None) -> Diagnostic:
    otherwise = f"the spec has {quoted(labels)}"
    title = "no label stands before `=`" if name == "" else f"the spec has no label `{name}`"
    return Diagnostic(title, here, "", suggest(name, labels, otherwise))


def _parse_range(text: str, source: Source, offset: int) -> Range:
    whole = Span(source, offset, offset + len(text))
    low, colon, high = text.partition(":")
    if not colon or ":" in high:
        alone = not colon and number(text) is not None
        help_ = f"write a band: {_band_text(text)}" if alone else "for instance 0.05:0.2"
        raise RequestError(Diagnostic("a range is written LO:HI, LO: or :HI", whole, "", help_))
    ends: list[float | None] = []
    for part, start in ((low, offset), (high, offset + len(low) + 1)):
        value = number(part) if part.strip() else None
        if part.strip() and value is None:
            here = Span(source, start, start + len(part))
            raise RequestError(Diagnostic(f"`{part}` is not a number", here, "", "write a range such as 0.05:0.2"))
        ends.append(value)
    if ends == [None, None]:
        raise RequestError(
            Diagnostic("this range has no end", whole, "", "write LO:HI, LO: or :HI, or leave --phi out")
        )
    result = Range(ends[0], ends[1], whole)
    problem = empty_range(result)
    if problem is not None:
        raise RequestError(problem)
    return result


def number(text: str) -> float | None:
    """A finite decimal number, or None. Python's own float() also takes `nan`, `inf` and `1_000`."""
    if not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", text, re.ASCII):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def _band_text(text: str) -> str:
    value = float(text)
    return f"{value - BAND:g}:{value + BAND:g}"


def empty_range(wanted: Range) -> Diagnostic | None:
    """What is wrong with a reversed range; None where nothing is. LO = HI is judged with the spec's bounds at hand."""
    if wanted.low is not None and wanted.high is not None and wanted.low > wanted.high:
        return Diagnostic("this range is reversed", wanted.span, "", f"write {wanted.high:g}:{wanted.low:g}")
    return None


def check_request(
    ranges: Mapping[str, Range],
    n: int,
    seed: int,
    spread: str,
    bounds: Mapping[str, tuple[float, float]],
) -> Request:
    """A request held against a spec's labels and the interval bounds of their phi. Raises RequestError."""
    if not 1 <= n <= MAX_SCENES:
        title = f"cannot sample {n:,} scenes"
        raise RequestError(Diagnostic(title, help=f"ask for 1 to {MAX_SCENES:,} with -n"))
    if not 0 <= seed <= MAX_SEED:
        raise RequestError(Diagnostic(f"{seed} is no seed", help=f"a seed lies between 0 and {MAX_SEED}"))
    if spread not in SPREADS:
        raise RequestError(Diagnostic(f"unknown spread `{spread}`", help=suggest(spread, SPREADS, "flat or base")))
    warnings: list[Diagnostic] = []
    checked: dict[str, Range] = {}
    for name, wanted in ranges.items():
        if name not in bounds:
            raise RequestError(_unknown_label(name, list(bounds), None))
        for end in (wanted.low, wanted.high):
            if end is not None and not abs(end) <= LARGEST_PHI:
                raise RequestError(Diagnostic(f"{end} cannot end a range of phi of `{name}`", help="use None for open"))
        problem = empty_range(wanted)
        if problem is not None:
            raise RequestError(problem)
        checked[name] = _within_reach(name, wanted, bounds[name], warnings)
    literal: Spread = "flat" if spread == "flat" else "base"
    return Request(checked, n, seed, literal, tuple(warnings))


def _within_reach(name: str, wanted: Range, bounds: tuple[float, float], warnings: list[Diagnostic]) -> Range:
    lowest, highest = bounds
    low = -math.inf if wanted.low is None else wanted.low
    high = math.inf if wanted.high is None else wanted.high
    reach = f"phi of `{name}` lies between {lowest:.4g} and {highest:.4g} in this workspace"
    if low > highest or high < lowest:
        raise RequestError(Diagnostic(f"no scene can have phi of `{name}` in {wanted}", wanted.span, help=reach))
    at_top, at_bottom = low == highest, high == lowest
    if at_top or at_bottom:
        # Reached at its bound only, as by closeTo(mug, plate, 0): what can be asked for is a band beside the bound.
        band = Range(highest - 2 * BAND, highest) if at_top else Range(lowest, lowest + 2 * BAND)
        title = f"phi of `{name}` reaches {highest if at_top else lowest:g} with probability 0; sampling {band} instead"
        warnings.append(Diagnostic(title, wanted.span, help=reach, severity="warning"))
        return band
    if low == high:
        band = Range(max(low - BAND, lowest), min(high + BAND, highest))
        title = f"phi of `{name}` is exactly {low:g} with probability 0"
        raise RequestError(Diagnostic(title, wanted.span, help=f"ask for a band: --phi {name}={band}"))
    return wanted
