"""`scenegen export --to pddl`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def export_problems(
    scenes: Path, out: Path, facts: str | None, goal: Sequence[str] | None, whole_goal: bool, table: Path | None
) -> None:
    """Write the scenes or pairs of a file as planning problems, and say where they are."""
    from scenegen.api import planning
    from scenegen.api.export import PLANNERS, check_export
    from scenegen.cli.output import complain, note_others, print_error

    inputs = [one for one in (scenes, table) if one is not None]
    check_export(out, PLANNERS, *inputs)
    names = None if facts is None else [one.strip() for one in facts.split(",") if one.strip()]
    found = planning.read_for_planning(scenes)
    made = planning.export_problems(found, out, facts=names, goal=goal or None, whole_goal=whole_goal, table=table)
    complain(*made.warnings)
    count, files = len(made.problems), made.problems
    where = f"{out}" if files == (out,) else f"{out}: {files[0].name}" + (f" to {files[-1].name}" if count > 1 else "")
    domain = "" if made.domain is None else f", and {made.domain.name}"
    print_error(f"{count} problem{'s' * (count != 1)} in {where}{domain}")
    if files != (out,):
        note_others(out, count, files[0].suffix)
