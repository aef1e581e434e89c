"""What of a goal PDDL has no words for, and where planners read it otherwise: told, once files are written."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.errors import Diagnostic
from scenegen.errors.planning import (
    FACTS_WITHOUT_PLACE,
    GOAL_ON_THE_EDGE,
    GOAL_TOO_LONG,
    LABELS_OVER_TIME,
    PARTS_WITHOUT_RELATION,
)
from scenegen.pddl.export import Problems
from scenegen.pddl.formula import Literal, facts_of
from scenegen.pddl.ground import MOST_PARTS
from scenegen.pddl.original import Originals

MOST_SAID = 3  # parts that are named; the domain has all


def unsaid(problems: Sequence[Problems]) -> tuple[Diagnostic, ...]:
    """Notes on problems that share a domain."""
    found: list[Diagnostic] = []
    timed = problems[0].grounded.spec.timed
    if timed is not None and timed.labels:
        found.append(LABELS_OVER_TIME(labels=tuple(timed.labels)))
    parts: dict[str, str] = {}
    long: dict[str, None] = {}
    for one in () if problems[0].whole_goal else problems:
        for label in one.labels:
            goal = one.grounded.goals[label]
            if isinstance(goal, Literal) and goal.fact == one.grounded.labels[label]:
                long[label] = None
                continue
            for fact in (one.grounded.facts[number] for number in facts_of(goal)):
                if fact.said:
                    parts[fact.predicate] = fact.said
    if long:
        found.append(GOAL_TOO_LONG(labels=tuple(long), limit=MOST_PARTS))
    if parts:
        said = ", ".join(f"{name} is `{text}`" for name, text in list(parts.items())[:MOST_SAID])
        more = f" and {len(parts) - MOST_SAID:,} more" if len(parts) > MOST_SAID else ""
        found.append(PARTS_WITHOUT_RELATION(parts=said + more))
    count = sum(one.edge for one in problems)
    return (*found, GOAL_ON_THE_EDGE(count=count)) if count else tuple(found)


def undecided(originals: Originals, file: str) -> tuple[Diagnostic, ...]:
    """Notes on scenes in the words of a problem."""
    names = originals.undecided
    return (FACTS_WITHOUT_PLACE(facts=names, file=file),) if names else ()
