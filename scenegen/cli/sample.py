"""`scenegen sample`: scenes for a range of phi."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.options import COUNT, PICTURES, ROOT, all_found, argument, option, seconds, spec_names
from scenegen.cli.sample_runs import SampleOptions, StorageOptions, sample_many, sample_one
from scenegen.errors.requests import CONFLICTING_ARGUMENTS, OUT_OF_PLACE, RESUME_WITHOUT_FILE
from scenegen.sampling.methods import METHODS, methods_help

if TYPE_CHECKING:
    from collections.abc import Callable


def _choices(*names: str) -> Callable[[str], list[str]]:
    """What a shell completes an option's value to."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


def sample(
    sources: list[Path] = argument(
        "A spec file, the name of a shipped spec, or a model file; several with a folder for --out.",
        "SPEC|MODEL",
        callback=all_found,
        autocompletion=spec_names,
    ),
    phi: list[str] | None = option("Wanted phi: LO:HI, LO: or :HI; NAME=LO:HI names a label.", "[NAME=]LO:HI"),
    satisfied: bool = option("phi >= 0 for every label that --phi does not name."),
    violated: bool = option("phi <= 0 for every label that --phi does not name."),
    n: int | None = option(
        "How many scenes; default: 16, with --fix-from as many as are given.",
    ),
    seed: int = option("The same seed gives the same scenes.", default=0),
    out: str | None = option(
        "The scenes file, or DIR/ or a URL for a set of shards; default: standard output.", "FILE|DIR/|URL"
    ),
    method: str = option(methods_help(), default="auto", autocompletion=_choices(*METHODS)),
    spread: str = option(
        "flat: evenly over the range of phi; base: as they occur.",
        default="flat",
        autocompletion=_choices("flat", "base"),
    ),
    fix: list[str] | None = option(
        "Hold an object where it is, in metres and radians or with units (50cm, 90deg); repeat for more. "
        "With --fix-from the name alone.",
        "NAME=X,Y[,THETA]",
    ),
    fix_from: Path | None = option(
        "Complete each scene of this file once: hold its objects, or those of --fix NAME, draw the others.", "SCENES"
    ),
    count: list[str] | None = COUNT,
    settle: bool = option("Only scenes in which nothing moves when dropped in a simulator."),
    workers: int | None = option("Processes; default: one for small requests, else one per core."),
    resume: bool = option("Go on where an earlier run with this --out was broken off."),
    engine: str = option(
        "What draws a set: local processes, or a ray cluster. The bytes are the same.",
        default="local",
        autocompletion=_choices("local", "ray"),
    ),
    address: str | None = option("The Ray cluster; default: $RAY_ADDRESS, or this machine.", "ADDR"),
    shard_size: int | None = option("Scenes of each file of a set, a multiple of 65536.", "N"),
    timeout: float = option("Seconds after which to give up.", "SECONDS", default=60.0, parser=seconds),
    keep_partial: bool = option("Keep what was found when time is up."),
    raw: bool = option("A model's own output, neither refined nor filtered."),
    steps: int | None = option("Evaluations of a flow's network for a scene; default: as it was trained.", "N"),
    spec: Path | None = option("Refuse a model that was trained on another spec.", "SPEC"),
    render: Path | None = option("Draw the scenes into this folder, too.", "DIR"),
    pictures: int | None = PICTURES,
    root: Path | None = ROOT,
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
