"""Progress of a training run on standard error: a bar with losses and ETA in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from scenegen.learn.training.config import GATHER_SECONDS, GATHERING
from scenegen.learn.training.session import EpochReport

# What a run without a terminal says while scenes are gathered: a line now and then, with numbers and what is left.


FIRST, EVERY = 3.0, 10.0  # seconds: what is quickly done says nothing


class GatheringLines:
    """Called as `scenegen.learn.training.gathering` says; returns the line that is due, or None. `used` are
    seconds of CPU."""

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, used: Callable[[], float] = time.process_time
    ) -> None:
        self._clock, self._used, self._first = clock, used, used()
        self._began = self._due = clock()
        self._due += FIRST
        self._stage = ""
        self._seen: tuple[float, int] = (self._began, 0)  # when, and how many: of the last line of this stage

    def used(self) -> float:
        """Seconds of CPU so far, SECONDS at most."""
        return min(GATHER_SECONDS, self._used() - self._first)

    def __call__(self, stage: str, done: int, wanted: int) -> str | None:
        now = self._clock()
        if stage != self._stage:
            self._stage, self._seen = stage, (now, 0)
        if now < self._due:
            return None
        self._due = now + EVERY
        if not wanted:
            return f"{stage}, {now - self._began:.0f} s so far"
        if stage == GATHERING:
            return f"{stage}: {done:,} of {wanted:,}, at most {GATHER_SECONDS - self.used():.0f} s of CPU time left"
        (then, before), self._seen = self._seen, (now, done)
        # The pace since the last line, not the mean: the last scenes are often the rarest.
        pace = (done - before) / (now - then) if now > then else 0.0
        left = f"about {(wanted - done) / pace:.0f} s left" if pace > 0.0 else "none found lately"
        return f"{stage}: {done:,} of {wanted:,}, {left}"


MAX_LINES = 10  # plain lines of a run


class TrainingProgress:
    """`with TrainingProgress(50, "gan") as progress: train(..., on_epoch=progress, on_step=progress.step,
    on_note=progress.note, on_gather=progress.gather)`."""

    def __init__(self, epochs: int, title: str, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr)
        self._epochs = epochs
        self._title = title
        self._seconds: list[float] = []
        self._bar: Progress | None = None
        self._moving = False
        self._gathering = GatheringLines()
        if self._console.is_terminal:
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}"),
                BarColumn(),
                TaskProgressColumn(),
                TextColumn("{task.fields[figures]}"),
                TimeElapsedColumn(),
                TextColumn("{task.fields[left]}"),
                TimeRemainingColumn(elapsed_when_finished=False),
                console=self._console,
                # The loop runs on one core; redrawing more often would take time from it.
                refresh_per_second=4,
            )
            self._task = self._bar.add_task(f"{title}: gathering scenes", total=None, figures="", left="left")

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def gather(self, stage: str, done: int, wanted: int) -> None:
        """So many of the training scenes are there; 0 of 0 where they are not counted."""
        if self._bar is None:
            line = self._gathering(stage, done, wanted)
            if line is not None:
                self._print(line)
            return
        words = f"{self._title}: {stage}"
        (task,) = self._bar.tasks
        if task.description != words:  # the pace is that of this stage
            self._bar.reset(self._task, total=wanted or None, description=words)
        figures = f"{done:,} of {wanted:,}" if wanted else ""
        if stage == GATHERING:  # of the time that it may take, so that what is left is what it takes at most
            used = self._gathering.used()
            self._bar.update(self._task, completed=used, total=GATHER_SECONDS, figures=figures, left="left at most")
        else:
            self._bar.update(self._task, completed=done, figures=figures, left="left")

    def step(self, done: int, total: int) -> None:
        """That many steps of all are done."""
        if self._bar is not None:
            words = self._epoch(min(self._epochs, 1 + done * self._epochs // total))
            # Time is counted from the first step, and a resumed run did not do the earlier ones in no time.
            tell = self._bar.update if self._moving else self._bar.reset
            if not self._moving:
                self._bar.update(self._task, figures="", left="left")  # no longer of the scenes
            self._moving = True
            tell(self._task, completed=done, total=total, description=words)

    def __call__(self, report: EpochReport) -> None:
        """An epoch is done."""
        self._seconds.append(report.seconds)
        words = [f"{name} {value:.4f}" for name, value in report.losses.items()]
        if report.validation is not None:
            words.append(f"phi off by {report.validation.error:.4f}")
        figures = "  ".join(words)
        if self._bar is not None:
            total = report.epochs * (report.step // report.epoch)
            self._bar.update(
                self._task,
                completed=report.step,
                total=total or None,
                description=self._epoch(report.epoch),
                figures=figures,
            )
            return
        first, last = len(self._seconds) == 1, report.epoch == report.epochs
        if first or last or report.epoch * MAX_LINES // report.epochs > (report.epoch - 1) * MAX_LINES // report.epochs:
            pace = sum(self._seconds) / len(self._seconds)
            left = (report.epochs - report.epoch) * pace
            self._print(f"epoch {report.epoch}/{report.epochs}  {figures}  {pace:.2f} s/epoch, {left:.0f} s left")

    def note(self, text: object) -> None:
        """Something worth saying."""
        self._print(str(text))

    def _epoch(self, number: int) -> str:
        return f"{self._title}: epoch {number}/{self._epochs}"

    def _print(self, text: str) -> None:
        self._console.print(f"{self._title}: {text}", markup=False, highlight=False, soft_wrap=True)
