"""Values held against the kind that their place demands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scenegen.errors import SpecError
from scenegen.errors.declarations import MEASURED_TOO_EARLY
from scenegen.errors.language import MISSING_ARGUMENTS, NOT_FINITE, UNKNOWN_NAME
from scenegen.lang.builder import TRUE, CoreBuilder
from scenegen.lang.scope import NO_NUMBERS, Scope
from scenegen.lang.spec import Pose
from scenegen.lang.values import (
    AnyValue,
    FormulaValue,
    ListValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    SurfaceValue,
    Value,
    wrong_kind,
)
from scenegen.primitives.footprint import POINT, Footprint


@dataclass(slots=True)
class Coercion:
    """Turns values into what the core is built of. Every method raises SpecError for a value of another kind.

    `any` is the number that stands for a parameter which nobody has given a value. `footprints` has one entry per
    object, none while the objects are still being declared; `fixed` holds the poses of those that do not move: their
    coordinates are constants. `stand_ins` has the footprints of objects that stand for many (scenegen.lang.template).
    """

    scope: Scope
    builder: CoreBuilder
    any: float
    footprints: tuple[Footprint, ...] = ()
    fixed: Mapping[int, Pose] = field(default_factory=dict)
    stand_ins: dict[int, Footprint] = field(default_factory=dict)

    def wrong(self, value: Value, wanted: str, place: str) -> SpecError:
        """What is wrong with a value's kind; `place` says what wanted it where the value has no role."""
        name = value.origin.text
        if not (self.scope.inferred and isinstance(value, ObjectValue) and name in self.scope.objects):
            return wrong_kind(value, wanted, place)
        # Nobody declared it: nothing else has this name, so it was taken for an object.
        signature = self.scope.signature(name)
        if signature is not None:
            return SpecError(MISSING_ARGUMENTS(value.origin, name=name, usage=signature.usage))
        if name.lower() in NO_NUMBERS and wanted == "a number":
            return SpecError(NOT_FINITE(value.origin, name=name))
        known = self.scope.constants if wanted == "a number" else {**self.scope.labels, **self.scope.definitions}
        unknown = UNKNOWN_NAME(value.origin, name=name, known=known, wanted=wanted)
        if unknown.facts["nearest"]:
            return SpecError(unknown)
        (problem,) = wrong_kind(value, wanted, place).diagnostics
        minus = place == "what `-` works on" and not value.role
        return SpecError(problem.but(inferred="an object", dashed=name if minus else None))

    def formula(self, value: Value, place: str) -> int:
        if isinstance(value, FormulaValue):
            return value.node
        if isinstance(value, AnyValue):
            return TRUE
        raise self.wrong(value, "a formula", place)

    def number(self, value: Value, place: str) -> NumberValue:
        if isinstance(value, NumberValue):
            return value
        if isinstance(value, AnyValue):
            return NumberValue(self.builder.const(self.any), origin=value.origin)
        raise self.wrong(value, "a number", place)

    def items(self, value: Value, place: str) -> Sequence[Value]:
        """The members of a list."""
        if isinstance(value, ListValue):
            return value.items
        raise self.wrong(value, "a list", place)

    def coordinate(self, index: int, axis: int) -> int:
        """A coordinate of an object, a constant where the object is held in place."""
        if index in self.fixed:
            return self.builder.const(self.fixed[index][axis])
        return self.builder.coord(index, axis)

    def place(self, value: Value, place: str) -> tuple[int, int]:
        """x and y of an object, a point, or a region's centre."""
        match value:
            case ObjectValue(index):
                return self.coordinate(index, 0), self.coordinate(index, 1)
            case SurfaceValue(index):
                return self.coordinate(index, 0), self.coordinate(index, 1)
            case PointValue(x, y):
                return x, y
            case RegionValue(_, area):
                return self.builder.const(area.center[0]), self.builder.const(area.center[1])
            case AnyValue():
                return self.builder.const(self.any), self.builder.const(self.any)
            case _:
                raise self.wrong(value, "an object, a point or a region", place)

    def heading(self, value: Value, place: str) -> int:
        """theta of an object."""
        if isinstance(value, ObjectValue):
            return self.coordinate(value.index, 2)
        if isinstance(value, AnyValue):
            return self.builder.const(self.any)
        raise self.wrong(value, "an object (nothing else has a heading)", place)

    def footprint(self, value: Value, place: str) -> tuple[Footprint, tuple[int, int, int]]:
        """What an object, a region or a point covers, and where it is."""
        x, y = self.place(value, place)
        match value:
            case ObjectValue(index):
                if not self.footprints:
                    raise SpecError(MEASURED_TOO_EARLY(value.origin))
                return self.covers(index), (x, y, self.coordinate(index, 2))
            case SurfaceValue(index, surface):
                return surface.outline, (x, y, self.coordinate(index, 2))
            case RegionValue(_, area):
                return area.footprint, (x, y, self.builder.const(0.0))
            case _:
                return POINT, (x, y, self.builder.const(0.0))

    def covers(self, index: int) -> Footprint:
        """What an object covers, in its own frame."""
        return self.footprints[index] if index < len(self.footprints) else self.stand_ins[index]
