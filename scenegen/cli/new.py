"""`scenegen new`: a commented spec to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenegen.errors.files import CANNOT_WRITE

STARTER = """\
# One line about the task: what should the table look like?
workspace [0, 1] x [0, 1]  # metres: x to the right, y away from you

# Names of the library get its shapes (`scenegen assets` lists them); any other object is a small block.
object plate, mug, fork
# An array, and sizes of your own:
# object block[3] = box(5 cm, 5 cm, 5 cm)
# Held in place, never moved:
# object tray = box(40 cm, 30 cm, 2 cm) at (0.5, 0.5)

# What you say more than once gets a name.
const NEAR = 30 cm
region middle = rect(0.3, 0.3, 0.7, 0.7)
def beside(a, b) = closeTo(a, b, NEAR) & alignedY(a, b, 5 cm)

# Holds in every scene, and is no part of phi.
require noOverlap() & insideWorkspace()

# A label: `--phi task=LO:HI` asks for scenes by its phi. Combine relations with &, |, ! and ->.
task: inside(plate, middle) & leftOf(fork, plate) & beside(fork, plate) & angle(fork, NORTH, 20 deg)

# As many labels as you like, each with a phi of its own.
safe: farFrom(mug, plate, NEAR)
"""


def new(
    name: Annotated[
        Path,
        typer.Argument(help="The file; .spec is added where it is missing.", metavar="NAME", show_default=False),
    ],
) -> None:
    """Write a commented spec to start from. A file that is there already is left as it is.

    \b
      scenegen new my.spec
      scenegen new tables/breakfast

    `scenegen specs NAME` prints a shipped spec, which is another way to start.
    """
    import shlex

    from scenegen.cli.output import print_error
    from scenegen.errors import OutputError
    from scenegen.scenes.files import write_whole

    path = name if name.suffix.lower() == ".spec" else name.with_name(f"{name.name}.spec")
    if path.exists() or path.is_symlink():
        raise OutputError(
            CANNOT_WRITE(path=path, reason="it is there already", remedy="choose another name; nothing is overwritten")
        )
    write_whole(path, STARTER.encode())
    print_error(f"wrote {path}; try: scenegen check {shlex.quote(str(path))}")
