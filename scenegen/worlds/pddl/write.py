"""Facts of scenes as PDDL text: a domain of types and predicates, and a problem for each scene."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.worlds.pddl.ground import Fact, Formula, GroundedFacts, text

# --------------------------------------------------------------------------------------------------------------------
# Names as every planner reads them: letters, digits, `-` and `_`, no two alike when case is ignored.


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
            comments[key] = "the label" if fact.said == fact.predicate else explained.get(fact.predicate, "")
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


def problem_text(
    words: DomainNames,
    facts: Sequence[Fact],
    truths: npt.NDArray[np.bool_],
    goal: Formula,
    *,
    name: str,
    domain: str,
    comments: Sequence[str] = (),
    missing: Collection[str] = (),
) -> str:
    """The problem whose initial facts are those of `facts` for which `truths` (F,) says so, without the
    `missing` things."""
    lines = [*(f"; {clean(one)}" for one in comments), f"(define (problem {name})", f"  (:domain {domain})"]
    lines.append("  (:objects")
    for one, kind in words.kinds.items():
        if one not in missing:
            made = words.things[one]
            lines.append(f"    {made} - {kind}" + (f" ; {clean(one)}" if made != one else ""))
    lines += ["  )", "  (:init"]
    lines += [f"    {words.fact(facts[number])}" for number in np.flatnonzero(truths).tolist()]
    lines += ["  )", f"  (:goal {text(goal, lambda number: words.fact(facts[number]))}))", ""]
    return "\n".join(lines)


def clean(said: str) -> str:
    """A text on one line, without what ends or hides a comment."""
    return " ".join("".join(char if char.isprintable() else " " for char in said).split())
