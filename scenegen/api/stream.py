"""Scenes straight into a file, however many there are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.api.request import Note, Phi, check_request, plan_of, read_phi
from scenegen.api.sample import PhiSummary, Written, partial
from scenegen.api.scene_arrays import header_of, stored_form
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import LearnedModel, Spec, check_spec, spec_of
from scenegen.errors import RequestError
from scenegen.errors.files import ONLY_FOR_SETS
from scenegen.errors.requests import TOO_MANY
from scenegen.pose import row_count
from scenegen.sampling.request import FixedPose, Progress, Range, SampleRequest
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


def sample_to(
    path: str | Path,
    source: Spec | LearnedModel,
    phi: Phi | None = None,
    n: int = 16,
    *,
    seed: int = 0,
    method: str = "auto",
    spread: str = "flat",
    timeout: float = 60.0,
    raw: bool = False,
    keep_partial: bool = False,
    fix: Mapping[str, FixedPose | tuple[float, ...]] | None = None,
    settle: bool = False,
    success: Range | tuple[float | None, float | None] | None = None,
    under: str | Path | None = None,
    workers: int | None = None,
    resume: bool = False,
    engine: str = "local",
    address: str | None = None,
    shard_size: int | None = None,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> Written:
    """The scenes of `sample(...)`, the very same in the same order, in a .parquet, .jsonl or .json file, or as a set;
    of a spec over time the motions of `sample_motions(...)`, also in a .csv file.

    A path that ends in a slash and a URL (s3://bucket/set/) are places of a set: Parquet files of
    `shard_size` scenes each, and a manifest. `engine` is "local" or "ray", whose cluster is at `address`; both give the
    same bytes.

    They are written block by block: memory stays flat, so n may be a billion (a million in .json, which is read as a
    whole). They grow in a folder beside the file, `scenes.parquet.part/`, and are joined at the end. After an
    interrupt, a timeout or `kill -9` at any moment, the same call with `resume` goes on from there and ends with the
    same bytes as an unbroken run; without, such a folder is refused. Raises what `sample` raises, OutputError for a
    file that cannot be written, and DataError for a damaged folder.
    """
    request = SampleRequest(
        read_phi(source, phi), n, seed=seed, method=method, spread=spread, fix={} if fix is None else fix,
        settle=settle, success=success, under=under, raw=raw, timeout=timeout, workers=workers,
        keep_partial=keep_partial, resume=resume,
        engine=engine, address=address, shard_size=shard_size,
    )  # fmt: skip
    return write_scenes(path, source, request, progress=progress, on_note=on_note)


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
        raise RequestError(TOO_MANY(n=n, most=most))


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
