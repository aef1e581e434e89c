"""From Lark's reductions to the syntax tree.

Lark calls the method named like the rule as soon as the rule is recognised, with the finished parts as `items`: tokens
and nodes in the order of the text. So a tree as deep as you like is built without recursion. The builder keeps no
state: offsets are enough, the module adds the source.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from lark import Token

from scenegen.lang import ast

# margins know no strictness: `<` means `<=`, and the tree says so
_COMPARE = {"≤": "<=", "≥": ">=", "≠": "!=", "<": "<=", ">": ">="}
_NUMBER = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)[ \t]*([a-z]*(?:/s)?)$")


class _Part(NamedTuple):
    """A piece of a declaration on its way to it."""

    kind: str
    value: ast.Expr
    start: int
    end: int
    choice: ast.Chosen = ""


class _Levels(list[ast.Expr]):
    """The heights of a region on their way to it."""

    @property
    def end(self) -> int:
        return self[-1].end


def _start(item: Any) -> int:
    return int(item.start_pos or 0) if isinstance(item, Token) else int(item.start)


def _end(item: Any) -> int:
    return int(item.end_pos or 0) if isinstance(item, Token) else int(item.end)


def _at(items: list[Any]) -> dict[str, int]:
    return {"start": _start(items[0]), "end": _end(items[-1])}


def _nodes(items: list[Any]) -> list[Any]:
    return [item for item in items if not isinstance(item, Token)]


def _name(token: Token) -> ast.Name:
    return ast.Name(str(token), start=_start(token), end=_end(token))


def _names(items: list[Any]) -> list[ast.Name]:
    return [_name(item) for item in items if isinstance(item, Token) and item.type in ("NAME", "LABEL")]


class Builder:
    """One method per rule of the grammar."""

    # ---- the file: statements come as a list, a bare formula as itself

    def start(self, items: list[Any]) -> list[ast.Statement]:
        return items

    def bare(self, items: list[Any]) -> ast.Expr:
        expr: ast.Expr = items[0]
        return expr

    # ---- statements

    def workspace(self, items: list[Any]) -> ast.Workspace:
        x, y = _nodes(items)
        return ast.Workspace(x, y, **_at(items))

    def interval(self, items: list[Any]) -> ast.Interval:
        lowest, highest = _nodes(items)
        return ast.Interval(lowest, highest, **_at(items))

    def objects(self, items: list[Any]) -> ast.Objects:
        return ast.Objects(tuple(_nodes(items)), **_at(items))

    def decl(self, items: list[Any]) -> ast.Declaration:
        parts = {part.kind: part.value for part in items if isinstance(part, _Part)}
        (name,) = _names(items)
        count, shape, pose, support = (parts.get(kind) for kind in ("count", "shape", "pose", "support"))
        choice: ast.Chosen = next((part.choice for part in items if isinstance(part, _Part) and part.choice), "")
        return ast.Declaration(name, count, shape, pose, support, choice, **_at(items))

    def count(self, items: list[Any]) -> _Part:
        return _Part("count", items[1], _start(items[0]), _end(items[-1]))

    def shape(self, items: list[Any]) -> _Part:
        return _Part("shape", items[1], _start(items[0]), _end(items[-1]))

    def support(self, items: list[Any]) -> _Part:
        words = {item.type for item in items if isinstance(item, Token)}
        choice: ast.Chosen = "area" if "BY_AREA" in words else "equal" if "ANY" in words else ""
        (surface,) = _nodes(items)
        return _Part("support", surface, _start(items[0]), _end(items[-1]), choice)

    def pose(self, items: list[Any]) -> _Part:
        return _Part("pose", items[1], _start(items[0]), _end(items[-1]))

    def region(self, items: list[Any]) -> ast.Region:
        parts = [item for item in items if not isinstance(item, Token)]
        counts = [part.value for part in parts if isinstance(part, _Part)]
        levels = next((tuple(part) for part in parts if isinstance(part, _Levels)), ())
        (shape,) = (part for part in parts if not isinstance(part, _Part | _Levels))
        count = counts[0] if counts else None
        return ast.Region(_name(items[1]), shape, count, levels, **_at(items))

    def levels(self, items: list[Any]) -> _Levels:
        return _Levels(_nodes(items))

    def const(self, items: list[Any]) -> ast.Constant:
        return ast.Constant(_name(items[1]), items[3], **_at(items))

    def define(self, items: list[Any]) -> ast.Definition:
        *parameters, body = _nodes(items)
        return ast.Definition(_name(items[1]), tuple(parameters), body, **_at(items))

    def param(self, items: list[Any]) -> ast.Parameter:
        return ast.Parameter(_name(items[0]), items[2] if len(items) > 1 else None, **_at(items))

    def require(self, items: list[Any]) -> ast.Require:
        return ast.Require(items[1], **_at(items))

    def import_(self, items: list[Any]) -> ast.Import:
        return ast.Import(self.string(items[1:]), **_at(items))

    def label(self, items: list[Any]) -> ast.Label:
        return ast.Label(_name(items[0]), items[2], **_at(items))

    def time_steps(self, items: list[Any]) -> ast.Time:
        return ast.Time(items[1], _name(items[2]), None, **_at(items))

    def time_span(self, items: list[Any]) -> ast.Time:
        return ast.Time(items[3], None, items[1], **_at(items))

    def moves(self, items: list[Any]) -> ast.Moves:
        return ast.Moves(_name(items[1]), **_at(items))

    # ---- formulas

    def implies(self, items: list[Any]) -> ast.Implies:
        return ast.Implies(items[0], items[2], **_at(items))

    def disjunction(self, items: list[Any]) -> ast.Or:
        return ast.Or(tuple(_nodes(items)), **_at(items))

    def conjunction(self, items: list[Any]) -> ast.And:
        return ast.And(tuple(_nodes(items)), **_at(items))

    def negation(self, items: list[Any]) -> ast.Not:
        return ast.Not(items[1], **_at(items))

    def temporal(self, items: list[Any]) -> ast.Temporal:
        operator: Any = str(items[0])
        return ast.Temporal(operator, items[1] if len(items) > 2 else None, items[-1], **_at(items))

    def until(self, items: list[Any]) -> ast.Until:
        operator: Any = str(items[1])
        return ast.Until(operator, items[2] if len(items) > 3 else None, items[0], items[-1], **_at(items))

    def quantifier(self, items: list[Any]) -> ast.Quantifier:
        domain, body = _nodes(items)
        kind: Any = "forall" if items[0].type == "FORALL" else "exists"
        return ast.Quantifier(kind, tuple(_names(items)), domain, body, **_at(items))

    def range(self, items: list[Any]) -> ast.Range:
        lowest, highest = _nodes(items)
        return ast.Range(lowest, highest, **_at(items))

    def compare(self, items: list[Any]) -> ast.Compare:
        operators: Any = tuple(_COMPARE.get(str(token), str(token)) for token in items[1::2])
        return ast.Compare(tuple(items[0::2]), operators, **_at(items))

    # ---- numbers and places

    def binary(self, items: list[Any]) -> ast.Binary:
        left, operator, right = items
        symbol: Any = str(operator)
        return ast.Binary(symbol, left, right, **_at(items))

    def negative(self, items: list[Any]) -> ast.Negative:
        return ast.Negative(items[1], **_at(items))

    def name(self, items: list[Any]) -> ast.Name:
        return _name(items[0])

    def member(self, items: list[Any]) -> ast.Member:
        base = _name(items[0]) if isinstance(items[0], Token) else items[0]
        return ast.Member(base, _name(items[2]), **_at(items))

    def index(self, items: list[Any]) -> ast.Index:
        return ast.Index(items[0], items[2], **_at(items))

    def call(self, items: list[Any]) -> ast.Call:
        return ast.Call(_name(items[0]), tuple(_nodes(items)), **_at(items))

    def argument(self, items: list[Any]) -> ast.Argument:
        name = _name(items[0]) if len(items) > 1 else None
        return ast.Argument(name, items[-1], **_at(items))

    def quantity(self, items: list[Any]) -> ast.Quantity:
        found = _NUMBER.match(items[0])
        if found is None:
            raise AssertionError(f"the grammar let {items[0]!r} pass for a quantity")
        return ast.Quantity(found[1], found[2], **_at(items))

    def string(self, items: list[Any]) -> ast.Text:
        return ast.Text(str(items[0])[1:-1], **_at(items[:1]))

    def truth(self, items: list[Any]) -> ast.Truth:
        return ast.Truth(items[0].type == "TRUE", **_at(items))

    def list_(self, items: list[Any]) -> ast.List:
        return ast.List(tuple(_nodes(items)), **_at(items))

    def point(self, items: list[Any]) -> ast.Point:
        return ast.Point(tuple(_nodes(items)), **_at(items))

    def parenthesis(self, items: list[Any]) -> ast.Expr:
        # Parentheses leave no node, but what stands in them now reaches from one to the other.
        inner: ast.Expr = items[1]
        return _moved(inner, _start(items[0]), _end(items[-1]))


def _moved(node: ast.Expr, start: int, end: int) -> ast.Expr:
    fields = {name: getattr(node, name) for name in type(node).__match_args__}
    return type(node)(**fields, start=start, end=end)
