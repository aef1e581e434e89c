"""`scenegen sample`: scenes for a range of phi, in files, pictures and a summary."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from scenegen.cli.options import COUNT, PICTURES, ROOT, argument, asking, find_specs, option, parse_counts, spec_names
from scenegen.cli.output import (
    check_output,
    complain,
    detail,
    print_columns,
    print_error,
    progress_bar,
    seconds_elapsed,
    time_left,
    write_data,
)
from scenegen.errors import RequestError
from scenegen.errors.requests import CONFLICTING_ARGUMENTS, NOT_FOR_MOTIONS, OUT_OF_PLACE, WITHOUT_MODEL
from scenegen.sampling.request import MODELS_PANEL, Range, SampleRequest
from scenegen.scenes.locations import inside, names_set

if TYPE_CHECKING:
    from rich.progress import Progress

    from scenegen.api.sample import PhiSummary
    from scenegen.api.scenes import SceneSet
    from scenegen.api.spec import Spec
    from scenegen.learn.model import Model
    from scenegen.scenes.motions import AnyFile


@dataclass(frozen=True, slots=True)
class SampleOptions:
    """The options of one run that are none of its request: what is sampled from, and what becomes of the scenes.
    `typed` are those of the request, as typed."""

    source: Path
    out: str | None
    render: Path | None
    satisfied: bool
    violated: bool
    fix_from: Path | None
    count: list[str]
    pictures: int | None
    steps: int | None
    spec: Path | None
    root: Path | None
    typed: Mapping[str, Any]

    @property
    def writes_set(self) -> bool:
        """Whether the scenes go into a set."""
        return self.out is not None and names_set(self.out)

    @property
    def path(self) -> Path | None:
        """The one file of the scenes."""
        return None if self.out is None or self.writes_set else Path(self.out)


@asking(SampleRequest)
def sample(
    sources: list[Path] = argument(
        "A spec file, the name of a shipped spec, or a model file; several with a folder for --out.",
        "SPEC|MODEL",
        callback=find_specs,
        autocompletion=spec_names,
    ),
    satisfied: bool = option("phi >= 0 for every label that --phi does not name."),
    violated: bool = option("phi <= 0 for every label that --phi does not name."),
    count: list[str] | None = COUNT,
    fix_from: Path | None = option(
        "Complete each scene of this file once: hold its objects, or those of --fix NAME, draw the others.", "SCENES"
    ),
    out: str | None = option(
        "The scenes file, or DIR/ or a URL for a set of shards; default: standard output.", "FILE|DIR/|URL"
    ),
    render: Path | None = option("Draw the scenes into this folder, too.", "DIR"),
    pictures: int | None = PICTURES,
    steps: int | None = option(
        "Evaluations of a flow's network for a scene; default: as it was trained.", rich_help_panel=MODELS_PANEL
    ),
    spec: Path | None = option(
        "Refuse a model that was trained on another spec.", "SPEC", rich_help_panel=MODELS_PANEL
    ),
    root: Path | None = ROOT,
    **typed: Any,
) -> int:
    """Draw scenes whose phi lies in the given ranges; every returned scene is verified against the spec.

    \b
      scenegen sample table_setting --satisfied --render pictures
      scenegen sample my.spec --phi 0:0.2 -n 100 --out scenes.json
      scenegen sample my.spec --phi task=-0.2:0 --satisfied --out s.json
      scenegen sample my.spec --phi 0: --fix plate=0.5,0.5
      scenegen sample my.spec --phi 0: --fix-from easy.json --fix can
      scenegen sample my.spec --phi 0: --count block=5
      scenegen sample my.spec --phi 0: -n 1000000 --timeout 600 --out s.parquet
      scenegen sample model.safetensors --phi -0.3:-0.1 -n 1000 --out hard.json
      scenegen sample my.spec --phi 0: -n 50_000_000 --timeout 36000 --out set/
      scenegen sample *.spec --satisfied -n 100_000 --out sets/ --engine ray

    LO:HI is cut into cells that get equal shares of the scenes; LO: and :HI only bound; a label that is not named is
    free. --spread even chooses such scenes far from each other, among 16 times as many: they are exact, but no sample
    of the base distribution. --satisfied is short for --phi NAME=0: for every label that is not named, --violated for
    --phi NAME=:0.

    --settle drops every scene in PyBullet for one simulated second and keeps those in which no object moves more than
    1 cm or turns more than 5 degrees; what was refused is counted by object. If fewer than -n scenes are found in time,
    nothing is written and the exit status is 1, unless --keep-partial.

    The scenes depend on the spec, the request and --seed alone, not on --workers or the format. Many scenes grow in a
    folder beside --out: what is broken off, by Ctrl-C, by --timeout or by force, goes on with --resume.

    An --out that ends in a slash, or a URL (s3://bucket/set/), is a set: Parquet files of --shard-size scenes, a
    manifest, a card. It may have any number of scenes. With several specs each gets a set in DIR/; a bad one is
    reported by its name, the others are made, and the exit status is 1."""
    if out is None and typed["resume"]:
        raise RequestError(
            OUT_OF_PLACE(option="--resume", rule="goes on with a file, and none is named", remedy="name it with --out")
        )
    if satisfied and violated:
        raise RequestError(CONFLICTING_ARGUMENTS(one="satisfied", other="violated"))
    if pictures is not None and render is None:
        raise RequestError(OUT_OF_PLACE(option="--pictures", rule="goes with --render", remedy="add --render DIR"))
    options = SampleOptions(
        sources[0], out, render, satisfied, violated, fix_from, count or [], pictures, steps, spec, root, typed
    )
    if len(sources) > 1:
        return _sample_many(sources, options)
    _sample_one(options)
    return 0


def _sample_many(sources: list[Path], options: SampleOptions) -> int:
    """A set for each source in the folder --out, and the exit status: 1 if one of them failed. Each uses the whole
    engine; the time limit is that of each. Raises RequestError if the sources cannot be told apart."""
    from scenegen.cli.many import finish_jobs, folder_for, names_of
    from scenegen.sampling.engine.engines import run_here
    from scenegen.scenes.files import ensure_folder

    folder, render, typed = folder_for(options.out, len(sources), urls=True), options.render, options.typed

    def sample(source: Path) -> None:
        print_error(f"{source}:")
        place = None if render is None else render / source.stem
        limit = {**typed, "timeout": typed["timeout"] + seconds_elapsed()}
        _sample_one(replace(options, source=source, out=inside(folder, source.stem), render=place, typed=limit))

    jobs = list(zip(names_of(sources), sources, strict=True))
    if render is not None:
        ensure_folder(render)
    with _shared_cluster(typed["engine"], typed["workers"], typed["address"]):
        return finish_jobs(run_here(sample, jobs), len(jobs))


@contextlib.contextmanager
def _shared_cluster(engine: str, workers: int | None, address: str | None) -> Iterator[None]:
    """One cluster for all runs."""
    if engine != "ray":
        yield
        return
    from scenegen.sampling.engine.ray import joined_cluster

    with joined_cluster(workers, address):
        yield


def _sample_one(options: SampleOptions) -> None:
    """Raises what the API raises, and OutputError for places that cannot be written to."""
    subject = _load(options)
    request = _request(subject, options)
    if _is_over_time(subject):
        _sample_motions(subject, request, options)
    else:
        _sample_scenes(subject, request, options)


def _load(options: SampleOptions) -> Spec | Model:
    """A model if the file is one, else a spec; with the numbers of things of --count, and the steps of --steps."""
    from scenegen.api.spec import load

    source, root = options.source, options.root
    subject: Spec | Model
    if looks_like_model(source):
        from scenegen.learn.model import load_model

        subject = load_model(source, None if options.spec is None else load(options.spec, root))
    elif options.spec is not None:
        raise RequestError(WITHOUT_MODEL(argument="spec", rule="says which spec a model must be of"))
    else:
        subject = load(source, root)
    subject = subject.with_counts(parse_counts(options.count)) if options.count else subject
    if options.steps is None:
        return subject
    from scenegen.learn.model import Model

    if not isinstance(subject, Model):
        raise RequestError(WITHOUT_MODEL(argument="steps", rule="says how a model makes its scenes"))
    return subject.in_steps(options.steps)


def _request(subject: Spec | Model, options: SampleOptions) -> SampleRequest:
    from scenegen.api.spec import spec_of

    labels = spec_of(subject).labels
    typed = {**options.typed, "timeout": time_left(options.typed["timeout"])}
    typed["fix"] = None if options.fix_from is not None else typed["fix"]
    request = SampleRequest.parse(typed, labels)
    if options.satisfied or options.violated:
        rest = Range(low=0.0) if options.satisfied else Range(high=0.0)
        request = replace(request, phi={name: request.phi.get(name, rest) for name in labels})
    wanted = ", ".join(f"{name}={one}" for name, one in request.phi.items()) or "any phi"
    detail(f"read {options.source} (labels {', '.join(labels)}); wanted: {wanted}")
    return request


def _sample_scenes(subject: Spec | Model, request: SampleRequest, options: SampleOptions) -> None:
    from scenegen.api.sample import refuse_set_options
    from scenegen.scenes.blocks import BLOCK

    if not options.writes_set:
        refuse_set_options(request)
    _check_places(options)
    if options.fix_from is not None:
        _complete(subject, request, options)
        return
    if options.out is not None and (options.writes_set or request.resume or request.n > BLOCK):
        from scenegen.api.reading import read_scenes
        from scenegen.api.stream import write_scenes

        with ProgressBar() as bar:
            written = write_scenes(options.out, subject, request, progress=bar, on_note=print_error)
        complain(*written.warnings)
        detail(f"sampled and wrote {written.count} scenes")
        summary(written.header, written.count, written.phi, options.out)
        if options.render is not None:
            _draw(read_scenes(options.out), options.render, options.pictures)
        return
    from scenegen.api.sample import draw_scenes

    with ProgressBar() as bar:
        scenes = draw_scenes(subject, request, progress=bar)
    complain(*scenes.warnings)
    detail(f"sampled {len(scenes)} scenes")
    _hand_out(scenes, options)


def _check_places(options: SampleOptions, motions: bool = False) -> None:
    """Refuse, before any work is done, places that cannot be written to, and a library that is missing."""
    from scenegen.needs import need
    from scenegen.scenes.files import check_folder, check_writable
    from scenegen.scenes.formats.registry import MOTIONS, SCENES, format_of

    if options.path is not None:
        format_of(options.path, MOTIONS if motions else SCENES)
        check_writable(options.path)
    elif options.out is None:
        check_output()
    if options.render is not None and options.fix_from is None:
        check_folder(options.render, options.path)
        need("pybullet", "to draw pictures")


def _complete(subject: Spec | Model, request: SampleRequest, options: SampleOptions) -> None:
    """The scenes of --fix-from, completed. Raises what `sample` raises."""
    from scenegen.api.complete import complete
    from scenegen.api.reading import part_of_scenes
    from scenegen.api.sample import draw_scenes
    from scenegen.api.spec import LearnedModel

    assert options.fix_from is not None
    if options.writes_set or request.resume or isinstance(subject, LearnedModel):
        rule = "completes scenes of a spec, in memory"
        raise RequestError(OUT_OF_PLACE(option="--fix-from", rule=rule, remedy="name a spec, and a single file"))
    names = options.typed["fix"] or []
    for text in names:
        if "=" in text:
            rule, name = "has no place beside --fix-from, whose scenes say where things are", text.partition("=")[0]
            raise RequestError(OUT_OF_PLACE(option=f"--fix {text}", rule=rule, remedy=f"write --fix {name}"))
    given = part_of_scenes(subject.checked, options.fix_from, names)
    scenes = complete(subject, request, given, draw_scenes, options.typed["n"], str(options.fix_from))
    complain(*scenes.warnings)
    _hand_out(scenes, options)


def _hand_out(scenes: SceneSet, options: SampleOptions) -> None:
    """Write scenes to a file or the output, say what they are, and draw them."""
    from scenegen.api.sample import summarize_phi

    if options.path is not None:
        scenes.save(options.path)
    else:
        from scenegen.scenes.formats.scenes_json import dump

        write_data(dump(scenes.file()))
    if "reason" in scenes.header.sampler:
        print_error(f"{scenes.header.sampler['method']}: {scenes.header.sampler['reason']}")
    summary(scenes.header, len(scenes), summarize_phi(scenes.phi), options.path)
    if options.render is not None:
        _draw(scenes, options.render, options.pictures)


def _draw(scenes: SceneSet, folder: Path, most: int | None) -> None:
    from scenegen.cli.render import draw

    draw(scenes, folder, most)


def _is_over_time(subject: Spec | Model) -> TypeGuard[Spec]:
    from scenegen.api.spec import LearnedModel

    return not isinstance(subject, LearnedModel) and subject.over_time is not None


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


def _sample_motions(spec: Spec, request: SampleRequest, options: SampleOptions) -> None:
    """Raises what the API raises, RequestError for an option that only scenes have, and OutputError for places that
    cannot be written to."""
    from scenegen.api.motions import draw_motions, read_motions
    from scenegen.api.request import check_request
    from scenegen.api.sample import refuse_set_options, summarize_phi
    from scenegen.api.stream import write_scenes
    from scenegen.scenes.blocks import BLOCK

    check_request(spec, request)
    for name in ("fix_from", "pictures"):
        if getattr(options, name) is not None:
            raise RequestError(NOT_FOR_MOTIONS(argument=name))
    if not options.writes_set:
        refuse_set_options(request)
    _check_places(options, motions=True)
    if options.out is not None and (options.writes_set or request.resume or request.n > BLOCK):
        with ProgressBar() as bar:
            written = write_scenes(options.out, spec, request, progress=bar, on_note=print_error)
        complain(*written.warnings)
        detail(f"sampled and wrote {written.count} motions")
        print_error(motion_summary(written.header.sampler, written.count, written.phi, options.out))
        if options.render is not None:
            made = read_motions(options.out).figures(options.render, "gif", "strip")
            print_error(f"drew {len(made)} figures in {options.render}")
        return
    found = draw_motions(spec, request)
    complain(*found.warnings)
    detail(f"sampled {len(found)} motions")
    if options.path is None:
        write_data(found.dump())
    else:
        found.save(options.path)
    print_error(motion_summary(found.header.sampler, len(found), summarize_phi(found.phi), options.path))
    if options.render is not None:
        made = found.figures(options.render, "gif", "strip")
        print_error(f"drew {len(made)} figures in {options.render}")


def motion_summary(info: Mapping[str, Any], count: int, phi: Mapping[str, PhiSummary], place: Path | str | None) -> str:
    """What was drawn, and where it is."""
    ranges = ", ".join(f"{name} {one.lowest:.4g} .. {one.highest:.4g}" for name, one in phi.items())
    rare = info.get("log10_probability")
    drawn = str(info["method"]) + ("" if rare is None else f"; log10 of their probability {rare:.2f}")
    share = info.get("effective_share")
    if share is not None and share < 1.0:
        drawn += f"; worth about {max(1, round(share * count)):,} independent ones"
    what = "motion" if count == 1 else "motions"
    return f"{count:,} {what}{'' if place is None else f' in {place}'}: phi of {ranges} ({drawn})"


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


def summary(header: AnyFile, count: int, phi: Mapping[str, PhiSummary], out: Path | str | None) -> None:
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
        shares = [part.get("share") for part in info["numbers"]]
        shared = "" if None in shares else " in equal shares" if len({*shares}) == 1 else " by their weights"
        what = "choices of assets" if any("assets" in part for part in info["numbers"]) else "numbers of things"
        return f"{len(info['numbers'])} {what}{shared}, by {methods}"
    if info["method"] == "paired":
        methods = ", ".join(part["method"] for part in info["components"])
        return f"{len(info['components'])} independent parts by {methods}, {info['candidates']:,} evaluations"
    return f"{info['method']}, {info['candidates']:,} candidates"


def _end(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
