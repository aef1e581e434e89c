"""Scenes as planning problems: which goal, which facts, and the texts of the files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.planning import NO_GOAL_OVER_TIME
from scenegen.errors.requests import OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.pddl.formula import Formula, Joined, Literal, asked_for, value
from scenegen.pddl.ground import Grounded
from scenegen.pddl.write import Vocabulary, domain_text, problem_text

Rows = npt.NDArray[np.float64]

DOMAIN = "scenes"
GOAL = "goal"  # the label that is one by its name


@dataclass(slots=True)
class Problems:
    """Problems of one spec; `words` may be those of several, which differ in how many things there are. Comments are
    by the number of the scene. `edge` counts the scenes in which the goal as planners read it is not the sign of phi: a
    margin is exactly 0 there."""

    grounded: Grounded
    labels: tuple[str, ...]
    words: Vocabulary
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
        return formulas[0] if len(formulas) == 1 else Joined("and", formulas)

    def of_scenes(self, rows: Rows, comments: Mapping[int, str]) -> Iterator[str]:
        """The problem of each scene of `rows` (3N, n): its facts, and what the labels ask for. Raises RequestError for
        scenes of a spec over time."""
        if not self.labels:
            raise RequestError(NO_GOAL_OVER_TIME())
        goal, numbers = self.goal, list(comments.items())
        for here, truths in self.grounded.truths(rows):
            wanted = np.all([truths[self.grounded.labels[label]] for label in self.labels], axis=0)
            self.edge += int((value(goal, truths) != wanted).sum())
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
                    goal: Formula = Joined("and", tuple(Literal(int(one)) for one in np.flatnonzero(then[:, 0])))
                else:
                    goal = asked_for(self.goal, then)
                yield self._text(truths[:, offset], goal, *said)

    def _text(self, truths: npt.NDArray[np.bool_], goal: Formula, number: int, comment: str) -> str:
        grounded = self.grounded
        return problem_text(
            self.words,
            grounded.facts,
            truths,
            goal,
            name=f"scene-{number}",
            domain=DOMAIN,
            comments=(comment,),
            missing=self.words.objects - frozenset(grounded.spec.objects),
        )


def goal_labels(grounded: Grounded, wanted: Sequence[str] | None) -> tuple[str, ...]:
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
