"""Planning problems as specs, and scenes as planning problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenegen.api.motions import MotionSet, read_motions
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet, check_count, read_scenes
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.planning import ONE_PROBLEM_A_FILE
from scenegen.errors.requests import OUT_OF_PLACE
from scenegen.export.simulators import check_out, is_file
from scenegen.formats.folder import scene_name, whole_files
from scenegen.formats.motions.table import is_motions
from scenegen.lang.check import check_text
from scenegen.pddl.compile import Imported, compile_problem
from scenegen.pddl.export import Problems, goal_labels
from scenegen.pddl.ground import ground
from scenegen.pddl.mapping import Map, read_map
from scenegen.pddl.original import Originals, candidates, refuse_other
from scenegen.pddl.problem import Domain, domain_of, problem_of
from scenegen.pddl.read import read
from scenegen.validation import as_path

__all__ = ["Exported", "Imported", "export_problems", "import_problem"]

ENDING = ".pddl"


@dataclass(frozen=True, slots=True)
class Exported:
    """The files of planning problems: `problems` in scene order, and their `domain`."""

    problems: tuple[Path, ...]
    domain: Path | None
    warnings: tuple[Diagnostic, ...]


def import_problem(problem: str | Path, domain: str | Path | None = None, table: str | Path | None = None) -> Imported:
    """The spec that a PDDL or BDDL problem is: its text, and what of the problem has no geometry.

    `domain` is the PDDL file of types, constants and predicates, `table` a TOML file that maps kinds of objects to
    shapes and predicates to relations (docs/pddl.md). Raises DataError for files that cannot be read, and for problems
    without places.
    """
    known = Domain() if domain is None else domain_of(*read(Path(domain), "a PDDL domain"))
    mapped = Map() if table is None else read_map(Path(table))
    return compile_problem(problem_of(*read(Path(problem), "a PDDL problem"), known), mapped)


def export_problems(
    scenes: SceneSet | MotionSet,
    out: str | Path,
    *,
    facts: Sequence[str] | None = None,
    goal: Sequence[str] | None = None,
    whole_goal: bool = False,
    table: str | Path | None = None,
    problem: str | Path | None = None,
    domain: str | Path | None = None,
) -> Exported:
    """Write scenes as PDDL problems: what holds in each is its `:init`. A folder `out` gets scene_0001.pddl, ... and
    domain.pddl, a file that ends in .pddl the one scene, and NAME_domain.pddl beside it.

    `facts` names the relations, by default all of one or two things (docs/pddl.md); what the goal mentions is there
    besides. `goal` names the labels that are the goal: by default `goal`, else all. Of motions and pairs the first
    moment is the start; the goal is what the labels ask for, as it is at the last moment, with `whole_goal` all that
    holds there. `table` is the map of `import_problem`: its predicates take the place of relations.

    With the `problem` that the spec was imported from, and its `domain`, facts and goal are in its own words, and
    `facts` names its predicates; of motions the first moment counts alone. A domain is written only for problems of
    LIBERO and BEHAVIOR, which others do not read. Raises RequestError, DataError, OutputError.
    """
    out = as_path("out", out)
    check_out(out, "pddl")
    header = scenes.header
    if problem is not None:
        if goal is not None or whole_goal:
            rule, remedy = "chooses a goal, and the problem has its own", "leave it out"
            raise RequestError(
                OUT_OF_PLACE(option="goal" if goal is not None else "whole_goal", rule=rule, remedy=remedy)
            )
        starts = scenes.scenes(0) if isinstance(scenes, MotionSet) else scenes
        check_count(starts)
        reading = import_problem(problem, domain, table).reading
        checked = check_text(header.spec.source, "the spec of the scenes")
        refuse_other(reading, checked.objects, [one.name for one in checked.regions], str(problem))
        originals = Originals(ground(header.spec.source, checked.name, explicit=candidates(reading, facts)), reading)
        comments = [f"Scene {number}" for number in _numbers(len(starts))]
        texts = originals.texts(rows_of(checked, starts), comments)
        return _write(out, texts, originals.domain, len(starts))
    own = None if table is None else dict(read_map(Path(table)).predicates) or None
    grounded = ground(header.spec.source, "the spec of the scenes", facts, own)
    problems = Problems(grounded, goal_labels(grounded, goal), whole_goal)
    count = len(scenes)
    if isinstance(scenes, MotionSet):
        ends = [rows_of(grounded.spec, scenes.scenes(moment)) for moment in (0, -1)]
        comments = [f"Motion {number}: its first moment, and its last one as the goal." for number in _numbers(count)]
        check_count(scenes.scenes(0))
        texts = problems.of_pairs(ends[0], ends[1], comments)
    else:
        check_count(scenes)
        phi = [
            ", ".join(f"{name} = {values[place]:.6g}" for name, values in scenes.phi.items()) for place in range(count)
        ]
        comments = [f"Scene {number}" + (f"; phi: {phi[number - 1]}" if phi[0] else "") for number in _numbers(count)]
        texts = problems.of_scenes(rows_of(grounded.spec, scenes), comments)
    made = _write(out, texts, problems.domain, count)
    return replace(made, warnings=problems.warnings)


def _numbers(count: int) -> range:
    return range(1, count + 1)


def _write(out: Path, texts: Iterator[str], words: str | None, count: int) -> Exported:
    together = is_file(out, "pddl")
    if together and count > 1:
        raise RequestError(ONE_PROBLEM_A_FILE(path=out, count=count))
    folder = out.parent if together else out
    domain = f"{out.stem}_domain{ENDING}" if together else f"domain{ENDING}"
    written: list[Path] = []
    with whole_files(folder) as put:
        for number, text in enumerate(texts, start=1):
            name = out.name if together else f"{scene_name(number, count)}{ENDING}"
            put(name, text.encode())
            written.append(folder / name)
        if words is not None:
            put(domain, words.encode())
    return Exported(tuple(written), None if words is None else folder / domain, ())


def read_for_planning(path: Path) -> SceneSet | MotionSet:
    """The scenes of a file, or its motions. Raises DataError, RequestError."""
    return read_motions(path) if is_motions(path) else read_scenes(path)
