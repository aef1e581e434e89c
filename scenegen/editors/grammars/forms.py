"""What can be said with a relation: calls of it, quantifiers over it, and comparisons of functions with numbers.

Forms come from the signatures alone. Which kinds an argument can have is tried, not written down: a new relation of the
prelude, or of the spec, takes part without a word here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, product

from scenegen.geometry.units import ANGLE, LENGTH, SPEED, TURN_RATE, Unit
from scenegen.lang.check.expressions import Lowering

# --------------------------------------------------------------------------------------------------------------------
# What a formula over a spec can name, by kind, as a model writes it.


OBJECT, REGION, POINT, LIST, HEADING = "object", "region", "point", "list", "heading"
KINDS = (OBJECT, REGION, POINT, LIST, HEADING)
HEADINGS = ("NORTH", "EAST", "SOUTH", "WEST", "45 deg", "135 deg", "225 deg", "315 deg")
FEW = 8  # objects up to which points of regions, groups of three and fine steps of numbers take part
SIDES = ("left", "right", "top", "bottom")


@dataclass(frozen=True, slots=True)
class Measure:
    """How numbers of a unit are written: whole ones with a suffix. `steps` are those that are tried."""

    suffix: str
    steps: tuple[int, ...]
    coarse: tuple[int, ...]
    scale: float  # of a whole one, in metres or radians

    def tried(self, few: bool) -> tuple[int, ...]:
        return self.steps if few else self.coarse


MEASURES: Mapping[Unit, Measure] = {
    LENGTH: Measure(" cm", (1, 2, 5, 10, 20, 30, 50, 100), (1, 5, 10, 20, 50, 100), 0.01),
    ANGLE: Measure(" deg", (5, 10, 20, 30, 45), (5, 20, 45), 0.017453292519943295),
    SPEED: Measure(" cm/s", (1, 50), (1, 50), 0.01),
    TURN_RATE: Measure(" deg/s", (1, 90), (1, 90), 0.017453292519943295),
}


@dataclass(frozen=True, slots=True)
class GrammarNames:
    """Names by kind, and variables that hide none of them. `own` are definitions of the spec itself."""

    names: Mapping[str, tuple[str, ...]]
    variables: tuple[str, str]
    own: frozenset[str]
    timed: bool

    @property
    def few(self) -> bool:
        """Whether there are so few objects that there is room for more to say of each."""
        return len(self.names[OBJECT]) <= FEW


def vocabulary(lowering: Lowering) -> GrammarNames:
    """The names of a spec, once its declarations have been evaluated."""
    scope = lowering.scope
    objects = tuple(scope.objects)
    regions = ("workspace", *(name for name in lowering.areas if name != "workspace"))
    carriers = sorted({one.carrier for one in lowering.supports.values() if one.carrier is not None})
    surfaces = dict.fromkeys(
        f"{objects[one.carrier]}.{one.name}" for one in lowering.supports.values() if one.carrier in carriers
    )
    points = tuple(f"{region}.{side}" for region in regions for side in SIDES) if len(objects) <= FEW else ()
    lists = (*(("objects",) if len(objects) > 1 else ()), *scope.arrays)
    taken = {*scope.values(), *scope.functions()}
    free = [name for name in chain("pqrstuvw", (f"p{k}" for k in range(len(taken) + 2))) if name not in taken]
    own = frozenset(name for name, one in scope.definitions.items() if one.source is not scope.prelude)
    names = {OBJECT: objects, REGION: (*regions, *surfaces), POINT: points, LIST: lists, HEADING: HEADINGS}
    return GrammarNames(names, (free[0], free[1]), own, scope.timed)


MOST_THREES = 1500  # ways to fill three arguments; of more, the third is no object


@dataclass(frozen=True, slots=True)
class PhraseForm:
    """Text around arguments: one piece more than there are kinds. `number`: what it makes is compared with numbers.
    `own`: it comes from a definition of the spec itself."""

    relation: str
    pieces: tuple[str, ...]
    kinds: tuple[str, ...]
    number: bool = False
    own: bool = False
    quantified: bool = False

    def text(self, arguments: tuple[str, ...]) -> str:
        """The form with its arguments."""
        head, *rest = self.pieces
        return head + "".join(argument + piece for argument, piece in zip(arguments, rest, strict=True))

    def ending(self, extra: str) -> PhraseForm:
        """The form of the same call with one argument more."""
        last = self.pieces[-1]
        return replace(self, pieces=(*self.pieces[:-1], last.replace(")", f"{extra})", 1)))

    def arguments(self, words: GrammarNames) -> Iterator[tuple[str, ...]]:
        """All ways to fill it in, no name twice."""
        for one in product(*(words.names[kind] for kind in self.kinds)):
            if len(set(one)) == len(one):
                yield one


def calls(relation: str, count: int, own: bool) -> Iterator[PhraseForm]:
    """Calls with so many arguments, of every kind that each may have. The first is never a place: goals are about
    objects."""
    for kinds in product(KINDS, repeat=count):
        if kinds and kinds[0] in (REGION, POINT, HEADING):
            continue
        if count > 2 and (POINT in kinds or kinds[0] != OBJECT):
            continue
        yield PhraseForm(
            relation, (f"{relation}(", *([", "] * (count - 1)), ")") if count else (f"{relation}()",), kinds, own=own
        )


def grouped(form: PhraseForm, words: GrammarNames) -> Iterator[PhraseForm]:
    """A call over a list with the objects written out."""
    if form.kinds == (LIST,):
        for count in (2, 3) if words.few else (2,):
            pieces = (f"{form.relation}([", *([", "] * (count - 1)), "])")
            yield replace(form, pieces=pieces, kinds=(OBJECT,) * count)


def quantified(form: PhraseForm, words: GrammarNames) -> Iterator[PhraseForm]:
    """The call for all and for some elements of a list, and for pairs of them."""
    if not form.kinds or form.kinds[0] != OBJECT or len(form.kinds) > 2 or form.number:
        return
    p, q = words.variables
    rest = form.kinds[1:]
    for kind in ("forall", "exists"):
        if not rest:
            yield _over(form, (f"({kind} {p} in ", f": {form.relation}({p}))"), (LIST,))
        elif rest[0] != POINT and words.few:
            yield _over(form, (f"({kind} {p} in ", f": {form.relation}({p}, ", "))"), (LIST, *rest))
        if rest == (OBJECT,):
            yield _over(form, (f"({kind} {p}, {q} in ", f": {form.relation}({p}, {q}))"), (LIST,))
            yield _over(form, (f"({kind} {p}, {q} in consecutive(", f"): {form.relation}({p}, {q}))"), (LIST,))


def _over(form: PhraseForm, pieces: tuple[str, ...], kinds: tuple[str, ...]) -> PhraseForm:
    return replace(form, pieces=pieces, kinds=kinds, quantified=True)


def samples(form: PhraseForm, words: GrammarNames) -> list[tuple[str, ...]]:
    """A few ways to fill a form in, for a first look: different objects in different places."""
    found: list[tuple[str, ...]] = []
    for shift in range(3):
        taken: list[str] = []
        for kind in form.kinds:
            names = [name for name in words.names[kind] if name not in taken]
            if not names:
                return found
            taken.append(names[shift % len(names)])
        found.append(tuple(taken))
    return found


def fits(form: PhraseForm, words: GrammarNames) -> bool:
    """Whether a form is small enough to be filled in in all ways."""
    threes = len(words.names[OBJECT]) ** 2
    return form.kinds.count(OBJECT) < 3 or threes * len(words.names[OBJECT]) <= MOST_THREES
