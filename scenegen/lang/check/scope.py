"""Which names a spec knows: what each statement declares, and the objects that a spec without `object` uses.

Relations and functions live apart from everything else, since a parenthesis marks a call: an object may be
called `box` or `x`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

from scenegen.errors import Diagnostic, Source, Span
from scenegen.errors.language import BUILT_IN_NAME, DEFINED_TWICE
from scenegen.geometry import PRIMITIVES
from scenegen.lang.check.imports import SourcedStatement
from scenegen.lang.spec import Count
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_expr
from scenegen.pose import NAMES
from scenegen.resources import grammar_file

NO_NUMBERS = ("nan", "inf", "infinity")  # how other languages write what is no number of this one

BUILT_IN = ("objects", "workspace")  # names with a meaning of their own

LABEL = "task"  # the name of an unnamed formula


@dataclass(frozen=True, slots=True)
class Signature:
    """What a call may look like: the parameters in order, how many of them are needed; `variadic` repeats the last."""

    name: str
    parameters: tuple[str, ...]
    needed: int
    variadic: bool = False
    usage: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Declared:
    """A statement that gives a name a meaning, and the source it stands in. Compared by identity: trees may be deep."""

    source: Source
    name: ast.Name
    statement: ast.Constant | ast.Definition | ast.Label | ast.Region | ast.CameraDeclaration

    @property
    def span(self) -> Span:
        return self.name.span(self.source)


@dataclass(frozen=True, slots=True, eq=False)
class DeclaredObject:
    """An object, or an array of them, as declared; without a declaration it was inferred from its use."""

    source: Source
    name: ast.Name
    declaration: ast.Declaration | None = None

    @property
    def is_array(self) -> bool:
        return self.declaration is not None and self.declaration.count is not None


@dataclass(slots=True)
class Scope:
    """Everything a formula can name.

    `things` are the objects and arrays by name. `objects` maps the name of each single object, `block[1]` for the
    element of an array, to its place in storage order, and `arrays` an array to the places of its elements; both are
    known once the declarations have been evaluated.
    """

    source: Source
    prelude: Source
    constants: dict[str, Declared] = field(default_factory=dict)
    definitions: dict[str, Declared] = field(default_factory=dict)
    labels: dict[str, Declared] = field(default_factory=dict)
    regions: dict[str, Declared] = field(default_factory=dict)
    cameras: dict[str, Declared] = field(default_factory=dict)
    things: dict[str, DeclaredObject] = field(default_factory=dict)
    objects: dict[str, int] = field(default_factory=dict)
    arrays: dict[str, range] = field(default_factory=dict)
    counts: dict[str, Count] = field(default_factory=dict)  # of the arrays whose number of elements is drawn
    inferred: bool = False
    timed: bool = False  # whether it has a `time` statement, and with it the functions of steps
    replaced: dict[str, Declared] = field(default_factory=dict)  # definitions of the prelude that the spec replaces
    _signatures: dict[str, Signature] = field(default_factory=dict, repr=False)

    def values(self) -> set[str]:
        """Names that stand for something by themselves."""
        return {*self.things, *self.constants, *self.labels, *self.regions, *self.cameras, *BUILT_IN}

    def knows(self, name: str) -> bool:
        """Whether a name stands for something by itself."""
        return self.declaration(name) is not None or name in self.things or name in BUILT_IN

    def declaration(self, name: str) -> Declared | None:
        """The constant, region, camera or label of that name."""
        one = self.constants.get(name) or self.regions.get(name) or self.cameras.get(name)
        return one or self.labels.get(name)

    def functions(self) -> set[str]:
        return {*self.definitions, *signatures(self.timed)}

    def signature(self, name: str) -> Signature | None:
        """How `name` may be called; None where nothing of that name can be."""
        declared = self.definitions.get(name)
        if declared is None:
            return signatures(self.timed).get(name)
        if name not in self._signatures:
            assert isinstance(declared.statement, ast.Definition)
            self._signatures[name] = signature_of(declared.statement)
        return self._signatures[name]

    def definition(self, name: str, caller: Source) -> Declared | None:
        """The definition that a call means: the prelude calls what it defines itself, specs their own first."""
        if caller is self.prelude and name in REPLACEABLE:
            mine = self.replaced.get(name) or self.definitions.get(name)
            return mine if mine is not None and mine.source is self.prelude else None
        return self.definitions.get(name)

    def callee_signature(self, name: str, caller: Source) -> Signature | None:
        """How the definition or function that a call means may be called."""
        declared = self.definition(name, caller)
        if declared is None:
            return signatures(self.timed).get(name)
        if declared is self.definitions.get(name):
            return self.signature(name)
        assert isinstance(declared.statement, ast.Definition)
        return signature_of(declared.statement)

    def is_own(self, source: Source) -> bool:
        """Whether a source is the spec itself, neither imported nor the prelude."""
        return source is self.source


def signature_of(definition: ast.Definition) -> Signature:
    names = tuple(parameter.name.id for parameter in definition.parameters)
    shown = [
        one.name.id if one.default is None else f"{one.name.id} = {print_expr(one.default)}"
        for one in definition.parameters
    ]
    needed = sum(one.default is None for one in definition.parameters)
    return Signature(definition.name.id, names, needed, usage=f"{definition.name.id}({', '.join(shown)})")


LIST_FUNCTIONS = {
    "consecutive": "the neighbours in a list, for a quantifier: forall p, q in consecutive(items)",
    "gaps": "the clearances between neighbours in a list, as a list of lengths",
}

HEIGHTS = {
    "z": "how high the lowest point of a is above the table, or a surface or a region; metres",
    "height": "from the lowest to the highest point of a; metres",
    "top": "how high the highest point of a is above the table; metres",
    "apart": "the clearance of two bodies in space; where they share space, minus the smallest shift that parts them",
    "surfaces": "the surfaces of a that things can stand on, as a list; as deep as `upper` fits, if given",
    "others": "all of the items but a, as a list; of all objects, if none are given",
    "bodies": "the items and, as boards, all regions at a height: what noCollision keeps apart",
    "base": "the surface that a was declared to stand on, of several the one taken; on the table its own footprint",
    "load": "the centre of mass of a and all that stands on it, as a point",
}

SIGHT = {
    "hiders": "what can hide a from a camera, as a list: all other objects, without what a always stands on, "
    "and all regions at a height, as boards",
    "viewRoom": "how far a's body is inside what a camera pictures, to the nearest side of that; metres",
    "shadowGap": "the clearance of a and what b hides from a camera; where b hides some of a, by how far; metres",
    "visibleShare": "the share of a's silhouette, seen from a camera, that nothing nearer covers; 1 is all of it, "
    "and beyond that 0.1 more for each centimetre to the nearest shadow",
}

ARMS = {
    "armReach": "how far a is inside of an arm's reach from above, fingers `depth` below its top; metres",
    "handRoom": "the room around the open hand of an arm at a yaw of a's frame, fingers `depth` below its top; metres",
    "armRoom": "how far all else is from the way between an arm's base and a, or lower than its hand there; metres",
    "yaws": "the yaws, of 12, at which a fits between the open fingers of an arm, as a list; else its narrowest",
}

# What the prelude says of heights, and the functions for it, came late: a spec may use these names for definitions of
# its own. The prelude itself goes on with its own.
REPLACEABLE = (
    *HEIGHTS,
    *("restsOn", "insideOf", "stackedOn", "stacked", "atLevel", "underneath", "supported", "stable"),
    *("reachableFromAbove", "noCollision"),
    *SIGHT,
    *("inView", "unhidden", "visible"),
    *(*ARMS, "pathGap", "reachable", "graspable", "armClear"),
)


STEPS = {
    "displacement": "how far a moved since the moment before; metres; 0 at moment 0",
    "speed": "displacement over the time of a step; metres per second",
    "spin": "how fast a turned since the moment before, in either direction; radians per second; 0 at moment 0",
    "still": "a did not move in the step, nor turn: by at most `within`, metres and radians alike",
    "moved": "a moved in the step, or turned: by at least `by`, metres and radians alike",
    "carried": "a's pose in the frame of b stayed the same in the step",
}
_STEPS = {
    "still": Signature("still", ("a", "within"), 1, usage="still(a, within = 1 mm)"),
    "moved": Signature("moved", ("a", "by"), 1, usage="moved(a, by = 1 mm)"),
    "carried": Signature("carried", ("a", "b"), 2, usage="carried(a, b)"),
}


@cache
def signatures(timed: bool = False) -> Mapping[str, Signature]:
    """The functions that no definition makes: coordinates, primitives, functions of lists; `timed`: of steps, too."""
    if timed:
        return {
            **signatures(),
            **{name: _STEPS.get(name) or Signature(name, ("a",), 1, usage=f"{name}(a)") for name in STEPS},
        }
    table = {axis: Signature(axis, ("a",), 1, usage=f"{axis}(a)") for axis in NAMES}
    for primitive in PRIMITIVES.values():
        if not (primitive.operator or primitive.hidden):
            names = primitive.names or tuple("abcdefgh"[: len(primitive.params)])
            dots = ", ..." if primitive.variadic else ""
            usage = f"{primitive.name}({', '.join(names)}{dots})"
            table[primitive.name] = Signature(primitive.name, names, len(names), primitive.variadic, usage)
    for name in LIST_FUNCTIONS:
        table[name] = Signature(name, ("items",), 1, usage=f"{name}(items)")
    for name in HEIGHTS:
        names = ("a", "b") if name == "apart" else ("items",) if name == "bodies" else ("a",)
        table[name] = Signature(name, names, len(names), usage=f"{name}({', '.join(names)})")
    for name in SIGHT:
        names = ("a", "b", "camera") if name == "shadowGap" else ("a",) if name == "hiders" else ("a", "camera")
        table[name] = Signature(name, names, len(names), usage=f"{name}({', '.join(names)})")
    table["surfaces"] = Signature("surfaces", ("a", "upper"), 1, usage="surfaces(a, upper)")
    for name, more in (("armReach", ("depth",)), ("armRoom", ("depth",)), ("handRoom", ("yaw", "depth")), ("yaws", ())):
        names = ("a", "arm", *more)
        table[name] = Signature(name, names, len(names), usage=f"{name}({', '.join(names)})")
    table["others"] = Signature("others", ("a", "items"), 1, usage="others(a, items = objects)")
    return table


@cache
def prelude() -> ast.Module:
    """The prelude's tree."""
    return parse(Source("prelude.spec", grammar_file("prelude.spec").read_text(encoding="utf-8")))


def collect(
    source: Source, placed: Sequence[SourcedStatement], bare: ast.Expr | None
) -> tuple[Scope, list[Diagnostic]]:
    """The scope of a spec's statements over the prelude, and a diagnostic for each name with two meanings."""
    base = prelude()
    scope = Scope(source, base.source)
    scope.timed = any(isinstance(one.statement, ast.Time) for one in placed)
    for statement in base.statements:
        if isinstance(statement, ast.Constant):
            scope.constants[statement.name.id] = Declared(base.source, statement.name, statement)
        elif isinstance(statement, ast.Definition):
            scope.definitions[statement.name.id] = Declared(base.source, statement.name, statement)
    problems: list[Diagnostic] = []
    places: dict[str, Span] = {}
    workspace: Span | None = None
    once: dict[type, Span] = {}
    for one in placed:
        if isinstance(one.statement, ast.Time | ast.Moves):
            here = one.statement.span(one.source)
            first = once.setdefault(type(one.statement), here)
            if first is not here:
                what = "the time" if isinstance(one.statement, ast.Time) else "what moves"
                problems.append(DEFINED_TWICE(here, what=what, first=first.place))
        if isinstance(one.statement, ast.Workspace):
            here = one.statement.span(one.source)
            if workspace is not None:
                problems.append(DEFINED_TWICE(here, what="the workspace", first=workspace.place))
            workspace = here
        for kind, name, node in _names(one.statement):
            here = name.span(one.source)
            problem = _clash(scope, kind, name.id, here, places)
            if problem is not None:
                problems.append(problem)
                continue
            places[name.id] = here
            _declare(scope, one.source, name, node)
    if not any(isinstance(one.statement, ast.Objects) and not one.statement.declarations[0].robot for one in placed):
        scope.inferred = True
        _infer_objects(source, placed, bare, scope)
    return scope, problems


def _names(statement: ast.Statement) -> Iterator[tuple[str, ast.Name, ast.Declaration | ast.Statement]]:
    """The names that a statement declares, each with its kind and the node that says what it is."""
    match statement:
        case ast.Objects(declarations):
            for one in declarations:
                yield "object", one.name, one
        case ast.Region(name, _):
            yield "region", name, statement
        case ast.CameraDeclaration(name):
            yield "camera", name, statement
        case ast.Constant(name, _):
            yield "constant", name, statement
        case ast.Definition(name, _, _):
            yield "definition", name, statement
        case ast.Label(name, _):
            yield "label", name, statement
        case _:
            return


def _declare(scope: Scope, source: Source, name: ast.Name, node: ast.Declaration | ast.Statement) -> None:
    match node:
        case ast.Declaration():
            scope.things[name.id] = DeclaredObject(source, name, node)
        case ast.Constant():
            scope.constants[name.id] = Declared(source, name, node)
        case ast.Definition():
            if name.id in scope.definitions:
                scope.replaced[name.id] = scope.definitions[name.id]
            scope.definitions[name.id] = Declared(source, name, node)
        case ast.Label():
            scope.labels[name.id] = Declared(source, name, node)
        case ast.Region():
            scope.regions[name.id] = Declared(source, name, node)
        case ast.CameraDeclaration():
            scope.cameras[name.id] = Declared(source, name, node)
        case _:
            return


def _clash(scope: Scope, kind: str, name: str, here: Span, places: Mapping[str, Span]) -> Diagnostic | None:
    if name in places:
        return DEFINED_TWICE(here, what=f"`{name}`", first=places[name].place)
    if name in BUILT_IN:
        return BUILT_IN_NAME(here, name=name, what="built in", use="be defined")
    if (
        kind == "definition"
        and name not in REPLACEABLE
        and (name in scope.definitions or name in signatures(scope.timed))
    ):
        what = "a relation of the prelude" if name in scope.definitions else "a built-in function"
        return BUILT_IN_NAME(here, name=name, what=what, use="be defined again")
    if kind not in ("definition", "constant") and name in scope.constants:
        return BUILT_IN_NAME(here, name=name, what="a constant of the prelude", use=f"name {_a(kind)}")
    return None


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _infer_objects(source: Source, placed: Sequence[SourcedStatement], bare: ast.Expr | None, scope: Scope) -> None:
    """Names that nothing else explains are objects, in the order in which the text mentions them."""
    roots: list[tuple[Source, ast.Expr, frozenset[str]]] = []
    for one in placed:
        bound = frozenset[str]()
        if isinstance(one.statement, ast.Definition):
            bound = frozenset(parameter.name.id for parameter in one.statement.parameters)
        if isinstance(one.statement, ast.Definition | ast.Label | ast.Require):
            roots.extend((one.source, expr, bound) for expr in ast.expressions(one.statement))
    if bare is not None:
        roots.append((source, bare, frozenset()))
    known = {*scope.constants, *scope.labels, *scope.regions, *scope.cameras, *BUILT_IN}
    for where, root, bound in roots:
        for node, visible in ast.walk(root, bound):
            if isinstance(node, ast.Name) and node.id not in known and node.id not in visible:
                scope.things.setdefault(node.id, DeclaredObject(where, node))


@dataclass(frozen=True)
class RelationEntry:
    """A definition with the comment above it, which is its meaning."""

    definition: ast.Definition
    meaning: str

    @property
    def name(self) -> str:
        return self.definition.name.id

    @property
    def usage(self) -> str:
        """How it is called: `closeTo(a, b, e = EPS_CLOSE)`."""
        return signature_of(self.definition).usage


@dataclass(frozen=True)
class RelationGroup:
    """The definitions under one heading of the prelude."""

    title: str
    entries: list[RelationEntry]


def groups() -> Iterator[RelationGroup]:
    """The definitions under the headings `# ---- title` of the prelude, in its order."""
    module = prelude()
    definitions = {one.start: one for one in module.statements if isinstance(one, ast.Definition)}
    title, entries, comment, place = "", list[RelationEntry](), list[str](), 0
    for line in module.source.text.splitlines(keepends=True):
        if line.startswith("# ---- "):
            if entries:
                yield RelationGroup(title, entries)
            title, entries, comment = line.removeprefix("# ---- ").strip(), [], []
        elif line.startswith("#"):
            comment.append(line.removeprefix("#").strip())
        elif place in definitions:
            entries.append(RelationEntry(definitions[place], " ".join(comment)))
        elif not line.strip():
            comment = []
        place += len(line)
    yield RelationGroup(title, entries)


def defaults(definition: ast.Definition) -> dict[str, str]:
    """The constants of the prelude that stand for parameters left out, with their values."""
    values = {one.name.id: print_expr(one.value) for one in prelude().statements if isinstance(one, ast.Constant)}
    used = dict.fromkeys(print_expr(one.default) for one in definition.parameters if one.default is not None)
    return {name: values[name] for name in used if name in values}
