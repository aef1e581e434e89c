"""S-expressions -> a problem: what it declares, as frozen dataclasses. Formulas stay expressions until lowered.

Understood are PDDL's problems and domains (types, constants, predicates), LIBERO's regions, fixtures and language, and
BEHAVIOR's lists of typed objects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scenegen.errors import DataError, Source
from scenegen.errors.planning import PDDL_FORM, PDDL_NO_PROBLEM, PDDL_TOO_MANY_THINGS
from scenegen.pddl.read import Atom, Group, Node

Numbers = tuple[float, ...]
MOST_THINGS = 200  # each pair of them may be a clause of the spec


@dataclass(frozen=True, slots=True)
class Place:
    """A region of a problem: rectangles x0, y0, x1, y1 in the frame of its target, in metres, none where the target
    itself knows the region; and ranges of headings in radians."""

    name: str
    target: str
    ranges: tuple[Numbers, ...]
    yaw: tuple[Numbers, ...]
    node: Group


@dataclass(frozen=True, slots=True)
class Domain:
    """`parents` of types, `constants` with their types, the number of arguments of `predicates`."""

    parents: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, tuple[str, Atom]] = field(default_factory=dict)
    predicates: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Problem:
    """`things` are objects and fixtures by name, each with its type; `fixtures` those that stay where they are."""

    source: Source
    name: str
    language: str
    domain: Domain
    things: Mapping[str, tuple[str, Atom]]
    fixtures: frozenset[str]
    regions: Mapping[str, Place]  # by TARGET_NAME
    init: tuple[Node, ...]
    goal: Node | None
    other: tuple[Group, ...]  # sections that are of no use here
    sections: tuple[Group, ...]  # all of them

    def is_a(self, name: str, kind: str) -> bool:
        """Whether a thing is of a type, or of a type below it."""
        mine: str | None = self.things[name][0]
        seen = set[str]()
        while mine is not None and mine not in seen:
            if mine == kind or kind == "object":
                return True
            seen.add(mine)
            mine = self.domain.parents.get(mine)
        return False


def domain_of(source: Source, nodes: Sequence[Node]) -> Domain:
    """The domain that a file defines. Raises DataError."""
    sections = _sections(source, nodes, "domain")
    parents: dict[str, str] = {}
    constants: dict[str, tuple[str, Atom]] = {}
    predicates: dict[str, int] = {}
    for one in sections:
        match one.head:
            case ":types":
                parents.update({name: kind for name, (kind, _) in typed(one.rest).items() if name != kind})
            case ":constants":
                constants.update(typed(one.rest))
            case ":predicates":
                for each in one.rest:
                    if isinstance(each, Group) and each.head:
                        predicates[each.head] = sum(isinstance(a, Atom) and a.text.startswith("?") for a in each.rest)
    return Domain(parents, constants, predicates)


def problem_of(source: Source, nodes: Sequence[Node], domain: Domain) -> Problem:
    """The problem that a file defines. Raises DataError."""
    sections = _sections(source, nodes, "problem")
    things: dict[str, tuple[str, Atom]] = dict(domain.constants)
    regions: dict[str, Place] = {}
    fixtures, init, other = set[str](), list[Node](), list[Group]()
    goal: Node | None = None
    name = language = ""
    for one in sections:
        match one.head:
            case "problem":
                name = _words(one.rest)
            case ":language":
                language = _words(one.rest)
            case ":objects" | ":fixtures":
                found = _pairs(one.rest)
                _declare(things, found)
                if one.head == ":fixtures":
                    fixtures.update(each for each, _ in found)
            case ":regions":
                for each in one.rest:
                    place = _place(each)
                    regions[f"{place.target}_{place.name}" if place.target else place.name] = place
            case ":init":
                init.extend(one.rest)
            case ":goal":
                if len(one.rest) != 1:
                    raise DataError(PDDL_FORM(one.span, wanted="a goal", reason="it takes one formula"))
                if goal is not None:
                    raise DataError(PDDL_FORM(one.span, wanted="the only goal", reason="join goals with (and ...)"))
                goal = one.rest[0]
            case ":domain" | ":obj_of_interest" | ":requirements" | ":scene_properties":
                pass
            case _:
                other.append(one)
    if goal is None:
        raise DataError(PDDL_NO_PROBLEM(file=source.name, reason="it has no (:goal ...)"))
    if len(things) > MOST_THINGS:
        raise DataError(PDDL_TOO_MANY_THINGS(file=source.name, count=len(things), limit=MOST_THINGS))
    return Problem(
        source, name, language, domain, things, frozenset(fixtures), regions, tuple(init), goal, tuple(other), sections
    )


def _declare(things: dict[str, tuple[str, Atom]], found: Sequence[tuple[str, tuple[str, Atom]]]) -> None:
    """Add things to others. Raises DataError for one that is declared as something else before."""
    for name, (kind, atom) in found:
        if name in things and things[name][0] != kind:
            reason = f"it is declared as `{things[name][0]}`, too"
            raise DataError(PDDL_FORM(atom.span, wanted="a new name", reason=reason))
        things[name] = kind, atom


def typed(nodes: Sequence[Node]) -> dict[str, tuple[str, Atom]]:
    """`a b - block c` as types by name; what has no type is an `object`. Raises DataError."""
    return dict(_pairs(nodes))


def _pairs(nodes: Sequence[Node]) -> list[tuple[str, tuple[str, Atom]]]:
    """Each name of such a list with its type, in order; a name can come twice. Raises DataError."""
    found: list[tuple[str, tuple[str, Atom]]] = []
    waiting: list[Atom] = []
    place = 0
    while place < len(nodes):
        one = nodes[place]
        if not isinstance(one, Atom):
            raise DataError(PDDL_FORM(one.span, wanted="a name", reason="a list of names with their types stands here"))
        if one.text != "-":
            waiting.append(one)
            place += 1
            continue
        kind = nodes[place + 1] if place + 1 < len(nodes) else None
        if isinstance(kind, Group) and kind.head == "either" and kind.rest:
            kind = kind.rest[0]
        if not isinstance(kind, Atom):
            raise DataError(PDDL_FORM(one.span, wanted="a list of names", reason="no type follows"))
        found.extend((each.text, (kind.text, each)) for each in waiting)
        waiting.clear()
        place += 2
    found.extend((each.text, ("object", each)) for each in waiting)
    return found


def _sections(source: Source, nodes: Sequence[Node], what: str) -> tuple[Group, ...]:
    whole = nodes[0] if len(nodes) == 1 else None
    if not isinstance(whole, Group) or whole.head != "define":
        raise DataError(PDDL_NO_PROBLEM(file=source.name, reason="it is no single (define ...)"))
    parts = []
    for one in whole.rest:
        if not isinstance(one, Group) or not one.head:
            raise DataError(PDDL_FORM(one.span, wanted="a section", reason="(:name ...) belongs here"))
        parts.append(one)
    if not parts or parts[0].head != what:
        raise DataError(PDDL_NO_PROBLEM(file=source.name, reason=f"it does not define a {what}"))
    return tuple(parts)


def _words(nodes: Sequence[Node]) -> str:
    return " ".join(one.text for one in nodes if isinstance(one, Atom))


def _place(node: Node) -> Place:
    if not isinstance(node, Group) or not node.items or not isinstance(node.items[0], Atom):
        raise DataError(PDDL_FORM(node.span, wanted="a region", reason="(NAME (:target THING) ...) belongs here"))
    target, ranges, yaw = "", tuple[Numbers, ...](), tuple[Numbers, ...]()
    for one in node.rest:
        match one:
            case Group() if one.head == ":target":
                target = _words(one.rest)
            case Group() if one.head == ":ranges":
                ranges = _rows(one, 4)
            case Group() if one.head == ":yaw_rotation":
                yaw = _rows(one, 2)
    return Place(node.items[0].text, target, ranges, yaw, node)


def _rows(node: Group, length: int) -> tuple[Numbers, ...]:
    rows = []
    for outer in node.rest:
        for row in outer.items if isinstance(outer, Group) else ():
            numbers = tuple(map(_number, row.items)) if isinstance(row, Group) else ()
            if len(numbers) != length:
                raise DataError(PDDL_FORM(row.span, wanted=f"{length} numbers", reason="a range is a row of numbers"))
            rows.append(numbers)
    return tuple(rows)


def _number(node: Node) -> float:
    try:
        value = float(node.text) if isinstance(node, Atom) else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= 1000.0:
        raise DataError(PDDL_FORM(node.span, wanted="a number", reason="metres or radians, up to 1000"))
    return value
