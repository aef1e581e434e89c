"""`scenegen explain`: what a diagnostic means, by its code; relations, words and pages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from scenegen.errors.catalog import Entry


def _codes(incomplete: str) -> list[str]:
    from scenegen.errors.catalog import catalog
    from scenegen.resources import PAGES

    return [code for code in (*PAGES, *catalog()) if code.startswith(incomplete)]


def explain(
    code: Annotated[
        str | None,
        typer.Argument(
            help="The code in brackets, a relation, a word or a page.",
            metavar="CODE|NAME",
            show_default=False,
            autocompletion=_codes,
        ),
    ] = None,
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
    from scenegen.cli.relations import described
    from scenegen.errors import RequestError
    from scenegen.errors.catalog import GROUPS, catalog
    from scenegen.errors.program import UNKNOWN_CODE
    from scenegen.lang.other_words import SIGNS, of_relation
    from scenegen.lsp.vocabulary import CLAUSES, KEYWORDS
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
    elif relation := list(described(code)):
        typer.echo("\n".join(relation))
    elif instead := {**KEYWORDS, **CLAUSES, **SIGNS}.get(code) or of_relation(code, ()):
        typer.echo(f"{code}: {instead}")
    else:
        raise RequestError(UNKNOWN_CODE(name=code, known=[*entries, *PAGES]))


def lines(entry: Entry) -> list[str]:
    """What is printed about one code."""
    out = [f"{entry.kind.severity}[{entry.kind.code}]", "", entry.means]
    if entry.facts:
        out += ["", f"Facts: {', '.join(entry.facts)}"]
    for title, text in (("Example:", entry.example), ("Mended:", entry.mended)):
        if text:
            out += ["", title, "", *(f"  {line}" for line in text.splitlines())]
    return out
