"""What can be said of a spec's objects, and what of it checks and varies over scenes that meet what the spec requires.

Forms (calls of a relation, quantifiers over it, comparisons of functions with numbers) come from the signatures alone.
Which kinds an argument can have is tried, not written down: a new relation of the prelude, or of the spec, takes part
without a word here. Every formula is expanded by the checker itself, into one core; what it refuses, and what is the
same in every scene, is left out. A formula that some of the scenes satisfies can be satisfied: no proof to the contrary
can be found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, product

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Source, SpecError
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.primitives import ANGLE, LENGTH, SPEED, TURN_RATE, Unit
from scenegen.lang.check.lowering import Lowering
from scenegen.lang.check.scope import LIST_FUNCTIONS, signatures
from scenegen.lang.check.values import CallFrame, FormulaValue, ListValue, NumberValue, PointValue, RegionValue, Value
from scenegen.lang.checker import check_module
from scenegen.lang.formula.builder import FormulaTooLarge
from scenegen.lang.formula.core import Coord, Core, children
from scenegen.lang.formula.interpret import evaluate, phi
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse

OBJECT, REGION, POINT, LIST, HEADING, CAMERA = "object", "region", "point", "list", "heading", "camera"
ARGUMENT_KINDS = (OBJECT, REGION, POINT, LIST, HEADING, CAMERA)
HEADING_WORDS = ("NORTH", "EAST", "SOUTH", "WEST", "45 deg", "135 deg", "225 deg", "315 deg")
FEW_THINGS = 8  # objects up to which points of regions, groups of three and fine steps of numbers take part
MIDPOINTS = ("left", "right", "top", "bottom")


@dataclass(frozen=True, slots=True)
class Measure:
    """How numbers of a unit are written: whole ones with a suffix. `steps` are those that are tried."""

    suffix: str
    steps: tuple[int, ...]
    coarse: tuple[int, ...]
    scale: float  # of a whole one, in metres or radians

    def trial_steps(self, few: bool) -> tuple[int, ...]:
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
    def is_small(self) -> bool:
        """Whether there are so few objects that there is room for more to say of each."""
        return len(self.names[OBJECT]) <= FEW_THINGS


def vocabulary(lowering: Lowering) -> GrammarNames:
    """The names of a spec, once its declarations have been evaluated."""
    scope = lowering.scope
    objects = tuple(scope.objects)
    regions = ("workspace", *(name for name in lowering.areas if name != "workspace"))
    carriers = sorted({one.carrier for one in lowering.supports.values() if one.carrier is not None})
    surfaces = dict.fromkeys(
        f"{objects[one.carrier]}.{one.name}" for one in lowering.supports.values() if one.carrier in carriers
    )
    points = tuple(f"{region}.{side}" for region in regions for side in MIDPOINTS) if len(objects) <= FEW_THINGS else ()
    lists = (*(("objects",) if len(objects) > 1 else ()), *scope.arrays)
    taken = {*scope.values(), *scope.functions()}
    free = [name for name in chain("pqrstuvw", (f"p{k}" for k in range(len(taken) + 2))) if name not in taken]
    own = frozenset(name for name, one in scope.definitions.items() if one.source is not scope.prelude)
    names = {
        OBJECT: objects,
        REGION: (*regions, *surfaces),
        POINT: points,
        LIST: lists,
        HEADING: HEADING_WORDS,
        CAMERA: tuple(lowering.cameras),
    }
    return GrammarNames(names, (free[0], free[1]), own, scope.timed)


MAX_TRIPLES = 1500  # ways to fill three arguments; of more, the third is no object


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
    for kinds in product(ARGUMENT_KINDS, repeat=count):
        if kinds and kinds[0] in (REGION, POINT, HEADING, CAMERA):
            continue
        if count > 2 and (POINT in kinds or kinds[0] != OBJECT):
            continue
        yield PhraseForm(
            relation, (f"{relation}(", *([", "] * (count - 1)), ")") if count else (f"{relation}()",), kinds, own=own
        )


def list_forms(form: PhraseForm, words: GrammarNames) -> Iterator[PhraseForm]:
    """A call over a list with the objects written out."""
    if form.kinds == (LIST,):
        for count in (2, 3) if words.is_small else (2,):
            pieces = (f"{form.relation}([", *([", "] * (count - 1)), "])")
            yield replace(form, pieces=pieces, kinds=(OBJECT,) * count)


def quantifier_forms(form: PhraseForm, words: GrammarNames) -> Iterator[PhraseForm]:
    """The call for all and for some elements of a list, and for pairs of them."""
    if not form.kinds or form.kinds[0] != OBJECT or len(form.kinds) > 2 or form.number:
        return
    p, q = words.variables
    rest = form.kinds[1:]
    for kind in ("forall", "exists"):
        if not rest:
            yield _over_list(form, (f"({kind} {p} in ", f": {form.relation}({p}))"), (LIST,))
        elif rest[0] != POINT and words.is_small:
            yield _over_list(form, (f"({kind} {p} in ", f": {form.relation}({p}, ", "))"), (LIST, *rest))
        if rest == (OBJECT,):
            yield _over_list(form, (f"({kind} {p}, {q} in ", f": {form.relation}({p}, {q}))"), (LIST,))
            yield _over_list(form, (f"({kind} {p}, {q} in consecutive(", f"): {form.relation}({p}, {q}))"), (LIST,))


def _over_list(form: PhraseForm, pieces: tuple[str, ...], kinds: tuple[str, ...]) -> PhraseForm:
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
    return form.kinds.count(OBJECT) < 3 or threes * len(words.names[OBJECT]) <= MAX_TRIPLES


PROBES = 16  # scenes in which an extra argument has to shift phi by as much
EXACT = 1e-9  # what rounding may make of a shift
MAX_PHI_NUMBERS = 1 << 23  # numbers that a look at some scenes may hold
MAX_SLOTS = 3  # arguments that relations can have here


@dataclass(frozen=True, slots=True)
class Extra:
    """A further argument of a call that is a number or a heading: its text is `before` and a value of the measure, or
    one of `words`."""

    before: str
    measure: Measure | None
    words: tuple[str, ...] = ()

    def values(self, words: GrammarNames) -> tuple[str, ...]:
        if self.measure is None:
            return self.words
        return tuple(f"{step}{self.measure.suffix}" for step in self.measure.trial_steps(words.is_small))


@dataclass(frozen=True, slots=True)
class TrialStatement:
    """A form filled in. `low` and `high` are the ends of phi, or of the number, over the scenes."""

    form: PhraseForm
    arguments: tuple[str, ...]
    extra: Extra | None = None
    value: str = ""
    low: float = -np.inf
    high: float = np.inf


@dataclass(slots=True)
class Findings:
    """All statements that check, the units of numbers, and the names that took part. `shifts` are those of phi where an
    extra argument has a value, for forms that it shifts by as much in every scene. `moving` are statements about a
    step, with what they reach where things move; `statements` have what is reached where nothing does."""

    statements: list[TrialStatement] = field(default_factory=list)
    moving: list[TrialStatement] = field(default_factory=list)
    units: dict[PhraseForm, Unit] = field(default_factory=dict)
    shifts: dict[PhraseForm, dict[Extra, dict[str, float]]] = field(default_factory=dict)
    words: GrammarNames | None = None
    steps: int = 0


def findings(source: Source, scenes: Array) -> Findings:
    """What can be said over the declarations of a spec's text, and what phi of it is in the scenes (3N, M).

    Over time the scenes are moments: first every object is taken to stand where it stood the moment before, then where
    it stands in the scene before. Raises SpecError for a text that does not check."""
    trial = _Trial(scenes)
    checked = check_module(parse(source), None, trial)
    if checked.timed is not None:
        trial.found.steps = checked.timed.horizon.steps
    return trial.found


def _phi_ends(core: Core, scenes: Array) -> Array:
    """The least and the largest value of each label over scenes, (L, 2)."""
    places = list(core.labels.values())
    ends = np.tile([np.inf, -np.inf], (len(places), 1))
    block = max(32, MAX_PHI_NUMBERS // max(1, len(core.nodes)))
    for start in range(0, scenes.shape[1], block):
        values = evaluate(core, list(scenes[:, start : start + block]), NUMPY)
        for end, place in zip(ends, places, strict=True):
            end[:] = min(end[0], np.min(values[place])), max(end[1], np.max(values[place]))
    return ends


def _with_ends(one: TrialStatement, ends: Array) -> TrialStatement:
    return replace(one, low=float(ends[0]), high=float(ends[1]))


class _Trial:
    """Expands statements with the checker's own machine, once all that a spec declares is known."""

    def __init__(self, scenes: Array) -> None:
        self.scenes = scenes
        self.found = Findings()
        self._values: dict[str, Value] = {}
        self._depends: list[bool] = []
        self._templates: dict[str, ast.Expr] = {}

    def __call__(self, lowering: Lowering) -> None:
        self.lowering = lowering
        self.words = self.found.words = vocabulary(lowering)
        over_time = lowering.builder.moving > 0
        still = np.tile(self.scenes, (2, 1)) if over_time else self.scenes
        steps = np.concatenate([self.scenes, np.roll(self.scenes, 1, axis=1)]) if over_time else still
        self.probes = steps[:, :PROBES]
        noticed = list(lowering.noticed)
        made = list(self._trials())
        lowering.noticed[:] = noticed
        core = lowering.builder.finish({str(place): node for place, (_, node) in enumerate(made)})
        found = _phi_ends(core, still)
        self.found.statements = [_with_ends(one, ends) for (one, _), ends in zip(made, found, strict=True)]
        if over_time:
            later = _phi_ends(core, steps)
            changed = np.flatnonzero((found != later).any(axis=1))
            self.found.moving = [_with_ends(made[place][0], later[place]) for place in changed]

    def _trials(self) -> Iterator[tuple[TrialStatement, int]]:
        scope, words = self.lowering.scope, self.words
        for name in (*scope.definitions, *signatures(scope.timed)):
            if name in LIST_FUNCTIONS or name == "height" or (name in PRIMITIVES and not PRIMITIVES[name].spatial):
                continue
            signature = scope.signature(name)
            assert signature is not None
            optional = self._optional(name)
            counts = [signature.needed]
            first = next(iter(optional.values()), None)
            if signature.needed < 2 and isinstance(first, ListValue | RegionValue | PointValue):
                counts.append(signature.needed + 1)
            for count in counts:
                if count > MAX_SLOTS:
                    continue
                for form in calls(name, count, name in words.own):
                    made = self._try_form(form)
                    if made is None or not fits(form, words):
                        continue
                    extras = [] if made.number else self._extras(optional, signature.needed, count)
                    for one in (made, *list_forms(made, words), *quantifier_forms(made, words)):
                        yield from self._fill(one, [] if one.quantified else extras)

    def _optional(self, name: str) -> dict[str, Value]:
        """The parameters that have defaults, with their values; none of built-in functions."""
        declared = self.lowering.scope.definitions.get(name)
        if declared is None or not isinstance(declared.statement, ast.Definition):
            return {}
        frame = CallFrame(declared.source)
        found: dict[str, Value] = {}
        for one in declared.statement.parameters:
            if one.default is not None:
                try:
                    found[one.name.id] = self.lowering.evaluate(one.default, frame)
                except SpecError:
                    continue  # a default that depends on the arguments before
        return found

    def _extras(self, optional: Mapping[str, Value], needed: int, count: int) -> list[Extra]:
        found = []
        for place, (name, value) in enumerate(optional.items(), start=needed):
            if not isinstance(value, NumberValue):
                continue
            before = (", " if count else "") + ("" if place == count else f"{name} = ")
            if name == "heading":
                found.append(Extra(before, None, HEADING_WORDS))
            elif value.unit in MEASURES:
                found.append(Extra(before, MEASURES[value.unit]))
        return found

    def _try_form(self, form: PhraseForm) -> PhraseForm | None:
        """The form, where a call of it can be a formula or a number; None where it cannot."""
        for arguments in samples(form, self.words):
            value = self._value(form, arguments)
            if isinstance(value, FormulaValue):
                return form
            if isinstance(value, NumberValue) and value.unit in (LENGTH, SPEED, TURN_RATE):
                made = replace(form, number=True)
                self.found.units[made] = value.unit
                return made
        return None

    def _fill(self, form: PhraseForm, extras: Sequence[Extra]) -> Iterator[tuple[TrialStatement, int]]:
        rest = [one for one in extras if not self._shift(form, one)]
        if not self.words.is_small or len(form.kinds) > 2:
            rest = []
        for arguments in form.arguments(self.words):
            node = self._node(form, arguments)
            if node is None:
                continue
            yield TrialStatement(form, arguments), node
            for extra in rest:
                for value in extra.values(self.words):
                    node = self._node(form.ending(extra.before + value), arguments)
                    if node is not None:
                        yield TrialStatement(form, arguments, extra, value), node

    def _shift(self, form: PhraseForm, extra: Extra) -> bool:
        """Whether the values of an extra argument shift phi by as much in every scene, and in proportion; then it is
        noted by how much."""
        if extra.measure is None:
            return False
        values = extra.values(self.words)
        shifts: list[Array] = []
        for arguments in samples(form, self.words):
            nodes = [self._node(form, arguments)]
            nodes += [self._node(form.ending(extra.before + value), arguments) for value in values]
            labels = {str(place): node for place, node in enumerate(nodes) if node is not None}
            if len(labels) < len(nodes):
                continue
            core = self.lowering.builder.finish(labels)
            phis = [np.broadcast_to(one, self.probes.shape[1]) for one in phi(core, list(self.probes), NUMPY).values()]
            moved = np.array(phis[1:]) - phis[0]
            if np.ptp(moved, axis=1).max() > EXACT:
                return False
            shifts.append(moved[:, 0])
        if not shifts or any(np.abs(one - shifts[0]).max() > EXACT for one in shifts):
            return False
        slopes = np.diff(shifts[0]) / np.diff(extra.measure.trial_steps(self.words.is_small))
        if np.ptp(slopes) > EXACT:
            return False
        self.found.shifts.setdefault(form, {})[extra] = dict(zip(values, map(float, shifts[0]), strict=True))
        return True

    def _node(self, form: PhraseForm, arguments: tuple[str, ...]) -> int | None:
        """The node of a filled-in form; None where the checker refuses it, or no coordinate takes part in it."""
        value = self._value(form, arguments, " >= 0" if form.number else "")
        if not isinstance(value, FormulaValue) or value.node < 0:
            return None
        nodes = self.lowering.builder.nodes
        for node in nodes[len(self._depends) :]:
            self._depends.append(isinstance(node, Coord) or any(map(self._depends.__getitem__, children(node))))
        return value.node if self._depends[value.node] else None

    def _value(self, form: PhraseForm, arguments: tuple[str, ...], end: str = "") -> Value | None:
        lowering = self.lowering
        lowering.inside = 0  # the limits are those of one spec, and this is many
        slots = tuple(f"_slot{place}" for place in range(len(arguments)))
        text = form.text(slots) + end
        template = self._templates.get(text)
        if template is None:
            template = self._templates[text] = self._parse(text)
        try:
            env = dict(zip(slots, map(self._argument, arguments), strict=True))
            return lowering.evaluate(template, self._frame(text), env)
        except (SpecError, FormulaTooLarge):
            return None

    def _argument(self, text: str) -> Value:
        value = self._values.get(text)
        if value is None:
            value = self.lowering.evaluate(self._parse(text), self._frame(text))
            self._values[text] = value
        return value

    def _parse(self, text: str) -> ast.Expr:
        parsed = parse(Source("<grammar>", text), self.lowering.scope.timed).bare
        assert parsed is not None
        return parsed

    def _frame(self, text: str) -> CallFrame:
        return CallFrame(Source("<grammar>", text))
