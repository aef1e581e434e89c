"""`scenegen data`: what is in sets of scenes, and new sets from them; `scenegen dataset`: sets of many specs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.many import exit_status, folder_for, names_of, say_why
from scenegen.cli.options import (
    ADDRESS,
    ENGINE,
    JSON,
    ROOT,
    WORKERS,
    argument,
    field_option,
    find_specs,
    option,
    seconds,
    spec_names,
)
from scenegen.cli.output import complain, print_error, print_json, print_message, progress_bar
from scenegen.errors import DataError, RequestError
from scenegen.errors.files import DAMAGED_SHARD, DATA_ARGUMENTS
from scenegen.errors.requests import OUT_OF_PLACE
from scenegen.sampling.request import SampleRequest
from scenegen.scenes.locations import inside

if TYPE_CHECKING:
    from scenegen.api.set_report import SetReport
    from scenegen.api.stored import StoredSet
    from scenegen.sampling.engine.engines import JobResult


DATA_OPTIONS: dict[str | None, tuple[str, ...]] = {  # of each action; None is the report
    None: ("--verify", "--json", "--engine", "--address", "--workers", "--timeout"),
    "merge": ("--out",),
    "split": ("--out", "--share", "--seed"),
    "filter": ("--out", "--phi"),
    "remake": ("--shard", "--timeout"),
}
BARS = " ▁▂▃▄▅▆▇█"
FRESH = 30.0  # seconds
MAX_NAMED_SHARDS = 5  # damaged shards that are named


def data(
    sets: list[str] = argument(
        "Sets, or folders of sets: DIR or URL. Or an action, merge, split, filter or remake, and its sets.",
        "[ACTION] SET",
    ),
    verify: bool = option("Check every checksum, and score every scene again."),
    out: str | None = option("The new set, or the folder of new sets.", "DIR/"),
    phi: list[str] | None = option("For filter: phi to keep.", "[NAME=]LO:HI"),
    share: list[str] | None = option("For split: a part and its share.", "NAME=SHARE"),
    seed: int = option("Of a split.", default=0),
    shard: list[int] | None = option("For remake: the number of a shard.", "N"),
    engine: str = option("What reads the shards: local or ray.", default="local"),
    address: str | None = option("The Ray cluster.", "ADDR"),
    workers: int | None = WORKERS,
    timeout: float = option(
        "Seconds for fresh exact scenes to compare with; 0 for none. For remake: of a shard.",
        "SECONDS",
        default=FRESH,
        parser=seconds,
    ),
    json: bool = JSON,
) -> int:
    """Say what is in a set of scenes, or make new sets from old ones. Sets are read shard by shard, whatever their
    size.

    \b
      scenegen data set/
      scenegen data s3://bucket/set/ --verify
      scenegen data build/dataset/ --verify --timeout 0
      scenegen data merge a/ b/ --out both/
      scenegen data split set/ --share train=0.9 --share test=0.1 --out parts/
      scenegen data filter set/ --phi 0:0.1 --out hard/
      scenegen data remake data/table_setting/ --shard 17

    The report has histograms of phi, where objects are, which numbers of things were drawn, repeated scenes, how many
    of fresh exact scenes the set covers, and the state of every shard. The exit status is 1 if a shard is damaged.
    Of a folder of sets, every set is reported; one that cannot be read is named and does not stop the rest.
    `remake` makes a shard of a data set again from its own seed, and puts it back where it is missing or damaged.
    """
    from scenegen.api.stored import open_set

    action = sets[0] if sets[0] in DATA_OPTIONS and not Path(sets[0]).is_dir() else None
    places = sets if action is None else sets[1:]
    least = 2 if action == "merge" else 1
    if len(places) < least or (len(places) > 1 and action not in (None, "merge")):
        wanted = "two sets or more" if action == "merge" else "one set"
        raise RequestError(DATA_ARGUMENTS(action=action or "", wanted=wanted))
    if action == "remake" and not shard:
        raise RequestError(DATA_ARGUMENTS(action=action, wanted="<shard=N>"))
    if action not in (None, "remake") and out is None:
        raise RequestError(DATA_ARGUMENTS(action=action, wanted="<out>"))
    given = {"--out": out, "--phi": phi, "--share": share, "--seed": seed, "--shard": shard}
    given |= {"--verify": verify, "--json": json}
    given |= {"--engine": engine != "local", "--address": address, "--workers": workers, "--timeout": timeout != FRESH}
    odd = next((option for option, value in given.items() if value and option not in DATA_OPTIONS[action]), None)
    if odd is not None:
        of = [f"`{name or 'the report'}`" for name, options in DATA_OPTIONS.items() if odd in options]
        raise RequestError(OUT_OF_PLACE(option=odd, rule=f"is an option of {', '.join(of)}", remedy="leave it out"))
    if action == "remake":
        _remake(places[0], shard or [], None if timeout == FRESH else timeout)
        return 0
    if action is not None:
        assert out is not None
        _edit(action, [open_set(place) for place in places], out, phi or [], share or [], seed)
        return 0
    from scenegen.sampling.engine.engines import map_each

    how: dict[str, Any] = {"verify": verify, "timeout": timeout}
    how["map_jobs"] = lambda job, items: map_each(engine, job, items, workers, address)
    return _report(places, json=json, **how)


def _report(places: list[str], *, json: bool, **how: Any) -> int:
    """Report every set of the places, `how` as `set_report` takes it, and return the exit status."""
    from scenegen.api.set_report import set_report
    from scenegen.api.stored import open_set, sets_in

    found = [one for place in places for one in sets_in(place)]
    documents, failed, scenes, size = [], [], 0, 0
    for number, location in enumerate(found):
        try:
            stored = open_set(location)
            report = set_report(stored, **how)
        except DataError as error:
            if len(found) == 1:
                raise
            print_message(f"{location} failed:")
            complain(*error.diagnostics)
            failed.append(location)
            continue
        scenes, size = scenes + report.scenes, size + report.bytes
        if json:
            documents.append(_as_json(stored, report))
        else:
            print("\n" * (number > 0), end="")
            _show(stored, report)
        if report.faults:
            failed.append(location)
            first = report.faults[0]
            whole = len(report.shards)
            complain(DAMAGED_SHARD(count=len(report.faults), total=whole, file=first.file, reason=first.fault))
    if json:
        several = {"format": "scenegen/data", "version": 1, "sets": documents, "failed": failed}
        print_json(documents[0] if len(found) == 1 else several)
    elif len(found) > 1:
        print(f"\n{len(found)} sets: {scenes:,} scenes, {size / 1e6:,.1f} MB; {len(failed)} damaged")
    return exit_status(failed, len(found)) if len(found) > 1 else int(bool(failed))


def _edit(action: str, opened: list[StoredSet], out: str, phi: list[str], share: list[str], seed: int) -> None:
    from scenegen.api.set_edit import filter_set, merge_sets, split_set
    from scenegen.sampling.request import parse_phi

    if action == "merge":
        made = {out: merge_sets(opened, out)}
    elif action == "filter":
        if not phi:
            raise RequestError(DATA_ARGUMENTS(action=action, wanted="<phi=LO:HI>"))
        made = {out: filter_set(opened[0], parse_phi(phi, opened[0].labels), out)}
    else:
        shares = dict(map(_share, share))
        if not shares or len(shares) < len(share):
            raise RequestError(DATA_ARGUMENTS(action=action, wanted="<share=NAME=SHARE>, each name once"))
        parts = split_set(opened[0], shares, seed, out)
        made = {inside(out, name): manifest for name, manifest in parts.items()}
    for place, manifest in made.items():
        print_error(f"{manifest.scenes:,} scenes in {_shards(len(manifest.shards))} in {place}")


def _remake(place: str, shards: list[int], timeout: float | None) -> None:
    from scenegen.api.dataset import SHARD_SECONDS, remake

    for number in shards:
        shard, written = remake(place, number, timeout or SHARD_SECONDS)
        made = shard.made
        assert made is not None
        state = "put back" if written else "the same bytes as there"
        print_error(f"{shard.file}: {shard.scenes:,} scenes from seed {made.seed}, sha256 {shard.sha256[:12]}: {state}")


def _share(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        if name.isidentifier():
            return name, float(value)
    except ValueError:
        pass
    raise RequestError(DATA_ARGUMENTS(action="split", wanted=f"<share=NAME=SHARE>, such as train=0.9, not {text!r}"))


def _show(stored: StoredSet, report: SetReport) -> None:
    manifest = stored.manifest
    header = stored.header
    print(f"{stored.location}: {header.spec.title or header.spec.sha256[:12]}\n")
    size = report.bytes / 1e6
    state = "complete" if report.complete else f"unfinished, of {manifest.request['n']:,}"
    facts = [
        ("scenes", f"{report.scenes:,} in {_shards(len(report.shards))}, {size:,.1f} MB, {state}"),
        ("objects", ", ".join(stored.objects)),
        ("request", f"seed {manifest.request['seed']}, spread {header.request.spread}, method {_method(stored)}"),
        ("repeated", "too many scenes to tell" if report.repeated is None else f"{report.repeated:,} scenes"),
    ]
    for name, each in report.drawn.items():
        facts.append(("drawn", f"{name}: " + ", ".join(f"{what} in {count:,}" for what, count in each.items())))
    if report.coverage is not None:
        own, other = report.coverage
        facts.append(("coverage", f"{own:.3f} of fresh exact scenes; by other fresh ones {other:.3f}"))
    healthy = len(report.shards) - len(report.faults)
    how = "checksums and phi of every scene" if report.verified else "sizes"
    facts.append(("health", f"{healthy} of {len(report.shards)} shards, by {how}"))
    for name, value in facts:
        print(f"  {name:<9} {value}")
    print("\nphi by label, lowest to highest:\n")
    for label, one in (manifest.phi() if manifest.shards else {}).items():
        print(f"  {label:<12} {one.lowest:+.4f} {_bars(report.phi[label])} {one.highest:+.4f}, mean {one.mean:+.4f}")
    print("\nwhere objects are, left to right (x) and near to far (y):\n")
    for name, counts in report.places.items():
        print(f"  {name:<12} x {_bars(counts.sum(axis=1))}  y {_bars(counts.sum(axis=0))}")
    for bad in report.faults[:MAX_NAMED_SHARDS]:
        print(f"\n  {bad.file}: {bad.fault}", end="")
    if report.faults:
        print()


def _shards(count: int) -> str:
    return f"{count} shard" + ("s" if count != 1 else "")


def _method(stored: StoredSet) -> str:
    return str(stored.header.sampler.get("method", "unknown"))


def _bars(counts: Any) -> str:
    """A histogram in one line."""
    most = int(counts.max()) or 1
    return "".join(BARS[-(-int(count) * (len(BARS) - 1) // most)] for count in counts)


def _as_json(stored: StoredSet, report: SetReport) -> dict[str, Any]:
    return {
        "format": "scenegen/data",
        "version": 1,
        "location": stored.location,
        "complete": report.complete,
        "scenes": report.scenes,
        "bytes": report.bytes,
        "request": stored.manifest.request,
        "phi": {
            label: {**one.model_dump(), "counts": report.phi[label].tolist()}
            for label, one in (stored.manifest.phi() if stored.shards else {}).items()
        },
        "places": {name: counts.tolist() for name, counts in report.places.items()},
        "drawn": report.drawn,
        "repeated": report.repeated,
        "coverage": None if report.coverage is None else dict(zip(("set", "fresh"), report.coverage, strict=True)),
        "verified": report.verified,
        "shards": [{"file": one.file, "scenes": one.scenes, "fault": one.fault or None} for one in report.shards],
    }


def dataset(
    out: str = option("The folder or URL of the data set.", "DIR/|URL", default=...),
    specs: list[Path] | None = argument(
        "Spec files, or names of shipped specs; all shipped specs where none is named.",
        "[SPEC]...",
        default=None,
        callback=find_specs,
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
    from scenegen.resources import shipped_specs

    paths = specs or list(shipped_specs().values())
    folder = folder_for(out, len(paths), urls=True)
    named = list(zip(names_of(paths), paths, strict=True))
    failed: list[str] = []
    jobs = done = 0
    with progress_bar() as bar:
        task = bar.add_task("measuring", total=len(named))

        def report_job(what: str, ended: JobResult, count: int, total: int) -> None:
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
                engine=engine, workers=workers, address=address, root=root, told=report_job,
            )  # fmt: skip
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(f"interrupted after {done} shards; --resume goes on in {folder}/") from error
    scenes = sum(one.scenes for one in made.values())
    for name, one in made.items():
        for why in one.missing or ():
            print_error(f"{name}: left out: {why}")
    print_error(f"{scenes:,} scenes of {len(made)} specs in {folder}/")
    return exit_status(failed, jobs)
