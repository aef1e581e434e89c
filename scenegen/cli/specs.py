"""Where a spec comes from: `scenegen specs` has those that ship, `scenegen new` writes one to start from, and `scenegen
import` makes one of a planning problem."""

from __future__ import annotations

from pathlib import Path

import typer

from scenegen.cli.options import argument, option, spec_names
from scenegen.cli.output import complain, print_error, print_message, write_data
from scenegen.errors import RequestError
from scenegen.errors.files import SPEC_NOT_FOUND


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
    from scenegen.resources import shipped_specs

    shipped = shipped_specs()
    if name is not None:
        if name not in shipped:
            raise RequestError(SPEC_NOT_FOUND(name=name, known=shipped))
        write_data(shipped[name].read_bytes())
        return
    wide = max(map(len, shipped))
    for one, path in shipped.items():
        first = path.read_text(encoding="utf-8").partition("\n")[0]
        typer.echo(f"{one:<{wide}}  {first.removeprefix('#').strip() if first.startswith('#') else ''}".rstrip())


SPEC_STARTER = """\
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
    out: Path = argument("The file; .spec is added where it is missing.", "NAME"),
) -> None:
    """Write a commented spec to start from. A file that is there already is left as it is.

    \b
      scenegen new my.spec
      scenegen new tables/breakfast

    `scenegen specs NAME` prints a shipped spec, which is another way to start.
    """
    import shlex

    from scenegen.scenes.files import refuse_existing, write_whole

    path = out if out.suffix.lower() == ".spec" else out.with_name(f"{out.name}.spec")
    refuse_existing(path)
    write_whole(path, SPEC_STARTER.encode())
    print_error(f"wrote {path}; try: scenegen check {shlex.quote(str(path))}")


def import_(
    problem: Path = argument("A PDDL or BDDL problem.", "PROBLEM"),
    out: Path = option("The spec.", "SPEC", default=...),
    domain: Path | None = option("Its PDDL domain.", "DOMAIN"),
    table: Path | None = option("Sizes of objects, meanings of predicates.", "TOML", flags="--map"),
) -> None:
    """Make a spec from a planning problem: of LIBERO, of BEHAVIOR, or of any PDDL domain.

    \b
      scenegen import task.bddl --out task.spec
      scenegen import p.pddl --domain d.pddl --map m.toml --out p.spec
      scenegen sample task.spec --phi goal=-0.3:0 -n 50 --out starts.json

    The goal becomes the label `goal`; where the things that it moves start is the label `start`. What has no geometry,
    such as a stove that is on, is listed here and in the spec. A map has [objects], kinds with shapes, and
    [predicates], names with relations.
    """
    import shlex

    from scenegen.planning.conversion import import_problem
    from scenegen.scenes.files import check_writable, write_whole
    from scenegen.scenes.formats.registry import check_ending

    check_writable(out)
    check_ending(out, ".spec")
    made = import_problem(problem, domain, table)
    write_whole(out, made.text.encode())
    complain(*made.warnings)
    for line in made.lost:
        print_message(line)
    print_error(f"wrote {out}; try: scenegen check {shlex.quote(str(out))}")
