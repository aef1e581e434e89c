"""`scenegen sample`: scenes for a range of phi."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenegen.cli.options import Root, find_spec, spec_names

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from scenegen.api.model import Model
    from scenegen.api.scenes import SceneSet
    from scenegen.api.spec import Spec
    from scenegen.api.stream import Met
    from scenegen.sampling.request import Range
    from scenegen.scene.data import SceneFile


def _choices(*names: str) -> Callable[[str], list[str]]:
    """What a shell completes an option's value to."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


def sample(
    source: Annotated[
        Path,
        typer.Argument(
            help="A spec file, the name of a shipped spec, or a model file.",
            metavar="SPEC|MODEL",
            show_default=False,
            callback=find_spec,
            autocompletion=spec_names,
        ),
    ],
    phi: Annotated[
        list[str] | None,
        typer.Option(
            "--phi",
            help="Wanted phi: LO:HI, LO: or :HI; NAME=LO:HI names a label.",
            metavar="[NAME=]LO:HI",
            show_default=False,
        ),
    ] = None,
    satisfied: Annotated[
        bool, typer.Option("--satisfied", help="phi >= 0 for every label that --phi does not name.")
    ] = False,
    violated: Annotated[
        bool, typer.Option("--violated", help="phi <= 0 for every label that --phi does not name.")
    ] = False,
    n: Annotated[int, typer.Option("-n", help="How many scenes.")] = 16,
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same scenes.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="The scenes file; default: standard output.", metavar="FILE", show_default=False),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="auto, rejection, growth or splitting (a spec), model (a model file).",
            autocompletion=_choices("auto", "rejection", "growth", "splitting", "model"),
        ),
    ] = "auto",
    spread: Annotated[
        str,
        typer.Option(
            "--spread",
            help="flat: evenly over the range of phi; base: as they occur.",
            autocompletion=_choices("flat", "base"),
        ),
    ] = "flat",
    fix: Annotated[
        list[str] | None,
        typer.Option(
            "--fix",
            help="Hold an object where it is; repeat for more.",
            metavar="NAME=X,Y[,THETA]",
            show_default=False,
        ),
    ] = None,
    settle: Annotated[
        bool, typer.Option("--settle", help="Only scenes in which nothing moves when dropped in a simulator.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", help="Processes; default: one for small requests, else one per core.", show_default=False
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where an earlier run with this --out was broken off.")
    ] = False,
    timeout: Annotated[float, typer.Option("--timeout", help="Seconds after which to give up.")] = 60.0,
    keep_partial: Annotated[bool, typer.Option("--keep-partial", help="Keep what was found when time is up.")] = False,
    raw: Annotated[bool, typer.Option("--raw", help="A model's own output, neither refined nor filtered.")] = False,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps",
            help="Evaluations of a flow's network for a scene; default: as it was trained.",
            metavar="N",
            show_default=False,
        ),
    ] = None,
    spec: Annotated[
        Path | None,
        typer.Option(
            "--spec", help="Refuse a model that was trained on another spec.", metavar="SPEC", show_default=False
        ),
    ] = None,
    render: Annotated[
        Path | None,
        typer.Option("--render", help="Draw the scenes into this folder, too.", metavar="DIR", show_default=False),
    ] = None,
    root: Root = None,
) -> None:
    """Draw scenes whose phi lies in the wanted ranges; every scene handed out is re-scored by the exact spec.

    \b
      scenegen sample table_setting --satisfied --render pictures
      scenegen sample my.spec --phi 0:0.2 -n 100 --out scenes.json
      scenegen sample my.spec --phi task=-0.2:0 --satisfied --out s.json
      scenegen sample my.spec --phi 0: --fix plate=0.5,0.5
      scenegen sample my.spec --phi 0: -n 1000000 --timeout 600 --out s.parquet
      scenegen sample model.safetensors --phi -0.3:-0.1 -n 1000 --out hard.json

    LO:HI is cut into cells that get equal shares of the scenes; LO: and :HI only bound; a label that is not named is
    free. --satisfied is short for --phi NAME=0: for every label that is not named, --violated for --phi NAME=:0.

    --settle drops every scene in PyBullet for one simulated second and keeps those in which no object moves more than
    1 cm or turns more than 5 degrees; what was refused is counted by object. If fewer than -n scenes are found in time,
    nothing is written and the exit status is 1, unless --keep-partial.

    The scenes depend on the spec, the request and --seed alone, not on --workers or the format. Many scenes grow in a
    folder beside --out: what is broken off, by Ctrl-C, by --timeout or by force, goes on with --resume.
    """
    from scenegen.api.sample import sample as draw_scenes
    from scenegen.cli.output import complain, detail, print_error
    from scenegen.cli.render import draw
    from scenegen.cli.streams import check_output
    from scenegen.errors import Diagnostic, RequestError
    from scenegen.formats.blocks import BLOCK
    from scenegen.formats.files import check_folder, check_writable
    from scenegen.formats.table import format_of
    from scenegen.needs import need

    if out is not None:
        format_of(out)
        check_writable(out, source)
    elif resume:
        raise RequestError(Diagnostic("--resume goes on with a file, and none is named", help="name it with --out"))
    else:
        check_output()
    if satisfied and violated:
        raise RequestError(Diagnostic("--satisfied and --violated contradict each other", help="give one of them"))
    subject = _load(source, spec, root)
    if steps is not None:
        subject = _in_steps(subject, steps)
    from scenegen.api.model import Model
    from scenegen.sampling.held import parse_fixed
    from scenegen.sampling.request import Range, parse_ranges

    labels = subject.spec.labels if isinstance(subject, Model) else subject.labels
    ranges = parse_ranges(phi or [], labels)
    if satisfied or violated:
        rest = Range(low=0.0) if satisfied else Range(high=0.0)
        ranges = {name: ranges.get(name, rest) for name in labels}
    detail(f"read {source} (labels {', '.join(labels)}); wanted: {_wanted(ranges)}")
    fixed = parse_fixed(fix or [])
    if render is not None:
        check_folder(render, out)
        need("pybullet", "to draw pictures")
    if isinstance(subject, Model):
        import torch

        torch.set_num_threads(1)  # so that the bytes do not depend on the number of cores
    common: dict[str, Any] = {
        "seed": seed,
        "method": method,
        "spread": spread,
        "timeout": timeout,
        "keep_partial": keep_partial,
        "fix": fixed,
        "settle": settle,
        "workers": workers,
    }
    if out is not None and (resume or (n > BLOCK and not isinstance(subject, Model))):
        _refuse_raw(raw)
        from scenegen.api.scenes import read_scenes
        from scenegen.api.stream import sample_to

        with _Bar() as bar:
            written = sample_to(out, subject, ranges, n, resume=resume, progress=bar, on_note=print_error, **common)
        complain(*written.warnings)
        detail(f"sampled and wrote {written.count} scenes")
        _summary(written.header, written.count, written.phi, out)
        if render is not None:
            draw(read_scenes(out), render)
        return
    with _Bar() as bar:
        scenes = draw_scenes(subject, ranges, n, raw=raw, progress=bar, **common)
    complain(*scenes.warnings)
    detail(f"sampled {len(scenes)} scenes")
    if out is not None:
        scenes.save(out)
    else:
        from scenegen.cli.streams import write_data
        from scenegen.formats.scenes_json import dump

        write_data(dump(scenes.file()))
    if "reason" in scenes.header.sampler:
        print_error(f"{scenes.header.sampler['method']}: {scenes.header.sampler['reason']}")
    _summary(scenes.header, len(scenes), _met(scenes), out)
    if render is not None:
        draw(scenes, render)


def _wanted(ranges: Mapping[str, Range]) -> str:
    return ", ".join(f"{name}={wanted}" for name, wanted in ranges.items()) or "any phi"


def _refuse_raw(raw: bool) -> None:
    from scenegen.errors import Diagnostic, RequestError

    if raw:
        title = "`raw` is a model's own output, made at once: there is nothing to resume"
        raise RequestError(Diagnostic(title, help="leave --raw or --resume out"))


def _in_steps(subject: Spec | Model, steps: int) -> Model:
    from scenegen.api.model import Model
    from scenegen.errors import Diagnostic, RequestError

    if not isinstance(subject, Model):
        title = "--steps says how a model makes its scenes, and this is a spec"
        raise RequestError(Diagnostic(title, help="leave --steps out, or name a model file"))
    return subject.in_steps(steps)


def _load(source: Path, expected: Path | None, root: Path | None) -> Spec | Model:
    """A model if the file is one, else a spec."""
    from scenegen.api.model import load_model
    from scenegen.api.spec import load
    from scenegen.errors import Diagnostic, RequestError

    if looks_like_model(source):
        return load_model(source, None if expected is None else load(expected, root))
    if expected is not None:
        title = "--spec says which spec a model must be of, and this is no model"
        raise RequestError(Diagnostic(title, help="name a model file, or leave --spec out"))
    return load(source, root)


def looks_like_model(path: Path) -> bool:
    """By its ending, or by how safetensors files begin: the header's length in 8 bytes, then the header."""
    if path.suffix == ".safetensors":
        return True
    if path.suffix == ".spec":
        return False
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            start = file.read(9)
    except OSError:
        return False
    return len(start) == 9 and start[8:] == b"{" and b"\0" in start[:8]


class _Bar:
    """A progress bar that appears only when sampling takes a while."""

    def __enter__(self) -> _Bar:
        from scenegen.cli.output import progress_bar

        self._progress = progress_bar()
        self._task = self._progress.add_task("sampling", total=None)
        self._calls = 0
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def __call__(self, found: int, wanted: int, candidates: int) -> None:
        self._calls += 1
        if self._calls == 2:
            self._progress.start()
        text = f"sampling: {found:,} of {wanted:,} in {candidates:,} candidates"
        self._progress.update(self._task, description=text, completed=found, total=wanted)


def _met(scenes: SceneSet) -> dict[str, Met]:
    from scenegen.api.stream import met

    return met(scenes)


def _summary(header: SceneFile, count: int, phi: Mapping[str, Met], out: Path | None) -> None:
    """What was asked for beside what came out."""
    from rich.table import Table

    from scenegen.cli.output import console, print_error

    print_error(f"{count} scenes ({_how(header.sampler)})" + (f" in {out}" if out is not None else ""))
    table = Table("label", "asked phi", "lowest", "mean", "highest", box=None, header_style="bold")
    for label, values in phi.items():
        low, high = header.request.phi.get(label, (None, None))
        asked = "any" if low is None and high is None else f"{_end(low)}:{_end(high)}"
        table.add_row(label, asked, *(f"{value:+.4f}" for value in (values.lowest, values.mean, values.highest)))
    console().print(table)


def _how(info: Mapping[str, Any]) -> str:
    """How scenes were made, and with what yield."""
    if info.get("raw"):
        return "raw output of the model"
    if info["method"] == "rejection":
        return f"rejection, {info['draws']:,} draws, {100 * info['acceptance']:.3g}% accepted"
    if info["method"] == "splitting":
        return f"splitting, {info['candidates']:,} evaluations, {100 * info['acceptance']:.3g}% of the moves accepted"
    if info["method"] == "growth":
        return f"growth, {info['candidates']:,} evaluations, {info['sweeps']} sweeps of moves after the last object"
    return f"{info['method']}, {info['candidates']:,} candidates"


def _end(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
