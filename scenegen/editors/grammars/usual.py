"""Rules of statements `usually`: where things usually are, before the labels of a text.

Each thing has at most one statement about its place and one about its heading, in the order of the declarations, and is
relative to earlier ones alone: so none is said twice, and there is no circle. Distributions reach the whole workspace,
so what a scene can be stays what it was. What the spec itself says of a thing is all there is to say.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from scenegen.editors.grammars.rules import Alternation, IntegerRange, Part, Repeat, RuleRef, Seq, Terminal, choice, seq
from scenegen.editors.grammars.statements import HEADING_WORDS
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


def usual_rules(spec: CheckedSpec, sure: Collection[str]) -> tuple[Part, dict[str, Part]]:
    """What may be said of where the things of a spec usually are, a line for each or none; and the rules of it. `sure`
    are the objects that are there whatever the number of things; `spec` has also those that may be missing."""
    said = {(owner(row), axis_of(row)) for row in prior_rows(spec.priors)}
    spoken_of = {one for one, _ in said}
    held = [spec.objects[one] for one in sorted(spec.fixed)]
    rules: dict[str, Part] = {}
    lines: list[str] = []
    fresh: list[str] = []  # earlier things that no rule has yet
    earlier: list[Part] = []  # the rule of those that have one
    for number, subject in enumerate(_subjects(spec), start=1):
        place = not any((one, axis) in said for one in subject.elements for axis in PLACE)
        turn = not any((one, THETA) in said for one in subject.elements)
        if fresh and (place or turn):
            rules[f"before{number}"] = choice([*earlier, *map(Terminal, fresh)])
            earlier, fresh = [RuleRef(f"before{number}")], []
        if place and (earlier or not subject.stands):
            rules[f"normal{number}"] = _normal(subject, earlier)
            made = _mixtures(RuleRef(f"normal{number}"), None if subject.stands else RuleRef("uniform"))
            rules[f"place{number}"] = seq(Terminal(f"usually {subject.name} ~ "), made)
            lines.append(f"place{number}")
        if turn:
            rules[f"turn{number}"] = seq(Terminal(f"usually theta({subject.name}) ~ "), _heading(earlier))
            lines.append(f"turn{number}")
        if not any(one in spoken_of for one in subject.elements):
            fresh += [name for one in subject.elements if (name := spec.objects[one]) in sure]
    shared = {
        "spot": choice([_point(spec), *map(Terminal, (*_regions(spec), *held))]),
        "uniform": choice([Terminal(f"uniform({name})") for name in (*_regions(spec), "workspace")]),
        "spread": seq(IntegerRange(1, WIDEST), Terminal(" cm")),
        "weight": seq(Terminal(": "), IntegerRange(1, MOST_WEIGHT)),
        "direction": choice([Terminal(one) for one in (*HEADING_WORDS, *(f"theta({name})" for name in held))]),
    }
    used = {name for part in rules.values() for name in _names(part)}
    rules |= {name: part for name, part in shared.items() if name in used}
    return seq(*(Repeat(seq(RuleRef(name), Terminal("\n")), 0, 1) for name in lines)), rules


def _normal(subject: _Subject, earlier: Sequence[Part]) -> Part:
    """A place around earlier things and, of what can be anywhere in the workspace, around anything in it."""
    around = [*earlier, *([] if subject.stands else [RuleRef("spot")])]
    return seq(Terminal("normal("), choice(around), Terminal(", "), RuleRef("spread"), Terminal(")"))


def _heading(earlier: Sequence[Part]) -> Part:
    """A heading around a direction, or around that of an earlier thing."""
    of_things = [seq(Terminal("theta("), one, Terminal(")")) for one in earlier]
    around = choice([RuleRef("direction"), *of_things])
    return seq(Terminal("normal("), around, Terminal(", "), IntegerRange(1, WIDEST_TURN), Terminal(" deg)"))


def _mixtures(normal: Part, uniform: Part | None) -> Part:
    """A normal distribution, or a mixture of it and another one."""
    other = normal if uniform is None else choice([normal, uniform])
    weight = RuleRef("weight")
    return choice([normal, seq(Terminal("["), other, weight, Terminal(", "), normal, weight, Terminal("]"))])


def _names(part: Part) -> set[str]:
    """The rules that a part refers to."""
    match part:
        case RuleRef(name):
            return {name}
        case Seq(parts) | Alternation(parts):
            return {name for one in parts for name in _names(one)}
        case _:
            return set()


def _subjects(spec: CheckedSpec) -> Iterator[_Subject]:
    together: dict[str, list[int]] = {}
    for number, name in enumerate(spec.objects):
        together.setdefault(name.partition("[")[0], []).append(number)
    for name, elements in together.items():
        if not any(one in spec.fixed for one in elements):
            stands = any(one in spec.supports or one in spec.choices for one in elements)
            yield _Subject(name, tuple(elements), stands)


def _point(spec: CheckedSpec) -> Part:
    """A point of the workspace: whole centimetres, or its middle, where that is too small for these."""
    parts: list[Part] = []
    for low, high in (spec.workspace.x, spec.workspace.y):
        least, most = math.ceil(low / CENTIMETRE - 1e-9), math.floor(high / CENTIMETRE + 1e-9)
        options: list[Part] = [IntegerRange(max(least, 0), most)] if most >= max(least, 0) else []
        if least < min(0, most + 1):
            options.append(seq(Terminal("-"), IntegerRange(max(1, -most), -least)))
        parts.append(seq(choice(options), Terminal(" cm")) if options else Terminal(repr((low + high) / 2.0)))
    return seq(Terminal("("), parts[0], Terminal(", "), parts[1], Terminal(")"))


def _regions(spec: CheckedSpec) -> tuple[str, ...]:
    """The regions with a middle in the workspace."""
    (left, right), (bottom, top) = spec.workspace.x, spec.workspace.y
    inside = (one for one in spec.regions if left < one.pose[0] < right and bottom < one.pose[1] < top)
    return tuple(one.name for one in inside)
