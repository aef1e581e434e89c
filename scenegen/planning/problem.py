"""S-expressions -> a problem: what it declares, as frozen dataclasses. Formulas stay expressions until lowered.

Understood are PDDL's problems and domains (types, constants, predicates), LIBERO's regions, fixtures and language, and
BEHAVIOR's lists of typed objects.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from scenegen.errors import DataError, Source, Span
from scenegen.errors.worlds import PDDL_FORM, PDDL_NO_PROBLEM, PDDL_TEXT, PDDL_TOO_LARGE
from scenegen.lang.syntax.parse import plain_breaks
from scenegen.scenes.files import read_bytes

MAX_PDDL_BYTES = 4_000_000
MAX_DEPTH = 200  # what reads the tree may recurse

# A word ends where a variable begins (`nextto?x?y`), and a hyphen that joins nothing is one of its own (`a -block`).
_LETTER = r"[^\s();?\x00-\x1f\x7f\ufffd-]"
_WORD = rf"\??(?:{_LETTER}+|-(?={_LETTER})|\?(?!\w))++"
_SEXPR_TOKEN = re.compile(rf"(?P<beside>[ \t\n\f]+|;[^\n]*)|[()]|-?(?=[\d.]){_WORD}|-|{_WORD}|(?P<odd>.)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class SExprAtom:
    """A word, as written."""

    text: str
    span: Span


@dataclass(frozen=True, slots=True)
class SExprList:
    """What stands between two parentheses."""

    items: tuple[Node, ...]
    span: Span

    @property
    def head(self) -> str:
        """The first word, in lower case; empty if there is none."""
        first = self.items[0] if self.items else None
        return first.text.lower() if isinstance(first, SExprAtom) else ""

    @property
    def rest(self) -> tuple[Node, ...]:
        return self.items[1:]


Node = SExprAtom | SExprList


def read(path: Path, what: str) -> tuple[Source, tuple[Node, ...]]:
    """A file and its expressions. Raises DataError for files too large, binary or unbalanced."""
    data = read_bytes(path, what, limit=MAX_PDDL_BYTES)
    text = plain_breaks(data.decode("utf-8-sig", errors="replace"))
    source = Source(str(path), text)
    return source, expressions(source)


def expressions(source: Source) -> tuple[Node, ...]:
    """All expressions of a text. Raises DataError."""
    open_: list[tuple[int, list[Node]]] = [(-1, [])]
    for word, start, end in _tokens(source):
        if word == "(":
            if len(open_) > MAX_DEPTH:
                raise DataError(PDDL_TEXT(Span(source, start, end), limit=MAX_DEPTH))
            open_.append((start, []))
        elif word == ")":
            if len(open_) == 1:
                raise DataError(PDDL_TEXT(Span(source, start, end)))
            begin, items = open_.pop()
            open_[-1][1].append(SExprList(tuple(items), Span(source, begin, end)))
        else:
            open_[-1][1].append(SExprAtom(word, Span(source, start, end)))
    if len(open_) > 1:
        begin = open_[-1][0]
        raise DataError(PDDL_TEXT(Span(source, begin, begin + 1), opened=True))
    return tuple(open_[0][1])


def _tokens(source: Source) -> Iterator[tuple[str, int, int]]:
    for found in _SEXPR_TOKEN.finditer(source.text):
        if found["odd"]:
            said = f"character U+{ord(found[0]):04X}"
            raise DataError(PDDL_TEXT(Span(source, *found.span()), file=source.name, character=said))
        if not found["beside"]:
            yield found[0], *found.span()


Numbers = tuple[float, ...]
MAX_PDDL_THINGS = 200  # each pair of them may be a clause of the spec


@dataclass(frozen=True, slots=True)
class TypedName:
    """What a list of names says of one: its type, of `(either a b)` several, and where it stands."""

    kinds: tuple[str, ...]
    node: SExprAtom

    @property
    def kind(self) -> str:
        """The type, as PDDL has it."""
        return self.kinds[0] if len(self.kinds) == 1 else f"(either {' '.join(self.kinds)})"


@dataclass(frozen=True, slots=True)
class PddlRegion:
    """A region of a problem: rectangles x0, y0, x1, y1 in the frame of its target, in metres, none where the target
    itself knows the region; and ranges of headings in radians."""

    name: str
    target: str
    ranges: tuple[Numbers, ...]
    yaw: tuple[Numbers, ...]
    node: SExprList


@dataclass(frozen=True, slots=True)
class Domain:
    """`parents` of types, in lower case, `constants` with their types, the number of arguments of `predicates`."""

    parents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    constants: Mapping[str, TypedName] = field(default_factory=dict)
    predicates: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PddlProblem:
    """`things` are objects and fixtures by name, each with its type; `fixtures` those that stay where they are. PDDL
    does not tell capitals from small letters: in `init` and `goal` each name is written as where it is declared, and
    variables are in lower case."""

    source: Source
    name: str
    language: str
    domain: Domain
    things: Mapping[str, TypedName]
    fixtures: frozenset[str]
    regions: Mapping[str, PddlRegion]  # by TARGET_NAME
    init: tuple[Node, ...]
    goal: Node | None
    other: tuple[SExprList, ...]  # sections that are of no use here
    sections: tuple[SExprList, ...]  # all of them

    def is_a(self, name: str, kinds: Iterable[str]) -> bool:
        """Whether a thing is of one of some types, or of a type below it."""
        wanted = {kind.lower() for kind in kinds}
        return "object" in wanted or not wanted.isdisjoint(self._above(self.things[name].kinds))

    @property
    def types(self) -> frozenset[str]:
        """All types that are declared, or that things have, in lower case."""
        used = [kind for one in self.things.values() for kind in one.kinds]
        return frozenset({"object", *self._above([*used, *self.domain.parents])})

    def _above(self, kinds: Iterable[str]) -> set[str]:
        """These types and those above them."""
        stack, seen = [kind.lower() for kind in kinds], set[str]()
        while stack:
            one = stack.pop()
            if one not in seen:
                seen.add(one)
                stack.extend(self.domain.parents.get(one, ()))
        return seen


def domain_of(source: Source, nodes: Sequence[Node]) -> Domain:
    """The domain that a file defines. Raises DataError."""
    sections = _sections(source, nodes, "domain")
    parents: dict[str, tuple[str, ...]] = {}
    constants: dict[str, TypedName] = {}
    predicates: dict[str, int] = {}
    for one in sections:
        match one.head:
            case ":types":
                for name, found in typed_names(one.rest):
                    above = (kind.lower() for kind in found.kinds)
                    parents[name.lower()] = tuple(dict.fromkeys((*parents.get(name.lower(), ()), *above)))
            case ":constants":
                _declare(constants, typed_names(one.rest))
            case ":predicates":
                for each in _flat(one.rest):
                    if isinstance(each, SExprList) and each.head:
                        predicates[each.head] = sum(
                            isinstance(a, SExprAtom) and a.text.startswith("?") for a in each.rest
                        )
    return Domain(parents, constants, predicates)


def problem_of(source: Source, nodes: Sequence[Node], domain: Domain) -> PddlProblem:
    """The problem that a file defines. Raises DataError."""
    sections = _sections(source, nodes, "problem")
    things = dict(domain.constants)
    regions: dict[str, PddlRegion] = {}
    fixtures, places, init, other = set[str](), list[PddlRegion](), list[Node](), list[SExprList]()
    goal: Node | None = None
    name = language = ""
    for one in sections:
        match one.head:
            case "problem":
                name = _words(one.rest)
            case ":language":
                language = _words(one.rest)
            case ":objects" | ":fixtures":
                found = _declare(things, typed_names(one.rest))
                if one.head == ":fixtures":
                    fixtures.update(found)
            case ":regions":
                places.extend(map(_place, one.rest))
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
    if len(things) > MAX_PDDL_THINGS:
        raise DataError(PDDL_TOO_LARGE(file=source.name, count=len(things), limit=MAX_PDDL_THINGS))
    spelled = {one.lower(): one for one in things}
    for place in places:
        target = spelled.get(place.target.lower(), place.target)
        regions[f"{target}_{place.name}" if target else place.name] = replace(place, target=target)
    spelled = {one.lower(): one for one in regions} | spelled
    goal, init = _spell(goal, spelled), [_spell(one, spelled) for one in init]
    return PddlProblem(
        source, name, language, domain, things, frozenset(fixtures), regions, tuple(init), goal, tuple(other), sections
    )


def _declare(things: dict[str, TypedName], found: Sequence[tuple[str, TypedName]]) -> list[str]:
    """Add things to others, and return their names, each as it was first written. Raises DataError for one that is
    declared as something else before."""
    spelled = {one.lower(): one for one in things}
    names = []
    for name, one in found:
        name = spelled.setdefault(name.lower(), name)
        if things.setdefault(name, one).kind.lower() != one.kind.lower():
            reason = f"it is declared as `{things[name].kind}`, too"
            raise DataError(PDDL_FORM(one.node.span, wanted="a new name", reason=reason))
        names.append(name)
    return names


def _spell(node: Node, spelled: Mapping[str, str]) -> Node:
    """A formula with its names as they are declared, and its variables in lower case."""
    if isinstance(node, SExprList):
        return replace(node, items=tuple(_spell(one, spelled) for one in node.items))
    mark, lower = "?" if node.text.startswith("?") else "", node.text.lower()
    name = spelled.get(lower.removeprefix("?"))
    if name is not None:
        return replace(node, text=mark + name)
    return replace(node, text=lower) if mark else node


def _flat(nodes: Iterable[Node]) -> list[Node]:
    """A section with what it calls `:private` to one agent: scenes belong to all."""
    return [
        each
        for one in nodes
        for each in (_flat(one.rest) if isinstance(one, SExprList) and one.head == ":private" else (one,))
    ]


def typed_names(nodes: Sequence[Node]) -> list[tuple[str, TypedName]]:
    """`a b - block c - (either cup mug) d` as names with their types, in order; a name can come twice. What has no type
    is an `object`. Raises DataError."""
    found: list[tuple[str, TypedName]] = []
    waiting: list[SExprAtom] = []
    parts = iter(_flat(nodes))
    for one in parts:
        if not isinstance(one, SExprAtom):
            raise DataError(PDDL_FORM(one.span, wanted="a name", reason="a list of names with their types stands here"))
        if one.text != "-":
            waiting.append(one)
            continue
        kind = next(parts, None)
        several = kind.rest if isinstance(kind, SExprList) and kind.head == "either" else (kind,)
        kinds = tuple(each.text for each in several if isinstance(each, SExprAtom))
        if not kinds or len(kinds) < len(several):
            raise DataError(PDDL_FORM(one.span, wanted="a list of names", reason="no type follows"))
        found.extend((each.text, TypedName(kinds, each)) for each in waiting)
        waiting.clear()
    return found + [(each.text, TypedName(("object",), each)) for each in waiting]


def _sections(source: Source, nodes: Sequence[Node], what: str) -> tuple[SExprList, ...]:
    whole = nodes[0] if len(nodes) == 1 else None
    if not isinstance(whole, SExprList) or whole.head != "define":
        raise DataError(PDDL_NO_PROBLEM(file=source.name, reason="it is no single (define ...)"))
    parts = []
    for one in whole.rest:
        if not isinstance(one, SExprList) or not one.head:
            raise DataError(PDDL_FORM(one.span, wanted="a section", reason="(:name ...) belongs here"))
        parts.append(one)
    if not parts or parts[0].head != what:
        raise DataError(PDDL_NO_PROBLEM(file=source.name, reason=f"it does not define a {what}"))
    return tuple(parts)


def _words(nodes: Sequence[Node]) -> str:
    return " ".join(one.text for one in nodes if isinstance(one, SExprAtom))


def _place(node: Node) -> PddlRegion:
    if not isinstance(node, SExprList) or not node.items or not isinstance(node.items[0], SExprAtom):
        raise DataError(PDDL_FORM(node.span, wanted="a region", reason="(NAME (:target THING) ...) belongs here"))
    target, ranges, yaw = "", tuple[Numbers, ...](), tuple[Numbers, ...]()
    for one in node.rest:
        match one:
            case SExprList() if one.head == ":target":
                target = _words(one.rest)
            case SExprList() if one.head == ":ranges":
                ranges = _rows(one, 4)
            case SExprList() if one.head == ":yaw_rotation":
                yaw = _rows(one, 2)
    return PddlRegion(node.items[0].text, target, ranges, yaw, node)


def _rows(node: SExprList, length: int) -> tuple[Numbers, ...]:
    rows = []
    for outer in node.rest:
        for row in outer.items if isinstance(outer, SExprList) else ():
            numbers = tuple(map(_number, row.items)) if isinstance(row, SExprList) else ()
            if len(numbers) != length:
                raise DataError(PDDL_FORM(row.span, wanted=f"{length} numbers", reason="a range is a row of numbers"))
            rows.append(numbers)
    return tuple(rows)


def _number(node: Node) -> float:
    try:
        value = float(node.text) if isinstance(node, SExprAtom) else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= 1000.0:
        raise DataError(PDDL_FORM(node.span, wanted="a number", reason="metres or radians, up to 1000"))
    return value
