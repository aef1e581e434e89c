"""Text -> syntax tree."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import Any, NamedTuple

import lark
from lark import Lark, Token
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.language import CANNOT_PARSE, NESTED_TOO_DEEPLY, NO_FORMULA, NOT_UTF8, ODD_CHARACTER, SPEC_TOO_LONG
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.tokens import TEMPORAL, blank, has_time, next_opening, scan
from scenegen.resources import grammar_file

# The parser, from tables that were computed ahead of time.
#
# Building an LALR parser from grammar/spec.lark takes Lark a quarter of a second, half of what `scenegen check` may
# take in all; reading finished tables takes 10 ms. The tables are JSON beside the grammar, and are used only if they
# were made from this very grammar text by this very version of Lark: otherwise the parser is built from the text.
# `make derived` rewrites them, and a test holds them equal to the grammar. See docs/adr/0001-parser-tables.md.


PARSER_TABLES = {False: "spec.tables.json", True: "time.tables.json"}  # without time, and with it
UNBOUNDED = (1 << 32) - 1  # how long a text may be that a terminal matches: from Python 3.11.7 on, Lark says 2^64
_TIMED, _UNTIMED = "//time ", "// untimed\n"  # what marks a line that counts with time only, without time only
_OPTIONS: dict[str, Any] = {"parser": "lalr", "maybe_placeholders": False, "keep_all_tokens": True}


def fingerprint(text: str) -> str:
    """What finished tables must have been made from."""
    return hashlib.sha256(f"lark {lark.__version__}\n{_OPTIONS}\n{text}".encode()).hexdigest()


def build(text: str, **options: Any) -> lark.Lark:
    """The parser of a grammar text, from scratch."""
    return lark.Lark(text, **_OPTIONS, **options)


def serialize(text: str) -> str:
    """The tables of a grammar text as JSON."""
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    data, memo = build(text).memo_serialize([TerminalDef, Rule])
    data["parser"]["parser"] = _renumber(data["parser"]["parser"])
    for entry in memo.values():
        if "_width" in entry.get("pattern", ()):
            entry["pattern"]["_width"] = [min(width, UNBOUNDED) for width in entry["pattern"]["_width"]]
    tables = {"fingerprint": fingerprint(text), "data": data, "memo": memo}
    return json.dumps(tables, separators=(",", ":"), sort_keys=True, ensure_ascii=True) + "\n"


def _renumber(table: dict[str, Any]) -> dict[str, Any]:
    """The parse table with tokens in alphabetical order and states as they are met from the start.

    Lark numbers both as sets happen to be ordered, which differs from run to run.
    """
    names = table["tokens"]
    moves = {
        state: sorted(((names[token], action) for token, action in row.items()), key=lambda move: str(move[0]))
        for state, row in table["states"].items()
    }
    order = dict.fromkeys(table["start_states"].values())
    queue = list(order)
    for state in queue:
        for _, (kind, argument) in moves[state]:
            if kind == 0 and argument not in order:  # a shift or goto, to that state
                order[argument] = None
                queue.append(argument)
    number = {state: index for index, state in enumerate(order)}
    token = {name: index for index, name in enumerate(sorted(names.values()))}
    return table | {
        "tokens": {index: name for name, index in token.items()},
        "states": {
            number[state]: {
                token[name]: (kind, argument if kind else number[argument]) for name, (kind, argument) in moves[state]
            }
            for state in order
        },
        "start_states": {name: number[state] for name, state in table["start_states"].items()},
        "end_states": {name: number[state] for name, state in table["end_states"].items()},
    }


def _whole_number_keys(pairs: dict[str, Any]) -> dict[Any, Any]:
    """JSON turned Lark's integer keys (parser states, memo entries) into strings."""
    return {int(key) if key.isdigit() else key: value for key, value in pairs.items()}


@cache
def grammar_text(timed: bool) -> str:
    """The grammar of specs without time, or of those with it: some lines of the one file count in one of them only."""
    lines = grammar_file("spec.lark").read_text(encoding="utf-8").splitlines(keepends=True)
    if timed:
        lines = [line for line in lines if not line.endswith(_UNTIMED)]
    return "".join(line.removeprefix(_TIMED) if timed else line for line in lines)


@cache
def _read_tables(timed: bool) -> Any:
    try:
        raw = grammar_file(PARSER_TABLES[timed]).read_text(encoding="utf-8")
        tables = json.loads(raw, object_hook=_whole_number_keys)
        return tables if tables["fingerprint"] == fingerprint(grammar_text(timed)) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def parser(transformer: Any, timed: bool = False) -> lark.Lark:
    """A parser that hands each reduced rule to the method of that name of `transformer`; `timed`, for a spec with
    time."""
    tables = _read_tables(timed)
    if tables is None:
        return build(grammar_text(timed), transformer=transformer)
    load: Any = lark.Lark._load_from_dict  # what Lark's own standalone parsers call
    loaded: lark.Lark = load(tables["data"], tables["memo"], transformer=transformer)
    return loaded


def main() -> None:
    """Rewrite the tables (`make tables`)."""
    for timed, name in PARSER_TABLES.items():
        grammar_file(name).write_text(serialize(grammar_text(timed)), encoding="utf-8")


if __name__ == "__main__":
    main()


# From Lark's reductions to the syntax tree.
#
# Lark calls the method named like the rule as soon as the rule is recognised, with the finished parts as `items`:
# tokens and nodes in the order of the text. So a tree as deep as you like is built without recursion. The builder
# keeps no state: offsets are enough, the module adds the source.


# margins know no strictness: `<` means `<=`, and the tree says so
_COMPARE = {"≤": "<=", "≥": ">=", "≠": "!=", "<": "<=", ">": ">="}
_NUMBER = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*([a-z]*(?:/s)?|%)$")


class _DeclarationPart(NamedTuple):
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


def _extent(items: list[Any]) -> dict[str, int]:
    return {"start": _start(items[0]), "end": _end(items[-1])}


def _nodes(items: list[Any]) -> list[Any]:
    return [item for item in items if not isinstance(item, Token)]


def _name(token: Token) -> ast.Name:
    return ast.Name(str(token), start=_start(token), end=_end(token))


def _names(items: list[Any]) -> list[ast.Name]:
    return [_name(item) for item in items if isinstance(item, Token) and item.type in ("NAME", "LABEL")]


class Builder:
    """One method per rule of the grammar."""

    def start(self, items: list[Any]) -> list[ast.Statement]:
        return items

    def bare(self, items: list[Any]) -> ast.Expr:
        expr: ast.Expr = items[0]
        return expr

    def workspace(self, items: list[Any]) -> ast.Workspace:
        x, y = _nodes(items)
        return ast.Workspace(x, y, **_extent(items))

    def interval(self, items: list[Any]) -> ast.Interval:
        lowest, highest = _nodes(items)
        return ast.Interval(lowest, highest, **_extent(items))

    def objects(self, items: list[Any]) -> ast.Objects:
        return ast.Objects(tuple(_nodes(items)), **_extent(items))

    def robots(self, items: list[Any]) -> ast.Objects:
        return ast.Objects(tuple(replace(one, robot=True) for one in _nodes(items)), **_extent(items))

    def decl(self, items: list[Any]) -> ast.Declaration:
        parts = {part.kind: part.value for part in items if isinstance(part, _DeclarationPart)}
        (name,) = _names(items)
        count, shape, pose, support = (parts.get(kind) for kind in ("count", "shape", "pose", "support"))
        choice: ast.Chosen = next(
            (part.choice for part in items if isinstance(part, _DeclarationPart) and part.choice), ""
        )
        return ast.Declaration(name, count, shape, pose, support, choice, False, **_extent(items))

    def count(self, items: list[Any]) -> _DeclarationPart:
        (count,) = _nodes(items)
        return _DeclarationPart("count", count, _start(items[0]), _end(items[-1]))

    def shape(self, items: list[Any]) -> _DeclarationPart:
        return _DeclarationPart("shape", items[1], _start(items[0]), _end(items[-1]))

    def support(self, items: list[Any]) -> _DeclarationPart:
        words = {item.type for item in items if isinstance(item, Token)}
        (surface,) = _nodes(items)
        choice: ast.Chosen = "area" if "BY_AREA" in words else "equal" if "ANY" in words else ""
        return _DeclarationPart("support", surface, _start(items[0]), _end(items[-1]), choice)

    def pose(self, items: list[Any]) -> _DeclarationPart:
        return _DeclarationPart("pose", items[1], _start(items[0]), _end(items[-1]))

    def region(self, items: list[Any]) -> ast.Region:
        parts = [item for item in items if not isinstance(item, Token)]
        counts = [part.value for part in parts if isinstance(part, _DeclarationPart)]
        levels = next((tuple(part) for part in parts if isinstance(part, _Levels)), ())
        (shape,) = (part for part in parts if not isinstance(part, _DeclarationPart | _Levels))
        count = counts[0] if counts else None
        return ast.Region(_name(items[1]), shape, count, levels, **_extent(items))

    def levels(self, items: list[Any]) -> _Levels:
        return _Levels(_nodes(items))

    def const(self, items: list[Any]) -> ast.Constant:
        return ast.Constant(_name(items[1]), items[3], **_extent(items))

    def camera(self, items: list[Any]) -> ast.CameraDeclaration:
        eye, target, field, width, height = _nodes(items)
        return ast.CameraDeclaration(_name(items[1]), eye, target, field, width, height, **_extent(items))

    def usually(self, items: list[Any]) -> ast.Usually:
        *things, distribution = _nodes(items)
        return ast.Usually(tuple(things), distribution, **_extent(items))

    def define(self, items: list[Any]) -> ast.Definition:
        *parameters, body = _nodes(items)
        return ast.Definition(_name(items[1]), tuple(parameters), body, **_extent(items))

    def param(self, items: list[Any]) -> ast.Parameter:
        return ast.Parameter(_name(items[0]), items[2] if len(items) > 1 else None, **_extent(items))

    def require(self, items: list[Any]) -> ast.Require:
        return ast.Require(items[1], **_extent(items))

    def import_(self, items: list[Any]) -> ast.Import:
        return ast.Import(self.string(items[1:]), **_extent(items))

    def label(self, items: list[Any]) -> ast.Label:
        return ast.Label(_name(items[0]), items[2], **_extent(items))

    def time_steps(self, items: list[Any]) -> ast.Time:
        return ast.Time(items[1], _name(items[2]), None, **_extent(items))

    def time_span(self, items: list[Any]) -> ast.Time:
        return ast.Time(items[3], None, items[1], **_extent(items))

    def moves(self, items: list[Any]) -> ast.Moves:
        return ast.Moves(_name(items[1]), **_extent(items))

    def implies(self, items: list[Any]) -> ast.Implies:
        return ast.Implies(items[0], items[2], **_extent(items))

    def disjunction(self, items: list[Any]) -> ast.Or:
        return ast.Or(tuple(_nodes(items)), **_extent(items))

    def conjunction(self, items: list[Any]) -> ast.And:
        return ast.And(tuple(_nodes(items)), **_extent(items))

    def negation(self, items: list[Any]) -> ast.Not:
        return ast.Not(items[1], **_extent(items))

    def temporal(self, items: list[Any]) -> ast.Temporal:
        operator: Any = str(items[0])
        return ast.Temporal(operator, items[1] if len(items) > 2 else None, items[-1], **_extent(items))

    def until(self, items: list[Any]) -> ast.Until:
        operator: Any = str(items[1])
        return ast.Until(operator, items[2] if len(items) > 3 else None, items[0], items[-1], **_extent(items))

    def quantifier(self, items: list[Any]) -> ast.Quantifier:
        domain, body = _nodes(items)
        kind: Any = "forall" if items[0].type == "FORALL" else "exists"
        return ast.Quantifier(kind, tuple(_names(items)), domain, body, **_extent(items))

    def range(self, items: list[Any]) -> ast.Range:
        lowest, highest = _nodes(items)
        return ast.Range(lowest, highest, **_extent(items))

    def compare(self, items: list[Any]) -> ast.Compare:
        operators: Any = tuple(_COMPARE.get(str(token), str(token)) for token in items[1::2])
        return ast.Compare(tuple(items[0::2]), operators, **_extent(items))

    def binary(self, items: list[Any]) -> ast.Binary:
        left, operator, right = items
        symbol: Any = str(operator)
        return ast.Binary(symbol, left, right, **_extent(items))

    def negative(self, items: list[Any]) -> ast.Negative:
        return ast.Negative(items[1], **_extent(items))

    def name(self, items: list[Any]) -> ast.Name:
        return _name(items[0])

    def member(self, items: list[Any]) -> ast.Member:
        base = _name(items[0]) if isinstance(items[0], Token) else items[0]
        return ast.Member(base, _name(items[2]), **_extent(items))

    def index(self, items: list[Any]) -> ast.Index:
        return ast.Index(items[0], items[2], **_extent(items))

    def call(self, items: list[Any]) -> ast.Call:
        return ast.Call(_name(items[0]), tuple(_nodes(items)), **_extent(items))

    def argument(self, items: list[Any]) -> ast.Argument:
        name = _name(items[0]) if len(items) > 1 else None
        return ast.Argument(name, items[-1], **_extent(items))

    def quantity(self, items: list[Any]) -> ast.Quantity:
        found = _NUMBER.match(items[0])
        if found is None:
            raise AssertionError(f"the grammar let {items[0]!r} pass for a quantity")
        return ast.Quantity(found[1], found[2], **_extent(items))

    def string(self, items: list[Any]) -> ast.Text:
        return ast.Text(str(items[0])[1:-1], **_extent(items[:1]))

    def truth(self, items: list[Any]) -> ast.Truth:
        return ast.Truth(items[0].type == "TRUE", **_extent(items))

    def list_(self, items: list[Any]) -> ast.List:
        return ast.List(tuple(_nodes(items)), **_extent(items))

    def weighted_list(self, items: list[Any]) -> ast.Weighted:
        pairs = _nodes(items)
        return ast.Weighted(tuple(one for one, _ in pairs), tuple(weight for _, weight in pairs), **_extent(items))

    def weight(self, items: list[Any]) -> tuple[ast.Expr, ast.Expr]:
        one, weight = _nodes(items)
        return one, weight

    def point(self, items: list[Any]) -> ast.Point:
        return ast.Point(tuple(_nodes(items)), **_extent(items))

    def parenthesis(self, items: list[Any]) -> ast.Expr:
        # Parentheses leave no node, but what stands in them now reaches from one to the other.
        inner: ast.Expr = items[1]
        return _with_extent(inner, _start(items[0]), _end(items[-1]))


def _with_extent(node: ast.Expr, start: int, end: int) -> ast.Expr:
    fields = {name: getattr(node, name) for name in type(node).__match_args__}
    return type(node)(**fields, start=start, end=end)


_ODD_BREAKS = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")

_OVER_TIME = re.compile(rf"\b(?:{'|'.join(sorted(TEMPORAL))})\b")

_SURROGATES = re.compile("[\ud800-\udfff]")  # halves of characters: text in memory can hold one alone, no file can

MAX_CHARACTERS = 16_000_000
MAX_NESTING = 20_000
MAX_OVER_TIME = 20_000  # operators of time, written out
MAX_QUANTIFIERS = 100  # inside each other: whatever walks a formula carries the variables along
MOST_ERRORS = 20  # of one run; more than that usually come from one mistake

_STATEMENT_RULES = frozenset(
    (
        *"workspace objects robots region const camera usually define require import_ label".split(),
        *"time_steps time_span moves".split(),
    )
)


def parse(source: Source, timed: bool | None = None) -> ast.Module:
    """The syntax tree of a spec's text. Raises SpecError with the first mistake of every statement that has one.

    `timed` says whether the words of time are keywords; left out: where the text has a `time` statement."""
    problem = _unreadable(source)
    if problem is not None:
        raise SpecError(problem)
    timed = has_time(source.text) if timed is None else timed
    many = _too_many_over_time(source) if timed else None
    if many is not None:
        raise SpecError(many)
    tree, problems = _statement_by_statement(source, _parser(timed), timed)
    if problems:
        raise SpecError(*problems)
    module = _module(source, tree)
    deep = _too_deep(module)
    if deep is not None:
        raise SpecError(deep)
    return module


def parse_tolerant(source: Source) -> tuple[ast.Module | None, list[Diagnostic]]:
    """What can be parsed, and what is wrong with the rest: for editors, which meet unfinished texts all the time.

    The module holds the statements that parse, None stands for it where not one does; places are those of the whole
    text. The diagnostics are those that `parse` raises. After MOST_ERRORS of them the rest of the text is left alone.
    """
    problem = _unreadable(source)
    if problem is not None:
        return None, [problem]
    builder = _RecoveringBuilder()
    timed = has_time(source.text)
    many = _too_many_over_time(source) if timed else None
    if many is not None:
        return None, [many]
    tree, problems = _statement_by_statement(source, parser(builder, timed), timed, builder.kept)
    module = _module(source, tree) if not problems else ast.Module(source, tuple(builder.kept), None)
    deep = _too_deep(module)
    if deep is not None:
        return None, [*problems, deep]
    return (module if module.statements or module.bare is not None else None), problems


def _unreadable(source: Source) -> Diagnostic | None:
    """What keeps a text from being read at all."""
    text = source.text
    if len(text) > MAX_CHARACTERS:
        return SPEC_TOO_LONG(file=source.name, characters=len(text), limit=MAX_CHARACTERS)
    if "\0" in text:
        return NOT_UTF8(file=source.name)
    odd = _ODD_BREAKS.search(text)
    if odd is not None:
        # Some editors show a new line here, the comment rule of the grammar does not see one: better to ask.
        here = Span(source, odd.start(), odd.end())
        return ODD_CHARACTER(here, point=ord(odd[0]))
    half = _SURROGATES.search(text)
    if half is not None:
        here = Span(source, half.start(), half.end())
        return ODD_CHARACTER(here, point=ord(half[0]), half=True)
    if not _has_content(text):
        return NO_FORMULA(Span(source, len(text), len(text)), file=source.name, empty=True)
    return None


def _module(source: Source, tree: Any) -> ast.Module:
    return ast.Module(source, tuple(tree), None) if isinstance(tree, list) else ast.Module(source, (), tree)


class _RecoveringBuilder:
    """A builder that keeps every finished statement: what stands before a mistake is not lost with it."""

    def __init__(self) -> None:
        self.kept: list[ast.Statement] = []
        self._builder = Builder()

    def __getattr__(self, rule: str) -> Any:
        build = getattr(self._builder, rule)
        if rule not in _STATEMENT_RULES:
            return build

        def keep(items: list[Any]) -> ast.Statement:
            statement: ast.Statement = build(items)
            self.kept.append(statement)
            return statement

        return keep


def _statement_by_statement(
    source: Source, parser: Lark, timed: bool, kept: list[ast.Statement] | None = None
) -> tuple[Any, list[Diagnostic]]:
    """The tree (of what follows the last mistake) and the first mistake of every statement, at most MOST_ERRORS.

    After a mistake everything up to the next opening of a statement is blanked and the rest parsed on its own: the
    parser's tables stay as they are. With `kept`, a statement that the mistake does not belong to is saved into it.
    """
    problems: list[Diagnostic] = []
    text, begin = source.text, 0
    while True:
        try:
            return parser.parse(text), problems
        except (UnexpectedToken, UnexpectedCharacters) as error:
            from scenegen.lang.syntax.syntax_errors import explain, stop  # five modules that correct specs do not need

            problem, stopped = explain(Source(source.name, text), error, timed), stop(text, error)
        except UnexpectedInput as error:  # Lark has no other kind today
            return None, [*problems, CANNOT_PARSE(file=source.name, reason=str(error))]
        problem = _in_source(problem, source)
        if problem not in problems:
            problems.append(problem)
        if kept is not None and not text[:stopped].rpartition("\n")[2].strip():
            # The mistake opens a line: what stands before it may be a statement in itself.
            done = max(begin, kept[-1].end if kept else 0)
            with contextlib.suppress(UnexpectedInput):
                parser.parse(blank(text[:stopped], begin, done))
        following = next_opening(source.text, begin, stopped)
        if following is None or len(problems) == MOST_ERRORS:
            return None, problems
        text, begin = blank(text, begin, following), following


def _in_source(problem: Diagnostic, source: Source) -> Diagnostic:
    """A diagnostic about the blanked text, about the whole one."""
    if problem.span is None:
        return problem
    return replace(problem, span=Span(source, problem.span.start, problem.span.end))


@cache
def _parser(timed: bool) -> Lark:
    return parser(Builder(), timed)


def _has_content(text: str) -> bool:
    return any(line.split("#", 1)[0].strip() for line in text.splitlines())


def _too_deep(module: ast.Module) -> Diagnostic | None:
    """No reader of the tree recurses, so depth is bounded by choice, not by Python's stack."""
    roots = [expr for statement in module.statements for expr in ast.expressions(statement)]
    roots = roots if module.bare is None else [module.bare]
    level: list[Any] = roots
    quantifiers = 0
    for _ in range(MAX_NESTING):
        if not level:
            return _too_many_quantifiers(module.source, roots) if quantifiers > MAX_QUANTIFIERS else None
        quantifiers += sum(isinstance(node, ast.Quantifier) for node in level)
        level = [child for node in level for child in ast.children(node)]
    if not level:
        return None
    return NESTED_TOO_DEEPLY(level[0].span(module.source), limit=MAX_NESTING)


def _too_many_quantifiers(source: Source, roots: list[Any]) -> Diagnostic | None:
    """The first quantifier that too many others are around."""
    stack = [(root, 0) for root in reversed(roots)]
    while stack:
        node, around = stack.pop()
        inside = around + isinstance(node, ast.Quantifier)
        if inside > MAX_QUANTIFIERS:
            return NESTED_TOO_DEEPLY(node.span(source), limit=MAX_QUANTIFIERS, quantifiers=True)
        stack.extend((child, inside) for child in reversed(ast.children(node)))
    return None


def _too_many_over_time(source: Source) -> Diagnostic | None:
    """Told before the text is parsed, which would take many seconds."""
    if sum(1 for _ in _OVER_TIME.finditer(source.text)) <= MAX_OVER_TIME:
        return None
    words = (token for token in scan(source.text, timed=True) if token.kind == "name" and token.text in TEMPORAL)
    beyond = next(islice(words, MAX_OVER_TIME, None), None)
    return (
        None
        if beyond is None
        else NESTED_TOO_DEEPLY(Span(source, beyond.start, beyond.end), limit=MAX_OVER_TIME, operators=True)
    )


def plain_breaks(text: str) -> str:
    """Line breaks of Windows and of old Macs become plain ones: a comment must end where people see it end."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_source(name: str, data: bytes) -> Source:
    """A spec file's bytes as text. Raises SpecError for binary data and for what is not UTF-8."""
    if b"\0" in data[:8192] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SpecError(NOT_UTF8(file=name))
    try:
        return Source(name, plain_breaks(data.decode("utf-8-sig")))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start]
        raise SpecError(NOT_UTF8(file=name, byte=byte, line=line)) from None
