"""Scenes straight into a file, however many there are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.api.request import Note, check_request, plan_of
from scenegen.api.sample import PhiSummary, Written, partial
from scenegen.api.scene_arrays import header_of, stored_form
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import LearnedModel, Spec, check_spec, spec_of
from scenegen.errors import RequestError
from scenegen.errors.files import ONLY_FOR_SETS
from scenegen.errors.requests import TOO_MANY_FOR_JSON
from scenegen.pose import row_count
from scenegen.sampling.request import Progress, SampleRequest
from scenegen.scenes.blocks import Block
from scenegen.scenes.files import check_writable
from scenegen.scenes.formats.registry import MOTIONS, SCENES, format_of, read_scenes
from scenegen.scenes.formats.scenes_json import BYTES, MOST_BYTES
from scenegen.scenes.locations import as_location, names_set
from scenegen.validation import as_int, as_path

if TYPE_CHECKING:
    from scenegen.api.motions import MotionSet
    from scenegen.scenes.motions import AnyFile

MAX_JSON = 1_000_000  # scenes of a .json file, which is read as a whole: 6 kB of memory each


def write_scenes(
    path: str | Path,
    source: Spec | LearnedModel,
    request: SampleRequest,
    *,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> Written:
    """The scenes of a request, in a file or a set. Raises what `sample_to` raises."""
    if names_set(path):
        from scenegen.api.sets import write_set

        return write_set(as_location(path), source, request, progress=progress, on_note=on_note)
    refuse_set_options(request)
    path = as_path("path", path)
    over_time = spec_of(source).over_time is not None
    format_of(path, MOTIONS if over_time else SCENES)
    check_writable(path)
    if path.suffix.lower() == ".json" and not over_time:
        _check_json(as_int("n", request.n), spec_of(source))
    request = check_request(source, request)
    from scenegen.sampling.engine.run import to_file
    from scenegen.sampling.problem import Budget
    from scenegen.scenes.shards import folder_of
    from scenegen.version import __version__

    budget = Budget(request.timeout)
    plan = plan_of(source, request, budget, on_note)
    seen = _PhiStatistics()
    stored = stored_form(plan.problem)
    headers: list[AnyFile] = []

    def header(info: Mapping[str, object]) -> AnyFile:
        headers.append(header_of(plan.problem, info))
        return headers[-1]

    tally, warnings, shortfall = to_file(
        path,
        plan,
        header,
        budget,
        versions={"scenegen": __version__},
        resume=request.resume,
        joining=seen,
        stored=stored and (lambda block: Block(stored(block.rows), block.phi)),
        progress=progress,
    )
    if isinstance(source, LearnedModel) and request.method == "model":
        warnings = (*warnings, *source.advice(request.phi, None, request.raw))
    if shortfall is not None:
        if not (request.keep_partial and tally.scenes):
            folder = folder_of(path)
            raise RequestError(shortfall.but(folder=folder if folder.exists() else None))
        warnings = (*warnings, partial(shortfall))
    if not seen.count:  # the file was there already, and only its folder was left to be removed
        for block in _blocks_of(path, over_time):
            seen(block)
    return Written(path, seen.count, headers[-1], seen.phi(plan.problem.labels), warnings)


def refuse_set_options(request: SampleRequest) -> None:
    """Raises RequestError for options that only sets have."""
    argument = request.misplaced("scenes", "motions", "files")
    if argument is not None:
        raise RequestError(ONLY_FOR_SETS(argument=argument))


def _blocks_of(path: Path, over_time: bool) -> Iterable[Block]:
    if not over_time:
        return read_scenes(path).blocks
    from scenegen.scenes.formats.registry import read_motions

    return [read_motions(path).block()]


def _check_json(n: int, spec: Spec) -> None:
    """Refuse more scenes than a .json file can hold. Raises RequestError."""
    check_spec(spec)
    most = min(MAX_JSON, MOST_BYTES // (BYTES * (row_count(len(spec.objects)) + len(spec.labels))))
    if n > most:
        raise RequestError(TOO_MANY_FOR_JSON(n=n, most=most))


def met(scenes: SceneSet | MotionSet) -> dict[str, PhiSummary]:
    """What phi is in a set of at least one scene, or motion."""
    return {label: PhiSummary(float(v.min()), float(v.mean()), float(v.max())) for label, v in scenes.phi.items()}


class _PhiStatistics:
    """What phi is in the blocks that it is shown."""

    def __init__(self) -> None:
        self.count = 0
        self._least: list[float] = []
        self._sum: list[float] = []
        self._most: list[float] = []

    def __call__(self, block: Block) -> None:
        if not block.count:
            return
        least, total, most = (list(map(float, f(axis=1))) for f in (block.phi.min, block.phi.sum, block.phi.max))
        if not self.count:
            self._least, self._sum, self._most = least, total, most
        else:
            self._least = list(map(min, self._least, least))
            self._sum = [one + more for one, more in zip(self._sum, total, strict=True)]
            self._most = list(map(max, self._most, most))
        self.count += block.count

    def phi(self, labels: tuple[str, ...]) -> dict[str, PhiSummary]:
        each = zip(labels, self._least, self._sum, self._most, strict=True)
        return {label: PhiSummary(least, total / self.count, most) for label, least, total, most in each}
