"""A user's request: ranges of phi for some labels, the number of scenes, and how to draw them.

`LO:HI` is a bounded range; `LO:` and `:HI` are constraints only; a label that is not mentioned is free. Text is parsed
here (`parse_phi`), Python values in `api/request.py`; after that a request is a `SampleRequest`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias, get_args

from scenegen.errors import Diagnostic, RequestError, Source, Span
from scenegen.errors.requests import (
    BEYOND_BOUNDS,
    LABEL_NOT_NAMED,
    LABEL_TWICE,
    NOT_A_NUMBER,
    ONLY_AT_BOUND,
    OUT_OF_RANGE,
    RANGE_END,
    RANGE_REVERSED,
    RANGE_SYNTAX,
    RANGE_WITHOUT_END,
    SINGLE_VALUE,
    UNKNOWN_CHOICE,
    UNKNOWN_LABEL,
)

Progress: TypeAlias = Callable[[int, int, int], None]
"""Called after each piece: scenes found, scenes requested, candidates in the requested cells."""

Spread = Literal["flat", "base"]
SPREADS: tuple[str, ...] = get_args(Spread)

BAND = 0.0125  # half the width of the band suggested in place of a single value: the paper's tolerance
USUAL = 16  # scenes, where nobody says how many
MAX_SCENES = 1_000_000_000
LARGEST_PHI = 1e12
MAX_SEED = 2**63 - 1
PHI_UNITS = ("", "m", "cm", "mm", "rad", "deg")
PHI_USAGE = "write a range such as 0.05:0.2, in metres and radians, or with units: 5cm:20cm"


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
class FixedPose:
    """The pose of a fixed object: metres and, if its heading is fixed too, radians. `span` is where it was typed."""

    x: float
    y: float
    theta: float | None = None
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """A request for scenes of a spec or a model; `sampling.problem.make_problem` checks it against its spec.

    `phi` are the ranges by label. `fix` has the poses of fixed objects by name: (x, y) or (x, y, theta), in metres and
    radians. `method` is one of `sampling.methods.METHODS`. `timeout` (seconds) and `workers` (processes; None: as many
    as save time) change no scene. A range that phi reaches only at its bound, with probability 0, is replaced by a band
    beside it, with a warning; with `strict` it is refused, for those who promise the range and show no warnings.
    """

    phi: Mapping[str, Range] = field(default_factory=dict)
    n: int = USUAL
    seed: int = 0
    method: str = "auto"
    spread: str = "flat"
    fix: Mapping[str, FixedPose | tuple[float, ...]] = field(default_factory=dict)
    settle: bool = False
    raw: bool = False
    timeout: float = 60.0
    workers: int | None = None
    keep_partial: bool = False
    strict: bool = False


def parse_phi(options: Sequence[str], labels: Sequence[str], argument: str = "phi") -> dict[str, Range]:
    """The ranges of `--phi` options as typed, e.g. ["task=0.05:0.2", "safe=0:"]; `argument` is the option's name.
    Raises RequestError with a caret."""
    phi: dict[str, Range] = {}
    for text in options:
        source = Source(argument, text, argument=True)
        name, equals, rest = text.partition("=")
        if not equals:
            if len(labels) > 1:
                named = {"count": len(labels), "labels": tuple(labels), "first": labels[0], "text": text}
                raise RequestError(LABEL_NOT_NAMED(Span(source, 0, len(text)), **named))
            name, rest = labels[0], text
        name = name.strip()
        offset = len(text) - len(rest)
        here = Span(source, 0, offset - 1 if equals else len(text))
        if name not in labels:
            raise RequestError(UNKNOWN_LABEL(here, name=name, known=labels))
        if name in phi:
            raise RequestError(LABEL_TWICE(here, name=name))
        phi[name] = _parse_range(rest, source, offset)
    return phi


def _parse_range(text: str, source: Source, offset: int) -> Range:
    from scenegen.primitives.units import quantity

    whole = Span(source, offset, offset + len(text))
    low, colon, high = text.partition(":")
    if not colon or ":" in high:
        alone = not colon and number(text) is not None
        raise RequestError(RANGE_SYNTAX(whole, band=_band_text(text) if alone else None))
    ends: list[float | None] = []
    for part, start in ((low, offset), (high, offset + len(low) + 1)):
        amount, suffix = unit_of(part)
        value = number(amount) if part.strip() and suffix in PHI_UNITS else None
        if part.strip() and value is None:
            here = Span(source, start, start + len(part))
            raise RequestError(NOT_A_NUMBER(here, text=part, usage=PHI_USAGE))
        value = value if value is None else quantity(amount, suffix)[0]
        ends.append(value)
    if ends == [None, None]:
        raise RequestError(RANGE_WITHOUT_END(whole))
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


def unit_of(text: str) -> tuple[str, str]:
    """A quantity as typed, such as 5 cm or 90\N{DEGREE SIGN}: its number and the suffix of its unit, both as texts."""
    found = re.fullmatch(r"\s*(.*?)\s*([a-z]*|\N{DEGREE SIGN})\s*", text, re.DOTALL)
    assert found is not None
    return found[1], "deg" if found[2] == "\N{DEGREE SIGN}" else found[2]


def _band_text(text: str) -> str:
    value = float(text)
    return f"{value - BAND:g}:{value + BAND:g}"


def empty_range(wanted: Range) -> Diagnostic | None:
    """The error for a reversed range; None if it is not reversed. LO = HI is checked later, when the spec's bounds are
    known."""
    if wanted.low is not None and wanted.high is not None and wanted.low > wanted.high:
        return RANGE_REVERSED(wanted.span, high=wanted.high, low=wanted.low)
    return None


def check_seed(seed: int) -> None:
    """Raises RequestError for what is no seed."""
    if not 0 <= seed <= MAX_SEED:
        raise RequestError(OUT_OF_RANGE(argument="seed", value=seed, wanted=f"from 0 to {MAX_SEED}"))


def check_request(
    request: SampleRequest, bounds: Mapping[str, tuple[float, float]]
) -> tuple[SampleRequest, tuple[Diagnostic, ...]]:
    """A request checked against a spec's labels and the interval bounds of their phi; and warnings. The ranges of the
    result can be sampled: none is empty or a single value. Raises RequestError."""
    n, seed, spread = request.n, request.seed, request.spread
    if not 1 <= n <= MAX_SCENES:
        raise RequestError(OUT_OF_RANGE(argument="n", value=n, wanted=f"from 1 to {MAX_SCENES:,}"))
    check_seed(seed)
    if spread not in SPREADS:
        raise RequestError(UNKNOWN_CHOICE(what="spread", name=spread, known=SPREADS))
    warnings: list[Diagnostic] = []
    checked: dict[str, Range] = {}
    for name, wanted in request.phi.items():
        if name not in bounds:
            raise RequestError(UNKNOWN_LABEL(name=name, known=bounds))
        for end in (wanted.low, wanted.high):
            if end is not None and not abs(end) <= LARGEST_PHI:
                raise RequestError(RANGE_END(end=end, label=name))
        problem = empty_range(wanted)
        if problem is not None:
            raise RequestError(problem)
        checked[name] = _within_reach(name, wanted, bounds[name], None if request.strict else warnings)
    return replace(request, phi=checked), tuple(warnings)


def _within_reach(name: str, wanted: Range, bounds: tuple[float, float], warnings: list[Diagnostic] | None) -> Range:
    """The range, or a band beside the bound where phi reaches the range only there. Without a list for its warning that
    is refused."""
    lowest, highest = bounds
    low = -math.inf if wanted.low is None else wanted.low
    high = math.inf if wanted.high is None else wanted.high
    reach = {"label": name, "lowest": lowest, "highest": highest}
    if low > highest or high < lowest:
        raise RequestError(BEYOND_BOUNDS(wanted.span, range=wanted, **reach))
    at_top, at_bottom = low == highest, high == lowest
    if at_top or at_bottom:
        # Reached only at its bound, as in closeTo(mug, plate, 0): suggest a band beside the bound.
        band = Range(highest - 2 * BAND, highest) if at_top else Range(lowest, lowest + 2 * BAND)
        bound = highest if at_top else lowest
        if warnings is None:
            refused = ONLY_AT_BOUND(wanted.span, bound=bound, ask=band, **reach)
            raise RequestError(replace(refused, severity="error"))
        warnings.append(ONLY_AT_BOUND(wanted.span, bound=bound, band=band, **reach))
        return band
    if low == high:
        band = Range(max(low - BAND, lowest), min(high + BAND, highest))
        raise RequestError(SINGLE_VALUE(wanted.span, label=name, value=low, band=band))
    return wanted
