"""A spec on its way through the passes of the checker, and what they found wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.geometry.workspace import Workspace
from scenegen.lang.check.families import Category, Variants
from scenegen.lang.check.imports import Project, SourcedStatement
from scenegen.lang.check.lowering import Lowering
from scenegen.lang.check.priors import PriorStatement
from scenegen.lang.check.scope import LABEL, DeclaredObject, Scope
from scenegen.lang.formula.builder import TRUE
from scenegen.lang.formula.core import Core
from scenegen.lang.formula.timed import Movers, Timed
from scenegen.lang.spec import Pose
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import MOST_ERRORS
from scenegen.things import Shape

LoweringHook = Callable[[Lowering], None]


class Problems(list[Diagnostic]):
    """What is wrong. As a context it keeps what a step raises, so that one mistake does not hide another."""

    def __enter__(self) -> Problems:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, SpecError):
            self.extend(error.diagnostics)
            return True
        return False

    @property
    def full(self) -> bool:
        """Whether nobody would read any more."""
        return len(self) >= MOST_ERRORS

    def refusal(self, main: Source) -> SpecError:
        """All of them once, those of the spec itself first, each file's in the order of its text."""

        def place(problem: Diagnostic) -> tuple[bool, str, int]:
            span = problem.span
            return (False, "", 0) if span is None else (span.source is not main, span.source.name, span.start)

        return SpecError(*sorted(dict.fromkeys(self), key=place)[:MOST_ERRORS])


@dataclass(slots=True)
class Draft:
    """What is asked for (`module`, `project`, `hook`, `counts`: see `check_module`), and what the passes have found.

    `placed` are the statements of all files. `lowering` knows the names, and what the declarations say. `kinds` are the
    categories of objects by name, `variants` what these objects are; `shapes` has one entry per object, `fixed` the
    poses of those that are held in place. `priors` has an entry per `usually` statement. `used` are the names that
    formulas and these use, without those of definitions that nobody calls. `constant` is what is wrong if it is so with
    all numbers of things that the spec draws.
    """

    module: ast.Module
    project: Project
    hook: LoweringHook | None
    counts: Mapping[str, int]
    scope: Scope = field(init=False)
    lowering: Lowering = field(init=False)
    placed: list[SourcedStatement] = field(default_factory=list)
    problems: Problems = field(default_factory=Problems)
    space: Workspace = field(default_factory=Workspace)
    kinds: dict[str, Category] = field(default_factory=dict)
    variants: Variants = field(default_factory=Variants)
    shapes: list[Shape] = field(default_factory=list)
    fixed: dict[int, Pose] = field(default_factory=dict)
    moves: Movers = "one"
    standing: list[int] = field(default_factory=list)
    priors: list[PriorStatement] = field(default_factory=list)
    labels: dict[str, int] = field(default_factory=dict)
    requirement: int = TRUE
    used: set[str] = field(default_factory=set)
    constant: dict[object, Diagnostic] = field(default_factory=dict)
    core: Core = field(init=False)
    timed: Timed | None = None

    @property
    def source(self) -> Source:
        """The spec's own text."""
        return self.module.source

    def refuse_constant(self, problem: Diagnostic, value: float) -> None:
        """Notes that what has this value in every scene is wrong: at once, or, where numbers of things or assets may
        decide, for `check_module`, which knows whether it is the same with all of them."""
        if self.lowering.numbered or self.kinds or any(one.least < one.most for one in self.scope.counts.values()):
            self.constant[problem.kind, problem.span, value] = problem
        else:
            self.problems.append(problem)

    def places(self, thing: DeclaredObject) -> Sequence[int]:
        """The places of an object, or of the elements of an array, in storage order."""
        return self.scope.arrays.get(thing.name.id) or (self.scope.objects.get(thing.name.id, 0),)

    def formulas(self) -> list[tuple[str, Source, ast.Expr]]:
        """Name, source and formula of every label."""
        if self.module.bare is not None:
            return [(LABEL, self.source, self.module.bare)]
        each = ((one.source, one.statement) for one in self.placed)
        return [(one.name.id, source, one.formula) for source, one in each if isinstance(one, ast.Label)]

    def formula(self, name: str) -> Span:
        """Where the formula of a label stands."""
        return next(formula.span(source) for label, source, formula in self.formulas() if label == name)

    def first_requirement(self) -> Span:
        """Where the first `require` statement stands."""
        return next(one.statement.span(one.source) for one in self.placed if isinstance(one.statement, ast.Require))
