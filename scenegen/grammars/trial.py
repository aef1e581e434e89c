"""What of all that could be said checks, and how phi of it varies over scenes that meet what the spec requires.

Every formula is expanded by the checker itself, into one core; what it refuses, and what is the same in every scene, is
left out. A formula that some of the scenes satisfies can be satisfied: no proof to the contrary can be found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from scenegen.errors import Source, SpecError
from scenegen.grammars.forms import Form, calls, fits, grouped, quantified, samples
from scenegen.grammars.vocabulary import HEADINGS, MEASURES, Measure, Vocabulary, vocabulary
from scenegen.lang import ast
from scenegen.lang.builder import TooLarge
from scenegen.lang.check import check_module
from scenegen.lang.core import Coord, Core, children
from scenegen.lang.interpret import evaluate, phi
from scenegen.lang.lower import Lowering
from scenegen.lang.parse import parse
from scenegen.lang.provenance import Frame
from scenegen.lang.scope import LIST_FUNCTIONS, signatures
from scenegen.lang.trampoline import run
from scenegen.lang.values import FormulaValue, ListValue, NumberValue, PointValue, RegionValue, Value
from scenegen.primitives import NUMPY
from scenegen.primitives.units import LENGTH, SPEED, TURN_RATE, Unit

Array = npt.NDArray[np.float64]

PROBES = 16  # scenes in which an extra argument has to shift phi by as much
EXACT = 1e-9  # what rounding may make of a shift
LIVE = 1 << 23  # numbers that a look at some scenes may hold
MOST_SLOTS = 3  # arguments that relations can have here
TRIVIAL = ("abs", "min", "max", "sum", "mean", "sin", "cos", "wrap", "height")


@dataclass(frozen=True, slots=True)
class Extra:
    """A further argument of a call that is a number or a heading: its text is `before` and a value of the measure, or
    one of `words`."""

    before: str
    measure: Measure | None
    words: tuple[str, ...] = ()

    def values(self, words: Vocabulary) -> tuple[str, ...]:
        if self.measure is None:
            return self.words
        return tuple(f"{step}{self.measure.suffix}" for step in self.measure.tried(words.few))


@dataclass(frozen=True, slots=True)
class Statement:
    """A form filled in. `low` and `high` are the ends of phi, or of the number, over the scenes."""

    form: Form
    arguments: tuple[str, ...]
    extra: Extra | None = None
    value: str = ""
    low: float = -np.inf
    high: float = np.inf


@dataclass(slots=True)
class Findings:
    """All statements that check, the units of numbers, and the names that took part. `shifts` are those of phi where an
    extra argument has a value, for forms that it shifts by as much in every scene."""

    statements: list[Statement] = field(default_factory=list)
    units: dict[Form, Unit] = field(default_factory=dict)
    shifts: dict[Form, dict[Extra, dict[str, float]]] = field(default_factory=dict)
    words: Vocabulary | None = None
    steps: int = 0


def findings(source: Source, scenes: Array | None) -> Findings:
    """What can be said over the declarations of a spec's text. `scenes` (3N, M) meet what it requires; None for a spec
    over time, of which no scene says what can be. Raises SpecError for a text that does not check."""
    trial = _Trial(None if scenes is None else scenes[:, :PROBES])
    checked = check_module(parse(source), None, trial)
    found = trial.found
    if scenes is not None:
        _measure(found, checked.core, trial.nodes, scenes)
    if checked.timed is not None:
        found.steps = checked.timed.horizon.steps
    return found


def _measure(found: Findings, core: Core, labels: Sequence[str], scenes: Array) -> None:
    """Sets the ends of what every statement reaches over the scenes."""
    places = np.array([core.labels[label] for label in labels], dtype=int)
    low, high = np.full(len(places), np.inf), np.full(len(places), -np.inf)
    block = max(32, LIVE // max(1, len(core.nodes)))
    for start in range(0, scenes.shape[1], block):
        rows = scenes[:, start : start + block]
        values = evaluate(core, list(rows), NUMPY)
        for which, place in enumerate(places):
            value = values[place]
            low[which], high[which] = min(low[which], np.min(value)), max(high[which], np.max(value))
    found.statements = [
        replace(one, low=float(least), high=float(most))
        for one, least, most in zip(found.statements, low, high, strict=True)
    ]


class _Trial:
    """Expands statements with the checker's own machine, once all that a spec declares is known."""

    def __init__(self, probes: Array | None) -> None:
        self.probes = probes
        self.found = Findings()
        self.nodes: list[str] = []
        self._values: dict[str, Value] = {}
        self._depends: list[bool] = []
        self._templates: dict[str, ast.Expr] = {}

    def __call__(self, lowering: Lowering) -> Mapping[str, int]:
        self.lowering = lowering
        self.words = self.found.words = vocabulary(lowering)
        noticed = list(lowering.noticed)
        labels: dict[str, int] = {}
        for statement, node in self._all():
            self.found.statements.append(statement)
            self.nodes.append(f"statement {len(labels)}")
            labels[self.nodes[-1]] = node
        lowering.noticed[:] = noticed
        return {} if lowering.scope.timed else labels

    def _all(self) -> Iterator[tuple[Statement, int]]:
        scope, words = self.lowering.scope, self.words
        for name in (*scope.definitions, *signatures(scope.timed)):
            if name in LIST_FUNCTIONS or name in TRIVIAL:
                continue
            signature = scope.signature(name)
            assert signature is not None
            optional = self._optional(name)
            counts = [signature.needed]
            first = next(iter(optional.values()), None)
            if signature.needed < 2 and isinstance(first, ListValue | RegionValue | PointValue):
                counts.append(signature.needed + 1)
            for count in counts:
                if count > MOST_SLOTS:
                    continue
                for form in calls(name, count, name in words.own):
                    made = self._looked_at(form)
                    if made is None or not fits(form, words):
                        continue
                    extras = [] if made.number else self._extras(optional, signature.needed, count)
                    for one in (made, *grouped(made, words), *quantified(made, words)):
                        yield from self._filled(one, [] if one.quantified else extras)

    def _optional(self, name: str) -> dict[str, Value]:
        """The parameters that have defaults, with their values; none of built-in functions."""
        declared = self.lowering.scope.definitions.get(name)
        if declared is None or not isinstance(declared.statement, ast.Definition):
            return {}
        frame = Frame(declared.source)
        found: dict[str, Value] = {}
        for one in declared.statement.parameters:
            if one.default is not None:
                try:
                    found[one.name.id] = run(self.lowering.lower(one.default, {}, frame))
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
                found.append(Extra(before, None, HEADINGS))
            elif value.unit in MEASURES:
                found.append(Extra(before, MEASURES[value.unit]))
        return found

    def _looked_at(self, form: Form) -> Form | None:
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

    def _filled(self, form: Form, extras: Sequence[Extra]) -> Iterator[tuple[Statement, int]]:
        rest = [one for one in extras if not self._shifted(form, one)]
        if not self.words.few or len(form.kinds) > 2:
            rest = []
        for arguments in form.arguments(self.words):
            node = self._node(form, arguments)
            if node is None:
                continue
            yield Statement(form, arguments), node
            for extra in rest:
                for value in extra.values(self.words):
                    node = self._node(form.ending(extra.before + value), arguments)
                    if node is not None:
                        yield Statement(form, arguments, extra, value), node

    def _shifted(self, form: Form, extra: Extra) -> bool:
        """Whether the values of an extra argument shift phi by as much in every scene, and in proportion; then it is
        noted by how much. Over time, where no scene says what can be, any value will do."""
        if extra.measure is None and self.probes is not None:
            return False
        values = extra.values(self.words)
        shifts: list[Array] = []
        for arguments in samples(form, self.words):
            nodes = [self._node(form, arguments)]
            nodes += [self._node(form.ending(extra.before + value), arguments) for value in values]
            labels = {str(place): node for place, node in enumerate(nodes) if node is not None}
            if len(labels) < len(nodes):
                continue
            if self.probes is None:
                shifts.append(np.full(len(values), np.inf))
                continue
            core = self.lowering.builder.finish(labels)
            phis = [np.broadcast_to(one, self.probes.shape[1]) for one in phi(core, list(self.probes), NUMPY).values()]
            moved = np.array(phis[1:]) - phis[0]
            if np.ptp(moved, axis=1).max() > EXACT:
                return False
            shifts.append(moved[:, 0])
        if not shifts or any(np.abs(one - shifts[0]).max() > EXACT for one in shifts if np.isfinite(one).all()):
            return False
        if self.probes is not None and extra.measure is not None:
            slopes = np.diff(shifts[0]) / np.diff(extra.measure.tried(self.words.few))
            if np.ptp(slopes) > EXACT:
                return False
        self.found.shifts.setdefault(form, {})[extra] = dict(zip(values, map(float, shifts[0]), strict=True))
        return True

    def _node(self, form: Form, arguments: tuple[str, ...]) -> int | None:
        """The node of a filled-in form; None where the checker refuses it, or no coordinate takes part in it."""
        value = self._value(form, arguments, " >= 0" if form.number else "")
        if not isinstance(value, FormulaValue) or value.node < 0:
            return None
        nodes = self.lowering.builder.nodes
        for node in nodes[len(self._depends) :]:
            self._depends.append(isinstance(node, Coord) or any(map(self._depends.__getitem__, children(node))))
        return value.node if self._depends[value.node] else None

    def _value(self, form: Form, arguments: tuple[str, ...], end: str = "") -> Value | None:
        lowering = self.lowering
        lowering.inside = 0  # the limits are those of one spec, and this is many
        slots = tuple(f"_slot{place}" for place in range(len(arguments)))
        text = form.text(slots) + end
        template = self._templates.get(text)
        if template is None:
            template = self._templates[text] = self._parsed(text)
        try:
            env = dict(zip(slots, map(self._argument, arguments), strict=True))
            return run(lowering.lower(template, env, self._frame(text)))
        except (SpecError, TooLarge):
            return None

    def _argument(self, text: str) -> Value:
        value = self._values.get(text)
        if value is None:
            value = run(self.lowering.lower(self._parsed(text), {}, self._frame(text)))
            self._values[text] = value
        return value

    def _parsed(self, text: str) -> ast.Expr:
        parsed = parse(Source("<grammar>", text), self.lowering.scope.timed).bare
        assert parsed is not None
        return parsed

    def _frame(self, text: str) -> Frame:
        return Frame(Source("<grammar>", text))
