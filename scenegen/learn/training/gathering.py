"""Gathering a training set: progress, estimates, the time limits, and the file that keeps what is there.

A set is gathered in batches, one after another, and each in pieces that follow from the seed. What is broken off, by
Ctrl-C, by a signal, by `--timeout` or by force, goes on from the last piece that the file has, to the same scenes.
`--timeout` ends a run; CPU time alone makes a set smaller: a batch that takes more than its share ends with what it
has.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict

from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.learning import DAMAGED_MODEL, NO_TIME_TO_TRAIN
from scenegen.learn.models.checkpoint import pack, read_card, unpack
from scenegen.learn.training.config import GATHER_SECONDS
from scenegen.processes.process import StopSignal
from scenegen.scenes.files import write_whole
from scenegen.search.effort import Budget

GATHERED_FORMAT, GATHERED_FILE = "scenegen/gathered", "a file of training scenes"
MIN_BATCH_SECONDS = 0.5  # of SECONDS that a batch may take
SAVE_EVERY = 5.0  # seconds of work that a kill may cost

Tell = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much of it is done; 0 of 0 where that cannot be counted."""


class TimeUpError(RequestError):
    """The time limit of the whole run is over."""


@dataclass(slots=True)
class SceneBatch:
    """Scenes (3N, m) of `pieces` pieces, which were estimated to take so many `seconds`; `whole` where no more are to
    come."""

    rows: Array
    pieces: int = 0
    whole: bool = False
    seconds: float = 0.0


class _Progress(BaseModel):
    model_config = ConfigDict(extra="forbid")

    run: str
    spent: float
    batches: dict[str, tuple[int, bool, float]]


class Gathering:
    """Mutable: `stage` is what is being done, `done` of `wanted` scenes are there. `check` is called often, by
    everything that takes time; it tells, and raises RequestError once `seconds` are over, KeyboardInterrupt where a
    signal has asked to `stop`."""

    def __init__(
        self,
        seconds: float = math.inf,
        tell: Tell | None = None,
        note: Callable[[Diagnostic], None] | None = None,
        stop: StopSignal | None = None,
        until: float | None = None,
    ) -> None:
        self.until = time.monotonic() + seconds if until is None else until
        self.stage = "gathering scenes"
        self.done = self.wanted = 0
        self._seconds = round(seconds, 2)
        self._tell = tell
        self._note = note
        self._stop = stop
        self.path: Path | None = None
        self._run = ""
        self._batches: dict[str, SceneBatch] = {}
        self._saved_at = time.monotonic()
        self._changed = False
        self._before = 0.0  # seconds of CPU that earlier runs took
        self._began = time.process_time()
        self._allowed = math.inf

    def keep_in(self, path: Path, run: str, resume: bool) -> None:
        """From now on the batches are kept in that file; `run` is all that they follow from. With `resume`, those that
        are there already are taken up. Raises DataError for a damaged file, and for one of another run."""
        self.path, self._run = path, run
        if not resume or not path.exists():
            return
        text, tensors = unpack(path, GATHERED_FORMAT, GATHERED_FILE)
        card = read_card(_Progress, text, path, GATHERED_FILE)
        if card.run != run or set(tensors) != set(card.batches):
            raise DataError(DAMAGED_MODEL(path=path, what=GATHERED_FILE, reason="it is of a run with other options"))
        self._before = card.spent
        self._batches = {key: SceneBatch(tensors[key].numpy(), *facts) for key, facts in card.batches.items()}

    def batch(self, key: str, coordinates: int) -> SceneBatch:
        """What there is of a batch by its name, for `add`."""
        return self._batches.setdefault(key, SceneBatch(np.empty((coordinates, 0))))

    def add(self, batch: SceneBatch, rows: Array) -> None:
        """One more piece of a batch."""
        batch.rows = np.concatenate([batch.rows, rows], axis=1)
        batch.pieces, self._changed = batch.pieces + 1, True
        if time.monotonic() - self._saved_at >= SAVE_EVERY:
            self.save()

    def save(self, *, long_ones: bool = False) -> int:
        """Write the file, if there is one and something in it; `long_ones`: only if that took long. Returns how many
        scenes it has. Raises OutputError."""
        if long_ones and self.seconds_spent < SAVE_EVERY:
            return 0
        count = sum(one.rows.shape[1] for one in self._batches.values())
        if self.path is not None and self._changed and count:
            facts = {key: (one.pieces, one.whole, one.seconds) for key, one in self._batches.items()}
            card = _Progress(run=self._run, spent=self.seconds_spent, batches=facts)
            tensors = {key: torch.from_numpy(one.rows) for key, one in self._batches.items()}
            write_whole(self.path, pack(GATHERED_FORMAT, card.model_dump_json(), tensors))
            self._saved_at, self._changed = time.monotonic(), False
        return count if self.path is not None else 0

    def discard(self) -> None:
        """The file is not needed any more."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    @property
    def seconds_spent(self) -> float:
        """Seconds of CPU that gathering has taken."""
        return self._before + time.process_time() - self._began

    @property
    def seconds_left(self) -> float:
        """Seconds of CPU that gathering may still take."""
        return max(0.0, GATHER_SECONDS - self.seconds_spent)

    def allow(self, share: float, kept: float = 0.0) -> None:
        """From now on budgets are spent after that share of what is left, but for `kept` seconds."""
        self._allowed = self.seconds_spent + max(MIN_BATCH_SECONDS, share * (self.seconds_left - kept))

    @property
    def overdrawn(self) -> bool:
        """Whether what was allowed is spent; checks."""
        self.check()
        return self.seconds_spent >= self._allowed

    def note(self, problem: Diagnostic) -> None:
        """Something worth saying."""
        if self._note is not None:
            self._note(problem)

    def begin(self, stage: str, wanted: int = 0) -> None:
        """Another thing is being done; of `wanted` scenes, where they are counted."""
        self.stage, self.done, self.wanted = stage, 0, wanted
        self.check()

    def reach(self, done: int) -> None:
        """So many scenes are there."""
        self.done = min(done, self.wanted) if self.wanted else done
        self.check()

    def check(self) -> None:
        """Tell how far it is. Raises RequestError where time is up."""
        if self._tell is not None:
            self._tell(self.stage, self.done, self.wanted)
        if self._stop is not None and self._stop.asked:
            raise KeyboardInterrupt
        if time.monotonic() >= self.until:
            told = {"seconds": self._seconds, "account": self.account, "kept": self.save() or None, "path": self.path}
            raise TimeUpError(NO_TIME_TO_TRAIN(**told))

    @property
    def account(self) -> str:
        """What is being done, in numbers."""
        return f"{self.stage}: {self.done:,} of {self.wanted:,}" if self.wanted else self.stage

    def budget(self) -> Budget:
        """For the exact samplers: spent when what was allowed is; `check` ends what takes too long in all, also where
        they say that time is up."""
        return _GatheringBudget(math.inf, gathering=self)


@dataclass(frozen=True, slots=True)
class _GatheringBudget(Budget):
    """Samplers look at their budget between all steps: so often is the gathering checked."""

    gathering: Gathering | None = None

    @property
    def ends(self) -> float:
        return math.inf if self.gathering is None else self.gathering.until

    @property
    def is_spent(self) -> bool:
        return self.gathering is not None and self.gathering.overdrawn

    @property
    def overdrawn(self) -> bool:
        return self.is_spent
