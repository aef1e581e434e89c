"""What a formula over a spec can name, by kind, as a model writes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain

from scenegen.lang.lower import Lowering
from scenegen.primitives.units import ANGLE, LENGTH, SPEED, TURN_RATE, Unit

OBJECT, REGION, POINT, LIST, HEADING = "object", "region", "point", "list", "heading"
KINDS = (OBJECT, REGION, POINT, LIST, HEADING)
HEADINGS = ("NORTH", "EAST", "SOUTH", "WEST", "45 deg", "135 deg", "225 deg", "315 deg")
FEW = 8  # objects up to which points of regions, groups of three and fine steps of numbers take part
SIDES = ("left", "right", "top", "bottom")


@dataclass(frozen=True, slots=True)
class Measure:
    """How numbers of a unit are written: whole ones with a suffix. `steps` are those that are tried."""

    suffix: str
    steps: tuple[int, ...]
    coarse: tuple[int, ...]
    scale: float  # of a whole one, in metres or radians

    def tried(self, few: bool) -> tuple[int, ...]:
        return self.steps if few else self.coarse


MEASURES: Mapping[Unit, Measure] = {
    LENGTH: Measure(" cm", (1, 2, 5, 10, 20, 30, 50, 100), (1, 5, 10, 20, 50, 100), 0.01),
    ANGLE: Measure(" deg", (5, 10, 20, 30, 45), (5, 20, 45), 0.017453292519943295),
    SPEED: Measure(" cm/s", (1, 50), (1, 50), 0.01),
    TURN_RATE: Measure(" deg/s", (1, 90), (1, 90), 0.017453292519943295),
}


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """Names by kind, and variables that hide none of them. `own` are definitions of the spec itself."""

    names: Mapping[str, tuple[str, ...]]
    variables: tuple[str, str]
    own: frozenset[str]
    timed: bool

    @property
    def few(self) -> bool:
        """Whether there are so few objects that there is room for more to say of each."""
        return len(self.names[OBJECT]) <= FEW


def vocabulary(lowering: Lowering) -> Vocabulary:
    """The names of a spec, once its declarations have been evaluated."""
    scope = lowering.scope
    objects = tuple(scope.objects)
    regions = ("workspace", *(name for name in lowering.areas if name != "workspace"))
    carriers = sorted({one.carrier for one in lowering.supports.values() if one.carrier is not None})
    surfaces = dict.fromkeys(
        f"{objects[one.carrier]}.{one.name}" for one in lowering.supports.values() if one.carrier in carriers
    )
    points = tuple(f"{region}.{side}" for region in regions for side in SIDES) if len(objects) <= FEW else ()
    lists = (*(("objects",) if len(objects) > 1 else ()), *scope.arrays)
    taken = {*scope.values(), *scope.functions()}
    free = [name for name in chain("pqrstuvw", (f"p{k}" for k in range(len(taken) + 2))) if name not in taken]
    own = frozenset(name for name, one in scope.definitions.items() if one.source is not scope.prelude)
    names = {OBJECT: objects, REGION: (*regions, *surfaces), POINT: points, LIST: lists, HEADING: HEADINGS}
    return Vocabulary(names, (free[0], free[1]), own, scope.timed)
