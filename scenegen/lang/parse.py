"""Text -> syntax tree."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from lark import Lark
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.lang import ast, tables
from scenegen.lang.build import Builder
from scenegen.lang.syntax_errors import explain

_ODD_BREAKS = re.compile("[\v\f\x1c-\x1e\x85\u2028\u2029]")

MAX_CHARACTERS = 16_000_000
MAX_NESTING = 20_000


def parse(source: Source) -> ast.Module:
    """The syntax tree of a spec's text. Raises SpecError with one diagnostic for the first mistake."""
    text = source.text
    if len(text) > MAX_CHARACTERS:
        size = f"{len(text):,} characters; the limit is {MAX_CHARACTERS:,}"
        raise SpecError(Diagnostic(f"{source.name} is too long: {size}"))
    if "\0" in text:
        raise SpecError(Diagnostic(f"{source.name} is a binary file", help="a spec is a text file in UTF-8"))
    odd = _ODD_BREAKS.search(text)
    if odd is not None:
        # Some editors show a new line here, the comment rule of the grammar does not see one: better to ask.
        here = Span(source, odd.start(), odd.end())
        title = f"character U+{ord(odd[0]):04X} cannot stand in a spec"
        raise SpecError(
            Diagnostic(title, here, "some programs take it for a line break", "put a plain line break here")
        )
    if not _has_content(text):
        raise SpecError(
            Diagnostic(
                f"{source.name} is empty",
                Span(source, len(text), len(text)),
                "there is no formula here",
                "write one, for instance: leftOf(mug, plate)",
            )
        )
    try:
        tree: Any = _parser().parse(text)
    except (UnexpectedToken, UnexpectedCharacters) as error:
        raise SpecError(explain(source, error)) from None
    except UnexpectedInput as error:  # Lark has no other kind today
        raise SpecError(Diagnostic(f"cannot parse {source.name}: {error}")) from None
    module = ast.Module(source, tuple(tree), None) if isinstance(tree, list) else ast.Module(source, (), tree)
    _limit_nesting(module)
    return module


@cache
def _parser() -> Lark:
    return tables.parser(Builder())


def _has_content(text: str) -> bool:
    return any(line.split("#", 1)[0].strip() for line in text.splitlines())


def _limit_nesting(module: ast.Module) -> None:
    """No reader of the tree recurses, so depth is bounded by choice, not by Python's stack."""
    roots = [expr for statement in module.statements for expr in ast.expressions(statement)]
    level: list[Any] = roots if module.bare is None else [module.bare]
    for _ in range(MAX_NESTING):
        if not level:
            return
        level = [child for node in level for child in ast.children(node)]
    if level:
        raise SpecError(
            Diagnostic(
                "this formula is nested too deeply",
                level[0].span(module.source),
                f"more than {MAX_NESTING:,} levels down",
                "split it: give parts of it a name with `def`",
            )
        )


def plain_breaks(text: str) -> str:
    """Line breaks of Windows and of old Macs become plain ones: a comment must end where people see it end."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_source(name: str, data: bytes) -> Source:
    """A spec file's bytes as text. Raises SpecError for binary data and for what is not UTF-8."""
    if b"\0" in data[:8192] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SpecError(Diagnostic(f"{name} is a binary file", help="a spec is a text file in UTF-8"))
    try:
        return Source(name, plain_breaks(data.decode("utf-8-sig")))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = f"byte 0x{data[error.start]:02x} in line {line}"
        raise SpecError(
            Diagnostic(f"{name} is not UTF-8: {byte}", help="save the file as UTF-8 in your editor")
        ) from None
