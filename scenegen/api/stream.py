"""Scenes straight into a file or a set, however many there are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.api.request import Note, Phi, any_model, check_request, read_phi
from scenegen.api.sample import PhiSummary, Written, refuse_set_options
from scenegen.api.sample import partial as kept_anyway
from scenegen.api.scene_arrays import header_of, stored_form
from scenegen.api.spec import LearnedModel, Spec, check_spec, model_of, spec_of
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import TOO_MANY
from scenegen.pose import row_count
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import Ends, FixedPose, Progress, Range, SampleRequest
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.files import check_writable
from scenegen.scenes.formats.registry import MOTIONS, SCENES, format_of, read_scenes
from scenegen.scenes.formats.scenes_json import BYTES, MAX_JSON_BYTES
from scenegen.scenes.locations import as_location, names_set
from scenegen.validation import as_int, as_path

if TYPE_CHECKING:
    from scenegen.sampling.engine.engines import ShardWriter
    from scenegen.sampling.plan import Plan, Tally
    from scenegen.scenes.motions import AnyFile
    from scenegen.scenes.sets import Manifest
    from scenegen.scenes.stores import Store

FILE_SHARD = 1 << 26  # bytes of a shard of a file in progress, at most
MOTION_COLUMNS = 4  # columns of motions beside poses and phi: number, time and two facts
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
    success: Range | Ends | None = None,
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
    write = _write_set if names_set(path) else _write_file
    return write(path, source, request, progress, on_note)


def _write_set(
    path: str | Path,
    source: Spec | LearnedModel,
    request: SampleRequest,
    progress: Progress | None,
    on_note: Note | None,
) -> Written:
    """The bytes depend on the request and `shard_size` alone, neither on the engine nor on the number of workers."""
    from scenegen.scenes.stores import open_store
    from scenegen.search.effort import Budget

    budget = Budget(request.timeout)
    store, spec = open_store(as_location(path), on_note), spec_of(source)
    source = any_model(source, budget) if request.method == "any" else source
    request = check_request(source, request)
    from scenegen.api.set_card import write_card
    from scenegen.sampling.engine.engines import check_engine, open_engine
    from scenegen.sampling.engine.writer import write_set
    from scenegen.scenes import sets
    from scenegen.scenes.lock import acquire, refuse_in_use

    numbers = _numbers(spec)
    block = BLOCK if spec.horizon is None else sets.motion_block(numbers)
    size = sets.shard_size(request.shard_size, numbers, len(spec.objects), block)
    check_engine(request.engine, request.address)
    refuse_in_use(store)
    sets.refuse_taken(store, resume=request.resume)
    with closing(plan_for(spec.definition, request, budget, model_of(source), on_note)) as plan:
        with acquire(store), open_engine(request.engine, request.workers, plan, request.address) as engine:
            manifest = _manifest(plan, size, method=request.method)
            tally, manifest = write_set(
                store, plan, engine, manifest, _shard_writer(plan, sets.PARQUET, store),
                lambda tally: _account(plan, tally), resume=request.resume, keep_partial=request.keep_partial,
                spent=lambda: budget.is_spent, progress=progress, block=block,
            )  # fmt: skip
            warnings: tuple[Diagnostic, ...] = ()
            if tally is not None:
                kept = store.location if manifest.shards else None
                warnings = _warnings(source, request, plan, tally, budget.is_spent, manifest.complete, kept)
            write_card(store, manifest)
        phi = {label: PhiSummary(one.lowest, one.mean, one.highest) for label, one in manifest.phi().items()}
        return Written(store.location, manifest.scenes, header_of(plan.problem, manifest.sampler), phi, warnings)


def _write_file(
    path: str | Path,
    source: Spec | LearnedModel,
    request: SampleRequest,
    progress: Progress | None,
    on_note: Note | None,
) -> Written:
    refuse_set_options(request)
    path, spec = as_path("path", path), spec_of(source)
    format_of(path, SCENES if spec.over_time is None else MOTIONS)
    check_writable(path)
    if path.suffix.lower() == ".json" and spec.over_time is None:
        _check_json(as_int("n", request.n), spec)
    from scenegen.search.effort import Budget

    budget = Budget(request.timeout)
    source = any_model(source, budget) if request.method == "any" else source
    request = check_request(source, request)
    from scenegen.sampling.engine.engines import open_engine
    from scenegen.sampling.engine.writer import folder_of, write_file
    from scenegen.scenes.sets import RAW

    size = max(1, FILE_SHARD // (8 * _numbers(spec) * BLOCK)) * BLOCK
    seen = _PhiStatistics()
    with closing(plan_for(spec.definition, request, budget, model_of(source), on_note)) as plan:
        with open_engine("local", None, plan) as engine:
            tally = write_file(
                path, plan, engine, _manifest(plan, size), partial(_shard_writer, plan, RAW),
                lambda tally: header_of(plan.problem, _account(plan, tally)), resume=request.resume,
                keep_partial=request.keep_partial, spent=lambda: budget.is_spent, progress=progress, joining=seen,
            )  # fmt: skip
        folder = folder_of(path)
        written = request.keep_partial and bool(tally.scenes)
        warnings = _warnings(
            source, request, plan, tally, budget.is_spent, written, folder if folder.exists() else None
        )
        if not seen.count:  # the file was there already, and only its folder was left to be removed
            for block in _blocks_of(path, spec.over_time is not None):
                seen(block)
        header = header_of(plan.problem, _account(plan, tally))
        return Written(path, seen.count, header, seen.phi(plan.problem.labels), warnings)


def _first_header(plan: Plan) -> AnyFile:
    """The header before the run."""
    header: AnyFile = header_of(plan.problem, {"method": plan.method})
    return header


def _manifest(plan: Plan, size: int, **facts: object) -> Manifest:
    """Before the run."""
    from scenegen.resources import __version__
    from scenegen.sampling.engine.run import resume_record
    from scenegen.scenes.sets import Manifest, header_data

    asked = {"plan": plan.plan_digest, "n": plan.scenes_wanted, "seed": plan.seed, **facts}
    return Manifest(
        request={**resume_record(plan.problem, {"scenegen": __version__}), **asked},
        labels=list(plan.problem.labels),
        shard_size=size,
        header=header_data(_first_header(plan)),
    )


def _shard_writer(plan: Plan, ending: str, store: Store) -> ShardWriter:
    from scenegen.sampling.engine.engines import ShardWriter

    return ShardWriter(plan, store, _first_header(plan), plan.problem.labels, stored_form(plan.problem), ending)


def _account(plan: Plan, tally: Tally) -> dict[str, object]:
    from scenegen.sampling.report import run_info

    return dict(run_info(plan, tally)[0])


def _warnings(
    source: Spec | LearnedModel,
    request: SampleRequest,
    plan: Plan,
    tally: Tally,
    spent: bool,
    written: bool,
    folder: object,
) -> tuple[Diagnostic, ...]:
    """Of a run that ended. Raises RequestError where it found too few scenes, and they were not `written`; `folder`
    keeps them then, if one does."""
    from scenegen.sampling.report import run_info, shortfall_of_run

    warnings = run_info(plan, tally)[1]
    if isinstance(source, LearnedModel) and request.method == "model":
        warnings = (*warnings, *source.advice(request, None))
    shortfall = shortfall_of_run(plan, tally, spent)
    if shortfall is None:
        return warnings
    if not written:
        raise RequestError(shortfall.but(folder=folder))
    return (*warnings, kept_anyway(shortfall))


def _numbers(spec: Spec) -> int:
    """How many numbers of a scene, or motion, files have."""
    rows = row_count(len(spec.objects)) + len(spec.labels)
    return rows if spec.horizon is None else (rows + MOTION_COLUMNS) * spec.horizon.moments


def _blocks_of(path: Path, over_time: bool) -> Iterable[Block]:
    if not over_time:
        return read_scenes(path).blocks
    from scenegen.scenes.formats.registry import read_motions

    return [read_motions(path).block()]


def _check_json(n: int, spec: Spec) -> None:
    """Refuse more scenes than a .json file can hold. Raises RequestError."""
    check_spec(spec)
    most = min(MAX_JSON, MAX_JSON_BYTES // (BYTES * (row_count(len(spec.objects)) + len(spec.labels))))
    if n > most:
        raise RequestError(TOO_MANY(n=n, most=most))


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
