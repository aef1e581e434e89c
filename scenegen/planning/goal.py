"""A goal -> a formula of the language, over the instances of its quantifiers.

What has no geometry is left out, with a note: states, numbers, preferences, and all else that is no relation of
things. The formula stays a necessary condition of the goal: of a conjunction the rest remains; of a disjunction, a
negation or an implication with such a part nothing remains, with a note, too.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from scenegen.errors import DataError
from scenegen.errors.worlds import BAD_MAP, PDDL_FORM, PDDL_TOO_LARGE, PDDL_UNKNOWN_NAME
from scenegen.planning.problem import Node, PddlProblem, SExprAtom, SExprList, typed_names
from scenegen.scenes.files import read_bytes

MAX_INSTANCES = 20_000  # instances of a formula
MAX_PAIRED = 2_000  # parts of a formula about pairs: all ways to pair 4 things with 6, or 5 with 5
NUMERIC = ("=", "<", "<=", ">", ">=", "increase", "decrease", "assign", "scale-up", "scale-down")  # over numbers

Names = Mapping[str, str]  # of variables


@dataclass(frozen=True, slots=True)
class TranslatedFormula:
    """A formula, None where nothing of it is about places; `whole` if all of it is. `more`: the part that is left out
    has relations of things in it."""

    text: str | None
    whole: bool = True
    more: bool = False


Lower = Callable[
    [SExprList, Sequence[str], bool], TranslatedFormula
]  # an atom with the names of its arguments; whether it is wanted
Lose = Callable[
    [Node, str], TranslatedFormula
]  # what is left out, and why; `NO_PLACE` where it says nothing about places

NO_PLACE = "without geometry"
LEFT_OUT_WITH_IT = "left out, as a part of it has no geometry"
KEPT_AS_AT_LEAST = "kept as `at least`, as a part of it has no geometry"
KEPT_IN_PART = "kept in part (how many have a partner, not that no two share one: there are too many ways)"


@dataclass(slots=True)
class GoalReader:
    """Reads formulas of a problem; `atom` says what an atom means, `lose` takes what is left out."""

    problem: PddlProblem
    atom: Lower
    lose: Lose
    instances: int = field(default=0)

    def read(self, node: Node, names: Names, wanted: bool = True) -> TranslatedFormula:
        """Raises DataError for what is no formula."""
        self.instances += 1
        if self.instances > MAX_INSTANCES:
            raise DataError(PDDL_TOO_LARGE(node.span, what="this formula", limit=MAX_INSTANCES))
        if not isinstance(node, SExprList) or not node.items:
            if isinstance(node, SExprList):
                return TranslatedFormula("true")
            raise DataError(PDDL_FORM(node.span, wanted="a formula", reason="(PREDICATE ...) belongs here"))
        match node.head:
            case "and":
                return all_hold(self._until("false", node.rest, names, wanted))
            case "or":
                return self._whole(node, either(self._until("true", node.rest, names, wanted)))
            case "not":
                (inner,) = self._parts(node, 1)
                return self._whole(node, negation(self.read(inner, names, not wanted)))
            case "imply" | "implies":
                first, second = self._parts(node, 2)
                fails = negation(self.read(first, names, not wanted))
                holds = fails if fails.text == "true" else self.read(second, names, wanted)
                return self._whole(node, either([fails, holds]))
            case "forall" | "exists":
                variables, body = self._parts(node, 2)
                found = [self.read(body, {**names, **one}, wanted) for one in self._choices(variables)]
                return all_hold(found) if node.head == "forall" else self._whole(node, either(found))
            case "forn":
                count, variables, body = self._parts(node, 3)
                found = [self.read(body, {**names, **one}, wanted) for one in self._choices(variables)]
                return self._whole(node, self._exactly(self._count(count), found, node))
            case "forpairs":
                one, other, body = self._parts(node, 3)
                return self._whole(node, self._pairs(None, one, other, body, names, wanted, node))
            case "fornpairs":
                count, one, other, body = self._parts(node, 4)
                return self._whole(node, self._pairs(self._count(count), one, other, body, names, wanted, node))
            case "":
                raise DataError(PDDL_FORM(node.span, wanted="a formula", reason="a word comes first"))
        arguments = [
            names.get(part.text, part.text.removeprefix("?")) for part in node.rest if isinstance(part, SExprAtom)
        ]
        if node.head == "=" and len(arguments) == len(node.rest) == 2 and not any(map(_is_number, arguments)):
            for name, part in zip(arguments, node.rest, strict=True):
                self._refuse_unknown("thing", name, (*self.problem.things, *self.problem.regions), part)
            return TranslatedFormula("true" if arguments[0] == arguments[1] else "false")
        if node.head in NUMERIC or len(arguments) < len(node.rest):
            return self.lose(node, NO_PLACE)
        return self.atom(node, arguments, wanted)

    def _until(self, end: str, nodes: Sequence[Node], names: Names, wanted: bool) -> list[TranslatedFormula]:
        """What some formulas mean, up to one that decides all."""
        found: list[TranslatedFormula] = []
        for one in nodes:
            found.append(self.read(one, names, wanted))
            if found[-1].text == end:
                break
        return found

    def _whole(self, node: Node, meaning: TranslatedFormula) -> TranslatedFormula:
        """Tell where more is left out than what has no geometry."""
        if meaning.text is None and meaning.more:
            self.lose(node, LEFT_OUT_WITH_IT)
            return TranslatedFormula(None, whole=False)
        return meaning

    def _refuse_unknown(self, what: str, name: str, known: Collection[str], node: Node) -> None:
        if name not in known:
            advice = "types are declared in the domain: <domain>" if what == "type" else None
            raise DataError(PDDL_UNKNOWN_NAME(node.span, what=what, name=name, known=known, advice=advice))

    def _parts(self, node: SExprList, count: int) -> tuple[Node, ...]:
        if len(node.rest) != count:
            raise DataError(PDDL_FORM(node.span, wanted=f"a formula with `{node.head}`", reason=f"it takes {count}"))
        return node.rest

    def _choices(self, variables: Node) -> list[dict[str, str]]:
        if not isinstance(variables, SExprList):
            raise DataError(PDDL_FORM(variables.span, wanted="a list of variables", reason="(?x - TYPE) belongs here"))
        kinds = {name: found.kinds for name, found in typed_names(variables.items)}
        for kind in (kind for several in kinds.values() for kind in several):
            self._refuse_unknown("type", kind.lower(), self.problem.types, variables)
        known = [[one for one in self.problem.things if self.problem.is_a(one, each)] for each in kinds.values()]
        if math.prod(len(each) for each in known) > MAX_INSTANCES:
            raise DataError(PDDL_TOO_LARGE(variables.span, what="this quantifier", limit=MAX_INSTANCES))
        return [dict(zip(kinds, chosen, strict=True)) for chosen in itertools.product(*known)]

    def _count(self, node: Node) -> int:
        word = node.items[0] if isinstance(node, SExprList) and len(node.items) == 1 else node
        if not isinstance(word, SExprAtom) or not word.text.isdecimal() or len(word.text) > 6:
            raise DataError(PDDL_FORM(node.span, wanted="a count", reason="(3), say"))
        return int(word.text)

    def _exactly(self, count: int, found: Sequence[TranslatedFormula], node: SExprList) -> TranslatedFormula:
        least, most = self._least(count, found, node), negation(self._least(count + 1, found, node))
        if least.text is not None and most.more:
            self.lose(node, KEPT_AS_AT_LEAST)
        return all_hold([least, most])

    def _least(self, count: int, found: Sequence[TranslatedFormula], node: SExprList) -> TranslatedFormula:
        """At least `count` of them hold: some subset of that size does."""
        if math.comb(len(found), min(count, len(found))) * max(count, 1) > MAX_INSTANCES:
            raise DataError(PDDL_TOO_LARGE(node.span, what="this count", limit=MAX_INSTANCES))
        return either([all_hold(one) for one in itertools.combinations(found, count)])

    def _pairs(
        self, count: int | None, one: Node, other: Node, body: Node, names: Names, wanted: bool, node: SExprList
    ) -> TranslatedFormula:
        """A one-to-one mapping: `count` of either side, or as many as there are on the smaller one, each with a
        partner of its own. Nothing is a partner of itself. Where there are too many ways to pair them, as many of
        either side have a partner, which is necessary."""
        rows, columns = self._choices(one), self._choices(other)
        if len(rows) * len(columns) > MAX_INSTANCES:
            raise DataError(PDDL_TOO_LARGE(node.span, what="this formula", limit=MAX_INSTANCES))
        count = min(len(rows), len(columns)) if count is None else count
        table = [
            [
                TranslatedFormula("false")
                if [*row.values()] == [*column.values()]
                else self.read(body, {**names, **row, **column}, wanted)
                for column in columns
            ]
            for row in rows
        ]
        if math.comb(len(rows), count) * math.perm(len(columns), count) * count <= MAX_PAIRED:
            return either(
                [
                    all_hold([table[row][column] for row, column in zip(chosen, partners, strict=True)])
                    for chosen in itertools.combinations(range(len(rows)), count)
                    for partners in itertools.permutations(range(len(columns)), count)
                ]
            )
        by_row, by_column = [either(each) for each in table], [either(each) for each in zip(*table, strict=True)]
        partly = self.lose(node, KEPT_IN_PART)
        return all_hold([self._least(count, by_row, node), self._least(count, by_column, node), partly])


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", text) is not None


def all_hold(parts: Sequence[TranslatedFormula]) -> TranslatedFormula:
    """All of them, as far as they are about places."""
    texts = list(dict.fromkeys(one.text for one in parts if one.text is not None and one.text != "true"))
    whole = all(one.whole for one in parts)
    if "false" in texts:
        return TranslatedFormula("false")
    if not texts:
        return TranslatedFormula("true" if whole else None, whole)
    return TranslatedFormula(texts[0] if len(texts) == 1 else "(" + " & ".join(texts) + ")", whole)


def either(parts: Sequence[TranslatedFormula]) -> TranslatedFormula:
    """One of them; nothing, where one of them is not about places."""
    texts = list(dict.fromkeys(one.text for one in parts if one.text != "false"))
    if "true" in texts:
        return TranslatedFormula("true")
    if None in texts:
        return TranslatedFormula(None, whole=False, more=len(texts) > 1)
    whole = all(one.whole for one in parts)
    if not texts:
        return TranslatedFormula("false", whole)
    return TranslatedFormula(texts[0] if len(texts) == 1 else "(" + " | ".join(map(str, texts)) + ")", whole)


def negation(part: TranslatedFormula) -> TranslatedFormula:
    """Not it; nothing, where only some of it is about places."""
    if part.text is None or not part.whole:
        return TranslatedFormula(None, whole=False, more=part.text is not None)
    return TranslatedFormula({"true": "false", "false": "true"}.get(part.text, f"!({part.text})"))


Holds = Literal["on", "in", ""]


@dataclass(frozen=True, slots=True)
class PredicateFormula:
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


NO_GEOMETRY = PredicateFormula(-1)
ON_FLOOR = PredicateFormula(-1, "z($1) <= EPS_LEVEL")
ON, IN = PredicateFormula(2, holds="on"), PredicateFormula(2, holds="in")

LIBERO_PREDICATES: dict[str, PredicateFormula] = {
    "on": PredicateFormula(2, holds="on", near=0.03),
    "in": IN,
    "stack": PredicateFormula(2, holds="on", near=0.03),
    "incontact": PredicateFormula(2, "apart($1, $2) <= EPS_TOUCH"),
    "open": NO_GEOMETRY,
    "close": NO_GEOMETRY,
    "turnon": NO_GEOMETRY,
    "turnoff": NO_GEOMETRY,
    "up": NO_GEOMETRY,
}

COMMON_PREDICATES: dict[str, PredicateFormula] = {
    "on": ON,
    "ontop": ON,
    "ontopof": ON,
    "at": NO_GEOMETRY,
    "in": IN,
    "inside": IN,
    "overlaid": ON,
    "draped": ON,
    "ontable": ON_FLOOR,
    "onfloor": ON_FLOOR,
    "under": PredicateFormula(2, "underneath($1, $2)"),
    "nextto": PredicateFormula(2, "0 m <= gap($1, $2) & gap($1, $2) <= 15 cm"),
    "touching": PredicateFormula(2, "apart($1, $2) <= EPS_TOUCH"),
    "clear": PredicateFormula(1, "reachableFromAbove($1)"),
    "leftof": PredicateFormula(2, "leftOf($1, $2)"),
    "rightof": PredicateFormula(2, "rightOf($1, $2)"),
    "behind": PredicateFormula(2, "aboveOf($1, $2)"),
    "infrontof": PredicateFormula(2, "belowOf($1, $2)"),
    "near": PredicateFormula(2, "closeTo($1, $2)"),
    **dict.fromkeys(
        "open closed toggledon turnon turnoff cooked frozen burnt soaked stained dusty sliced diced broken perished "
        "screwed hot onfire heated covered filled contains empty attached folded unfolded assembled inroom insource "
        "timeset handempty armempty holding saturated boiled melted real future saturated grasped dirty clean".split(),
        NO_GEOMETRY,
    ),
}


def plain(name: str) -> str:
    """A predicate's name as tables have it."""
    return re.sub(r"[-_]", "", name).lower()


def relation(written: str) -> PredicateFormula:
    """What a map says of a predicate: a formula, `on`, `in` or `none`."""
    match written.strip():
        case "none" | "":
            return NO_GEOMETRY
        case "on":
            return ON
        case "in":
            return IN
        case formula:
            return PredicateFormula(
                max((int(one) for one in re.findall(r"\$(\d)", formula)), default=0), f"({formula})"
            )


MAX_MAP_BYTES = 1_000_000


class NameMap(BaseModel):
    """`objects`: the shape of a thing by its name or kind, as the language writes it. `predicates`: a formula in which
    $1 and $2 are the arguments, or `on`, `in` or `none`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    objects: dict[str, str] = {}
    predicates: dict[str, str] = {}


def read_map(path: Path) -> NameMap:
    """Raises DataError for what is no map."""
    data = read_bytes(path, "a map", limit=MAX_MAP_BYTES)
    try:
        return NameMap.model_validate(tomllib.loads(data.decode("utf-8-sig")))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise DataError(BAD_MAP(file=path, reason=f"{error}".splitlines()[0])) from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise DataError(BAD_MAP(file=path, reason=f"{place}: {first['msg'].lower()}")) from None


def key(name: str) -> str:
    """A name as the key of a map: TOML has quotes round all but letters, digits, `-` and `_`."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)
