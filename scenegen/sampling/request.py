"""A user's request: ranges of phi for some labels, the number of scenes, and how to draw them.

`LO:HI` is a bounded range; `LO:` and `:HI` are constraints only; a label that is not mentioned is free. Text is parsed
here (`SampleRequest.parse`), Python values in `api/request.py`; after that a request is a `SampleRequest`. A new option
is a field of it, and the place where it acts.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, cast, get_args

from scenegen.errors import Diagnostic, RequestError, Source, Span
from scenegen.errors.language import FOREIGN_SIGN, MORE_THAN_A_TURN
from scenegen.errors.requests import (
    ARGUMENT_SYNTAX,
    BEYOND_BOUNDS,
    GIVEN_TWICE,
    LABEL_NOT_NAMED,
    NOT_A_NUMBER,
    ONLY_AT_BOUND,
    OUT_OF_RANGE,
    RANGE_NOT_A_PAIR,
    RANGE_REVERSED,
    SINGLE_VALUE,
    UNKNOWN_LABEL,
    WRONG_VALUE,
)
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI
from scenegen.sampling.methods import METHODS, methods_help
from scenegen.validation import Option, as_int, as_list, as_number, as_path, by_name, options_of

Progress: TypeAlias = Callable[[int, int, int], None]
"""Called after each piece: scenes found, scenes requested, candidates in the requested cells."""

Spread = Literal["flat", "base", "even"]
SPREADS: tuple[str, ...] = get_args(Spread)

BAND_HALF_WIDTH = 0.0125  # half the width of the band suggested in place of a single value: the paper's tolerance
DEFAULT_SCENES = 16  # scenes, where nobody says how many
MAX_SCENES = 1_000_000_000
EVEN_CANDIDATES = 16  # scenes that are drawn for each that is chosen by `even`
MAX_EVEN = 4096  # scenes that are chosen by `even`: the time grows with their square
MAX_PHI = 1e12
MAX_SEED = 2**63 - 1
LENGTH_UNITS = ("", "m", "cm", "mm")
PHI_UNITS = (*LENGTH_UNITS, "rad", "deg")
RANGE_FORM = {"what": "a range", "form": "LO:HI, LO: or :HI"}
RATE_USAGE = "write a range of rates such as 0.4:0.6 or 40%:60%"
PHI_USAGE = "write a range such as 0.05:0.2, in metres and radians, or with units: 5cm:20cm"


Ends: TypeAlias = tuple[float | None, float | None]
"""A range as Python and files have it: lowest and highest value, None for an open end."""


@dataclass(frozen=True, slots=True)
class Range:
    """phi from `low` to `high`, both inclusive; None is an open end. `span` is where it was typed, if it was."""

    low: float | None = None
    high: float | None = None
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def is_bounded(self) -> bool:
        return self.low is not None and self.high is not None

    @property
    def ends(self) -> tuple[float, float]:
        """Both, an open one infinite."""
        return -math.inf if self.low is None else self.low, math.inf if self.high is None else self.high

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


def parse_phi(
    options: Sequence[str],
    labels: Sequence[str],
    argument: str = "phi",
    units: Collection[str] = PHI_UNITS,
    usage: str = PHI_USAGE,
) -> dict[str, Range]:
    """The ranges of `--phi` options as typed, e.g. ["task=0.05:0.2", "safe=0:"]; `argument` is the option's name,
    `units` are those that bounds may have, `usage` is how to write a range. Raises RequestError with a caret."""
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
            raise RequestError(GIVEN_TWICE(here, what=f"the range of `{name}`"))
        phi[name] = _parse_range(rest, source, offset, units, usage)
    return phi


def _parse_range(
    text: str, source: Source, offset: int, units: Collection[str] = PHI_UNITS, usage: str = PHI_USAGE
) -> Range:
    _refuse_lookalikes(source)
    whole = Span(source, offset, offset + len(text))
    low, colon, high = text.partition(":")
    if not colon or ":" in high:
        alone = not colon and number(text) is not None
        raise RequestError(
            ARGUMENT_SYNTAX(whole, **RANGE_FORM, band=_band_text(text) if alone else None, example="0.05:0.2")
        )
    ends: list[float | None] = []
    for part, start in ((low, offset), (high, offset + len(low) + 1)):
        value = amount_of(part, units) if part.strip() else None
        if part.strip() and value is None:
            here = Span(source, start, start + len(part))
            raise RequestError(NOT_A_NUMBER(here, text=part, usage=usage))
        ends.append(value)
    if ends == [None, None]:
        raise RequestError(ARGUMENT_SYNTAX(whole, **RANGE_FORM, example="0.05:0.2; or leave the option out"))
    result = Range(ends[0], ends[1], whole)
    problem = empty_range(result)
    if problem is not None:
        raise RequestError(problem)
    return result


def _refuse_lookalikes(source: Source) -> None:
    """Raises RequestError for a character that looks like a minus sign, a colon or a comma, as in specs."""
    odd = re.search(r"[^\x00-\x7f\s\N{DEGREE SIGN}]", source.text)
    if odd:
        from scenegen.lang.syntax.foreign import LOOKALIKES

        what, instead = LOOKALIKES.get(odd[0], (None, None))
        if what:
            here = Span(source, odd.start(), odd.end())
            raise RequestError(FOREIGN_SIGN(here, character=odd[0], what=what, instead=instead))


def number(text: str) -> float | None:
    """A finite decimal number, or None. Python's own float() also takes `nan`, `inf` and `1_000`."""
    if not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", text, re.ASCII):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def unit_of(text: str) -> tuple[str, str]:
    """A quantity as typed, such as 5 cm or 90\N{DEGREE SIGN}: its number and the suffix of its unit, both as texts."""
    found = re.fullmatch(r"\s*(.*?)\s*([a-z]*|\N{DEGREE SIGN}|%)\s*", text, re.DOTALL)
    assert found is not None
    return found[1], "deg" if found[2] == "\N{DEGREE SIGN}" else found[2]


def amount_of(text: str, units: Collection[str]) -> float | None:
    """A quantity as typed, such as 5cm, in metres, radians or seconds, 40% as 0.4; None for what is none, and for one
    in another unit."""
    from scenegen.geometry.primitives import quantity  # needs numpy, which `sample --help` does not

    amount, suffix = unit_of(text)
    value = number(amount)
    if value is None or suffix not in units:
        return None
    return value / 100.0 if suffix == "%" else quantity(amount, suffix)[0]


def _band_text(text: str) -> str:
    value = float(text)
    return f"{value - BAND_HALF_WIDTH:g}:{value + BAND_HALF_WIDTH:g}"


def empty_range(wanted: Range) -> Diagnostic | None:
    """The error for a reversed range; None if it is not reversed. LO = HI is checked later, when the spec's bounds are
    known."""
    if wanted.low is not None and wanted.high is not None and wanted.low > wanted.high:
        return RANGE_REVERSED(wanted.span, high=wanted.high, low=wanted.low)
    return None


def _parse_success(text: str, labels: tuple[str, ...]) -> Range:
    return _parse_range(text, Source("success", text, argument=True), 0, ("", "%"), RATE_USAGE)


def _as_rates(name: str, value: Any) -> Range:
    """A range of rates: a Range, or two ends, None for an open one. Raises RequestError."""
    ends = [value.low, value.high] if isinstance(value, Range) else as_list(value)
    if not isinstance(ends, list) or len(ends) != 2:
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="two rates: success=(0.4, 0.6)"))
    low, high = (None if end is None else as_number(name, end) for end in ends)
    if not 0.0 <= (0.0 if low is None else low) < (1.0 if high is None else high) <= 1.0:
        wanted = "LO:HI of rates from 0 to 1, LO below HI"
        raise RequestError(OUT_OF_RANGE(argument=name, value=str(Range(low, high)), wanted=wanted))
    return Range(low, high)


def _check_fix(name: str, fix: object) -> Mapping[str, Any]:
    return by_name(name, fix, 'poses by name: fix={"plate": (0.5, 0.5)}')


def _check_phi(name: str, phi: object) -> Mapping[str, Range]:
    """Raises RequestError for an end that is not finite, and for a reversed range."""
    for label, wanted in by_name(name, phi, "ranges by label").items():
        for end in (wanted.low, wanted.high):
            if end is not None and not abs(end) <= MAX_PHI:
                raise RequestError(RANGE_NOT_A_PAIR(end=end, label=label))
        problem = empty_range(wanted)
        if problem is not None:
            raise RequestError(problem)
    return cast("Mapping[str, Range]", phi)


FIX_EXAMPLE = "plate=0.5,0.5 or plate=50cm,0.5,90deg"
FIX_USAGE = f"write NAME=X,Y or NAME=X,Y,THETA, for instance {FIX_EXAMPLE}"
COMPASS_DEGREES = {"EAST": 0, "NORTH": 90, "WEST": 180, "SOUTH": 270}
POSE_UNITS = {"m": ("", "m", "cm", "mm"), "rad": ("", "rad", "deg", "turn")}


def parse_fix(options: Sequence[str], labels: Sequence[str] = ()) -> dict[str, FixedPose]:
    """The objects of `--fix` options as typed, e.g. ["plate=0.5,0.5"], whatever the labels. Raises RequestError with a
    caret."""
    found: dict[str, FixedPose] = {}
    for text in options:
        source = Source("fix", text, argument=True)
        _refuse_lookalikes(source)
        name, equals, rest = text.partition("=")
        whole = Span(source, 0, len(text))
        parts = rest.split(",")
        if not equals or not name.strip() or len(parts) not in (len(PLACE), len(FLAT)):
            raise RequestError(
                ARGUMENT_SYNTAX(whole, what="what is held", form="NAME=X,Y or NAME=X,Y,THETA", example=FIX_EXAMPLE)
            )
        values = []
        start = len(name) + 1
        for place, part in enumerate(parts):
            value = _coordinate(part, "rad" if place == THETA else "m", Span(source, start, start + len(part)))
            values.append(value)
            start += len(part) + 1
        if name.strip() in found:
            raise RequestError(GIVEN_TWICE(whole, what=f"the place of `{name.strip()}`"))
        found[name.strip()] = FixedPose(values[0], values[1], values[2] if len(values) == len(FLAT) else None, whole)
    return found


def _coordinate(part: str, base: str, here: Span) -> float:
    """A coordinate in metres, or a heading in radians: a number, with a unit of the language or without. Raises
    RequestError."""
    value, (amount, suffix) = amount_of(part, POSE_UNITS[base]), unit_of(part)
    if value is None:
        turn = COMPASS_DEGREES.get(part.strip().upper()) if base == "rad" else None
        usage = FIX_USAGE if turn is None else f"a heading is a number here: {turn}deg for {part.strip()}"
        if number(amount) is not None:
            usage = f"it is in {', '.join(POSE_UNITS[base][1:])}; {FIX_USAGE}"
        raise RequestError(NOT_A_NUMBER(here, text=part, usage=usage))
    if not suffix and base == "rad" and abs(value) > TWO_PI:
        raise RequestError(MORE_THAN_A_TURN(here, amount=value))
    return value


def _optional(check: Callable[[str, Any], Any], name: str, value: object) -> Any:
    return None if value is None else check(name, value)


DRAWING_PANEL, SETS_PANEL, MODELS_PANEL = "How scenes are drawn", "Sets of scenes", "Models"  # panels of the help


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """A request for scenes of a spec or a model. Values that can be no request's are refused when it is made; what
    depends on the spec is checked by `api.request.check_request` and `within_reach`.

    `phi` are the ranges by label. `fix` has the poses of fixed objects by name: (x, y) or (x, y, theta), in metres and
    radians. `success` is the Range of rates, or its ends, that the fit in the file `under` may predict. `method` is one
    of METHODS. `timeout` (seconds) and `workers` (processes; None: as many as save time) change no scene, nor do
    `resume`, `engine`, `address` and `shard_size`, which say how scenes are written. A range that phi reaches only at
    its bound, with probability 0, is replaced by a band beside it, with a warning; with `strict` it is refused, for
    those who promise the range and show no warnings.
    """

    phi: Annotated[
        Mapping[str, Range],
        Option(
            "Wanted phi: LO:HI, LO: or :HI; NAME=LO:HI names a label.",
            "[NAME=]LO:HI",
            typed=list[str] | None,
            parse=parse_phi,
            check=_check_phi,
        ),
    ] = field(default_factory=dict)
    n: Annotated[
        int,
        Option(
            "How many scenes; default: 16, with --fix-from as many as are given.",
            typed=int | None,
            least=1,
            most=MAX_SCENES,
        ),
    ] = DEFAULT_SCENES
    seed: Annotated[int, Option("The same seed gives the same scenes.", most=MAX_SEED)] = 0
    method: Annotated[str, Option(methods_help(), hints=METHODS, panel=DRAWING_PANEL)] = "auto"
    spread: Annotated[
        str,
        Option(
            "flat: evenly over the range of phi; base: as they occur; even: as flat, and far from each other.",
            choices=SPREADS,
        ),
    ] = "flat"
    fix: Annotated[
        Mapping[str, FixedPose | tuple[float, ...]],
        Option(
            "Hold an object where it is, in metres and radians or with units (50cm, 90deg); repeat for more. "
            "With --fix-from the name alone.",
            "NAME=X,Y[,THETA]",
            typed=list[str] | None,
            parse=parse_fix,
            check=_check_fix,
        ),
    ] = field(default_factory=dict)
    settle: Annotated[bool, Option("Only scenes in which nothing moves when dropped in a simulator.")] = False
    success: Annotated[
        Range | Ends | None,
        Option(
            "Only scenes at which a policy is predicted to succeed so often, by the fit of --under.",
            "LO:HI",
            typed=str | None,
            parse=_parse_success,
            check=functools.partial(_optional, _as_rates),
            of=("scenes",),
        ),
    ] = None
    under: Annotated[
        str | Path | None,
        Option(
            "The fit of the policy, a file of `scenegen fit`.",
            "FIT",
            typed=Path | None,
            check=functools.partial(_optional, as_path),
            of=("scenes",),
        ),
    ] = None
    workers: Annotated[
        int | None, Option("Processes; default: one for small requests, else one per core.", panel=DRAWING_PANEL)
    ] = None
    timeout: Annotated[float, Option("Seconds after which to give up.", unit="s", panel=DRAWING_PANEL)] = 60.0
    keep_partial: Annotated[bool, Option("Keep what was found when time is up.", panel=DRAWING_PANEL)] = False
    raw: Annotated[
        bool, Option("A model's own output, neither refined nor filtered.", of=("scenes",), panel=MODELS_PANEL)
    ] = False
    resume: Annotated[bool, Option("Go on where an earlier run with this --out was broken off.", of=("files",))] = False
    shard_size: Annotated[
        int | None,
        Option(
            "Scenes of each file of a set, a multiple of 65536.",
            "N",
            check=functools.partial(_optional, as_int),
            of=("sets",),
            panel=SETS_PANEL,
        ),
    ] = None
    engine: Annotated[
        str,
        Option(
            "What draws a set: local processes, or a ray cluster. The bytes are the same.",
            hints=("local", "ray"),
            of=("sets",),
            panel=SETS_PANEL,
        ),
    ] = "local"
    address: Annotated[
        str | None,
        Option("The Ray cluster; default: $RAY_ADDRESS, or this machine.", "ADDR", of=("sets",), panel=SETS_PANEL),
    ] = None
    strict: bool = False

    def __post_init__(self) -> None:
        for name, option in _options().items():
            object.__setattr__(self, name, option.check_value(name, getattr(self, name)))

    @classmethod
    def parse(cls, options: Mapping[str, Any], labels: Sequence[str]) -> SampleRequest:
        """The request of options as typed, by their names; those that were not typed are None. Raises RequestError with
        a caret."""
        found = {}
        for name, option in _options().items():
            value = options.get(name)
            if value is not None:
                found[name] = value if option.parse is None else option.parse(value, tuple(labels))
        return cls(**found)

    def misplaced_option(self, *what: str) -> str | None:
        """The first option that was given and means nothing for any of `what`: "scenes", "motions", "files", "sets"."""
        usual = SampleRequest()
        for name, option in _options().items():
            if not {*what} & {*option.of} and getattr(self, name) != getattr(usual, name):
                return name
        return None


@functools.cache
def _options() -> dict[str, Option]:
    return {name: option for name, (_, option) in options_of(SampleRequest).items()}


def within_reach(
    request: SampleRequest, bounds: Mapping[str, tuple[float, float]]
) -> tuple[SampleRequest, tuple[Diagnostic, ...]]:
    """A request held against a spec's labels and the interval bounds of their phi; and warnings. The ranges of the
    result can be sampled: none is empty or a single value. Raises RequestError."""
    warnings: list[Diagnostic] = []
    checked: dict[str, Range] = {}
    for name, wanted in request.phi.items():
        if name not in bounds:
            raise RequestError(UNKNOWN_LABEL(name=name, known=bounds))
        checked[name] = _within_reach(name, wanted, bounds[name], None if request.strict else warnings)
    return replace(request, phi=checked), tuple(warnings)


def _within_reach(name: str, wanted: Range, bounds: tuple[float, float], warnings: list[Diagnostic] | None) -> Range:
    """The range, or a band beside the bound where phi reaches the range only there. Without a list for its warning that
    is refused."""
    lowest, highest = bounds
    low, high = wanted.ends
    reach = {"label": name, "lowest": lowest, "highest": highest}
    if low > highest or high < lowest:
        raise RequestError(BEYOND_BOUNDS(wanted.span, range=wanted, **reach))
    at_top, at_bottom = low == highest, high == lowest
    if at_top or at_bottom:
        # Reached only at its bound, as in closeTo(mug, plate, 0): suggest a band beside the bound.
        band = Range(highest - 2 * BAND_HALF_WIDTH, highest) if at_top else Range(lowest, lowest + 2 * BAND_HALF_WIDTH)
        bound = highest if at_top else lowest
        if warnings is None:
            refused = ONLY_AT_BOUND(wanted.span, bound=bound, ask=band, **reach)
            raise RequestError(replace(refused, severity="error"))
        warnings.append(ONLY_AT_BOUND(wanted.span, bound=bound, band=band, **reach))
        return band
    if low == high:
        band = Range(max(low - BAND_HALF_WIDTH, lowest), min(high + BAND_HALF_WIDTH, highest))
        raise RequestError(SINGLE_VALUE(wanted.span, label=name, value=low, band=band))
    return wanted
