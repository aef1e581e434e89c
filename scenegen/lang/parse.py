"""Text -> syntax tree."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import Any

from lark import Lark
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.syntax import (
    BINARY_FILE,
    CANNOT_PARSE,
    EMPTY_SPEC,
    HALF_CHARACTER,
    NESTED_TOO_DEEPLY,
    NOT_UTF8,
    ODD_LINE_BREAK,
    SPEC_TOO_LONG,
    TOO_MANY_QUANTIFIERS,
)
from scenegen.errors.temporal import TOO_MANY_OVER_TIME
from scenegen.lang import ast, traversal
from scenegen.lang import parser_tables as tables
from scenegen.lang.build import Builder
from scenegen.lang.recovery import blank, next_opening
from scenegen.lang.tokens import TEMPORAL, has_time, scan

_ODD_BREAKS = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")

_OVER_TIME = re.compile(rf"\b(?:{'|'.join(sorted(TEMPORAL))})\b")

_SURROGATES = re.compile("[\ud800-\udfff]")  # halves of characters: text in memory can hold one alone, no file can

MAX_CHARACTERS = 16_000_000
MAX_NESTING = 20_000
MAX_OVER_TIME = 20_000  # operators of time, written out
MAX_QUANTIFIERS = 100  # inside each other: whatever walks a formula carries the variables along
MOST_ERRORS = 20  # of one run; more than that usually come from one mistake

_STATEMENT_RULES = frozenset(
    "workspace objects region const define require import_ label time_steps time_span moves".split()
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
    builder = _Keeping()
    timed = has_time(source.text)
    many = _too_many_over_time(source) if timed else None
    if many is not None:
        return None, [many]
    tree, problems = _statement_by_statement(source, tables.parser(builder, timed), timed, builder.kept)
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
        return BINARY_FILE(file=source.name)
    odd = _ODD_BREAKS.search(text)
    if odd is not None:
        # Some editors show a new line here, the comment rule of the grammar does not see one: better to ask.
        here = Span(source, odd.start(), odd.end())
        return ODD_LINE_BREAK(here, point=ord(odd[0]))
    half = _SURROGATES.search(text)
    if half is not None:
        here = Span(source, half.start(), half.end())
        return HALF_CHARACTER(here, point=ord(half[0]))
    if not _has_content(text):
        return EMPTY_SPEC(Span(source, len(text), len(text)), file=source.name)
    return None


def _module(source: Source, tree: Any) -> ast.Module:
    return ast.Module(source, tuple(tree), None) if isinstance(tree, list) else ast.Module(source, (), tree)


class _Keeping:
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
            from scenegen.lang.syntax_errors import explain, stop  # five modules that correct specs do not need

            problem, stopped = explain(Source(source.name, text), error, timed), stop(text, error)
        except UnexpectedInput as error:  # Lark has no other kind today
            return None, [*problems, CANNOT_PARSE(file=source.name, reason=str(error))]
        problem = _here(problem, source)
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


def _here(problem: Diagnostic, source: Source) -> Diagnostic:
    """A diagnostic about the blanked text, about the whole one."""
    if problem.span is None:
        return problem
    return replace(problem, span=Span(source, problem.span.start, problem.span.end))


@cache
def _parser(timed: bool) -> Lark:
    return tables.parser(Builder(), timed)


def _has_content(text: str) -> bool:
    return any(line.split("#", 1)[0].strip() for line in text.splitlines())


def _too_deep(module: ast.Module) -> Diagnostic | None:
    """No reader of the tree recurses, so depth is bounded by choice, not by Python's stack."""
    roots = [expr for statement in module.statements for expr in traversal.expressions(statement)]
    roots = roots if module.bare is None else [module.bare]
    level: list[Any] = roots
    quantifiers = 0
    for _ in range(MAX_NESTING):
        if not level:
            return _too_many_quantifiers(module.source, roots) if quantifiers > MAX_QUANTIFIERS else None
        quantifiers += sum(isinstance(node, ast.Quantifier) for node in level)
        level = [child for node in level for child in traversal.children(node)]
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
            return TOO_MANY_QUANTIFIERS(node.span(source), limit=MAX_QUANTIFIERS)
        stack.extend((child, inside) for child in reversed(traversal.children(node)))
    return None


def _too_many_over_time(source: Source) -> Diagnostic | None:
    """Told before the text is parsed, which would take many seconds."""
    if sum(1 for _ in _OVER_TIME.finditer(source.text)) <= MAX_OVER_TIME:
        return None
    words = (token for token in scan(source.text, timed=True) if token.kind == "name" and token.text in TEMPORAL)
    beyond = next(islice(words, MAX_OVER_TIME, None), None)
    return None if beyond is None else TOO_MANY_OVER_TIME(Span(source, beyond.start, beyond.end), limit=MAX_OVER_TIME)


def plain_breaks(text: str) -> str:
    """Line breaks of Windows and of old Macs become plain ones: a comment must end where people see it end."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_source(name: str, data: bytes) -> Source:
    """A spec file's bytes as text. Raises SpecError for binary data and for what is not UTF-8."""
    if b"\0" in data[:8192] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SpecError(BINARY_FILE(file=name))
    try:
        return Source(name, plain_breaks(data.decode("utf-8-sig")))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start]
        raise SpecError(NOT_UTF8(file=name, byte=byte, line=line)) from None
