"""Rules of statements `usually`: where things usually are, before the labels of a text.

Each thing has at most one statement about its place and one about its heading, in the order of the declarations, and is
relative to earlier ones alone: so none is said twice, and there is no circle. Distributions reach the whole workspace,
so what a scene can be stays what it was. What the spec itself says of a thing is all there is to say.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from scenegen.editors.grammars.rules import IntegerRange, Part, Repeat, RuleRef, Terminal, choice, seq
from scenegen.lang.prior import prior_rows
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import PLACE, THETA, axis_of, owner

CENTIMETRE = 0.01
WIDEST, WIDEST_TURN, MOST_WEIGHT = 50, 90, 9  # centimetres, degrees, and of a part of a mixture


@dataclass(frozen=True, slots=True)
class _Subject:
    """What a statement is about: an object, or an array of them; `elements` are its objects by number. `stands`: on
    something else than the table."""

    name: str
    elements: tuple[int, ...]
    stands: bool


def usual_rules(spec: CheckedSpec, sure: Collection[str], headings: Sequence[str]) -> tuple[Part, dict[str, Part]]:
    """What may be said of where the things of a spec usually are, a line for each or none; and the rules of it. `sure`
    are objects that are there whatever the number of things; `spec` has all of them."""
    point, regions = _point(spec), _regions(spec)
    said = {(owner(row), axis_of(row)) for row in prior_rows(spec.priors)}
    spoken_of = {one for one, _ in said}
    held = [spec.objects[one] for one in sorted(spec.fixed)]
    earlier: list[str] = []
    places: list[Part] = []
    turns: list[Part] = []
    for subject in _subjects(spec):
        if not any((one, axis) in said for one in subject.elements for axis in PLACE):
            fixed = () if subject.stands else (*regions, *held)
            made = _place(None if subject.stands else point, regions, (*fixed, *earlier))
            places += [] if made is None else [seq(Terminal(f"usually {subject.name} ~ "), made)]
        if not any((one, THETA) in said for one in subject.elements):
            turns.append(seq(Terminal(f"usually theta({subject.name}) ~ "), _turn(headings, (*held, *earlier))))
        if not any(one in spoken_of for one in subject.elements):
            earlier += [name for one in subject.elements if (name := spec.objects[one]) in sure]
    rules = {f"place{number}": one for number, one in enumerate(places, start=1)}
    rules |= {f"turn{number}": one for number, one in enumerate(turns, start=1)}
    lines = [Repeat(seq(RuleRef(name), Terminal("\n")), 0, 1) for name in rules]
    if places:
        rules["spread"] = seq(IntegerRange(1, WIDEST), Terminal(" cm"))
        rules["weight"] = seq(Terminal(": "), IntegerRange(1, MOST_WEIGHT))
    if point is not None and any(not one.stands for one in _subjects(spec)):
        rules["point"] = point
    return seq(*lines), rules


def _subjects(spec: CheckedSpec) -> Iterator[_Subject]:
    together: dict[str, list[int]] = {}
    for number, name in enumerate(spec.objects):
        together.setdefault(name.partition("[")[0], []).append(number)
    for name, elements in together.items():
        if not any(one in spec.fixed for one in elements):
            stands = any(one in spec.supports or one in spec.choices for one in elements)
            yield _Subject(name, tuple(elements), stands)


def _point(spec: CheckedSpec) -> Part | None:
    """A point of the workspace, in whole centimetres; None where there is none."""
    ranges = []
    for low, high in (spec.workspace.x, spec.workspace.y):
        least, most = math.ceil(low / CENTIMETRE - 1e-9), math.floor(high / CENTIMETRE + 1e-9)
        options: list[Part] = []
        if most >= 0 and least <= most:
            options.append(IntegerRange(max(least, 0), most))
        if least < 0:
            options.append(seq(Terminal("-"), IntegerRange(max(1, -most), -least)))
        if not options:
            return None
        ranges.append(seq(choice(options), Terminal(" cm")))
    return seq(Terminal("("), ranges[0], Terminal(", "), ranges[1], Terminal(")"))


def _regions(spec: CheckedSpec) -> tuple[str, ...]:
    """The regions with a middle in the workspace."""
    (left, right), (bottom, top) = spec.workspace.x, spec.workspace.y
    inside = (one for one in spec.regions if left < one.pose[0] < right and bottom < one.pose[1] < top)
    return tuple(one.name for one in inside)


def _place(point: Part | None, regions: Sequence[str], middles: Sequence[str]) -> Part | None:
    """A distribution of places around the middles or, of what can be anywhere in the workspace, around a point of it;
    None where there is no middle."""
    around = [*([] if point is None else [RuleRef("point")]), *map(Terminal, middles)]
    if not around:
        return None
    normal = seq(Terminal("normal("), choice(around), Terminal(", "), RuleRef("spread"), Terminal(")"))
    over = [] if point is None else [Terminal(f"uniform({name})") for name in (*regions, "workspace")]
    weight = RuleRef("weight")
    mixture = seq(Terminal("["), choice([normal, *over]), weight, Terminal(", "), normal, weight, Terminal("]"))
    return choice([normal, mixture])


def _turn(headings: Sequence[str], earlier: Sequence[str]) -> Part:
    """A distribution of headings."""
    middle = choice([Terminal(one) for one in (*headings, *(f"theta({name})" for name in earlier))])
    return seq(Terminal("normal("), middle, Terminal(", "), IntegerRange(1, WIDEST_TURN), Terminal(" deg)"))
