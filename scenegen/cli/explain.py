"""`scenegen explain`: what a diagnostic means, by its code; relations, words and pages."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import TYPE_CHECKING

import typer

from scenegen.cli.options import argument
from scenegen.errors import RequestError
from scenegen.errors.program import UNKNOWN_CODE

if TYPE_CHECKING:
    from scenegen.errors.catalog import CatalogEntry


def _codes(incomplete: str) -> list[str]:
    from scenegen.errors.catalog import catalog
    from scenegen.resources import PAGES

    return [code for code in (*PAGES, *catalog()) if code.startswith(incomplete)]


def explain(
    code: str | None = argument(
        "The code in brackets, a relation, a word or a page.", "CODE|NAME", default=None, autocompletion=_codes
    ),
) -> None:
    """Explain an error or warning by its code: what it means, its facts, an example, and the example mended.

    \b
      scenegen explain
      scenegen explain unknown-relation
      scenegen explain closeTo
      scenegen explain not-here

    Without a code, all codes and pages are listed. Codes stay the same from version to version; texts may change. Facts
    are what `check --json`, editors and Python have as data. A relation or function is shown as by `scenegen
    relations`; a page of the documentation is printed whole; a word of another language gets what to write for it here.
    """
    from scenegen.editors.lsp.names import CLAUSE_TEXTS, KEYWORDS_IN_WORDS
    from scenegen.errors.catalog import GROUPS, catalog
    from scenegen.lang.syntax.foreign import SIGNS, of_relation
    from scenegen.resources import PAGES, shipped_pages

    entries = catalog()
    if code is None:
        wide = max(map(len, entries))
        for group, title in GROUPS.items():
            typer.echo(f"{title}:")
            for one in entries.values():
                if one.group == group:
                    typer.echo(f"  {one.kind.code:<{wide}}  {one.means.split('. ')[0].rstrip('.')}")
        typer.echo(f"Pages:\n  {', '.join(PAGES)}")
        return
    code = code.strip("[]")
    if code in entries:
        typer.echo("\n".join(lines(entries[code])))
    elif code in PAGES:
        typer.echo(shipped_pages()[code].read_text(encoding="utf-8"), nl=False)
    elif relation := list(describe_relation(code)):
        typer.echo("\n".join(relation))
    elif instead := {**KEYWORDS_IN_WORDS, **CLAUSE_TEXTS, **SIGNS}.get(code) or of_relation(code, ()):
        typer.echo(f"{code}: {instead}")
    else:
        raise RequestError(UNKNOWN_CODE(name=code, known=[*entries, *PAGES]))


def lines(entry: CatalogEntry) -> list[str]:
    """What is printed about one code."""
    out = [f"{entry.kind.severity}[{entry.kind.code}]", "", entry.means]
    if entry.facts:
        out += ["", f"Facts: {', '.join(entry.facts)}"]
    for title, text in (("Example:", entry.example), ("Mended:", entry.mended)):
        if text:
            out += ["", title, "", *(f"  {line}" for line in text.splitlines())]
    return out


TEXT_WIDTH = 100  # columns of a text


def _names(incomplete: str) -> list[str]:
    from scenegen.lang.check.scope import groups, signatures

    names = *(entry.name for group in groups() for entry in group.entries), *signatures()
    return [name for name in names if name.startswith(incomplete)]


def relations(
    name: str | None = argument(
        "A relation or function; all if left out.", "NAME", default=None, autocompletion=_names
    ),
) -> None:
    """List the relations and functions of the language, or show one: its meaning, definition and defaults.

    \b
      scenegen relations
      scenegen relations closeTo
      scenegen relations near

    A name of another language, such as `near`, gets the one that it has here.
    """
    from scenegen.errors.language import UNKNOWN_RELATION
    from scenegen.lang.check.scope import groups
    from scenegen.lang.syntax.foreign import of_relation

    known = [one.name for group in groups() for one in group.entries]
    if name is None:
        typer.echo("\n".join(list_relations()))
    elif told := list(describe_relation(name)):
        typer.echo("\n".join(told))
    else:
        raise RequestError(
            UNKNOWN_RELATION(name=name, known=[*known, *_functions()], relations=known, instead=of_relation(name, ()))
        )


def list_relations() -> Iterator[str]:
    """A line or two for each relation and function: how it is called, and what it means."""
    from scenegen.lang.check.scope import groups

    for group in groups():
        yield from (*wrap(f"{group.title[0].upper()}{group.title[1:]}", TEXT_WIDTH), "")
        for one in group.entries:
            yield from _line(one.usage, one.meaning.split(". ")[0].rstrip(".:"))
        yield ""
    yield from ("Functions", "")
    for usage, meaning in _functions().values():
        yield from _line(usage, meaning)


def _line(usage: str, meaning: str) -> list[str]:
    return [f"  {usage}", *wrap(meaning, TEXT_WIDTH, initial_indent=" " * 6, subsequent_indent=" " * 6)]


def describe_relation(name: str) -> Iterator[str]:
    """All about one relation or function; nothing for other names."""
    from scenegen.lang.check.scope import defaults, groups
    from scenegen.lang.syntax.printer import print_statement

    entry = next((one for group in groups() for one in group.entries if one.name == name), None)
    if entry is None:
        if name in _functions():
            usage, meaning = _functions()[name]
            yield from (usage, "", *wrap(meaning, TEXT_WIDTH))
        return
    yield from (entry.usage, "", *wrap(entry.meaning, TEXT_WIDTH), "", "Definition:", "")
    yield from (f"  {line}" for line in print_statement(entry.definition).splitlines())
    values = defaults(entry.definition)
    if values:
        yield from ("", f"Defaults: {', '.join(f'{constant} = {value}' for constant, value in values.items())}")


def _functions() -> dict[str, tuple[str, str]]:
    """Usage and meaning of the functions that no definition makes, those of a step behind them."""
    from scenegen.editors.lsp.names import functions
    from scenegen.lang.check.scope import STEPS, signatures

    found = {name: functions()[name] for name in signatures()}
    return found | {name: (signatures(True)[name].usage, f"{words} (with `time`)") for name, words in STEPS.items()}
