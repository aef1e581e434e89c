"""Early stopping: the validations of a run, the best of them, and when patience ends."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from scenegen.models.base import SceneModel
from scenegen.training.validate import Validation


class Watch:
    """Mutable. `seen` holds the errors and the score of each epoch, (L + 1,) float64. With a patience, `best` are the
    sampler's weights of the epoch `kept` (from 0) whose mean error was least, the first of equals."""

    def __init__(
        self, patience: int | None, seen: list[Tensor] | None = None, best: Mapping[str, Tensor] | None = None
    ) -> None:
        self.patience = patience
        self.seen = seen or []
        self.best = best

    @property
    def kept(self) -> int | None:
        """The epoch with the least error so far."""
        errors = [float(row[:-1].mean()) for row in self.seen]
        return errors.index(min(errors)) if errors else None

    @property
    def tired(self) -> bool:
        """Whether the last `patience` epochs brought nothing better."""
        kept = self.kept
        return self.patience is not None and kept is not None and len(self.seen) - 1 - kept >= self.patience

    def see(self, found: Validation, model: SceneModel) -> None:
        """Take note of an epoch that is done."""
        self.seen.append(torch.tensor([*found.errors.values(), found.score], dtype=torch.float64))
        if self.patience is not None and self.kept == len(self.seen) - 1:
            self.best = {name: tensor.cpu() for name, tensor in model.sampler_state().items()}

    def table(self, labels: int) -> Tensor:
        """(epochs, L + 1) float64."""
        return torch.stack(self.seen) if self.seen else torch.zeros(0, labels + 1, dtype=torch.float64)
