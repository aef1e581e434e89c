"""Arguments of public calls, held against what they can be: numpy's whole numbers are as good as Python's, and what is
of another kind is refused before any work is done."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from scenegen.errors import RequestError, ScenegenError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE


@dataclass(frozen=True, slots=True)
class Option:
    """A field of a request as an option of commands: `Annotated[int, Option(...)]`.

    `help` and `metavar` are shown; `typed` is the type of what is typed where that is another than the field's, and
    `parse` makes the field's value of it and of the labels of the spec. What the value can be: a whole number from
    `least` to `most` (checked where there is a `most`), one of `choices`, a span of time where `unit` is "s", or what
    `check` returns of its name and the value. `hints` are values that a shell completes. `of` is what the option
    means something for: scenes, motions, files, sets; `panel` is the part of a help text where it stands.
    """

    help: str
    metavar: str | None = None
    typed: Any = None
    parse: Callable[[Any, tuple[str, ...]], Any] | None = None
    least: int = 0
    most: int | None = None
    choices: Collection[str] = ()
    unit: str = ""
    check: Callable[[str, Any], Any] | None = None
    hints: Collection[str] = ()
    of: tuple[str, ...] = ("scenes", "motions")
    panel: str | None = None

    def check_value(self, name: str, value: Any) -> Any:
        """The value as it is kept. Raises RequestError for what it cannot be."""
        if self.most is not None:
            number = as_int(name, value)
            if not self.least <= number <= self.most:
                most = f"{self.most:,}" if self.most < 1 << 60 else f"{self.most}"
                raise RequestError(OUT_OF_RANGE(argument=name, value=number, wanted=f"from {self.least} to {most}"))
            return number
        if self.choices and value not in tuple(self.choices):
            raise RequestError(UNKNOWN_CHOICE(what=name, name=value, known=self.choices))
        if self.unit == "s":
            return as_seconds(name, value)
        return value if self.check is None else self.check(name, value)


def options_of(kind: type) -> dict[str, tuple[Any, Option]]:
    """The type and the option of each field of a dataclass that has one, by the field's name, in their order."""
    hints = get_type_hints(kind, include_extras=True)
    each = {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Annotated}
    return {name: (hint[0], hint[1]) for name, hint in each.items() if isinstance(hint[1], Option)}


def by_name(name: str, value: object, wanted: str) -> Mapping[str, Any]:
    """Values by name. Raises RequestError."""
    if not isinstance(value, Mapping):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted=wanted))
    return value


def as_int(name: str, value: object) -> int:
    """A whole number as Python has it; True and False are none. Raises RequestError."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a whole number"))
    return int(value)


def as_seconds(name: str, value: object) -> float:
    """A span of time. Raises RequestError for what is none, or not above 0."""
    if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < float(value) < math.inf:
        shown = f"{value:g}" if isinstance(value, float | int) else repr(value)
        raise RequestError(WRONG_VALUE(argument=name, value=shown, wanted="a positive number of seconds"))
    return float(value)


def as_number(name: str, value: object) -> float:
    """A finite number. Raises RequestError."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a finite number"))
    return float(value)


def as_point(name: str, value: Any) -> tuple[float, float, float]:
    """Three finite numbers. Raises RequestError."""
    try:
        x, y, z = map(float, value)
    except (TypeError, ValueError):
        x = y = z = math.nan
    if not math.isfinite(x + y + z):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a point (x, y, z)"))
    return x, y, z


def as_success(world: str, info: Mapping[str, Any], name: str) -> bool:
    """What a world says of an episode: True or False, 0 or 1, as Python, numpy or torch has them, alone or as the one
    element of an array; None is no success. Raises ScenegenError for what is no judgement."""
    value = info.get(name, "missing")
    found = as_list(value)
    while isinstance(found, tuple | list) and len(found) == 1:
        found = found[0]
    if value is not None and not (isinstance(found, Real) and found in (0, 1)):
        from scenegen.errors.worlds import WORLD_FAILS

        reason = f"`{name}` of info is {value!r}"[:200]
        raise ScenegenError(WORLD_FAILS(what="the world", name=world, how="does not judge", reason=reason))
    return bool(found)


def as_list(value: object) -> object:
    """A tuple, a list, an array or a tensor as a list, numbers as Python has them; anything else as it is."""
    tolist = getattr(value, "tolist", None)
    value = tolist() if callable(tolist) else value
    if not isinstance(value, tuple | list):
        return value
    return [one.item() if getattr(one, "shape", None) == () else one for one in value]  # a number of numpy or torch


def as_words(name: str, value: object, example: str) -> tuple[str, ...]:
    """A list of words, not one by itself, whose letters would be taken for words. Raises RequestError."""
    if not isinstance(value, list | tuple) or not all(isinstance(one, str) for one in value):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted=f"a list: {name}={example}"))
    return tuple(value)


def as_path(name: str, value: object) -> Path:
    """Raises RequestError for what is no path, and for a name that no file can have."""
    given = os.fspath(value) if isinstance(value, str | PathLike) else None
    if not isinstance(given, str):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="the path of a file"))
    odd = "a NUL character" if "\0" in given else "" if _encodes(given) else "half of a character"
    if odd:
        raise RequestError(WRONG_VALUE(argument=name, value=ascii(given), wanted=f"a file name without {odd}"))
    return Path(given)


def _encodes(text: str) -> bool:
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        return False
    return True
