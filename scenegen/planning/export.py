"""Facts of scenes as PDDL text: a domain of types and predicates, and a problem for each scene."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic, RequestError, Source
from scenegen.errors.requests import OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.errors.worlds import NO_GOAL_OVER_TIME, NOT_ITS_SCENES, PDDL_GOAL, PDDL_TOO_LARGE
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.planning.facts import (
    MAX_FACTS,
    MAX_GOAL_PARTS,
    Fact,
    FactJunction,
    Formula,
    GroundedFacts,
    Literal,
    facts_of,
    formula_text,
    holding_part,
    truth_of,
)
from scenegen.planning.goal import GoalReader, PredicateFormula, TranslatedFormula
from scenegen.planning.problem import Node, SExprAtom, SExprList
from scenegen.planning.translation import CompiledProblem, carried_formula, fill_arguments, resting_formula

RESERVED = frozenset(  # words with a meaning where facts and types stand
    "and or not imply forall exists when either object number assign increase decrease scale-up scale-down preference "
    "always sometime within define".split()
)


def fits(name: str) -> bool:
    """Whether PDDL has such a name."""
    return re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) is not None


class Names:
    """Names that were given. Objects, types and predicates share them: some planners keep them in one table."""

    def __init__(self) -> None:
        self._taken = set(RESERVED)

    def give(self, wanted: str, otherwise: str = "") -> str:
        """A free name like the wanted one: itself, with `otherwise` behind it, or with a number."""
        made = re.sub(r"[^A-Za-z0-9_-]+", "_", wanted.rstrip("]")) or "thing"
        made = made if made[0].isalpha() else f"a{'' if made[0] == '_' else '_'}{made}"
        number = 1
        name = made
        while name.lower() in self._taken:
            number += 1
            name = f"{made}{otherwise}" if otherwise and number == 2 else f"{made}-{number}"
        self._taken.add(name.lower())
        return name


REQUIREMENTS = ":typing :negative-preconditions :disjunctive-preconditions"
NO_ACTIONS = (
    "There are no actions: a scene says where things are, not what a robot can do.",
    "Facts are those whose phi is 0 or more. What becomes of the others when a thing is moved follows from geometry.",
)


@dataclass(frozen=True, slots=True)
class DomainNames:
    """The names of a domain: of things and regions, of predicates, with the types of their `arguments`, and of
    types. `kinds` has the type of each thing."""

    things: Mapping[str, str]
    predicates: Mapping[str, str]
    arguments: Mapping[str, tuple[str, ...]]
    types: Mapping[str, str]
    kinds: Mapping[str, str]
    comments: Mapping[str, str]
    objects: frozenset[str]  # the things, without regions

    def fact(self, fact: Fact) -> str:
        """A fact as PDDL."""
        return f"({' '.join((self.predicates[_key(fact)], *(self.things[one] for one in fact.arguments)))})"


def _key(fact: Fact) -> str:
    """Predicates of one name with another number of arguments are others."""
    return f"{fact.predicate}/{len(fact.arguments)}"


def vocabulary(members: Sequence[GroundedFacts]) -> DomainNames:
    """Names for all that the facts of some specs mention, which differ in how many things there are. Assets become
    types."""
    names = Names()
    facts = tuple(dict.fromkeys(fact for one in members for fact in one.facts))
    objects = {
        name: made.asset for one in members for name, made in zip(one.spec.objects, one.spec.shapes, strict=True)
    }
    explained = {name: said for one in members for name, said in one.comments.items()}
    mentioned = dict.fromkeys(one for fact in facts for one in fact.arguments if one not in objects)
    things = {one: names.give(one) for one in (*objects, *mentioned)}
    predicates: dict[str, str] = {}
    arguments: dict[str, tuple[str, ...]] = {}
    comments: dict[str, str] = {}
    for fact in facts:
        key = _key(fact)
        if key not in predicates:
            predicates[key] = names.give(fact.predicate)
            comments[key] = "the label" if fact.description == fact.predicate else explained.get(fact.predicate, "")
        kinds = tuple("thing" if one in objects else "region" for one in fact.arguments)
        known = arguments.get(key, kinds)
        arguments[key] = tuple(one if one == other else "object" for one, other in zip(kinds, known, strict=True))
    base = {name: names.give(name, "-type") for name in ("thing", "region")}
    types = {asset: names.give(asset, "-type") for asset in dict.fromkeys(objects.values())}
    kinds_of = {one: types[asset] for one, asset in objects.items()}
    kinds_of |= dict.fromkeys(mentioned, base["region"])
    base["object"] = "object"
    arguments = {key: tuple(base[one] for one in kinds) for key, kinds in arguments.items()}
    return DomainNames(things, predicates, arguments, {**base, **types}, kinds_of, comments, frozenset(objects))


def domain_text(words: DomainNames, name: str) -> str:
    """The domain of these names."""
    below = [one for key, one in words.types.items() if key not in ("thing", "region", "object")]
    lines = [*(f"; {line}" for line in NO_ACTIONS), f"(define (domain {name})", f"  (:requirements {REQUIREMENTS})"]
    lines.append(f"  (:types {words.types['thing']} {words.types['region']} - object")
    lines.append(f"    {' '.join(below)} - {words.types['thing']})")
    lines.append("  (:predicates")
    for key, predicate in words.predicates.items():
        kinds = words.arguments[key]
        slots = "".join(f" ?{letter} - {kind}" for letter, kind in zip("abcdefghi", kinds, strict=False))
        comment = clean(words.comments[key])
        lines.append(f"    ({predicate}{slots})" + (f" ; {comment}" if comment else ""))
    return "\n".join([*lines, "  ))", ""])


def clean(said: str) -> str:
    """A text on one line, without what ends or hides a comment."""
    return " ".join("".join(char if char.isprintable() else " " for char in said).split())


Rows = npt.NDArray[np.float64]

DOMAIN = "scenes"
GOAL = "goal"  # the label that is one by its name


@dataclass(slots=True)
class SpecProblems:
    """Problems of one spec; `words` may be those of several, which differ in how many things there are. Comments are
    by the number of the scene. `edge` counts the scenes in which the goal as planners read it is not the sign of phi: a
    margin is exactly 0 there."""

    grounded: GroundedFacts
    labels: tuple[str, ...]
    words: DomainNames
    whole_goal: bool = False
    edge: int = field(default=0, init=False)

    @property
    def domain(self) -> str:
        """The text of the domain."""
        return domain_text(self.words, DOMAIN)

    @property
    def goal(self) -> Formula:
        """What the labels ask for."""
        formulas = tuple(self.grounded.goals[label] for label in self.labels)
        return formulas[0] if len(formulas) == 1 else FactJunction("and", formulas)

    def of_scenes(self, rows: Rows, comments: Mapping[int, str]) -> Iterator[str]:
        """The problem of each scene of `rows` (3N, n): its facts, and what the labels ask for. Raises RequestError for
        scenes of a spec over time."""
        if not self.labels:
            raise RequestError(NO_GOAL_OVER_TIME())
        goal, numbers = self.goal, list(comments.items())
        for here, truths in self.grounded.truths(rows):
            wanted = np.all([truths[self.grounded.labels[label]] for label in self.labels], axis=0)
            self.edge += int((truth_of(goal, truths) != wanted).sum())
            for offset, said in enumerate(numbers[here]):
                yield self._text(truths[:, offset], goal, *said)

    def of_pairs(self, starts: Rows, ends: Rows, comments: Mapping[int, str]) -> Iterator[str]:
        """The problem of each start (3N, n): its facts, and those facts of its goal scene in `ends` that the labels ask
        for; all of them with `whole_goal`, and in a spec over time."""
        numbers = list(comments.items())
        for (here, truths), (_, reached) in zip(self.grounded.truths(starts), self.grounded.truths(ends), strict=True):
            for offset, said in enumerate(numbers[here]):
                then = reached[:, offset : offset + 1]
                if self.whole_goal or not self.labels:
                    goal: Formula = FactJunction("and", tuple(Literal(int(one)) for one in np.flatnonzero(then[:, 0])))
                else:
                    goal = holding_part(self.goal, then)
                yield self._text(truths[:, offset], goal, *said)

    def _text(self, truths: npt.NDArray[np.bool_], goal: Formula, number: int, comment: str) -> str:
        """The problem whose initial facts are those for which `truths` (F,) says so, without things that are not
        there."""
        words, facts = self.words, self.grounded.facts
        missing = words.objects - frozenset(self.grounded.spec.objects)
        lines = [f"; {clean(comment)}", f"(define (problem scene-{number})", f"  (:domain {DOMAIN})", "  (:objects"]
        for one, kind in words.kinds.items():
            if one not in missing:
                made = words.things[one]
                lines.append(f"    {made} - {kind}" + (f" ; {clean(one)}" if made != one else ""))
        lines += ["  )", "  (:init"]
        lines += [f"    {words.fact(facts[place])}" for place in np.flatnonzero(truths).tolist()]
        lines += ["  )", f"  (:goal {formula_text(goal, lambda place: words.fact(facts[place]))}))", ""]
        return "\n".join(lines)


def goal_labels(grounded: GroundedFacts, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The labels that are the goal: those asked for, else `goal`, else all. Raises RequestError for one that is not
    there."""
    if wanted and grounded.spec.timed is not None:
        rule = "is for specs without time"
        raise RequestError(OUT_OF_PLACE(option="a label as the goal", rule=rule, remedy="leave it out"))
    known = tuple(grounded.goals)
    for name in wanted or ():
        if name not in known:
            raise RequestError(UNKNOWN_CHOICE(what="label", name=name, known=known))
    return tuple(dict.fromkeys(wanted)) if wanted else (GOAL,) if GOAL in known else known


BDDL_ONLY = ("forn", "forpairs", "fornpairs")
Call = tuple[str, tuple[str, ...]]


def candidates(reading: CompiledProblem, wanted: Sequence[str] | None = None) -> list[tuple[Fact, str]]:
    """Every fact that could hold, with its formula: those that the problem mentions, and all others of its predicates
    over its things, and the places that it mentions. `wanted` names predicates; those of the goal are there besides.
    Raises RequestError."""
    problem, setting = reading.problem, reading.setting
    spelled: dict[str, str] = {}
    asked_of: dict[tuple[str, int], set[str]] = {}  # what the problem has in a place of a predicate
    arities: dict[str, set[int]] = {}
    for name, names in reading.formulas:
        spelled.setdefault(name.lower(), name)
        arities.setdefault(name.lower(), set()).add(len(names))
        for place, one in enumerate(names):
            asked_of.setdefault((name.lower(), place), set()).add(one)
    for name, count in problem.domain.predicates.items():
        found = reading.known(name)
        if found is not None and (found.formula or found.holds):
            spelled.setdefault(name, name)
            arities.setdefault(name, set()).add(count)
    if wanted is not None:
        for name in wanted:
            if name.lower() not in spelled:
                raise RequestError(UNKNOWN_CHOICE(what="predicate", name=name, known=tuple(spelled.values())))
        asked = {name.lower() for name in wanted} | {head.lower() for head, _ in _atoms_of(reading)}
        spelled = {key: name for key, name in spelled.items() if key in asked}
    things = tuple(setting.shapes)
    places = tuple(dict.fromkeys(one for _, names in reading.formulas for one in names[1:] if one not in things))
    places = tuple(dict.fromkeys((*places, *setting.grounds)))
    made: dict[Fact, str] = {}
    for (name, names), formula in reading.formulas.items():
        if name.lower() in spelled:
            made.setdefault(Fact(spelled[name.lower()], names), formula)
    for key, name in spelled.items():
        found = reading.known(name)
        for count in sorted(arities[key]) if found is not None else ():
            assert found is not None
            if len(things) ** min(count, 3) > MAX_FACTS:
                raise RequestError(PDDL_TOO_LARGE(count=len(things) ** count, limit=MAX_FACTS))
            for names in _choices(things, places, count):
                if any(names[place] not in asked_of.get((key, place), ()) for place in _unread(found, count)):
                    continue
                formula = _formula(reading, found, names)
                if formula:
                    made.setdefault(Fact(name, names), formula)
    return list(made.items())


def _choices(things: Sequence[str], places: Sequence[str], count: int) -> Iterator[tuple[str, ...]]:
    if 1 <= count <= 3:
        yield from permutations(things, count)
    if count == 2:
        yield from ((thing, place) for thing in things for place in places)


def _unread(found: PredicateFormula, count: int) -> list[int]:
    """Places of a predicate that its formula does not read, as the floor of `onfloor`."""
    return [] if found.holds else [place for place in range(count) if f"${place + 1}" not in found.formula]


def _formula(reading: CompiledProblem, found: PredicateFormula, names: tuple[str, ...]) -> str:
    """What a fact means; empty where it cannot hold."""
    setting = reading.setting
    node = reading.problem.goal
    assert node is not None
    refs = [setting.resolve(name, node) for name in names]
    if not found.holds:
        return fill_arguments(found.formula, [one.argument for one in refs])
    if len(refs) != 2:
        return ""
    if refs[1].kind != "thing":
        return resting_formula(refs[0].argument, refs[1])
    owner = refs[1].owner
    off = setting.height_error(names[0], owner, inside=found.holds == "in") if owner != names[0] else None
    return "" if off is None else carried_formula(found, refs[0].argument, refs[1].argument, off)


def refuse_other(reading: CompiledProblem, objects: Sequence[str], regions: Sequence[str], file: str) -> None:
    """Raises DataError where scenes lack a thing or a region of the problem."""
    setting = reading.setting
    for name in (*setting.shapes, *(one for one, made in setting.furniture.items() if made.body is not None)):
        if setting.ids[name] not in objects:
            raise DataError(NOT_ITS_SCENES(file=file, name=setting.ids[name]))
    for name in setting.used:
        if name not in regions:
            raise DataError(NOT_ITS_SCENES(file=file, name=name))


def _atoms_of(reading: CompiledProblem) -> list[Call]:
    """The facts that the goal mentions, once its quantifiers are written out."""
    return _goal(reading)[1]


def _goal(reading: CompiledProblem, lost: dict[str, None] | None = None) -> tuple[Formula, list[Call]]:
    """The goal over facts by number, and the facts; `lost` gets what is no fact, or too long to be written out."""
    atoms: dict[Call, int] = {}

    def atom(node: SExprList, names: Sequence[str], wanted: bool) -> TranslatedFormula:
        number = atoms.setdefault((node.items[0].span.text, tuple(names)), len(atoms))
        return TranslatedFormula(f"a{number}")

    def lose(node: Node, why: str) -> TranslatedFormula:
        if lost is not None:
            lost[_one_line(node)] = None
        return TranslatedFormula(None, whole=False)

    assert reading.problem.goal is not None
    said = GoalReader(reading.problem, atom, lose).read(reading.problem.goal, {}).text or "true"
    tree = parse(Source("<goal>", said)).bare
    assert tree is not None
    return _read(tree, holds=True), list(atoms)


def _read(node: ast.Expr, *, holds: bool) -> Formula:
    match node:
        case ast.Name(name):
            return Literal(int(name[1:]), holds)
        case ast.Truth(truth):
            return FactJunction("and" if truth == holds else "or", ())
        case ast.Not(inner):
            return _read(inner, holds=not holds)
        case ast.And(parts) | ast.Or(parts):
            same = isinstance(node, ast.And) == holds
            return FactJunction("and" if same else "or", tuple(_read(one, holds=holds) for one in parts))
    raise AssertionError("a goal is made of facts, `!`, `&` and `|`")


class Originals:
    """Problems with the facts of scenes in place of those of the original. One that other planners read keeps its
    text, but for `:init`, and needs no domain but its own; one of LIBERO or BEHAVIOR is written out."""

    def __init__(self, grounded: GroundedFacts, reading: CompiledProblem) -> None:
        self.grounded, self.reading = grounded, reading
        problem = reading.problem
        names = [*problem.things, *(kind for one in problem.things.values() for kind in one.kinds)]
        self.plain = not (problem.regions or problem.fixtures or _bddl(problem.goal)) and all(map(fits, names))
        geometric = {(one.predicate.lower(), one.arguments) for one in grounded.facts}
        self.kept = [one for one in problem.init if not _is_replaced(one, geometric)]
        self._lost: dict[str, None] = {}
        self._goal, self._goal_facts = _goal(reading, self._lost)
        self._words = _ProblemText(self) if not self.plain else None

    @property
    def undecided_parts(self) -> tuple[str, ...]:
        """Parts of the goal without geometry."""
        known = {(one.predicate.lower(), one.arguments) for one in self.grounded.facts}
        facts = [one for one in self._goal_facts if (one[0].lower(), one[1]) not in known]
        return (*(f"({' '.join((name, *names))})" for name, names in facts), *self._lost)

    @property
    def domain(self) -> str | None:
        """The text of a domain for what is written out; None where the problem has its own."""
        return None if self._words is None else self._words.domain()

    def texts(self, rows: npt.NDArray[np.float64], comments: Sequence[str]) -> Iterator[str]:
        """The problem of each scene of `rows` (3N, n)."""
        geometric = [number for number, fact in enumerate(self.grounded.facts) if not fact.description]
        for here, truths in self.grounded.truths(rows):
            for offset, number in enumerate(range(here.start, here.stop)):
                facts = [self.grounded.facts[one] for one in geometric if truths[one, offset]]
                made = self._as_it_is if self._words is None else self._words.problem
                yield f"; {clean(comments[number])}\n{made(facts, number + 1)}"

    def _as_it_is(self, facts: Sequence[Fact], number: int) -> str:
        problem = self.reading.problem
        whole = problem.goal.span.source.text if problem.goal is not None else ""
        init = [_one_line(node) for node in self.kept]
        init += [f"({' '.join((one.predicate, *one.arguments))})" for one in facts]
        section = "\n".join(["  (:init", *(f"    {one}" for one in init), "  )"])
        lines = [f"(define (problem {problem.name or 'scene'}-{number})"]
        done = False
        for one in problem.sections:
            if one.head == "problem":
                continue
            if one.head != ":init":
                lines.append("  " + whole[one.span.start : one.span.end])
            elif not done:
                done = True
                lines.append(section)
        if not done:
            lines.append(section)
        return "\n".join([*lines, ")", ""])


class _ProblemText:
    """A problem of LIBERO or BEHAVIOR written out: names without dots, regions as objects, the goal without numbers of
    things."""

    def __init__(self, owner: Originals) -> None:
        self.owner = owner
        problem = owner.reading.problem
        names = Names()
        kept = [_call(one) for one in owner.kept]
        self.kept = [one for one in kept if one is not None]
        calls = [*((one.predicate, one.arguments) for one in owner.grounded.facts if not one.description), *self.kept]
        calls += owner._goal_facts
        more = dict.fromkeys(one for _, arguments in calls for one in arguments if one not in problem.things)
        self.things = {one: names.give(one) for one in (*problem.things, *more)}
        self.arities = dict.fromkeys((name.lower(), len(arguments)) for name, arguments in calls)
        spelled = {name.lower(): name for name, _ in reversed(calls)}
        self.predicates = {key: names.give(spelled[key[0]]) for key in self.arities}
        kinds = dict.fromkeys(kind.lower() for one in problem.things.values() for kind in one.kinds)
        self.types = {kind: "object" if kind == "object" else names.give(kind, "-type") for kind in kinds}
        self.region = names.give("region", "-type") if more else ""

    def fact(self, name: str, arguments: Sequence[str]) -> str:
        return (
            f"({' '.join((self.predicates[name.lower(), len(arguments)], *(self.things[one] for one in arguments)))})"
        )

    def domain(self) -> str:
        types = [one for one in (*self.types.values(), self.region) if one and one != "object"]
        slots = {key: "".join(f" ?{letter} - object" for letter in "abcdefghi"[: key[1]]) for key in self.predicates}
        lines = ["(define (domain scenes)", f"  (:requirements {REQUIREMENTS})"]
        lines += [f"  (:types {' '.join(types)} - object)"] if types else []
        lines += ["  (:predicates", *(f"    ({name}{slots[key]})" for key, name in self.predicates.items()), "  ))", ""]
        return "\n".join(lines)

    def problem(self, facts: Sequence[Fact], number: int) -> str:
        """The problem of a scene."""
        owner = self.owner
        things = owner.reading.problem.things
        kinds = {
            name: replace(one, kinds=tuple(self.types[kind.lower()] for kind in one.kinds)).kind
            for name, one in things.items()
        }
        goal = formula_text(owner._goal, lambda at: self.fact(*owner._goal_facts[at]))
        lines = [f"(define (problem scene-{number})", "  (:domain scenes)", "  (:objects"]
        lines += [f"    {made} - {kinds.get(one, self.region)}" for one, made in self.things.items()]
        lines += ["  )", "  (:init", *(f"    {self.fact(*one)}" for one in self.kept)]
        lines += [f"    {self.fact(one.predicate, one.arguments)}" for one in facts]
        return "\n".join([*lines, "  )", f"  (:goal {goal}))", ""])


def _call(node: Node) -> Call | None:
    """A fact without geometry as a call; None for functions, negations and what has numbers."""
    if not isinstance(node, SExprList) or node.head in ("", "=", "not", "and", "at") or len(node.rest) > 9:
        return None
    names = tuple(one.text for one in node.rest if isinstance(one, SExprAtom))
    return (node.items[0].span.text, names) if len(names) == len(node.rest) else None


def _is_replaced(node: Node, geometric: set[Call]) -> bool:
    """Whether an initial fact is one that scenes decide, or that such a fact does not hold."""
    if isinstance(node, SExprList) and node.head == "not" and len(node.rest) == 1:
        return _is_replaced(node.rest[0], geometric)
    found = _call(node)
    return found is not None and (found[0].lower(), found[1]) in geometric


def _bddl(node: Node | None) -> bool:
    stack: list[Node] = [] if node is None else [node]
    while stack:
        one = stack.pop()
        if isinstance(one, SExprList):
            if one.head in BDDL_ONLY:
                return True
            stack += one.items
        elif one.text.startswith("?") and not fits(one.text[1:]):
            return True
    return False


def _one_line(node: Node) -> str:
    return " ".join(re.sub(r";[^\n]*", " ", node.span.text).split())


MAX_NAMED_PARTS = 3  # parts that are named; the domain has all


def goal_notes(problems: Sequence[SpecProblems]) -> tuple[Diagnostic, ...]:
    """Notes on problems that share a domain."""
    found: list[Diagnostic] = []
    timed = problems[0].grounded.spec.timed
    if timed is not None and timed.labels:
        found.append(PDDL_GOAL(labels=tuple(timed.labels)))
    parts: dict[str, str] = {}
    long: dict[str, None] = {}
    for one in () if problems[0].whole_goal else problems:
        for label in one.labels:
            goal = one.grounded.goals[label]
            if isinstance(goal, Literal) and goal.fact == one.grounded.labels[label]:
                long[label] = None
                continue
            for fact in (one.grounded.facts[number] for number in facts_of(goal)):
                if fact.description:
                    parts[fact.predicate] = fact.description
    if long:
        found.append(PDDL_GOAL(labels=tuple(long), limit=MAX_GOAL_PARTS))
    if parts:
        said = ", ".join(f"{name} is `{text}`" for name, text in list(parts.items())[:MAX_NAMED_PARTS])
        more = f" and {len(parts) - MAX_NAMED_PARTS:,} more" if len(parts) > MAX_NAMED_PARTS else ""
        found.append(PDDL_GOAL(parts=said + more))
    count = sum(one.edge for one in problems)
    return (*found, PDDL_GOAL(edge=count)) if count else tuple(found)


def undecided_notes(originals: Originals, file: str) -> tuple[Diagnostic, ...]:
    """Notes on scenes in the words of a problem."""
    names = originals.undecided_parts
    return (PDDL_GOAL(facts=names, file=file),) if names else ()
