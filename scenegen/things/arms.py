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
ALL_ROUND = -math.pi, math.pi  # limits that are none


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
class ReachRing:
    """Where the last axis of a hand that points down can be: at a height (metres above the plane that the base stands
    on) from `nearest` to `farthest` of the base's axis, linear between the `heights`, nowhere below the first of them
    or above the last. `bearing` are the limits of where around the base, from its heading, and `turn` those of the
    direction in which the hand closes, from that away from the base: radians."""

    heights: tuple[float, ...]
    nearest: tuple[float, ...]
    farthest: tuple[float, ...]
    bearing: tuple[float, float]
    turn: tuple[float, float] = ALL_ROUND

    @property
    def turns_freely(self) -> bool:
        """Whether it goes all the way round the base."""
        return self.bearing[1] - self.bearing[0] >= TWO_PI

    def reach_at(self, height: float) -> tuple[float, float]:
        """The nearest and farthest distance from the base's axis at a height; beyond all heights those at the end."""
        at = min(max(bisect_right(self.heights, height), 1), len(self.heights) - 1)
        low, high = self.heights[at - 1], self.heights[at]
        share = min(max((height - low) / (high - low), 0.0), 1.0)
        near, far = (values[at - 1] + share * (values[at] - values[at - 1]) for values in (self.nearest, self.farthest))
        return near, far

    def tip_distance(self, offset: tuple[float, float], away: float) -> float:
        """How far the point between the fingertips, `offset` from the last axis, can be from it at most, in a direction
        `away` (rad) from that away from the base: metres."""
        length, angle = math.hypot(*offset), math.atan2(offset[1], offset[0])
        middle, half = (self.turn[0] + self.turn[1]) / 2.0, (self.turn[1] - self.turn[0]) / 2.0
        return length * math.cos(max(0.0, abs(math.remainder(angle + middle - away, TWO_PI)) - half))


RING_FIELDS = tuple(one.name for one in fields(ReachRing))


@dataclass(frozen=True, slots=True)
class Arm:
    """What an arm reaches from above, and how large its base and hand are. `offset` is where the point between the
    fingertips is from the last axis, in metres: along the direction in which the hand closes, and to its left. `behind`
    is what the last axis reaches where the arm leans back over its base."""

    name: str
    ring: ReachRing
    base: ArmBase
    hand: Hand
    offset: tuple[float, float] = (0.0, 0.0)
    behind: ReachRing | None = None

    @property
    def rings(self) -> list[ReachRing]:
        return [self.ring, *([self.behind] if self.behind else [])]


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
    parts = {"behind": RING_FIELDS, "": ("name", *RING_FIELDS, "offset", "base", "hand", "behind")}
    parts |= {part: tuple(one.name for one in fields(kind)) for part, kind in (("base", ArmBase), ("hand", Hand))}
    tables: dict[str, Mapping[str, Any]] = {"": given}
    for part in ("base", "hand", "behind"):
        if part in given or part != "behind":
            tables[part] = table if isinstance(table := given.get(part), Mapping) else {}
            wrong += [f"it has no table [{part}]"] * (tables[part] is not table)
    for part, table in tables.items():
        prefix, known = f"{part}." * bool(part), parts[part]
        wrong += [f"it has no field `{prefix}{name}`: {', '.join(known)}" for name in table if name not in known]

    def numbers(name: str, count: int | None, least: float, part: str = "") -> Any:
        """A list of so many numbers between `least` and the largest; with a count of 0 one number."""
        table, shown = tables[part], f"{part}.{name}" if part else name
        value = table.get(name)
        items: Any = [value] if count == 0 else value
        what = "a number" if count == 0 else "a list of numbers" if count is None else f"a list of {count} numbers"
        if part and not table:
            return None
        if name not in table:
            wrong.append(f"`{shown}` is missing: {what}")
        elif not (isinstance(items, Sequence) and all(map(_is_number, items)) and count in (None, 0, len(items))):
            wrong.append(f"`{shown}` must be {what}")
        elif not all(least <= item <= LARGEST_ARM for item in items):
            unit = "rad" if name in ("bearing", "turn") else "m"
            wrong.append(f"`{shown}` must be from {least:g} to {LARGEST_ARM:g} {unit}")
        else:
            return float(items[0]) if count == 0 else tuple(map(float, items))
        return None

    def ring(part: str = "") -> ReachRing:
        prefix = f"{part}." * bool(part)
        heights = numbers("heights", None, -LARGEST_ARM, part)
        nearest, farthest = (numbers(one, None, 0.0, part) for one in ("nearest", "farthest"))
        bearing = numbers("bearing", 2, -LARGEST_ARM, part)
        turn = numbers("turn", 2, -LARGEST_ARM, part) if "turn" in tables[part] else ALL_ROUND
        if heights is not None:
            if not 2 <= len(heights) <= MAX_HEIGHTS or any(a >= b for a, b in pairwise(heights)):
                wrong.append(
                    f"`{prefix}heights` must be 2 to {MAX_HEIGHTS:,} numbers, each higher than the one before it"
                )
            elif nearest is not None and farthest is not None:
                if not len(heights) == len(nearest) == len(farthest):
                    wrong.append(f"`{prefix}heights`, `nearest` and `farthest` must have equally many numbers")
                elif any(a > b for a, b in zip(nearest, farthest, strict=True)):
                    wrong.append(f"`{prefix}nearest` must be at most `farthest` at every height")
        for name, limits in (("bearing", bearing), ("turn", turn)):
            if limits is not None and not limits[0] < limits[1]:
                wrong.append(f"`{prefix}{name}` must be the lower limit, then the upper one")
        return ReachRing(heights, nearest, farthest, bearing, turn)

    name = given.get("name")
    if not (isinstance(name, str) and name.strip() and '"' not in name and name.isprintable()):
        wrong.append("`name` must be a text")
    rings = ring(), ring("behind") if tables.get("behind") else None
    offset = numbers("offset", 2, -LARGEST_ARM) if "offset" in given else (0.0, 0.0)
    sizes = [numbers(one.name, 0, 0.001, "base") for one in fields(ArmBase)]
    opening, length = (numbers(one, 0, 0.001, "hand") for one in ("opening", "finger_length"))
    finger, palm = numbers("finger", 2, 0.001, "hand"), numbers("palm", 3, 0.001, "hand")
    if wrong:
        raise ArmError(*wrong)
    return Arm(str(name), rings[0], ArmBase(*sizes), Hand(opening, finger, length, palm), offset, rings[1])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
