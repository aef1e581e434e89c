"""A trained model as a proposer of scenes: what plans carry to other processes and machines.

It holds the bytes of the model file. torch is loaded, and the network made from them, when scenes are first proposed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from scenegen.models.trained import TrainedModel


@dataclass(frozen=True, slots=True)
class ModelProposer:
    """`data` is a model file. `labels` are those of the model: a request may have others after them. `steps` is how
    often a flow evaluates its network for a scene, None for other models. `asked` are the labels whose phi matters: the
    others are left free, where the model can do that; none stands for all."""

    name: str
    data: bytes
    labels: int
    steps: int | None = None
    asked: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        return hashlib.sha256(self.data + str((self.steps, self.asked)).encode()).hexdigest()

    @property
    def info(self) -> Mapping[str, object]:
        return {} if self.steps is None else {"steps": self.steps}

    def __call__(self, phi: Tensor, generator: torch.Generator) -> Tensor:
        network = _network(self)
        return network.propose(network.asked(phi[: self.labels], self.asked), generator)


@lru_cache(maxsize=2)  # of a process: a plan draws many pieces with one network
def _network(proposer: ModelProposer) -> TrainedModel:
    from scenegen.lang.check import check_text
    from scenegen.models.checkpoint import load_model

    made = load_model(Path(f"the {proposer.name}"), data=proposer.data)
    made = made.corrected(check_text(made.card.spec.source, made.card.spec.name))
    return made if proposer.steps is None else made.in_steps(proposer.steps)


def make_proposer(trained: TrainedModel) -> ModelProposer:
    from scenegen.models.checkpoint import packed

    return ModelProposer(trained.name, packed(trained.model, trained.card), len(trained.card.labels), trained.steps)
