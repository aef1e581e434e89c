"""TensorBoard event files: `--log-dir DIR`, then `tensorboard --logdir DIR`.

Written with TensorBoard's own writer (`pip install "scenegen[tensorboard]"`, which brings the viewer as well). Steps
are the optimiser's. A resumed run may write into the folder of the earlier one: of steps that occur twice, TensorBoard
shows the later ones.
"""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.errors import RequestError
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.formats.files import check_folder, reported

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

    from scenegen.training.report import EpochReport


class EventLog:
    """Called with the report of each epoch, writes its figures: `loss/NAME`, `error/LABEL` (mean of |phi - wanted phi|
    at held-out labels), `error` (the mean of these), `score`, `learning_rate` and `scenes_per_second`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: SummaryWriter | None = None

    def __call__(self, report: EpochReport) -> None:
        with reported(self._folder):
            if self._writer is None:
                from torch.utils.tensorboard import SummaryWriter

                # whatever an earlier run wrote from this step on is superseded
                self._writer = SummaryWriter(str(self._folder), purge_step=report.step)
            for name, value in figures(report).items():
                self._writer.add_scalar(name, value, report.step)
            self._writer.flush()

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()


def figures(report: EpochReport) -> dict[str, float]:
    """What a report says, by TensorBoard's tags."""
    found = {f"loss/{name}": value for name, value in report.losses.items()}
    if report.validation is not None:
        found |= {f"error/{label}": value for label, value in report.validation.errors.items()}
        found |= {"error": report.validation.error, "score": report.validation.score}
    return {**found, "learning_rate": report.rate, "scenes_per_second": report.scenes / max(report.seconds, 1e-9)}


@contextlib.contextmanager
def event_log(folder: Path) -> Iterator[EventLog]:
    """A log that writes into the folder, which is made where it is missing.

    Raises RequestError where TensorBoard is not installed, OutputError where the folder cannot be written to.
    """
    if importlib.util.find_spec("tensorboard") is None:  # told before the work starts
        command = 'pip install "scenegen[tensorboard]"'
        raise RequestError(NOT_INSTALLED(package="tensorboard", purpose="for event files", command=command))
    with reported(folder):
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(folder)
    log = EventLog(folder)
    try:
        yield log
    finally:
        log.close()
        for path in made:  # what holds no events is not left behind
            with contextlib.suppress(OSError):
                path.rmdir()
