"""`scenegen export --to pddl`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenegen.api.scenes import SceneSet


@dataclass(frozen=True, slots=True)
class Original:
    """The problem that a spec was imported from, its domain, and a map."""

    problem: Path | None
    domain: Path | None
    table: Path | None


def export_problems(
    scenes: Path,
    out: Path,
    facts: str | None,
    goal: Sequence[str] | None,
    whole_goal: bool,
    original: Original,
    read: SceneSet | None,
) -> None:
    """Write the scenes or pairs of a file as planning problems, and say where they are; `read` are its scenes, if they
    have been read."""
    from scenegen.api import planning
    from scenegen.api.export import PLANNERS, check_export
    from scenegen.api.motions import MotionSet
    from scenegen.cli.output import complain, note_others, print_error
    from scenegen.errors import RequestError
    from scenegen.errors.requests import OUT_OF_PLACE

    inputs = [one for one in (scenes, *astuple(original)) if one is not None]
    check_export(out, PLANNERS, *inputs)
    names = None if facts is None else [one.strip() for one in facts.split(",") if one.strip()]
    if original.domain is not None and original.problem is None:
        raise RequestError(OUT_OF_PLACE(option="--domain", rule="is that of a problem", remedy="add --problem"))
    if original.problem is not None and (goal or whole_goal):
        option, rule = "--goal" if goal else "--whole-goal", "chooses a goal, and the problem has its own"
        raise RequestError(OUT_OF_PLACE(option=option, rule=rule, remedy="leave it out"))
    found = planning.read_for_planning(scenes) if read is None else read
    if whole_goal and not isinstance(found, MotionSet):
        rule = "is for motions and pairs, and these are scenes"
        raise RequestError(OUT_OF_PLACE(option="--whole-goal", rule=rule, remedy="leave it out"))
    made = planning.export_problems(
        found,
        out,
        facts=names,
        goal=goal or None,
        whole_goal=whole_goal,
        table=original.table,
        problem=original.problem,
        domain=original.domain,
    )
    complain(*made.warnings)
    count, files = len(made.problems), made.problems
    where = f"{out}" if files == (out,) else f"{out}: {files[0].name}" + (f" to {files[-1].name}" if count > 1 else "")
    domain = "" if made.domain is None else f", and {made.domain.name}"
    print_error(f"{count} problem{'s' * (count != 1)} in {where}{domain}")
    if files != (out,):
        note_others(out, count, files[0].suffix)
