"""Predicates -> relations of the language. `$1`, `$2` are arguments; matching ignores case, hyphens and underscores."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

Holds = Literal["on", "in", ""]


@dataclass(frozen=True, slots=True)
class Relation:
    """A predicate's formula, empty where it has no geometry. With `holds`, the second argument carries the first one:
    `on` its top or `in` its inside; the formula then follows from what the carrier is. `near`: the centres are at most
    this many metres apart, too, if the carrier is a thing."""

    arity: int
    formula: str = ""
    holds: Holds = ""
    near: float | None = None

    @property
    def places(self) -> tuple[int, ...]:
        """The arguments that it reads, from 0."""
        said = {int(one) - 1 for one in re.findall(r"\$(\d)", self.formula)}
        return (0, 1) if self.holds else tuple(sorted(said))

    def takes(self, count: int) -> bool:
        """Whether a fact with so many arguments is one of it."""
        return self.arity == count if self.arity >= 0 else count > max(self.places, default=-1)


NONE = Relation(-1)
FLOOR = Relation(-1, "z($1) <= EPS_LEVEL")
ON, IN = Relation(2, holds="on"), Relation(2, holds="in")

LIBERO: dict[str, Relation] = {
    "on": Relation(2, holds="on", near=0.03),
    "in": IN,
    "stack": Relation(2, holds="on", near=0.03),
    "incontact": Relation(2, "apart($1, $2) <= EPS_TOUCH"),
    "open": NONE,
    "close": NONE,
    "turnon": NONE,
    "turnoff": NONE,
    "up": NONE,
}

COMMON: dict[str, Relation] = {
    "on": ON,
    "ontop": ON,
    "ontopof": ON,
    "at": NONE,
    "in": IN,
    "inside": IN,
    "overlaid": ON,
    "draped": ON,
    "ontable": FLOOR,
    "onfloor": FLOOR,
    "under": Relation(2, "underneath($1, $2)"),
    "nextto": Relation(2, "0 m <= gap($1, $2) & gap($1, $2) <= 15 cm"),
    "touching": Relation(2, "apart($1, $2) <= EPS_TOUCH"),
    "clear": Relation(1, "reachableFromAbove($1)"),
    "leftof": Relation(2, "leftOf($1, $2)"),
    "rightof": Relation(2, "rightOf($1, $2)"),
    "behind": Relation(2, "aboveOf($1, $2)"),
    "infrontof": Relation(2, "belowOf($1, $2)"),
    "near": Relation(2, "closeTo($1, $2)"),
    **dict.fromkeys(
        "open closed toggledon turnon turnoff cooked frozen burnt soaked stained dusty sliced diced broken perished "
        "screwed hot onfire heated covered filled contains empty attached folded unfolded assembled inroom insource "
        "timeset handempty armempty holding saturated boiled melted real future saturated grasped dirty clean".split(),
        NONE,
    ),
}


def plain(name: str) -> str:
    """A predicate's name as tables have it."""
    return re.sub(r"[-_]", "", name).lower()


def relation(written: str) -> Relation:
    """What a map says of a predicate: a formula, `on`, `in` or `none`."""
    match written.strip():
        case "none" | "":
            return NONE
        case "on":
            return ON
        case "in":
            return IN
        case formula:
            return Relation(max((int(one) for one in re.findall(r"\$(\d)", formula)), default=0), f"({formula})")
