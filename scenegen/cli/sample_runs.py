"""One or several runs of `scenegen sample`: from its options to files, pictures and a summary."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from scenegen.cli.output import print_columns, print_error, progress_bar
from scenegen.errors.files import ONLY_FOR_SETS
from scenegen.errors.requests import OUT_OF_PLACE, SPEC_OF_SPEC, STEPS_OF_SPEC
from scenegen.errors.time import NOT_FOR_MOTIONS
from scenegen.scenes.locations import inside, names_set

if TYPE_CHECKING:
    from rich.progress import Progress

    from scenegen.api.motions import MotionSet
    from scenegen.api.sample import PhiSummary
    from scenegen.api.scenes import SceneSet
    from scenegen.api.spec import Spec
    from scenegen.learn.model import Model
    from scenegen.processes.ahead import IdleWorkers
    from scenegen.sampling.request import SampleRequest
    from scenegen.scenes.data import SceneFile


@dataclass(frozen=True, slots=True)
class SampleOptions:
    """The options that say which scenes are wanted."""

    phi: list[str]
    satisfied: bool
    violated: bool
    n: int | None
    seed: int
    method: str
    spread: str
    fix: list[str]
    settle: bool
    raw: bool
    workers: int | None
    keep_partial: bool
    timeout: float
    steps: int | None
    spec: Path | None
    root: Path | None
    counts: list[str]
    fix_from: Path | None = None


@dataclass(frozen=True, slots=True)
class StorageOptions:
    """The options that say how scenes are stored."""

    resume: bool
    engine: str
    address: str | None
    shard_size: int | None
    pictures: int | None = None  # scenes that --render draws


def sample_many(
    sources: list[Path], wishes: SampleOptions, out: str | None, storing: StorageOptions, render: Path | None
) -> int:
    """A set for each source in the folder `out`, and the exit status: 1 if one of them failed. Each uses the whole
    engine; the time limit is that of each. Raises RequestError if the sources cannot be told apart."""
    from scenegen.cli.many import finished, folder_for, names_of
    from scenegen.cli.output import print_error
    from scenegen.sampling.engine.engines import here
    from scenegen.scenes.files import ensure_folder

    folder = folder_for(out, len(sources), urls=True)

    def sample(source: Path) -> None:
        print_error(f"{source}:")
        each = replace(wishes, timeout=wishes.timeout + _elapsed())
        pictures = None if render is None else render / source.stem
        sample_one(source, each, inside(folder, source.stem), storing, pictures)

    jobs = list(zip(names_of(sources), sources, strict=True))
    if render is not None:
        ensure_folder(render)
    with _shared(storing, wishes):
        return finished(here(sample, jobs), len(jobs))


@contextlib.contextmanager
def _shared(storing: StorageOptions, wishes: SampleOptions) -> Iterator[None]:
    """One cluster for all runs."""
    if storing.engine != "ray":
        yield
        return
    from scenegen.sampling.engine.ray import joined_cluster

    with joined_cluster(wishes.workers, storing.address):
        yield


def sample_one(
    source: Path, wishes: SampleOptions, out: str | None, storing: StorageOptions, render: Path | None
) -> None:
    """Raises what the API raises, and OutputError for places that cannot be written to."""
    from scenegen.sampling.engine.run import MODELS, SCENES, start_processes

    # `os.path.isdir` is False also for a name that is too long: that is reported where the source is loaded
    load = MODELS if source.suffix.lower() == ".safetensors" or os.path.isdir(source) else SCENES  # noqa: PTH112
    with start_processes(wishes.workers, storing.engine, settle=wishes.settle, load=load) as reserve:
        _sample(source, wishes, out, storing, render, reserve)


def _sample(
    source: Path,
    wishes: SampleOptions,
    out: str | None,
    storing: StorageOptions,
    render: Path | None,
    reserve: IdleWorkers,
) -> None:
    from scenegen.cli.output import complain, detail, print_error
    from scenegen.cli.render import draw
    from scenegen.cli.streams import check_output
    from scenegen.needs import need
    from scenegen.scenes.blocks import BLOCK
    from scenegen.scenes.files import check_folder, check_writable
    from scenegen.scenes.formats.registry import format_of

    subject = _load(source, wishes.spec, wishes.root)
    if wishes.counts:
        from scenegen.cli.options import parse_counts

        subject = subject.with_counts(parse_counts(wishes.counts))
    if _is_over_time(subject):
        refused = {"engine": storing.engine != "local", "resume": storing.resume}
        refused |= {"address": bool(storing.address), "shard_size": bool(storing.shard_size)}
        refused |= {"fix_from": wishes.fix_from is not None, "pictures": storing.pictures is not None}
        sample_motions(subject, _request(source, subject, wishes), source, out, refused, render, reserve)
        return
    stored = out is not None and names_set(out)
    path = None if out is None or stored else Path(out)
    if path is not None:
        format_of(path)
        check_writable(path, source)
    elif out is None:
        check_output()
    if not stored:
        _refuse_set_options(storing)
    if wishes.steps is not None:
        subject = _in_steps(subject, wishes.steps)
    request = _request(source, subject, wishes)
    if wishes.fix_from is not None:
        _complete(subject, request, wishes, path, storing, render, stored)
        return
    if render is not None:
        check_folder(render, path)
        need("pybullet", "to draw pictures")
    if out is not None and (stored or storing.resume or request.n > BLOCK):
        from scenegen.api.reading import read_scenes
        from scenegen.api.stream import write_scenes

        with ProgressBar() as bar:
            written = write_scenes(
                out, subject, request, resume=storing.resume, engine=storing.engine, address=storing.address,
                shard_size=storing.shard_size, progress=bar, on_note=print_error, reserve=reserve,
            )  # fmt: skip
        complain(*written.warnings)
        detail(f"sampled and wrote {written.count} scenes")
        summary(written.header, written.count, written.phi, out)
        if render is not None:
            draw(read_scenes(out), render, most=storing.pictures)
        return
    from scenegen.api.sample import draw_scenes

    with ProgressBar() as bar:
        scenes = draw_scenes(subject, request, progress=bar, reserve=reserve)
    complain(*scenes.warnings)
    detail(f"sampled {len(scenes)} scenes")
    _hand_out(scenes, path, render, storing.pictures)


def _complete(
    subject: Spec | Model,
    request: SampleRequest,
    wishes: SampleOptions,
    path: Path | None,
    storing: StorageOptions,
    render: Path | None,
    stored: bool,
) -> None:
    """The scenes of --fix-from, completed. Raises what `sample` raises."""
    from scenegen.api.complete import complete
    from scenegen.api.reading import part_of_scenes
    from scenegen.api.sample import draw_scenes
    from scenegen.api.spec import LearnedModel
    from scenegen.cli.output import complain
    from scenegen.errors import RequestError

    assert wishes.fix_from is not None
    if stored or storing.resume or isinstance(subject, LearnedModel):
        rule = "completes scenes of a spec, in memory"
        raise RequestError(OUT_OF_PLACE(option="--fix-from", rule=rule, remedy="name a spec, and a single file"))
    for text in wishes.fix:
        if "=" in text:
            rule, name = "has no place beside --fix-from, whose scenes say where things are", text.partition("=")[0]
            raise RequestError(OUT_OF_PLACE(option=f"--fix {text}", rule=rule, remedy=f"write --fix {name}"))
    given = part_of_scenes(subject.checked, wishes.fix_from, wishes.fix)
    scenes = complete(subject, request, given, draw_scenes, wishes.n)
    complain(*scenes.warnings)
    _hand_out(scenes, path, render, storing.pictures)


def _hand_out(scenes: SceneSet, path: Path | None, render: Path | None, pictures: int | None) -> None:
    """Write scenes to a file or the output, say what they are, and draw them."""
    from scenegen.api.stream import met
    from scenegen.cli.output import print_error
    from scenegen.cli.render import draw

    if path is not None:
        scenes.save(path)
    else:
        from scenegen.cli.streams import write_data
        from scenegen.scenes.formats.scenes_json import dump

        write_data(dump(scenes.file()))
    if "reason" in scenes.header.sampler:
        print_error(f"{scenes.header.sampler['method']}: {scenes.header.sampler['reason']}")
    summary(scenes.header, len(scenes), met(scenes), path)
    if render is not None:
        draw(scenes, render, most=pictures)


def _is_over_time(subject: Spec | Model) -> TypeGuard[Spec]:
    from scenegen.api.spec import LearnedModel

    return not isinstance(subject, LearnedModel) and subject.over_time is not None


def _refuse_set_options(storing: StorageOptions) -> None:
    from scenegen.errors import RequestError

    given = {"engine": storing.engine != "local", "address": storing.address, "shard_size": storing.shard_size}
    for argument, value in given.items():
        if value:
            raise RequestError(ONLY_FOR_SETS(argument=argument))


def _request(source: Path, subject: Spec | Model, wishes: SampleOptions) -> SampleRequest:
    from scenegen.api.spec import spec_of
    from scenegen.cli.output import detail, left
    from scenegen.sampling.request import USUAL, Range, SampleRequest, parse_fix, parse_phi

    labels = spec_of(subject).labels
    ranges = parse_phi(wishes.phi, labels)
    if wishes.satisfied or wishes.violated:
        rest = Range(low=0.0) if wishes.satisfied else Range(high=0.0)
        ranges = {name: ranges.get(name, rest) for name in labels}
    wanted = ", ".join(f"{name}={one}" for name, one in ranges.items()) or "any phi"
    detail(f"read {source} (labels {', '.join(labels)}); wanted: {wanted}")
    return SampleRequest(
        ranges, USUAL if wishes.n is None else wishes.n, seed=wishes.seed, method=wishes.method, spread=wishes.spread,
        fix={} if wishes.fix_from is not None else parse_fix(wishes.fix),
        settle=wishes.settle, raw=wishes.raw, timeout=left(wishes.timeout), workers=wishes.workers,
        keep_partial=wishes.keep_partial,
    )  # fmt: skip


def _elapsed() -> float:
    from scenegen.cli.output import elapsed

    return elapsed()


def _in_steps(subject: Spec | Model, steps: int) -> Model:
    from scenegen.errors import RequestError
    from scenegen.learn.model import Model

    if not isinstance(subject, Model):
        raise RequestError(STEPS_OF_SPEC())
    return subject.in_steps(steps)


def _load(source: Path, expected: Path | None, root: Path | None) -> Spec | Model:
    """A model if the file is one, else a spec."""
    from scenegen.api.spec import load
    from scenegen.errors import RequestError

    if looks_like_model(source):
        from scenegen.learn.model import load_model

        return load_model(source, None if expected is None else load(expected, root))
    if expected is not None:
        raise RequestError(SPEC_OF_SPEC())
    return load(source, root)


def looks_like_model(path: Path) -> bool:
    """By its ending, by the spec in a folder of models, or by how safetensors files begin: the header's length in 8
    bytes, then the header."""
    if path.suffix.lower() == ".safetensors":
        return True
    if path.suffix.lower() == ".spec" and not path.is_dir():
        return False
    from scenegen.learn.model import is_family

    if is_family(path):
        return True
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            start = file.read(9)
    except OSError:
        return False
    return len(start) == 9 and start[8:] == b"{" and b"\0" in start[:8]


# --------------------------------------------------------------------------------------------------------------------
# `scenegen sample` of a spec over time: motions.


def sample_motions(
    spec: Spec,
    request: SampleRequest,
    source: Path,
    out: str | None,
    refused: Mapping[str, object],
    render: Path | None,
    reserve: IdleWorkers,
) -> None:
    """`refused` are options that only scenes have, with their values. Raises what the API raises, RequestError for
    one of those that is given, and OutputError for places that cannot be written to."""
    from scenegen.api.motions import draw_motions
    from scenegen.cli.output import complain, detail, print_error
    from scenegen.cli.streams import check_output, write_data
    from scenegen.errors import RequestError
    from scenegen.needs import need
    from scenegen.scenes.files import check_folder, check_writable
    from scenegen.scenes.formats.motions.table import format_of

    given = {**refused, "out": out is not None and names_set(out)}
    for argument, value in given.items():
        if value:
            raise RequestError(NOT_FOR_MOTIONS(argument=argument, value=out if argument == "out" else None))
    path = None if out is None else Path(out)
    if path is None:
        check_output()
    else:
        format_of(path)
        check_writable(path, source)
    if render is not None:
        check_folder(render, path)
        need("pybullet", "to draw pictures")
    found = draw_motions(spec, request, reserve=reserve)
    complain(*found.warnings)
    detail(f"sampled {len(found)} motions")
    if path is None:
        write_data(found.dump())
    else:
        found.save(path)
    print_error(motion_summary(found, path))
    if render is not None:
        made = found.figures(render, "gif", "strip")
        print_error(f"drew {len(made)} figures in {render}")


def motion_summary(found: MotionSet, path: Path | None) -> str:
    """What was drawn, and where it is."""
    info = found.header.sampler
    ranges = ", ".join(f"{name} {min(values):.4g} .. {max(values):.4g}" for name, values in found.phi.items())
    rare = info.get("log10_probability")
    drawn = str(info["method"]) + ("" if rare is None else f"; log10 of their probability {rare:.2f}")
    share = info.get("effective_share")
    if share is not None and share < 1.0:
        drawn += f"; worth about {max(1, round(share * len(found))):,} independent ones"
    what = "motion" if len(found) == 1 else "motions"
    return f"{len(found):,} {what}{'' if path is None else f' in {path}'}: phi of {ranges} ({drawn})"


# --------------------------------------------------------------------------------------------------------------------
# What `scenegen sample` shows: a bar while it works, and a table of what was found.


class ProgressBar:
    """A progress bar that appears only when sampling takes a while."""

    def __enter__(self) -> ProgressBar:
        self._progress: Progress | None = None
        self._calls = 0
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def __call__(self, found: int, wanted: int, candidates: int) -> None:
        self._calls += 1
        if self._calls < 2:
            return
        if self._progress is None:
            self._progress = progress_bar()
            self._task = self._progress.add_task("sampling", total=None)
            self._progress.start()
        text = f"sampling: {found:,} of {wanted:,} in {candidates:,} candidates"
        self._progress.update(self._task, description=text, completed=found, total=wanted)


def summary(header: SceneFile, count: int, phi: Mapping[str, PhiSummary], out: Path | str | None) -> None:
    """The requested ranges beside the results."""
    print_error(f"{count} scenes ({_how(header.sampler)})" + (f" in {out}" if out is not None else ""))
    rows = []
    for label, values in phi.items():
        low, high = header.request.phi.get(label, (None, None))
        wanted = "any" if low is None and high is None else f"{_end(low)}:{_end(high)}"
        rows.append((label, wanted, *(f"{value:+.4f}" for value in (values.lowest, values.mean, values.highest))))
    print_columns(("label", "wanted phi", "lowest", "mean", "highest"), rows)


def _how(info: Mapping[str, Any]) -> str:
    """How scenes were made, and with what yield."""
    if info.get("raw"):
        return "raw output of the model"
    if info["method"] in ("rejection", "completed"):
        return f"{info['method']}, {info['draws']:,} draws, {100 * info['acceptance']:.3g}% accepted"
    if info["method"] == "splitting":
        return f"splitting, {info['candidates']:,} evaluations, {100 * info['acceptance']:.3g}% of the moves accepted"
    if info["method"] == "growth":
        return f"growth, {info['candidates']:,} evaluations, {info['sweeps']} sweeps of moves after the last object"
    if info["method"] == "numbered":
        methods = ", ".join(dict.fromkeys(part["method"] for part in info["numbers"]))
        equal = " in equal shares" if all("share" in part for part in info["numbers"]) else ""
        what = "choices of assets" if any("assets" in part for part in info["numbers"]) else "numbers of things"
        return f"{len(info['numbers'])} {what}{equal}, by {methods}"
    if info["method"] == "paired":
        methods = ", ".join(part["method"] for part in info["components"])
        return f"{len(info['components'])} independent parts by {methods}, {info['candidates']:,} evaluations"
    return f"{info['method']}, {info['candidates']:,} candidates"


def _end(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
