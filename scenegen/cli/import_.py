"""`scenegen import`: PDDL and BDDL problems as specs."""

from __future__ import annotations

from pathlib import Path

from scenegen.cli.options import argument, option


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

    from scenegen.cli.output import complain, print_error, print_message
    from scenegen.scenes.files import check_writable, write_whole
    from scenegen.worlds.planning import import_problem

    inputs = [one for one in (problem, domain, table) if one is not None]
    check_writable(out, *inputs)
    made = import_problem(problem, domain, table)
    write_whole(out, made.text.encode())
    complain(*made.warnings)
    for line in made.lost:
        print_message(line)
    print_error(f"wrote {out}; try: scenegen check {shlex.quote(str(out))}")
