"""Outcomes of a policy on a suite: JSON lines, a header and one line an episode. Format `scenegen/outcomes`, version 1.

No times are in it, so the same outcomes give the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from scenegen.errors import DataError, RequestError
from scenegen.errors.files import OTHER_REQUEST
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.scenes.files import read_bytes
from scenegen.scenes.sets import Sha256
from scenegen.worlds.suites.suite import Suite, SuiteModel, load_model

Instruction = Literal["own", "empty"]


class OutcomesHeader(SuiteModel):
    """The first line: which suite, world and policy; `episodes` is the number of starts of the suite."""

    format: Literal["scenegen/outcomes"] = "scenegen/outcomes"
    version: Literal[1] = 1
    suite: str
    digest: Sha256
    world: str
    policy: str
    instruction: Instruction = "own"
    reverse: bool = False
    episodes: Annotated[int, Field(ge=1)]


class EpisodeOutcome(SuiteModel):
    """A line: `error` says why an episode counts as a failure that was none of the world's judgement."""

    episode: Annotated[int, Field(ge=0)]
    task: str
    band: str
    success: bool
    steps: Annotated[int, Field(ge=0)]
    error: str | None = None


@dataclass(frozen=True, slots=True)
class SuiteOutcomes:
    """A file of outcomes, in the order of episodes."""

    header: OutcomesHeader
    episodes: tuple[EpisodeOutcome, ...]

    @property
    def success(self) -> dict[int, bool]:
        """Success by the number of the episode."""
        return {one.episode: one.success for one in self.episodes}

    @property
    def name(self) -> str:
        """The policy without its folder, and how it was run where that was another way than usual."""
        how = [word for word, there in (("reversed", self.header.reverse), ("no instruction", self.empty)) if there]
        policy = self.header.policy.rpartition("/")[2]
        return f"{policy} ({', '.join(how)})" if how else policy

    @property
    def empty(self) -> bool:
        return self.header.instruction == "empty"


def read_outcomes(path: Path, suite: Suite | None = None) -> SuiteOutcomes:
    """The outcomes in a file; of `suite`, where one is given. An unfinished last line, as a run that was killed leaves
    it, is left out. Raises DataError."""
    what = "a file of outcomes"
    lines = read_bytes(path, what).split(b"\n")
    header = load_model(OutcomesHeader, lines[0], path, what)
    found: dict[int, EpisodeOutcome] = {}
    for line in lines[1:-1]:
        one = load_model(EpisodeOutcome, line, path, what)
        if one.episode >= header.episodes or one.episode in found:
            reason = f"episode {one.episode} is there twice, or beyond the {header.episodes} of the suite"
            raise DataError(NOT_A_SUITE(file=path, what=what, reason=reason))
        found[one.episode] = one
    if suite is not None:
        if header.digest != suite.digest:
            reason = f"its suite has the digest {header.digest[:12]}, and this one {suite.digest[:12]}"
            raise DataError(NOT_A_SUITE(file=path, what=f"of the suite {suite.name}", reason=reason))
        cells = suite.cells
        for one in found.values():
            task, band = cells[one.episode % len(cells)]
            if header.reverse == suite.reverse and (one.task, one.band) != (task.name, band.name):
                reason = f"episode {one.episode} names another task or band"
                raise DataError(NOT_A_SUITE(file=path, what=f"of the suite {suite.name}", reason=reason))
    return SuiteOutcomes(header, tuple(found[number] for number in sorted(found)))


def same_run(path: Path, found: OutcomesHeader, wanted: OutcomesHeader) -> None:
    """Raises RequestError where a file that is to be continued has outcomes of another run."""
    for name, mine in wanted:
        if getattr(found, name) != mine:
            raise RequestError(OTHER_REQUEST(folder=path, key=name, before=getattr(found, name), now=mine))


def dump_outcomes(header: OutcomesHeader, episodes: Iterable[EpisodeOutcome]) -> bytes:
    """The bytes of a file, episodes in their order."""
    each: list[OutcomesHeader | EpisodeOutcome] = [header, *sorted(episodes, key=lambda one: one.episode)]
    return b"".join(map(line_of, each))


def line_of(one: OutcomesHeader | EpisodeOutcome) -> bytes:
    """A line of the file."""
    return (json.dumps(one.model_dump(), ensure_ascii=False) + "\n").encode()
