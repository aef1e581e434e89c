"""The syntax tree: frozen dataclasses that say what was written and where, nothing about what it means.

`start` and `end` are character offsets into the module's source, `end` exclusive. They do not take part in comparison.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from scenegen.errors import Source, Span


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    start: int = field(compare=False, default=0)
    end: int = field(compare=False, default=0)

    def span(self, source: Source) -> Span:
        return Span(source, self.start, self.end)


@dataclass(frozen=True, slots=True)
class Name(Node):
    id: str


@dataclass(frozen=True, slots=True)
class Quantity(Node):
    """A number as written, with its unit suffix or ''."""

    number: str
    unit: str


@dataclass(frozen=True, slots=True)
class Text(Node):
    value: str


@dataclass(frozen=True, slots=True)
class Truth(Node):
    value: bool


@dataclass(frozen=True, slots=True)
class Point(Node):
    """(x, y) or (x, y, theta)."""

    coordinates: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class List(Node):
    items: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Weighted(Node):
    """[tray: 7, workspace: 3]: things of which each scene has one, and how often each compared with the others."""

    items: tuple[Expr, ...]
    weights: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Argument(Node):
    """One argument of a call; `name` is set where it was given by name."""

    name: Name | None
    value: Expr


@dataclass(frozen=True, slots=True)
class Call(Node):
    function: Name
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True)
class Member(Node):
    base: Expr
    member: Name


@dataclass(frozen=True, slots=True)
class Index(Node):
    base: Expr
    index: Expr


@dataclass(frozen=True, slots=True)
class Negative(Node):
    value: Expr


@dataclass(frozen=True, slots=True)
class Binary(Node):
    operator: Literal["+", "-", "*", "/"]
    left: Expr
    right: Expr


@dataclass(frozen=True, slots=True)
class Compare(Node):
    """a <= b <= c: one operand more than there are operators. `<` and `>` were written or not: they mean the same.
    `!=` is between things or constants, so it is the same in every scene."""

    operands: tuple[Expr, ...]
    operators: tuple[Literal["<=", ">=", "!="], ...]


@dataclass(frozen=True, slots=True)
class Not(Node):
    value: Expr


@dataclass(frozen=True, slots=True)
class And(Node):
    parts: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Or(Node):
    parts: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Implies(Node):
    condition: Expr
    consequence: Expr


@dataclass(frozen=True, slots=True)
class Range(Node):
    """lowest..highest, both inclusive."""

    lowest: Expr
    highest: Expr


@dataclass(frozen=True, slots=True)
class Quantifier(Node):
    kind: Literal["forall", "exists"]
    variables: tuple[Name, ...]
    domain: Expr
    body: Expr


@dataclass(frozen=True, slots=True)
class Interval(Node):
    lowest: Expr
    highest: Expr


@dataclass(frozen=True, slots=True)
class Temporal(Node):
    """A formula over later moments; without a window over all that are left."""

    operator: Literal["always", "eventually", "next", "initially", "finally"]
    window: Interval | None
    value: Expr


@dataclass(frozen=True, slots=True)
class Until(Node):
    """`left` up to the moment of `right`: without that moment ("until") or with it ("until_with")."""

    operator: Literal["until", "until_with"]
    window: Interval | None
    left: Expr
    right: Expr


Expr = (
    Name
    | Quantity
    | Text
    | Truth
    | Point
    | List
    | Weighted
    | Call
    | Member
    | Index
    | Negative
    | Binary
    | Compare
    | Not
    | And
    | Or
    | Implies
    | Range
    | Quantifier
    | Temporal
    | Until
)


@dataclass(frozen=True, slots=True)
class Workspace(Node):
    x: Interval
    y: Interval


Chosen = Literal["", "equal", "area"]  # how an object chooses what it stands on


@dataclass(frozen=True, slots=True)
class Declaration(Node):
    """One object, or an array of `count` of them: a number, or a Range or Weighted from which their number is drawn.
    `choice` is set where `support` names several surfaces of which each object stands on one: all equally likely, or by
    their area; times their weights, where it is Weighted. Of a `robot` the shape is an arm."""

    name: Name
    count: Expr | None
    shape: Expr | None
    pose: Expr | None
    support: Expr | None = None
    choice: Chosen = ""
    robot: bool = False


@dataclass(frozen=True, slots=True)
class Objects(Node):
    """`object ...`, or, where all declarations are of robots, `robot ...`."""

    declarations: tuple[Declaration, ...]


@dataclass(frozen=True, slots=True)
class Region(Node):
    """`levels` are heights above the table: none, one, or one for each of `count` regions."""

    name: Name
    shape: Expr
    count: Expr | None = None
    levels: tuple[Expr, ...] = ()


@dataclass(frozen=True, slots=True)
class Constant(Node):
    name: Name
    value: Expr


@dataclass(frozen=True, slots=True)
class CameraDeclaration(Node):
    """`camera NAME = at EYE looks at TARGET fov ANGLE, WIDTH:HEIGHT`; the angle is that of the picture's height."""

    name: Name
    eye: Expr
    target: Expr
    field: Expr
    width: Expr
    height: Expr


@dataclass(frozen=True, slots=True)
class Usually(Node):
    """`usually THING, ... ~ DISTRIBUTION`: where things usually are, or, of `theta(...)`, how they are turned."""

    things: tuple[Expr, ...]
    distribution: Expr


@dataclass(frozen=True, slots=True)
class Parameter(Node):
    name: Name
    default: Expr | None


@dataclass(frozen=True, slots=True)
class Definition(Node):
    name: Name
    parameters: tuple[Parameter, ...]
    body: Expr


@dataclass(frozen=True, slots=True)
class Require(Node):
    formula: Expr


@dataclass(frozen=True, slots=True)
class Import(Node):
    path: Text


@dataclass(frozen=True, slots=True)
class Label(Node):
    name: Name
    formula: Expr


@dataclass(frozen=True, slots=True)
class Time(Node):
    """`time AMOUNT WORD`, where the word should be `steps`, or `time SPAN every AMOUNT`."""

    amount: Expr
    word: Name | None = None
    span_: Interval | None = None


@dataclass(frozen=True, slots=True)
class Moves(Node):
    """`moves one` or `moves all`: what moves in a step."""

    which: Name


Statement = (
    Workspace
    | Objects
    | Region
    | Constant
    | CameraDeclaration
    | Usually
    | Definition
    | Require
    | Import
    | Label
    | Time
    | Moves
)


@dataclass(frozen=True, slots=True)
class Module:
    """A spec file: statements, or one bare formula."""

    source: Source
    statements: tuple[Statement, ...]
    bare: Expr | None


def children(node: Expr | Argument) -> tuple[Expr | Argument, ...]:
    """The expressions directly below an expression, in the order of the text. Names of members and calls are not."""
    match node:
        case Call():
            return node.arguments
        case Argument() | Not() | Negative():
            return (node.value,)
        case And() | Or():
            return node.parts
        case Compare():
            return node.operands
        case Binary():
            return (node.left, node.right)
        case Implies():
            return (node.condition, node.consequence)
        case Point():
            return node.coordinates
        case List():
            return node.items
        case Weighted():
            return tuple(part for pair in zip(node.items, node.weights, strict=True) for part in pair)
        case Range():
            return (node.lowest, node.highest)
        case Quantifier():
            return (node.domain, node.body)
        case Member():
            return (node.base,)
        case Index():
            return (node.base, node.index)
        case Temporal():
            return (*_ends(node.window), node.value)
        case Until():
            return (node.left, *_ends(node.window), node.right)
        case _:
            return ()


def walk(
    root: Expr | Argument, visible: frozenset[str] = frozenset(), into: Callable[[Expr | Argument], bool] | None = None
) -> Iterator[tuple[Expr | Argument, frozenset[str]]]:
    """An expression and all below it, in the order of the text, each with the variables that it can name: `visible` and
    those of the quantifiers around. What is below a node is left out where `into` says so."""
    stack = [(root, visible)]
    while stack:
        node, visible = stack.pop()
        yield node, visible
        if into is not None and not into(node):
            continue
        if isinstance(node, Quantifier):
            stack.append((node.body, visible.union(variable.id for variable in node.variables)))
            stack.append((node.domain, visible))
        else:
            stack.extend((child, visible) for child in reversed(children(node)))


def _ends(window: Interval | None) -> tuple[Expr, ...]:
    return () if window is None else (window.lowest, window.highest)


def expressions(statement: Statement) -> tuple[Expr, ...]:
    """The expressions of a statement, in the order of the text."""
    match statement:
        case Workspace(x, y):
            return (x.lowest, x.highest, y.lowest, y.highest)
        case Objects(declarations):
            parts = (part for one in declarations for part in (one.count, one.shape, one.support, one.pose))
            return tuple(part for part in parts if part is not None)
        case Definition(_, parameters, body):
            return (*(one.default for one in parameters if one.default is not None), body)
        case Region(_, shape, count, levels):
            return (shape, *levels) if count is None else (count, shape, *levels)
        case Constant():
            return (statement.value,)
        case CameraDeclaration(_, eye, target, field_of_view, width, height):
            return (eye, target, field_of_view, width, height)
        case Usually(things, distribution):
            return (*things, distribution)
        case Import():
            return (statement.path,)
        case Time():
            return (*_ends(statement.span_), statement.amount)
        case Moves():
            return ()
        case _:
            return (statement.formula,)


def same(one: Module, other: Module) -> bool:
    """Whether two modules say the same; unlike `==` without recursion."""
    stack: list[tuple[Any, Any]] = [((one.statements, one.bare), (other.statements, other.bare))]
    while stack:
        first, second = stack.pop()
        if type(first) is not type(second):
            return False
        if isinstance(first, tuple):
            if len(first) != len(second):
                return False
            stack.extend(zip(first, second, strict=True))
        elif isinstance(first, Node):
            names = (item.name for item in fields(first) if item.compare)
            stack.extend((getattr(first, name), getattr(second, name)) for name in names)
        elif first != second:
            return False
    return True
