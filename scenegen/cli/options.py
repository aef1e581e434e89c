"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Root = Annotated[
    Path | None,
    typer.Option("--root", help="The folder that imports may read from; the spec's own if left out.", metavar="DIR"),
]
