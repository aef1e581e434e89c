"""`base` and `load`: what an object was declared to stand on, and the centre of mass of it and all that it carries.

Where a support is a choice, both are numbers that the switches pick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from scenegen.assets.surfaces import Surface
from scenegen.errors import Span
from scenegen.lang.choices import of_cases, options_of
from scenegen.lang.spec import Support
from scenegen.lang.values import ChosenValue, ObjectValue, PointValue, RegionValue, SurfaceValue, Value
from scenegen.pose import PLACE

if TYPE_CHECKING:
    from scenegen.lang.context import Context


def base(lowering: Context, which: int, origin: Span) -> Value:
    """What an object was declared to stand on: a surface, a region at a height, or on the table its own footprint."""

    def value(under: Support) -> Value:
        if under.carrier is not None:
            surface = Surface(under.name.partition(".")[2], under.outline, under.height, walled=under.walled)
            return SurfaceValue(under.carrier, surface, origin=origin)
        if under.height:
            return RegionValue(under.name, lowering.areas[under.name], origin=origin)
        return ObjectValue(which, origin=origin)

    if which in lowering.choices:
        return ChosenValue(which, tuple(map(value, lowering.choices[which].options)), origin=origin)
    under = lowering.supports.get(which)
    return ObjectValue(which, origin=origin) if under is None else value(under)


def load(lowering: Context, which: int, value: Value) -> PointValue | None:
    """The centre of mass of an object and all that stands on it. None where choices allow too many cases."""
    above = _above(lowering, which)
    free: dict[int, list[int]] = {}  # for each choice: options on one carrier, or on none of these, are one case
    for one in sorted(above):
        if one in lowering.choices:
            first: dict[int | None, int] = {}
            free[one] = [
                first.setdefault(under.carrier if under.carrier in above else None, at)
                for at, under in enumerate(lowering.choices[one].options)
            ]
    found: list[int] = []
    for axis in PLACE:
        number = of_cases(lowering, free, lambda supports, axis=axis: _centre(lowering, which, supports, axis))  # type: ignore[misc]
        if number is None:
            return None
        found.append(number)
    return PointValue(*found, origin=value.origin)


def _above(lowering: Context, which: int) -> set[int]:
    """An object, and all that can come to stand on it."""
    above, larger = {which}, True
    while larger:
        more = {
            one
            for one in (*lowering.supports, *lowering.choices)
            if any(under.carrier in above for under in options_of(one, lowering.supports, lowering.choices))
        }
        larger = not more <= above
        above |= more
    return above


def _centre(lowering: Context, which: int, supports: Mapping[int, Support], axis: int) -> int:
    """A coordinate of the centre of mass of an object with all that stands on it, where every support is known."""
    from scenegen.assets.physics import mass_of

    builder, coerce = lowering.builder, lowering.coerce
    carried = [which]
    for one in carried:
        carried.extend(upper for upper, under in supports.items() if under.carrier == one)
    masses: Sequence[float] = [mass_of(lowering.shapes[one]) for one in carried]
    parts = [
        builder.apply("mul", (builder.const(mass / sum(masses)), coerce.coordinate(one, axis)))
        for one, mass in zip(carried, masses, strict=True)
    ]
    return parts[0] if len(parts) == 1 else builder.apply("sum", parts)
