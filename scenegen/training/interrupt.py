"""What a training run that was stopped says."""

from __future__ import annotations

from pathlib import Path

from scenegen.errors.program import TRAINING_INTERRUPTED


class Interrupted(KeyboardInterrupt):
    """Training was stopped from outside; the state to go on from is saved beside the model file `path`."""

    def __init__(self, epochs_done: int, epochs: int, path: Path) -> None:
        super().__init__(TRAINING_INTERRUPTED(done=epochs_done, epochs=epochs, path=path))
        self.epochs_done = epochs_done
        self.epochs = epochs
        self.path = path
