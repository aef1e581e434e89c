"""Scenes straight into a file, however many there are."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen import given
from scenegen.api.ask import Wanted, ask
from scenegen.api.model import Model
from scenegen.api.sample import Note, chosen, partial, sample
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.api.settled import blamed, check_settle, refuse_model, settling, told
from scenegen.api.spec import Spec, check_spec
from scenegen.errors import Diagnostic, RequestError
from scenegen.formats.files import check_writable
from scenegen.formats.scenes_json import BYTES, MOST_BYTES
from scenegen.formats.table import format_of, read_scenes
from scenegen.scene.data import SceneFile

if TYPE_CHECKING:
    from scenegen.engine.stream import Progress
    from scenegen.formats.blocks import Block
    from scenegen.sampling.held import Held

MAX_JSON = 1_000_000  # scenes of a .json file, which is read as a whole: 6 kB of memory each


@dataclass(frozen=True, slots=True)
class Met:
    """phi of one label over the scenes of a file."""

    lowest: float
    mean: float
    highest: float


@dataclass(frozen=True, slots=True)
class Written:
    """A scene file: where it is, how many scenes it holds, its header, and what phi is in it, by label."""

    path: Path
    count: int
    header: SceneFile
    phi: Mapping[str, Met]
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False)

    def __len__(self) -> int:
        return self.count


def sample_to(
    path: str | Path,
    source: Spec | Model,
    phi: Wanted | None = None,
    n: int = 16,
    *,
    seed: int = 0,
    method: str = "auto",
    spread: str = "flat",
    timeout: float = 60.0,
    keep_partial: bool = False,
    fix: Mapping[str, Held | tuple[float, ...]] | None = None,
    settle: bool = False,
    workers: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> Written:
    """The scenes of `sample(...)`, the very same in the same order, in a .parquet, .jsonl or .json file.

    They are written block by block: memory stays flat, so n may be a billion (a million in .json, which is read as a
    whole). They grow in a folder beside the file, `scenes.parquet.part/`, and are joined at the end. After an
    interrupt, a timeout or `kill -9` at any moment, the same call with `resume` goes on from there and ends with the
    same bytes as an unbroken run; without, such a folder is refused. Raises what `sample` raises, OutputError for a
    file that cannot be written, and DataError for a damaged folder. A model's scenes are made in memory, and cannot be
    resumed.
    """
    path = given.path("path", path)
    format_of(path)
    check_writable(path)
    n = given.whole("n", n)
    if path.suffix.lower() == ".json":
        _check_json(n, source.spec if isinstance(source, Model) else source)
    if isinstance(source, Model) and method in ("auto", "model"):
        if settle:
            raise refuse_model()
        if resume:
            title = "a model's scenes are made at once, so there is nothing to resume"
            raise RequestError(Diagnostic(title, help="leave --resume out"))
        scenes = sample(
            source, phi, n, seed=seed, spread=spread, timeout=timeout, keep_partial=keep_partial, fix=fix,
            progress=progress,
        )  # fmt: skip
        scenes.save(path)
        return Written(path, len(scenes), scenes.header, met(scenes), scenes.warnings)
    from scenegen.engine.exact import to_file
    from scenegen.formats.shards import folder_of
    from scenegen.sampling.report import fell_short
    from scenegen.version import __version__

    asked = ask(source, phi, n, seed=seed, method=method, spread=spread, timeout=timeout, raw=False, fix=fix)
    check_settle(settle)
    choice = chosen(asked, on_note)
    seen = _Seen()
    headers: list[SceneFile] = []

    def header(info: Mapping[str, object]) -> SceneFile:
        headers.append(make_header(asked.problem.spec, info, asked.data))
        return headers[-1]

    with settling(asked, choice, workers, settle) as (choice, crew, refusals):
        tally, warnings = to_file(
            path,
            choice,
            header,
            asked.budget,
            versions={"scenegen": __version__},
            workers=crew,
            resume=resume,
            keep_partial=keep_partial,
            joining=seen,
            progress=progress,
        )
    warnings = told(warnings, refusals)
    short = blamed(fell_short(choice.plan, tally), refusals)
    if short is not None:
        if not (keep_partial and tally.scenes):
            raise RequestError(_resumable(short, folder_of(path)))
        warnings = (*warnings, partial(short))
    if not seen.count:  # the file was there already, and only its folder was left to be removed
        for block in read_scenes(path).blocks:
            seen(block)
    return Written(path, seen.count, headers[-1], seen.phi(asked.problem.spec.labels), warnings)


def _check_json(n: int, spec: Spec) -> None:
    """Refuse more scenes than a .json file can hold. Raises RequestError."""
    check_spec(spec)
    most = min(MAX_JSON, MOST_BYTES // (BYTES * (3 * len(spec.objects) + len(spec.labels))))
    if n > most:
        title = f"a .json file cannot hold {n:,} scenes: whoever reads it needs all of it in memory"
        raise RequestError(Diagnostic(title, help=f"write .jsonl or .parquet, or ask for at most {most:,}"))


def met(scenes: SceneSet) -> dict[str, Met]:
    """What phi is in a set of at least one scene."""
    return {label: Met(float(v.min()), float(v.mean()), float(v.max())) for label, v in scenes.phi.items()}


def _resumable(short: Diagnostic, folder: Path) -> Diagnostic:
    """The shortfall of a run that can go on."""
    if not folder.exists():
        return short
    kept = f"{folder} keeps what is done: go on with --resume"
    return dataclasses.replace(short, note=f"{short.note}; {kept}" if short.note else kept)


class _Seen:
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

    def phi(self, labels: tuple[str, ...]) -> dict[str, Met]:
        each = zip(labels, self._least, self._sum, self._most, strict=True)
        return {label: Met(least, total / self.count, most) for label, least, total, most in each}
