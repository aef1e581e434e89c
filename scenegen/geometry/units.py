"""Units of scalar expressions, as powers of metre and radian.

A bare number takes its unit from its place (docs/language.md), so `BARE` agrees with every unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """metre^length * radian^angle * second^time."""

    length: int = 0
    angle: int = 0
    time: int = 0

    def __str__(self) -> str:
        if self.time == -1 and self.length + self.angle == 1:
            return "m/s" if self.length else "rad/s"
        parts = [
            name if power == 1 else f"{name}^{power}"
            for name, power in (("m", self.length), ("rad", self.angle), ("s", self.time))
            if power
        ]
        return " ".join(parts)

    @property
    def words(self) -> str:
        """The unit as text."""
        known = {LENGTH: "a length", ANGLE: "an angle", BARE: "a plain number", Unit(2, 0): "an area"}
        known |= {TIME: "a time", SPEED: "a speed", TURN_RATE: "a turn rate"}
        return known.get(self, f"a quantity in {self}")


BARE = Unit()
LENGTH = Unit(length=1)
ANGLE = Unit(angle=1)
TIME = Unit(time=1)
SPEED = Unit(length=1, time=-1)
TURN_RATE = Unit(angle=1, time=-1)

# unit suffix of a quantity -> (multiplier, divisor) to metres, radians or seconds, and what it measures. Dividing by
# 100, not multiplying by 0.01, makes `7 cm` the same number as `0.07`.
_UNITS: dict[str, tuple[float, float, Unit]] = {
    "m": (1.0, 1.0, LENGTH),
    "cm": (1.0, 100.0, LENGTH),
    "mm": (1.0, 1000.0, LENGTH),
    "rad": (1.0, 1.0, ANGLE),
    "deg": (math.pi, 180.0, ANGLE),
    "turn": (2.0 * math.pi, 1.0, ANGLE),
    "s": (1.0, 1.0, TIME),
    "ms": (1.0, 1000.0, TIME),
    "min": (60.0, 1.0, TIME),
}


class UnitMismatch(Exception):  # noqa: N818 - a signal between primitives and the checker, which words the diagnostic
    """Two units that cannot be added or compared."""

    def __init__(self, left: Unit, right: Unit) -> None:
        super().__init__(left, right)
        self.left, self.right = left, right


def agree(*units: Unit) -> Unit:
    """The common unit of numbers that are added or compared. Raises UnitMismatch if there is none."""
    result = BARE
    for unit in units:
        if unit == BARE:
            continue
        if result not in (BARE, unit):
            raise UnitMismatch(result, unit)
        result = unit
    return result


def times(left: Unit, right: Unit) -> Unit:
    return Unit(left.length + right.length, left.angle + right.angle, left.time + right.time)


def over(left: Unit, right: Unit) -> Unit:
    return Unit(left.length - right.length, left.angle - right.angle, left.time - right.time)


def quantity(number: str, suffix: str) -> tuple[float, Unit]:
    """The value in metres, radians and seconds and the unit of a number as written, e.g. ("25", "cm") -> (0.25,
    LENGTH)."""
    if not suffix:
        return float(number), BARE
    name, per_second, _ = suffix.partition("/")
    multiplier, divisor, unit = _UNITS[name]
    return float(number) * multiplier / divisor, over(unit, TIME) if per_second else unit
