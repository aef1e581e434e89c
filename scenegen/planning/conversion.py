"""Planning problems as specs, and scenes as planning problems."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenegen.api.motions import MotionSet, read_motions
from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet, check_count
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import NO_SCENES, OUT_OF_PLACE
from scenegen.errors.worlds import ONE_PROBLEM_A_FILE
from scenegen.planning.export import (
    Originals,
    SpecProblems,
    candidates,
    goal_labels,
    goal_notes,
    refuse_other,
    undecided_notes,
    vocabulary,
)
from scenegen.planning.facts import ground
from scenegen.planning.goal import NameMap, read_map
from scenegen.planning.problem import Domain, domain_of, problem_of, read
from scenegen.planning.translation import CompiledProblem, Imported, compile_problem
from scenegen.scenes.files import scene_name, whole_files
from scenegen.scenes.formats.registry import check_out, is_motions, is_one_file
from scenegen.validation import as_path

__all__ = ["Exported", "Imported", "export_problems", "import_problem"]

PDDL_ENDING = ".pddl"
SPEC_NAME = "the spec of the scenes"
MOTION_COMMENT = "its first moment, and its last one as the goal."

Own = Mapping[str, str] | None  # predicates and formulas of a map


@dataclass(frozen=True, slots=True)
class Exported:
    """The files of planning problems: `problems` in scene order, and their `domain`."""

    problems: tuple[Path, ...]
    domain: Path | None
    warnings: tuple[Diagnostic, ...]


def of_scenes(
    scenes: SceneSet,
    out: Path,
    facts: Sequence[str] | None = None,
    own: Own = None,
    goal: Sequence[str] | None = None,
    *,
    ends: SceneSet | None = None,
    whole_goal: bool = False,
) -> Exported:
    """The problems of scenes; with `ends`, those of motions that begin in the scenes and end there. Where the spec
    draws how many things there are, scenes with as many share their facts; all share the domain. Raises RequestError,
    DataError, OutputError."""
    if not len(scenes):
        raise RequestError(NO_SCENES())
    source = scenes.header.spec.checked_spec.source
    named: dict[tuple[str, int], str] = {}
    parts = [
        (ground(source, SPEC_NAME, facts, own, counts=numbers, parts=named), numbers, which)
        for numbers, which in scenes.parts()
    ]
    words = vocabulary([grounded for grounded, _, _ in parts])
    made = [SpecProblems(grounded, goal_labels(grounded, goal), words, whole_goal) for grounded, _, _ in parts]

    def texts() -> Iterator[tuple[int, str]]:
        for problems, (grounded, counts, which) in zip(made, parts, strict=True):
            first, *last = (
                rows_of(grounded.spec, one.only(counts, which) if counts else one)
                for one in (scenes, ends)
                if one is not None
            )
            if ends is None:
                comments = {place + 1: _comment(scenes, place) for place in which.tolist()}
                written = problems.of_scenes(first, comments)
            else:
                comments = {place + 1: f"Motion {place + 1}: {MOTION_COMMENT}" for place in which.tolist()}
                written = problems.of_pairs(first, last[0], comments)
            yield from zip(comments, written, strict=True)

    files = _write(out, texts(), made[0].domain, len(scenes))
    return replace(files, warnings=goal_notes(made))


def _comment(scenes: SceneSet, place: int) -> str:
    phi = ", ".join(f"{name} = {values[place]:.6g}" for name, values in scenes.phi.items())
    return f"Scene {place + 1}" + (f"; phi: {phi}" if phi else "")


def _write(out: Path, texts: Iterable[tuple[int, str]], words: str | None, count: int) -> Exported:
    """Writes texts, which come with the numbers of their scenes."""
    together = is_one_file(out, "pddl")
    if together and count > 1:
        raise RequestError(ONE_PROBLEM_A_FILE(path=out, count=count))
    folder = out.parent if together else out
    domain = f"{out.stem}_domain{PDDL_ENDING}" if together else f"domain{PDDL_ENDING}"
    written: dict[int, Path] = {}
    with whole_files(folder) as put:
        for number, text in texts:
            name = out.name if together else f"{scene_name(number, count)}{PDDL_ENDING}"
            put(name, text.encode())
            written[number] = folder / name
        if words is not None:
            put(domain, words.encode())
    return Exported(
        tuple(written[number] for number in sorted(written)), None if words is None else folder / domain, ()
    )


def import_problem(problem: str | Path, domain: str | Path | None = None, table: str | Path | None = None) -> Imported:
    """The spec that a PDDL or BDDL problem is: its text, and what of the problem has no geometry.

    `domain` is the PDDL file of types, constants and predicates, `table` a TOML file that maps kinds of objects to
    shapes and predicates to relations (docs/pddl.md). Raises DataError for files that cannot be read, and for problems
    without places.
    """
    known = Domain() if domain is None else domain_of(*read(Path(domain), "a PDDL domain"))
    mapped = NameMap() if table is None else read_map(Path(table))
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
    own = None if table is None else dict(read_map(Path(table)).predicates) or None
    if problem is not None:
        for argument, value in (("goal", goal is not None), ("whole_goal", whole_goal)):
            if value:
                rule = "chooses a goal, and the problem has its own"
                raise RequestError(OUT_OF_PLACE(argument=argument, rule=rule, remedy="leave it out"))
        starts = scenes.scenes(0) if isinstance(scenes, MotionSet) else scenes
        return _in_its_words(starts, out, import_problem(problem, domain, table).reading, str(problem), facts)
    if isinstance(scenes, MotionSet):
        starts, ends = scenes.scenes(0), scenes.scenes(-1)
        return of_scenes(starts, out, facts, own, goal, ends=ends, whole_goal=whole_goal)
    if whole_goal:
        rule = "is for motions and pairs, and these are scenes"
        raise RequestError(OUT_OF_PLACE(argument="whole_goal", rule=rule, remedy="leave it out"))
    return of_scenes(scenes, out, facts, own, goal)


def _in_its_words(
    scenes: SceneSet, out: Path, reading: CompiledProblem, file: str, facts: Sequence[str] | None
) -> Exported:
    check_count(scenes)
    checked = scenes.header.spec.checked_spec
    refuse_other(reading, checked.objects, [one.name for one in checked.regions], file)
    rows = rows_of(checked, scenes)
    originals = Originals(ground(checked.source, SPEC_NAME, explicit=candidates(reading, facts)), reading)
    texts = originals.texts(rows, [f"Scene {number}" for number in range(1, len(scenes) + 1)])
    made = _write(out, enumerate(texts, start=1), originals.domain, len(scenes))
    return replace(made, warnings=undecided_notes(originals, file))


def read_for_planning(path: Path) -> SceneSet | MotionSet:
    """The scenes of a file, or its motions. Raises DataError, RequestError."""
    return read_motions(path) if is_motions(path) else read_scenes(path)
