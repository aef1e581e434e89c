"""`scenegen dataset`: a data set of many specs, at every difficulty."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.many import exit_status, folder_for, names_of, say_why
from scenegen.cli.options import (
    ADDRESS,
    ENGINE,
    ROOT,
    WORKERS,
    all_found,
    argument,
    field_option,
    option,
    spec_names,
)
from scenegen.sampling.request import SampleRequest

if TYPE_CHECKING:
    from scenegen.sampling.engine.engines import JobResult


def dataset(
    out: str = option("The folder or URL of the data set.", "DIR/|URL", default=...),
    specs: list[Path] | None = argument(
        "Spec files, or names of shipped specs; all shipped specs where none is named.",
        "[SPEC]...",
        default=None,
        callback=all_found,
        autocompletion=spec_names,
    ),
    n: int = field_option(SampleRequest, "n", "How many scenes, in equal shares of all specs.", default=1_000_000),
    seed: int = field_option(SampleRequest, "seed", "The same seed gives the same data set."),
    shard_size: int = field_option(
        SampleRequest, "shard_size", "Scenes of each file at most, a multiple of 65536.", default=65_536
    ),
    timeout: float = field_option(SampleRequest, "timeout", "Seconds after which to give a shard up.", default=600.0),
    resume: bool = field_option(SampleRequest, "resume", "Go on with the shards that are not there yet."),
    license: str = option("What the cards say of it, as dataset hubs name it.", "ID", default="unknown"),
    engine: str = ENGINE,
    address: str | None = ADDRESS,
    workers: int | None = WORKERS,
    root: Path | None = ROOT,
) -> int:
    """Make a data set of many specs: scenes of every label, satisfied and not, evenly over phi, and how rare each is.

    \b
      scenegen dataset --out data/
      scenegen dataset table_setting breakfast -n 100_000 --out data/
      scenegen dataset -n 50_000_000 --out s3://bucket/data/ --engine ray

    First the rarity of phi is measured, as `scenegen range` does. Then each spec gets a set of its own in DIR/, with a
    manifest and a card. Every shard is an independent job with a seed of its own: `scenegen data remake` makes one
    again.

    A label that no scene satisfies, or every scene, is named in the cards; its share goes to the other parts of the
    spec. A spec or a shard that fails is reported by its name, the others are made, and the exit status is 1; --resume
    with a longer --timeout goes on.
    """
    from scenegen.api.dataset import DRAWING, make_dataset
    from scenegen.cli.output import print_error, progress_bar
    from scenegen.resources import shipped_specs

    paths = specs or list(shipped_specs().values())
    folder = folder_for(out, len(paths), urls=True)
    named = list(zip(names_of(paths), paths, strict=True))
    failed: list[str] = []
    jobs = done = 0
    with progress_bar() as bar:
        task = bar.add_task("measuring", total=len(named))

        def told(what: str, ended: JobResult, count: int, total: int) -> None:
            nonlocal jobs, done
            jobs += 1
            done += what == DRAWING and not ended.errors
            bar.update(task, completed=count, total=total, description=f"{what}: {count} of {total}")
            if ended.errors:
                say_why(ended)
                failed.append(ended.name)

        try:
            made = make_dataset(
                folder, named, n, seed=seed, shard_size=shard_size, timeout=timeout, resume=resume, license=license,
                engine=engine, workers=workers, address=address, root=root, told=told,
            )  # fmt: skip
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(f"interrupted after {done} shards; --resume goes on in {folder}/") from error
    scenes = sum(one.scenes for one in made.values())
    for name, one in made.items():
        for why in one.missing or ():
            print_error(f"{name}: left out: {why}")
    print_error(f"{scenes:,} scenes of {len(made)} specs in {folder}/")
    return exit_status(failed, jobs)
