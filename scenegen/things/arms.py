"""Robot arms: where a hand that points down can be, and how much room it needs. Data, read from TOML."""

from __future__ import annotations

import math
import tomllib
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

from scenegen.geometry.footprint import Box
from scenegen.pose import TWO_PI
from scenegen.resources import grammar_file

LARGEST_ARM = 10.0  # metres: no size or reach of an arm on a table is larger
MAX_HEIGHTS = 1000  # at which a file gives the reach


class ArmError(Exception):
    """A file that is no arm; `reasons` say why, one for each mistake."""

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons


@dataclass(frozen=True, slots=True)
class ArmBase:
    """The box around an arm's base, centred on its first axis: metres, `depth` along the heading, `width` across it."""

    width: float
    depth: float
    height: float

    @property
    def footprint(self) -> Box:
        """What it covers of the table."""
        return Box(self.depth, self.width)


@dataclass(frozen=True, slots=True)
class Hand:
    """A parallel gripper that points down, in metres. `opening` is the widest gap between its open fingers; `finger` is
    the size of one along the direction in which they close and across it, `finger_length` from its tip up to the palm;
    `palm` is a box along that direction, across it and upwards. All are centred on the hand's axis."""

    opening: float
    finger: tuple[float, float]
    finger_length: float
    palm: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Arm:
    """Where the fingertips of a hand that points down can be: at a height (metres above the plane that the base stands
    on) from `nearest` to `farthest` of the base's axis, linear between the `heights`, nowhere below the first of them
    or above the last. `bearing` are the limits of the first joint from the base's heading, in radians."""

    name: str
    heights: tuple[float, ...]
    nearest: tuple[float, ...]
    farthest: tuple[float, ...]
    bearing: tuple[float, float]
    base: ArmBase
    hand: Hand

    @property
    def turns_freely(self) -> bool:
        """Whether the first joint goes all the way round."""
        return self.bearing[1] - self.bearing[0] >= TWO_PI

    def reach_at(self, height: float) -> tuple[float, float]:
        """The nearest and farthest distance from the base's axis at a height from the first to the last."""
        at = min(max(bisect_right(self.heights, height), 1), len(self.heights) - 1)
        low, high = self.heights[at - 1], self.heights[at]
        share = (height - low) / (high - low)
        near, far = (values[at - 1] + share * (values[at] - values[at - 1]) for values in (self.nearest, self.farthest))
        return near, far


def shipped_arms() -> list[str]:
    """The names of the arms that come along."""
    return sorted(path.stem for path in grammar_file("arms").glob("*.toml"))


def shipped_arm(name: str) -> Arm:
    """An arm that comes along. Raises KeyError for an unknown name."""
    if name not in shipped_arms():
        raise KeyError(name)
    return read_arm(grammar_file(f"arms/{name}.toml").read_bytes())


def read_arm(data: bytes) -> Arm:
    """The arm that the bytes of a TOML file are. Raises ArmError with every mistake."""
    try:
        given = tomllib.loads(data.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ArmError(f"it is no TOML: {error}") from None
    return make_arm(given)


def make_arm(given: Mapping[str, Any]) -> Arm:
    """The arm of fields named as those of `Arm`, `ArmBase` and `Hand`. Raises ArmError with every mistake."""
    wrong: list[str] = []
    tables = {name: table if isinstance(table := given.get(name), Mapping) else {} for name in ("base", "hand")}
    wrong += [f"it has no table [{name}]" for name in tables if not isinstance(given.get(name), Mapping)]
    for table, kind, prefix in ((given, Arm, ""), (tables["base"], ArmBase, "base."), (tables["hand"], Hand, "hand.")):
        known = [one.name for one in fields(kind)]
        wrong += [f"it has no field `{prefix}{name}`: {', '.join(known)}" for name in table if name not in known]

    def numbers(name: str, count: int | None, least: float, table: Mapping[str, Any] = given, prefix: str = "") -> Any:
        """A list of so many numbers between `least` and the largest; with a count of 0 one number."""
        value = table.get(name)
        items: Any = [value] if count == 0 else value
        what = "a number" if count == 0 else "a list of numbers" if count is None else f"a list of {count} numbers"
        if table is not given and not table:
            return None
        if name not in table:
            wrong.append(f"`{prefix}{name}` is missing: {what}")
        elif not (isinstance(items, Sequence) and all(map(_is_number, items)) and count in (None, 0, len(items))):
            wrong.append(f"`{prefix}{name}` must be {what}")
        elif not all(least <= item <= LARGEST_ARM for item in items):
            unit = "rad" if name == "bearing" else "m"
            wrong.append(f"`{prefix}{name}` must be from {least:g} to {LARGEST_ARM:g} {unit}")
        else:
            return float(items[0]) if count == 0 else tuple(map(float, items))
        return None

    name = given.get("name")
    if not (isinstance(name, str) and name.strip() and '"' not in name and name.isprintable()):
        wrong.append("`name` must be a text")
    heights = numbers("heights", None, -LARGEST_ARM)
    nearest, farthest = (numbers(one, None, 0.0) for one in ("nearest", "farthest"))
    bearing = numbers("bearing", 2, -LARGEST_ARM)
    base, hand = tables["base"], tables["hand"]
    sizes = [numbers(one.name, 0, 0.001, base, "base.") for one in fields(ArmBase)]
    opening, length = (numbers(one, 0, 0.001, hand, "hand.") for one in ("opening", "finger_length"))
    finger, palm = numbers("finger", 2, 0.001, hand, "hand."), numbers("palm", 3, 0.001, hand, "hand.")
    if heights is not None:
        if not 2 <= len(heights) <= MAX_HEIGHTS or any(a >= b for a, b in pairwise(heights)):
            wrong.append(f"`heights` must be 2 to {MAX_HEIGHTS:,} numbers, each higher than the one before it")
        elif nearest is not None and farthest is not None:
            if not len(heights) == len(nearest) == len(farthest):
                wrong.append("`heights`, `nearest` and `farthest` must have equally many numbers")
            elif any(a > b for a, b in zip(nearest, farthest, strict=True)):
                wrong.append("`nearest` must be at most `farthest` at every height")
    if bearing is not None and not bearing[0] < bearing[1]:
        wrong.append("`bearing` must be the lower limit, then the upper one")
    if wrong:
        raise ArmError(*wrong)
    return Arm(str(name), heights, nearest, farthest, bearing, ArmBase(*sizes), Hand(opening, finger, length, palm))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
