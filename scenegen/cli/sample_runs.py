"""One or several runs of `scenegen sample`: from its options to files, pictures and a summary."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard

from scenegen.errors.requests import OUT_OF_PLACE, SPEC_OF_SPEC, STEPS_OF_SPEC
from scenegen.errors.stores import ONLY_FOR_SETS
from scenegen.formats.locations import inside, names_set

if TYPE_CHECKING:
    from scenegen.api.model import Model
    from scenegen.api.scenes import SceneSet
    from scenegen.api.spec import Spec
    from scenegen.processes.reserve import Reserve
    from scenegen.sampling.request import SampleRequest


@dataclass(frozen=True, slots=True)
class Wishes:
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
class Storing:
    """The options that say how scenes are stored."""

    resume: bool
    engine: str
    address: str | None
    shard_size: int | None
    pictures: int | None = None  # scenes that --render draws


def sample_many(sources: list[Path], wishes: Wishes, out: str | None, storing: Storing, render: Path | None) -> int:
    """A set for each source in the folder `out`, and the exit status: 1 if one of them failed. Each uses the whole
    engine; the time limit is that of each. Raises RequestError if the sources cannot be told apart."""
    from scenegen.cli.many import finished, folder_for, names_of
    from scenegen.cli.output import print_error
    from scenegen.engine.many import here
    from scenegen.formats.files import ensure_folder

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
def _shared(storing: Storing, wishes: Wishes) -> Iterator[None]:
    """One cluster for all runs."""
    if storing.engine != "ray":
        yield
        return
    from scenegen.engine.ray import joined_cluster

    with joined_cluster(wishes.workers, storing.address):
        yield


def sample_one(source: Path, wishes: Wishes, out: str | None, storing: Storing, render: Path | None) -> None:
    """Raises what the API raises, and OutputError for places that cannot be written to."""
    from scenegen.engine.budget import MODELS, SCENES, start_processes

    # `os.path.isdir` is False also for a name that is too long: that is reported where the source is loaded
    load = MODELS if source.suffix.lower() == ".safetensors" or os.path.isdir(source) else SCENES  # noqa: PTH112
    with start_processes(wishes.workers, storing.engine, settle=wishes.settle, load=load) as reserve:
        _sample(source, wishes, out, storing, render, reserve)


def _sample(
    source: Path, wishes: Wishes, out: str | None, storing: Storing, render: Path | None, reserve: Reserve
) -> None:
    from scenegen.cli.output import complain, detail, print_error
    from scenegen.cli.render import draw
    from scenegen.cli.sampled import Bar, summary
    from scenegen.cli.streams import check_output
    from scenegen.formats.blocks import BLOCK
    from scenegen.formats.files import check_folder, check_writable
    from scenegen.formats.registry import format_of
    from scenegen.needs import need

    subject = _load(source, wishes.spec, wishes.root)
    if wishes.counts:
        from scenegen.cli.options import parse_counts

        counts = parse_counts(wishes.counts)
        subject = subject.with_counts(counts)
    if _is_over_time(subject):
        from scenegen.cli.motion_runs import sample_motions

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

        with Bar() as bar:
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

    with Bar() as bar:
        scenes = draw_scenes(subject, request, progress=bar, reserve=reserve)
    complain(*scenes.warnings)
    detail(f"sampled {len(scenes)} scenes")
    _hand_out(scenes, path, render, storing.pictures)


def _complete(
    subject: Spec | Model,
    request: SampleRequest,
    wishes: Wishes,
    path: Path | None,
    storing: Storing,
    render: Path | None,
    stored: bool,
) -> None:
    """The scenes of --fix-from, completed. Raises what `sample` raises."""
    from scenegen.api.complete import complete
    from scenegen.api.model import Model
    from scenegen.api.reading import part_of_scenes
    from scenegen.api.sample import draw_scenes
    from scenegen.cli.output import complain
    from scenegen.errors import RequestError

    assert wishes.fix_from is not None
    if stored or storing.resume or isinstance(subject, Model):
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
    from scenegen.cli.sampled import summary

    if path is not None:
        scenes.save(path)
    else:
        from scenegen.cli.streams import write_data
        from scenegen.formats.scenes_json import dump

        write_data(dump(scenes.file()))
    if "reason" in scenes.header.sampler:
        print_error(f"{scenes.header.sampler['method']}: {scenes.header.sampler['reason']}")
    summary(scenes.header, len(scenes), met(scenes), path)
    if render is not None:
        draw(scenes, render, most=pictures)


def _is_over_time(subject: Spec | Model) -> TypeGuard[Spec]:
    from scenegen.api.model import Model

    return not isinstance(subject, Model) and subject.over_time is not None


def _refuse_set_options(storing: Storing) -> None:
    from scenegen.errors import RequestError

    given = {"engine": storing.engine != "local", "address": storing.address, "shard_size": storing.shard_size}
    for argument, value in given.items():
        if value:
            raise RequestError(ONLY_FOR_SETS(argument=argument))


def _request(source: Path, subject: Spec | Model, wishes: Wishes) -> SampleRequest:
    from scenegen.api.model import Model
    from scenegen.cli.output import detail, left
    from scenegen.sampling.fixed_objects import parse_fix
    from scenegen.sampling.request import USUAL, Range, SampleRequest, parse_phi

    labels = subject.spec.labels if isinstance(subject, Model) else subject.labels
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
    from scenegen.api.model import Model
    from scenegen.errors import RequestError

    if not isinstance(subject, Model):
        raise RequestError(STEPS_OF_SPEC())
    return subject.in_steps(steps)


def _load(source: Path, expected: Path | None, root: Path | None) -> Spec | Model:
    """A model if the file is one, else a spec."""
    from scenegen.api.family import load_model
    from scenegen.api.spec import load
    from scenegen.errors import RequestError

    if looks_like_model(source):
        return load_model(source, None if expected is None else load(expected, root))
    if expected is not None:
        raise RequestError(SPEC_OF_SPEC())
    return load(source, root)


def looks_like_model(path: Path) -> bool:
    """By its ending, by the spec in a folder of models, or by how safetensors files begin: the header's length in 8
    bytes, then the header."""
    from scenegen.api.family import is_family

    if path.suffix.lower() == ".safetensors" or is_family(path):
        return True
    if path.suffix.lower() == ".spec":
        return False
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            start = file.read(9)
    except OSError:
        return False
    return len(start) == 9 and start[8:] == b"{" and b"\0" in start[:8]
