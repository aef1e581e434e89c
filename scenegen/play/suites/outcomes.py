"""Outcomes of a policy on a suite: JSON lines, a header and one line an episode. Format `scenegen/outcomes`, version 1.

No times are in it, so the same outcomes give the same bytes.
"""

from __future__ import annotations

import codecs
import contextlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from operator import not_
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, FiniteFloat
from pydantic_core import from_json

from scenegen.errors import DataError, RequestError
from scenegen.errors.files import OTHER_REQUEST
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.learn.success.files import FileModel, Letter, OutcomesHeader, load_model
from scenegen.learn.success.statistics import PairedDifference
from scenegen.play.suites.suite import Suite
from scenegen.scenes.files import read_bytes

LETTERS: tuple[Letter, Letter] = ("A", "B")
RUN_FIELDS = ("steps", "timeout", "world", "versions")  # what should not differ between runs that are compared


class SceneThatStood(FileModel):
    """Where the objects of an episode really stood when it began, x, y and theta by name, and phi there."""

    poses: dict[str, tuple[FiniteFloat, FiniteFloat, FiniteFloat]]
    phi: FiniteFloat


class EpisodeOutcome(FileModel, extra="allow"):
    """Another line: `steps` are None where a harness does not say them; `error` says why an episode counts as a failure
    that was none of the world's judgement, `scene` what stood there, where the world says that it was another scene
    than the start, `trial` which one it was in the order of episodes, from 1 on."""

    episode: Annotated[int, Field(ge=0)]
    task: str
    band: str
    success: bool
    steps: Annotated[int, Field(ge=0)] | None
    error: str | None = None
    scene: SceneThatStood | None = Field(default=None, exclude_if=not_)
    trial: Annotated[int, Field(ge=1)] | None = Field(default=None, exclude_if=not_)


@dataclass(frozen=True, slots=True)
class EpisodeOrder:
    """The trial of each episode, in this order; `digest` is the SHA-256 of the file that says so. In an order of pairs
    `blind` is what the policy is called."""

    trials: dict[int, int]
    digest: str
    blind: Letter | None = None


@dataclass(frozen=True, slots=True)
class SuiteOutcomes:
    """A file of outcomes, in the order of episodes; `name` is what a report calls it."""

    header: OutcomesHeader
    episodes: tuple[EpisodeOutcome, ...]
    name: str = ""

    @property
    def success(self) -> dict[int, bool]:
        """Success by the number of the episode."""
        return {one.episode: one.success for one in self.episodes}


def read_outcomes(path: Path, suite: Suite | None = None) -> SuiteOutcomes:
    """The outcomes in a file; of `suite`, where one is given. Blank lines count for nothing. The last line is left out
    where it is unfinished, as a run that was killed leaves it. Raises DataError."""
    what = "a file of outcomes"
    lines = read_bytes(path, what).removeprefix(codecs.BOM_UTF8).split(b"\n")
    with contextlib.suppress(ValueError):
        from_json(lines[-1])
        lines.append(b"")
    (_, first), *rest = [(number, line) for number, line in enumerate(lines[:-1], 1) if line.strip()] or [(1, b"")]
    header = load_model(OutcomesHeader, first, path, what)
    found: dict[int, EpisodeOutcome] = {}
    for number, line in rest:
        one = load_model(EpisodeOutcome, line, f"line {number} of {path}", what)
        if one.episode >= header.episodes or one.episode in found:
            reason = f"episode {one.episode} is there twice, or beyond the {header.episodes} of the suite"
            raise DataError(NOT_A_SUITE(file=path, what=what, reason=reason))
        found[one.episode] = one
    outcomes = SuiteOutcomes(header, tuple(found[number] for number in sorted(found)))
    if suite is not None:
        check_outcomes(path, outcomes, suite)
    return outcomes


def check_outcomes(path: Path, found: SuiteOutcomes, suite: Suite) -> None:
    """Raises DataError where the outcomes in a file are not of a suite, or of its reversed tasks."""
    header, reason = found.header, ""
    if header.digest != suite.digest:
        reason = f"its suite has the digest {header.digest[:12]}, and this one {suite.digest[:12]}"
    elif header.reverse == suite.reverse:
        if header.episodes != len(suite):
            reason = f"it is of {header.episodes:,} episodes, and the suite has {len(suite):,}"
        cells = [(task.name, band.name) for task, band in suite.cells]
        for one in found.episodes:
            if (one.task, one.band) != cells[one.episode % len(cells)]:
                reason = f"episode {one.episode} names another task or band"
    if reason:
        raise DataError(NOT_A_SUITE(file=path, what=f"of the suite {suite.name}", reason=reason))


def differences(one: OutcomesHeader, other: OutcomesHeader) -> dict[str, tuple[Any, Any]]:
    """What of two runs differs, by the name of the field; what a file does not say is None."""
    names = OutcomesHeader.model_fields
    pairs = {name: (getattr(one, name), getattr(other, name)) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def compare_outcomes(one: SuiteOutcomes, other: SuiteOutcomes) -> PairedDifference:
    """Two policies on the starts that both were run on."""
    first, second = one.success, other.success
    both = first.keys() & second.keys()
    alone = sum(first[k] and not second[k] for k in both), sum(second[k] and not first[k] for k in both)
    return PairedDifference(*alone, len(both))


def blind_pairs(one: SuiteOutcomes, other: SuiteOutcomes) -> PairedDifference | None:
    """Of two policies, A and B of one order of pairs, the starts that both had back to back: how many were solved by
    the first trial alone and by the second alone, whichever policy had which. None for others."""
    if one.header.order is None or one.header.order != other.header.order:
        return None
    if {one.header.blind, other.header.blind} != {*LETTERS}:
        return None
    second = {each.episode: each for each in other.episodes}
    both = [(each, second[each.episode]) for each in one.episodes if each.episode in second]
    pairs = [
        (a.success, b.success) if a.trial < b.trial else (b.success, a.success)
        for a, b in both
        if a.trial is not None and b.trial is not None and abs(a.trial - b.trial) == 1
    ]
    alone = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    return PairedDifference(*alone, len(pairs))


def check_same_run(path: Path, found: OutcomesHeader, wanted: OutcomesHeader) -> None:
    """Raises RequestError where a file that is to be continued has outcomes of another run. What an old file does not
    say is not compared."""
    for name, (before, now) in differences(found, wanted).items():
        if before is not None:
            raise RequestError(OTHER_REQUEST(folder=path, key=name, before=before, now=now, outcomes=True))


def dump_outcomes(header: OutcomesHeader, episodes: Iterable[EpisodeOutcome]) -> bytes:
    """The bytes of a file, episodes in their order."""
    each: list[OutcomesHeader | EpisodeOutcome] = [header, *sorted(episodes, key=lambda one: one.episode)]
    return b"".join(map(dump_line, each))


def dump_line(one: OutcomesHeader | EpisodeOutcome) -> bytes:
    """A line of the file."""
    return (json.dumps(one.model_dump(), ensure_ascii=False) + "\n").encode(errors="replace")
