"""What an expression stands for while the checker expands it, and where that is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import ClassVar, overload

from scenegen.errors import Source, Span, SpecError
from scenegen.errors.declarations import MEASURED_TOO_EARLY
from scenegen.errors.language import MIXED_LIST, NOT_FINITE, UNKNOWN_NAME, WRONG_NUMBER_OF_ARGUMENTS, WRONG_TYPE
from scenegen.geometry import MATH, PRIMITIVES
from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, Polygon
from scenegen.geometry.primitives import BARE, LENGTH, Unit
from scenegen.geometry.workspace import BOARD, Workspace
from scenegen.lang.check.scope import NO_NUMBERS, Scope
from scenegen.lang.formula.builder import TRUE, CoreBuilder
from scenegen.lang.spec import Pose, SpecCamera
from scenegen.lang.syntax import ast
from scenegen.things.furniture import SupportSurface

Point = tuple[float, float]


SIDES = ("left", "right", "top", "bottom", "center")


CORNERS = ("topLeft", "topRight", "bottomLeft", "bottomRight")


SIZES = ("width", "height")


MEMBERS = (*SIDES, *CORNERS, "corners", *SIZES)


@dataclass(frozen=True, slots=True)
class Area:
    """A part of the table, or a board at a height, as it was written: bounding box (left, bottom, right, top), centre,
    and corners counter-clockwise, in metres. A circle has no corners. `kind` is the word that made it; `z` is how high
    its top is above the table."""

    kind: str
    box: tuple[float, float, float, float]
    center: Point
    corners: tuple[Point, ...]
    z: float = 0.0

    @property
    def underside(self) -> float:
        """How high the lower side of a board is above the table."""
        return self.z - min(BOARD, self.z)

    @property
    def footprint(self) -> Footprint:
        """What it covers, in the frame of its centre."""
        left, bottom, right, top = self.box
        match self.kind:
            case "circle":
                return Circle((right - left) / 2.0)
            case "polygon":
                x, y = self.center
                return Polygon(tuple((px - x, py - y) for px, py in self.corners))
            case _:
                return Box(right - left, top - bottom)

    def side(self, name: str) -> Point:
        """The middle of a side of the bounding box, or the centre."""
        left, bottom, right, top = self.box
        x, y = (left + right) / 2.0, (bottom + top) / 2.0
        sides = {"left": (left, y), "right": (right, y), "top": (x, top), "bottom": (x, bottom), "center": self.center}
        return sides[name]

    def corner(self, name: str) -> Point:
        """A corner of a rectangle."""
        left, bottom, right, top = self.box
        return (left if name.endswith("Left") else right), (top if name.startswith("top") else bottom)


def rectangle(left: float, bottom: float, right: float, top: float, kind: str = "rect") -> Area:
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return Area(kind, (left, bottom, right, top), ((left + right) / 2.0, (bottom + top) / 2.0), corners)


def disc(center: Point, radius: float) -> Area:
    x, y = center
    return Area("circle", (x - radius, y - radius, x + radius, y + radius), center, ())


def polygon(corners: Sequence[Point], center: Point) -> Area:
    """A convex polygon; `corners` counter-clockwise."""
    xs, ys = zip(*corners, strict=True)
    return Area("polygon", (min(xs), min(ys), max(xs), max(ys)), center, tuple(corners))


def whole(workspace: Workspace) -> Area:
    """The workspace as a region."""
    (left, right), (bottom, top) = workspace.x, workspace.y
    return rectangle(left, bottom, right, top, "workspace")


def board_gap(one: Area, other: Area) -> float:
    """The clearance of the boards of two regions, in metres: see `apart`."""
    gap = PRIMITIVES["gap"].evaluate
    beside = float(gap(MATH, one.footprint, other.footprint, *one.center, 0.0, *other.center, 0.0))
    return max(beside, one.z - min(BOARD, one.z) - other.z, other.z - min(BOARD, other.z) - one.z)


MAX_ECHO_LENGTH = 40  # characters of the user's text that a help line repeats


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """`origin` is where the user wrote it; `role` is what it was given as, e.g. "argument `a` of `closeTo`"."""

    kind: ClassVar[str] = "a value"
    origin: Span = field(compare=False)
    role: str = field(compare=False, default="")

    def with_origin(self, origin: Span, role: str = "") -> Value:
        """The same value, written elsewhere."""
        return replace(self, origin=origin, role=role)


@dataclass(frozen=True, slots=True)
class ObjectValue(Value):
    kind: ClassVar[str] = "an object"
    index: int

    def with_origin(self, origin: Span, role: str = "") -> Value:
        return ObjectValue(self.index, origin=origin, role=role)  # replace() costs ten times as much


@dataclass(frozen=True, slots=True)
class PointValue(Value):
    """A fixed or computed place; x and y are numbers of the core."""

    kind: ClassVar[str] = "a point"
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class RegionValue(Value):
    """A named part of the table, or the workspace itself. As a place it is its centre."""

    kind: ClassVar[str] = "a region"
    name: str
    area: Area


@dataclass(frozen=True, slots=True)
class CameraValue(Value):
    kind: ClassVar[str] = "a camera"
    camera: SpecCamera


@dataclass(frozen=True, slots=True)
class SurfaceValue(Value):
    """A surface of an object, which moves with it. As a place it is the centre of the object."""

    kind: ClassVar[str] = "a surface"
    carrier: int
    surface: SupportSurface


@dataclass(frozen=True, slots=True)
class ChosenValue(Value):
    """What an object stands on where that is a choice: `options` has the value for each of the choice's surfaces."""

    kind: ClassVar[str] = "a surface that differs from scene to scene"
    chooser: int
    options: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Row(Sequence[Value]):
    """The objects at some places in storage order, each made when it is asked for: an array may have thousands, and a
    text name it as often. `origin` is where the row was named."""

    places: range
    origin: Span = field(compare=False)

    def __len__(self) -> int:
        return len(self.places)

    def __iter__(self) -> Iterator[Value]:
        return (ObjectValue(place, origin=self.origin) for place in self.places)

    @overload
    def __getitem__(self, at: int) -> Value: ...

    @overload
    def __getitem__(self, at: slice) -> Sequence[Value]: ...

    def __getitem__(self, at: int | slice) -> Value | Sequence[Value]:
        found = self.places[at]
        return Row(found, self.origin) if isinstance(found, range) else ObjectValue(found, origin=self.origin)


@dataclass(frozen=True, slots=True)
class ListValue(Value):
    """Things in a row: an array of objects, `[mug, plate]`, `objects`, the corners of a region."""

    kind: ClassVar[str] = "a list"
    items: Sequence[Value]


@dataclass(frozen=True, slots=True)
class NeighboursValue(Value):
    """`consecutive(items)`: what a quantifier takes two or more neighbours at a time from."""

    kind: ClassVar[str] = "a row of neighbours"
    items: Sequence[Value]


@dataclass(frozen=True, slots=True)
class NumberValue(Value):
    kind: ClassVar[str] = "a number"
    node: int
    unit: Unit = BARE

    def with_origin(self, origin: Span, role: str = "") -> Value:
        return NumberValue(self.node, self.unit, origin=origin, role=role)


@dataclass(frozen=True, slots=True)
class FormulaValue(Value):
    """`named`: the names in it say whether it holds (`p != q`), so what stands beside it may mean nothing."""

    kind: ClassVar[str] = "a formula"
    node: int
    named: bool = False

    def with_origin(self, origin: Span, role: str = "") -> Value:
        return FormulaValue(self.node, self.named, origin=origin, role=role)


@dataclass(frozen=True, slots=True)
class AnyValue(Value):
    """A parameter of a definition that nobody calls: it may be anything, so only the rest of the body is checked."""


MAX_NOTED_VARIABLES = 4  # how many variables of quantifiers a note names


@dataclass(frozen=True, slots=True)
class CallFrame:
    """The source of the text at hand, and the calls that led here, innermost first.

    `text` is the call being expanded, `body` the definition's formula; both are unset outside definitions. `where`
    says what the variables of quantifiers stand for, innermost last; `rounds` is how often the quantifiers around, in
    the same formula, come by here.
    """

    source: Source
    calls: tuple[Span, ...] = ()
    text: str = ""
    body: ast.Expr | None = None
    where: tuple[Mapping[str, Value], ...] = ()
    rounds: int = 1


def check_alike(items: Sequence[Value]) -> None:
    """Lists beside other things in a list are nearly always meant as more of those. Raises SpecError."""
    lists = [one for one in items if isinstance(one, ListValue)]
    if lists and any(not isinstance(one, ListValue | AnyValue) for one in items):
        parts = []
        for is_list, some in groupby(items, lambda one: isinstance(one, ListValue)):
            texts = [one.origin.text for one in some]
            parts += texts if is_list else [f"[{', '.join(texts)}]"]
        raise SpecError(MIXED_LIST(lists[0].origin, mended=" + ".join(parts)))


def wrong_kind(value: Value, wanted: str, place: str) -> SpecError:
    """The diagnostic for a value of the wrong kind; `place` says what wanted it where the value has no role."""
    role = value.role or place
    return SpecError(
        WRONG_TYPE(value.origin, role=role, wanted=wanted, found=value.kind, remedy=_remedy(value, wanted, role))
    )


def _remedy(value: Value, wanted: str, role: str) -> str:
    if wanted == "a formula" and isinstance(value, NumberValue):
        return "compare it with something: ... <= 0.25"
    if wanted == "a formula" and isinstance(value, ObjectValue):
        other = "mug" if value.origin.text == "plate" else "plate"
        return f"say something about it: leftOf({value.origin.text}, {other})"
    if "`heading`" in value.role or "of headings" in role:
        return "a heading is an angle: NORTH, 90 deg, theta(plate)"
    if role == "what `*` works on" and isinstance(value, FormulaValue):
        return "join formulas with `&` (and), `|` (or); for shares of the scenes see `scenegen explain not-here`"
    if wanted == "a number" and isinstance(value, ObjectValue):
        return f"take a coordinate of it: x({value.origin.text}), or the distance to something: dist(a, b)"
    if isinstance(value, NeighboursValue):
        return "it stands in a quantifier: forall p, q in consecutive(items): ..."
    if isinstance(value, ListValue) and "surface" in wanted:
        written = value.origin.text
        if written.startswith("[") or len(written) > MAX_ECHO_LENGTH:
            return "one of several in each scene is `on any of [...]`, with all of them in one list"
        return f"take one of them, {written}[1], or one of them in each scene: on any of {written}"
    if isinstance(value, ListValue):
        written = value.origin.text
        if not value.items:
            return ""
        if len(written) > MAX_ECHO_LENGTH:
            written = "items"
        return f"take one of them, {written}[1], or all: forall p in {written}: ..."
    if wanted == "a list" and isinstance(value, ObjectValue):
        return f"write [{value.origin.text}, ...], or declare an array: object {value.origin.text}[3]"
    if wanted == "a number" and isinstance(value, RegionValue):
        return f"take a coordinate of one of its points: x({value.origin.text}.left)"
    if wanted == "a formula" and isinstance(value, RegionValue):
        return f"say what lies in it: inside(mug, {value.origin.text})"
    if wanted == "a region":
        return "declare one: region left = rect(0, 0, 0.5, 1)"
    if wanted == "a point" and isinstance(value, RegionValue):
        return f"write {value.origin.text}.center"
    if wanted == "an object that a hand can grasp":
        return "name an object of the table"
    if wanted == "a robot":
        return "declare one: robot arm = panda at (0.5, -0.25, NORTH)"
    if wanted == "a point" and isinstance(value, ObjectValue):
        return "write where it is: (0.5, 0.2)"
    if "object" in wanted and isinstance(value, NumberValue):
        if "point" in wanted:
            return "name an object, or write a point: (0.5, 0.2)"
        height = f"; a height is compared: z(mug) >= {value.origin.text}" if value.unit == LENGTH else ""
        return f"name an object or a surface, such as workspace or cabinet.top{height}"
    return ""


@dataclass(slots=True)
class Coercion:
    """Turns values into what the core is built of. Every method raises SpecError for a value of another kind.

    `any` is the number that stands for a parameter which nobody has given a value. `footprints` has one entry per
    object, none while the objects are still being declared; `fixed` holds the poses of those that do not move: their
    coordinates are constants.
    """

    scope: Scope
    builder: CoreBuilder
    any: float
    footprints: tuple[Footprint, ...] = ()
    fixed: Mapping[int, Pose] = field(default_factory=dict)

    def wrong(self, value: Value, wanted: str, place: str) -> SpecError:
        """What is wrong with a value's kind; `place` says what wanted it where the value has no role."""
        name = value.origin.text
        if not (self.scope.inferred and isinstance(value, ObjectValue) and name in self.scope.objects):
            return wrong_kind(value, wanted, place)
        # Nobody declared it: nothing else has this name, so it was taken for an object.
        signature = self.scope.signature(name)
        if signature is not None:
            return SpecError(WRONG_NUMBER_OF_ARGUMENTS(value.origin, name=name, usage=signature.usage))
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
        return self.footprints[index]


def key_of(value: Value) -> object:
    """What tells an argument from another, in time that does not grow with it: lists by identity. It stays true while
    somebody holds the list."""
    if isinstance(value, ListValue | NeighboursValue) and isinstance(value.items, tuple):
        return id(value.items)
    return value
