"""What outcomes of a suite say, as a page: success by band and task, the share of all starts, differences of two
policies on the same starts, and pictures of the starts that most of them failed."""

from __future__ import annotations

import base64
import html
import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from scenegen.errors import RequestError
from scenegen.errors.files import WRONG_ENDING
from scenegen.errors.requests import GIVEN_TWICE
from scenegen.learn.success.statistics import ALPHA, base_rate, required_unpaired_starts, wilson
from scenegen.play.suites.harnesses.results import read_results
from scenegen.play.suites.outcomes import (
    RUN_FIELDS,
    EpisodeOutcome,
    SuiteOutcomes,
    blind_pairs,
    check_outcomes,
    compare_outcomes,
    differences,
)
from scenegen.play.suites.suite import GradedStart, Suite
from scenegen.scenes.files import write_whole
from scenegen.validation import as_path

DIFFERENCE = 0.05  # the difference whose episodes are counted
PICTURE_SIZE = (320, 240)
PAGE_STYLE = """
body { max-width: 70em; margin: 2em auto; padding: 0 1em; background: #faf9f6; color: #1e2126;
  font: 14px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif }
h1 { font-size: 20px } h2 { font-size: 15px; margin: 2em 0 .3em }
p, figcaption, th { color: #626871; margin: .2em 0 .6em }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { padding: 4px 14px 4px 6px; text-align: left; border-bottom: 1px solid #e3e0d9 }
figure { display: inline-block; width: 320px; margin: 0 14px 14px 0; vertical-align: top } img { width: 100% }
"""  # the colours of the page of `scenegen view`


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table of a report; cells that begin with a share, as in "41 % ...", get a bar."""

    title: str
    note: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


def report_suite(
    folder: str | Path, files: Sequence[Path], out: str | Path, *, pictures: int = 8, workers: int | None = None
) -> Path:
    """Write a report on files of outcomes: .html, one page without anything beside it, or .md, without pictures.
    Raises RequestError, DataError, OutputError."""
    out = as_path("out", out)
    if out.suffix not in (".html", ".md"):
        raise RequestError(WRONG_ENDING(path=out, ending=".html", better=out.with_suffix(".html")))
    suite = Suite.load(folder)
    read = [read_results(path, suite) for path in files]
    suites = {way: Suite.load(folder, reverse=way) for way in {one.header.reverse for one in read}}
    for path, one in zip(files, read, strict=True):
        check_outcomes(path, one, suites[one.header.reverse])
    read = [replace(one, name=name) for one, name in zip(read, _names(read, files), strict=True)]
    played = [(one, suites[one.header.reverse]) for one in read]
    title = f"Suite {suite.name}"
    about = f"{len(suite):,} starts: {len(suite.tasks)} tasks, {suite.n} of each band. Digest {suite.digest}."
    tables = [*_shares(played), *_scenes_by_hand(played), *_differences(read), *_blind(read), *_errors(read)]
    if out.suffix == ".md":
        write_whole(out, "\n".join([f"# {title}", "", about, *map(_markdown, tables)]).encode())
        return out
    shown = _worst(read, suites[read[0].header.reverse])[:pictures]
    body = "".join([f"<h1>{html.escape(title)}</h1><p>{about}</p>", *map(_html, tables), _pictures(shown, workers)])
    head = (
        f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{html.escape(title)}</title>'
    )
    page = f'<!doctype html>\n<html lang="en"><head>{head}</head><body>{body}</body></html>\n'
    write_whole(out, page.encode())
    return out


def _names(read: Sequence[SuiteOutcomes], files: Sequence[Path]) -> list[str]:
    """What each file is called: its policy without the folder, how that was run where it was not as usual, and, of
    those that are then called alike, what tells them apart. Raises RequestError for a file that is given twice."""
    headers = [one.header for one in read]
    words = [["reversed"] * one.reverse + ["no instruction"] * (one.instruction == "empty") for one in headers]
    details = [[_run_text(field, getattr(one, field)) for one in headers] for field in (*RUN_FIELDS, "policy")]
    for detail in (*details, [path.name for path in files], [str(path) for path in files], [""] * len(files)):
        policies = [re.split(r"[/\\]", one.policy.rstrip("/"))[-1] for one in headers]
        names = [f"{one} ({', '.join(how)})" if how else one for one, how in zip(policies, words, strict=True)]
        for own, how, name in zip(detail, words, names, strict=True):
            if any(own != other for other, its in zip(detail, names, strict=True) if its == name):
                how.append(own)
    twice = [str(path) for path, name in zip(files, names, strict=True) if names.count(name) > 1]
    if twice:
        raise RequestError(GIVEN_TWICE(what=twice[0]))
    return names


def _run_text(field: str, value: object) -> str:
    """What a header says in a field of RUN_FIELDS."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {version}" for name, version in value.items())
    return f"{field} {'not recorded' if value is None else value}"


def _shares(played: Sequence[tuple[SuiteOutcomes, Suite]]) -> Iterator[ReportTable]:
    names = tuple(one.name for one, _ in played)
    note = "Success, and its 95 % interval (Wilson)."
    stood = [[band_that_stood(e, suite) for e in one.episodes] for one, suite in played]
    kinds = dict.fromkeys(band.name for _, suite in played for _, band in suite.cells)
    rows = [
        (
            kind,
            *(
                _share([e for e, band in zip(one.episodes, bands, strict=True) if band == kind])
                for (one, _), bands in zip(played, stood, strict=True)
            ),
        )
        for kind in kinds
    ]
    rows.append(("every episode", *(_share(one.episodes) for one, _ in played)))
    rows.append(("base distribution", *(_base(one, suite) for one, suite in played)))
    more = " Base distribution: all starts that the tasks allow, each band by its probability, played or not."
    yield ReportTable("Success by band", note + more, ("band", *names), rows)
    kinds = dict.fromkeys(task.name for _, suite in played for task in suite.tasks)
    rows = [(kind, *(_share([e for e in one.episodes if e.task == kind]) for one, _ in played)) for kind in kinds]
    yield ReportTable("Success by task", note, ("task", *names), rows)


def band_that_stood(one: EpisodeOutcome, suite: Suite) -> str:
    """The band of an episode: that of phi where objects really stood, if the outcome says it; "" where that is in no
    band."""
    if one.scene is None:
        return one.band
    phi = one.scene.phi
    bands = suite[one.episode].task.bands
    own = [band.name for band in bands if band.name == one.band and band.phi[0] <= phi <= band.phi[1]]
    return next(iter(own + [band.name for band in bands if band.phi[0] <= phi <= band.phi[1]]), "")


def _share(some: Sequence[EpisodeOutcome]) -> str:
    if not some:
        return "-"
    hits, n = sum(one.success for one in some), len(some)
    return f"{_with_interval(hits / n, *wilson(hits / n, n))}, {hits} of {n}"


def _base(outcomes: SuiteOutcomes, suite: Suite) -> str:
    """The share of success over all starts that the tasks' specs allow, tasks alike."""
    if not outcomes.episodes:
        return "-"
    cells, each = suite.cells, [list[bool]() for _ in suite.cells]
    place = {(task.name, band.name): k for k, (task, band) in enumerate(cells)}
    for one in outcomes.episodes:
        if band := band_that_stood(one, suite):
            each[place[one.task, band]].append(one.success)
    weights = [band.probability / len(suite.tasks) for _, band in cells]
    errors = [band.error for _, band in cells]
    return _with_interval(*base_rate([sum(some) for some in each], [len(some) for some in each], weights, errors))


def _with_interval(share: float, low: float, high: float) -> str:
    return f"{100 * share:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def _differences(read: Sequence[SuiteOutcomes]) -> list[ReportTable]:
    rows = []
    for one, other in combinations(read, 2):
        found = compare_outcomes(one, other)
        if one.header.reverse != other.header.reverse or not found.n:
            continue
        low, high = (f"{100 * end:+.1f}" for end in found.interval)
        unlike = differences(one.header, other.header)
        fields = [name for name in RUN_FIELDS if name in unlike]
        words = [" and ".join(_run_text(name, value) for value in unlike[name]) for name in fields]
        success = [*one.success.values(), *other.success.values()]
        unpaired = required_unpaired_starts(sum(success) / len(success), DIFFERENCE)
        rows.append((
            f"{one.name} - {other.name}", f"{100 * found.difference:+.1f} points ({low} to {high})",
            f"{found.first} and {found.second} of {found.n}", f"{found.p:.2g}",
            ", but the runs differ: ".join(["yes" if found.p < ALPHA else "no", *words]),
            f"{'yes' if found.is_decided else 'no'} ({found.evidence:.3g} of {1.0 / ALPHA:.0f})",
            f"{found.required_starts(DIFFERENCE):,} ({unpaired:,} on starts of their own)",
        ))  # fmt: skip
    head = (
        "",
        "difference",
        "one alone succeeds",
        "p",
        "told apart",
        "at any look",
        f"episodes for {100 * DIFFERENCE:.0f} points",
    )
    note = (
        "On the same starts: 95 % interval (Bonett and Price); McNemar's exact test, for a number of episodes that was"
        " chosen before; a test that stays valid however often one looked and whenever one stopped; and how many"
        " episodes of each policy tell such a difference apart at 95 % with power 80 %."
    )
    return [ReportTable("Paired differences", note, head, rows)] if rows else []


def _blind(read: Sequence[SuiteOutcomes]) -> list[ReportTable]:
    rows = []
    for one, other in combinations(read, 2):
        found = blind_pairs(one, other)
        if found is not None:
            names = f"{one.name} as {one.header.blind}, {other.name} as {other.header.blind}"
            rows.append((names, f"{found.n}", f"{found.first} and {found.second}", f"{found.p:.2g}"))
    head = ("", "back to back", "first, second trial alone succeeds", "p")
    note = (
        "Two policies on the same start in succession, by letters, in an order drawn by lot. A small p (McNemar's exact"
        " test) says that which trial came first made a difference, whichever policy it was."
    )
    return [ReportTable("Blind pairs", note, head, rows)] if rows else []


def _errors(read: Sequence[SuiteOutcomes]) -> list[ReportTable]:
    rows = []
    for one in read:
        each = Counter(episode.error for episode in one.episodes if episode.error is not None)
        rows += [(one.name, f"{many}", said) for said, many in each.most_common(3)]
        at_once = sum(episode.success and episode.steps == 0 for episode in one.episodes)
        rows += [(one.name, f"{at_once}", "solved at once: the world judges the start a success")] if at_once else []
    note = "Episodes that ended by an error count as failures."
    return [ReportTable("Errors", note, ("", "episodes", "what"), rows)] if rows else []


def _scenes_by_hand(played: Sequence[tuple[SuiteOutcomes, Suite]]) -> list[ReportTable]:
    """What stood there where people set the starts."""
    rows = []
    for one, suite in played:
        some = [(e, e.scene.phi, suite[e.episode]) for e in one.episodes if e.scene is not None]
        if some:
            own = sum(band_that_stood(e, suite) == e.band for e, _, _ in some)
            off = sum(abs(phi - start.phi[start.task.success]) for _, phi, start in some) / len(some)
            rows.append(
                (
                    one.name,
                    f"{len(some)}",
                    f"{100 * own / len(some):.1f} % in the band that was asked for",
                    f"{off:.4f}",
                )
            )
    note = "Starts as they really stood: bands above are those of phi there. What is in no band counts in none."
    return [ReportTable("Set by hand", note, ("", "episodes", "bands", "phi off by, mean"), rows)] if rows else []


def _html(table: ReportTable) -> str:
    def cell(text: str) -> str:
        share = text.partition(" %")[0]
        bar = f' style="background: linear-gradient(90deg, #dff0ea {share}%, transparent 0)"'
        bar = bar if " %" in text and share.replace(".", "").isdigit() else ""
        return f"<td{bar}>{html.escape(text)}</td>"

    head = "".join(f"<th>{html.escape(text)}</th>" for text in table.head)
    rows = "".join(f"<tr>{''.join(map(cell, row))}</tr>" for row in table.rows)
    return f"<h2>{html.escape(table.title)}</h2><p>{html.escape(table.note)}</p><table><tr>{head}</tr>{rows}</table>"


def _markdown(table: ReportTable) -> str:
    lines = [table.head, ("---",) * len(table.head), *table.rows]
    each = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
    return f"\n## {table.title}\n\n{table.note}\n\n{each}\n"


def _worst(read: Sequence[SuiteOutcomes], suite: Suite) -> list[tuple[GradedStart, int, int]]:
    """Of each task the start that most policies failed, the easiest of several; how many failed, of how many."""
    same = [one.success for one in read if one.header.reverse == suite.reverse]
    found: dict[str, tuple[GradedStart, int, int]] = {}
    for start in suite:
        each = [one[start.number] for one in same if start.number in one]
        failed = len(each) - sum(each)
        best = found.get(start.task.name)
        if failed and (best is None or (failed, start.log10p) > (best[1], best[0].log10p)):
            found[start.task.name] = start, failed, len(each)
    return sorted(found.values(), key=lambda one: (-one[1], -one[0].log10p))


def _pictures(worst: Sequence[tuple[GradedStart, int, int]], workers: int | None) -> str:
    parts = []
    for start, failed, count in worst:
        with tempfile.TemporaryDirectory() as folder:
            some = start.task.scenes[[start.row]]
            drawn = some.render(folder, views=("perspective",), size=PICTURE_SIZE, workers=workers)
            data = base64.b64encode(drawn.pictures[0].read_bytes()).decode()
        said = f"{start.task.name}, {start.band}, episode {start.number}: {failed} of {count} failed. "
        said = html.escape(said + start.task.instruction)
        parts.append(f'<figure><img src="data:image/png;base64,{data}" alt=""><figcaption>{said}</figcaption></figure>')
    note = "Of each task the start that most policies failed; of several, the easiest."
    return f"<h2>Failed by most</h2><p>{note}</p>{''.join(parts)}" if parts else ""
