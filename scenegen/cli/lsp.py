"""`scenegen lsp`: the language server, for editors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenegen.errors.files import CANNOT_READ
from scenegen.errors.requests import NOT_INSTALLED


def lsp(
    stdio: Annotated[
        bool, typer.Option("--stdio", help="Talk over standard input and output; there is no other way.")
    ] = True,
    root: Annotated[
        Path | None, typer.Option(help="Specs may import what lies below this folder, not below their own alone.")
    ] = None,
) -> int:
    """Serve editors: mistakes as you type, hover, completion, definitions, formatting and renaming.

    \b
      # what an editor starts
      scenegen lsp --stdio
      # specs that import from a folder above their own
      scenegen lsp --root specs

    It speaks the Language Server Protocol over standard input and output, and ends when the editor says so. How to set
    up an editor is in editors/README.md. Needs the extra `lsp`: pip install "scenegen\\[lsp]".
    """
    from scenegen.errors import RequestError

    del stdio  # editors that know several ways say which one they use
    try:
        from scenegen.editors.lsp.server import serve
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in ("pygls", "lsprotocol"):
            raise
        command = 'pip install "scenegen[lsp]"'
        problem = NOT_INSTALLED(package="pygls", purpose="for the language server", command=command)
        raise RequestError(problem) from None
    if root is not None and not root.is_dir():
        raise RequestError(
            CANNOT_READ(path=root, reason="it is not a folder", remedy="name the folder that specs may read")
        )
    return serve(root)
