"""`scenegen specs`: the specs that ship with scenegen."""

from __future__ import annotations

import typer

from scenegen.cli.options import argument, spec_names
from scenegen.errors.requests import UNKNOWN_SHIPPED_SPEC


def specs(
    name: str | None = argument("Print the text of this one.", "NAME", default=None, autocompletion=spec_names),
) -> None:
    """List the specs that ship with scenegen, or print one. Other commands take them by name.

    \b
      scenegen specs
      scenegen specs table_setting
      scenegen specs table_setting > my.spec
      scenegen sample table_setting --phi 0: --render pictures

    A file NAME or NAME.spec in the current folder comes before the shipped spec NAME.
    """
    from scenegen.cli.streams import write_data
    from scenegen.errors import RequestError
    from scenegen.resources import shipped_specs

    shipped = shipped_specs()
    if name is not None:
        if name not in shipped:
            raise RequestError(UNKNOWN_SHIPPED_SPEC(name=name, known=shipped))
        write_data(shipped[name].read_bytes())
        return
    wide = max(map(len, shipped))
    for one, path in shipped.items():
        first = path.read_text(encoding="utf-8").partition("\n")[0]
        typer.echo(f"{one:<{wide}}  {first.removeprefix('#').strip() if first.startswith('#') else ''}".rstrip())
