"""`scenegen explain`: what a diagnostic means, by its code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from scenegen.errors.catalog import Entry


def _codes(incomplete: str) -> list[str]:
    from scenegen.errors.catalog import catalog

    return [code for code in catalog() if code.startswith(incomplete)]


def explain(
    code: Annotated[
        str | None,
        typer.Argument(help="The code in brackets.", metavar="CODE", show_default=False, autocompletion=_codes),
    ] = None,
) -> None:
    """Explain an error or warning by its code: what it means, its facts, an example, and the example mended.

    \b
      scenegen explain
      scenegen explain unknown-relation

    Without a code, all codes are listed. Codes stay the same from version to version; texts may change. Facts are
    what `check --json`, editors and Python have as data.
    """
    from scenegen.errors import RequestError
    from scenegen.errors.catalog import GROUPS, catalog
    from scenegen.errors.program import UNKNOWN_CODE

    entries = catalog()
    if code is None:
        wide = max(map(len, entries))
        for group, title in GROUPS.items():
            typer.echo(f"{title}:")
            for one in entries.values():
                if one.group == group:
                    typer.echo(f"  {one.kind.code:<{wide}}  {one.means.split('. ')[0].rstrip('.')}")
        return
    code = code.strip("[]")
    if code not in entries:
        raise RequestError(UNKNOWN_CODE(name=code, known=entries))
    typer.echo("\n".join(lines(entries[code])))


def lines(entry: Entry) -> list[str]:
    """What is printed about one code."""
    out = [f"{entry.kind.severity}[{entry.kind.code}]", "", entry.means]
    if entry.facts:
        out += ["", f"Facts: {', '.join(entry.facts)}"]
    for title, text in (("Example:", entry.example), ("Mended:", entry.mended)):
        if text:
            out += ["", title, "", *(f"  {line}" for line in text.splitlines())]
    return out
