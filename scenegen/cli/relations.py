"""`scenegen relations`: the relations and functions of the language, in the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import Annotated

import typer

WIDE = 100  # columns of a text


def _names(incomplete: str) -> list[str]:
    from scenegen.lang.relations import groups
    from scenegen.lang.scope import signatures

    names = *(entry.name for group in groups() for entry in group.entries), *signatures()
    return [name for name in names if name.startswith(incomplete)]


def relations(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A relation or function; all if left out.", metavar="NAME", show_default=False, autocompletion=_names
        ),
    ] = None,
) -> None:
    """List the relations and functions of the language, or show one: its meaning, definition and defaults.

    \b
      scenegen relations
      scenegen relations closeTo
      scenegen relations near

    A name of another language, such as `near`, gets the one that it has here.
    """
    from scenegen.errors import RequestError
    from scenegen.errors.language import UNKNOWN_RELATION
    from scenegen.lang.other_words import of_relation
    from scenegen.lang.relations import groups

    known = [one.name for group in groups() for one in group.entries]
    if name is None:
        typer.echo("\n".join(listed()))
    elif told := list(described(name)):
        typer.echo("\n".join(told))
    else:
        raise RequestError(
            UNKNOWN_RELATION(name=name, known=[*known, *_functions()], relations=known, instead=of_relation(name, ()))
        )


def listed() -> Iterator[str]:
    """A line or two for each relation and function: how it is called, and what it means."""
    from scenegen.lang.relations import groups

    for group in groups():
        yield from (*wrap(f"{group.title[0].upper()}{group.title[1:]}", WIDE), "")
        for one in group.entries:
            yield from _line(one.usage, one.meaning.split(". ")[0].rstrip(".:"))
        yield ""
    yield from ("Functions", "")
    for usage, meaning in _functions().values():
        yield from _line(usage, meaning)


def _line(usage: str, meaning: str) -> list[str]:
    return [f"  {usage}", *wrap(meaning, WIDE, initial_indent=" " * 6, subsequent_indent=" " * 6)]


def described(name: str) -> Iterator[str]:
    """All about one relation or function; nothing for other names."""
    from scenegen.lang.print import print_statement
    from scenegen.lang.relations import defaults, groups

    entry = next((one for group in groups() for one in group.entries if one.name == name), None)
    if entry is None:
        if name in _functions():
            usage, meaning = _functions()[name]
            yield from (usage, "", *wrap(meaning, WIDE))
        return
    yield from (entry.usage, "", *wrap(entry.meaning, WIDE), "", "Definition:", "")
    yield from (f"  {line}" for line in print_statement(entry.definition).splitlines())
    values = defaults(entry.definition)
    if values:
        yield from ("", f"Defaults: {', '.join(f'{constant} = {value}' for constant, value in values.items())}")


def _functions() -> dict[str, tuple[str, str]]:
    """Usage and meaning of the functions that no definition makes, those of a step behind them."""
    from scenegen.lang.scope import STEPS, signatures
    from scenegen.lsp.vocabulary import functions

    found = {name: functions()[name] for name in signatures()}
    return found | {name: (signatures(True)[name].usage, f"{words} (with `time`)") for name, words in STEPS.items()}
