"""`scenegen sample`: scenes for a range of phi."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenegen.cli.options import Counts, Root, all_found, seconds, spec_names, whole
from scenegen.cli.render import Most
from scenegen.cli.sample_runs import SampleOptions, StorageOptions, sample_many, sample_one
from scenegen.errors.requests import CONFLICTING_ARGUMENTS, OUT_OF_PLACE, RESUME_WITHOUT_FILE
from scenegen.sampling.methods import METHODS, methods_help

if TYPE_CHECKING:
    from collections.abc import Callable


def _choices(*names: str) -> Callable[[str], list[str]]:
    """What a shell completes an option's value to."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


def sample(
    sources: Annotated[
        list[Path],
        typer.Argument(
            help="A spec file, the name of a shipped spec, or a model file; several with a folder for --out.",
            metavar="SPEC|MODEL",
            show_default=False,
            callback=all_found,
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
    n: Annotated[
        int | None,
        typer.Option(
            "-n",
            help="How many scenes; default: 16, with --fix-from as many as are given.",
            parser=whole,
            metavar="N",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same scenes.")] = 0,
    out: Annotated[
        str | None,
        typer.Option(
            "--out",
            help="The scenes file, or DIR/ or a URL for a set of shards; default: standard output.",
            metavar="FILE|DIR/|URL",
            show_default=False,
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help=methods_help(),
            autocompletion=_choices(*METHODS),
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
            help="Hold an object where it is, in metres and radians or with units (50cm, 90deg); repeat for more. "
            "With --fix-from the name alone.",
            metavar="NAME=X,Y[,THETA]",
            show_default=False,
        ),
    ] = None,
    fix_from: Annotated[
        Path | None,
        typer.Option(
            "--fix-from",
            help="Complete each scene of this file once: hold its objects, or those of --fix NAME, draw the others.",
            metavar="SCENES",
            show_default=False,
        ),
    ] = None,
    count: Counts = None,
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
    engine: Annotated[
        str,
        typer.Option(
            "--engine",
            help="What draws a set: local processes, or a ray cluster. The bytes are the same.",
            autocompletion=_choices("local", "ray"),
        ),
    ] = "local",
    address: Annotated[
        str | None,
        typer.Option(
            "--address",
            help="The Ray cluster; default: $RAY_ADDRESS, or this machine.",
            metavar="ADDR",
            show_default=False,
        ),
    ] = None,
    shard_size: Annotated[
        int | None,
        typer.Option(
            "--shard-size",
            help="Scenes of each file of a set, a multiple of 65536.",
            metavar="N",
            show_default=False,
        ),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option("--timeout", help="Seconds after which to give up.", parser=seconds, metavar="SECONDS"),
    ] = 60.0,
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
    pictures: Most = None,
    root: Root = None,
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
    free. --satisfied is short for --phi NAME=0: for every label that is not named, --violated for --phi NAME=:0.

    --settle drops every scene in PyBullet for one simulated second and keeps those in which no object moves more than
    1 cm or turns more than 5 degrees; what was refused is counted by object. If fewer than -n scenes are found in time,
    nothing is written and the exit status is 1, unless --keep-partial.

    The scenes depend on the spec, the request and --seed alone, not on --workers or the format. Many scenes grow in a
    folder beside --out: what is broken off, by Ctrl-C, by --timeout or by force, goes on with --resume.

    An --out that ends in a slash, or a URL (s3://bucket/set/), is a set: Parquet files of --shard-size scenes, a
    manifest, a card. It may have any number of scenes. With several specs each gets a set in DIR/; a bad one is
    reported by its name, the others are made, and the exit status is 1."""
    from scenegen.errors import RequestError

    if out is None and resume:
        raise RequestError(RESUME_WITHOUT_FILE())
    if satisfied and violated:
        raise RequestError(CONFLICTING_ARGUMENTS(one="satisfied", other="violated"))
    wishes = SampleOptions(
        phi or [], satisfied, violated, n, seed, method, spread, fix or [], settle, raw, workers, keep_partial, timeout,
        steps, spec, root, count or [], fix_from,
    )  # fmt: skip
    if pictures is not None and render is None:
        raise RequestError(OUT_OF_PLACE(option="--pictures", rule="goes with --render", remedy="add --render DIR"))
    storing = StorageOptions(resume, engine, address, shard_size, pictures)
    if len(sources) == 1:
        sample_one(sources[0], wishes, out, storing, render)
        return 0
    return sample_many(sources, wishes, out, storing, render)
