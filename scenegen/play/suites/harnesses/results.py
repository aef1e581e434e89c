"""Outcomes of a suite from what other harnesses write: vla-eval's `NAME_aggregate.json`, Inspect Robots' logs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenegen.errors import DataError
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.learn.success.files import FileModel, OutcomesHeader, load_model
from scenegen.play.suites.outcomes import EpisodeOutcome, SuiteOutcomes, read_outcomes
from scenegen.play.suites.suite import Suite
from scenegen.scenes.files import read_bytes

RESULTS = "results of vla-eval or a log of Inspect Robots"


class VlaParams(FileModel, extra="ignore"):
    """What SuiteBenchmark was given."""

    world: str
    steps: int = 1000
    reverse: bool = False


class VlaConfig(FileModel, extra="ignore"):
    params: VlaParams
    max_steps: int | None = None


class VlaEpisode(FileModel, extra="ignore"):
    episode_id: int
    metrics: dict[str, Any]
    steps: int = 0
    failure_reason: str | None = None
    failure_detail: str | None = None


class VlaTask(FileModel, extra="ignore"):
    task: str
    episodes: list[VlaEpisode]


class VlaResults(FileModel, extra="ignore"):
    """One benchmark, as vla-eval aggregates it."""

    harness_version: str
    tasks: list[VlaTask]
    config: VlaConfig
    server_info: dict[str, Any] = {}
