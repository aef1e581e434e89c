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

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from scenegen.learn.models.trained import TrainedModel

LEAST, MOST, EACH = 24, 256, 2  # moves within the range that was asked for: so many for each node of the formula

Array = npt.NDArray[np.float64]


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

    @property
    def regions(self) -> tuple[Array, ...]:
        return tuple(one.double().numpy() for one in _network(self).regions)

    def stirred(self, rows: Tensor, ends: tuple[Tensor, Tensor], box: tuple[Array, Array], seed: int) -> Tensor:
        import torch

        from scenegen.learn.models.correction import McmcMoves

        network = _network(self)
        if network.correction is None or len(ends[0]) != self.labels:  # labels that were added are not known here
            return rows
        stir = McmcMoves(network.correction.spec, torch.zeros(self.labels, 1), box)
        old, low, high = (one.to(torch.float32) for one in (rows, *ends))
        moves = max(LEAST, min(MOST, EACH * len(network.correction.spec.core.nodes)))
        random = torch.Generator().manual_seed(seed)
        new = stir.within(old, (low, high), random, moves if stir.moving else 0, fit=True)
        return torch.where(new == old, rows, new.to(rows.dtype))

    def __call__(self, phi: Tensor, generator: torch.Generator) -> Tensor:
        network = _network(self)
        return network.propose(network.asked(phi[: self.labels], self.asked), generator)


@lru_cache(maxsize=2)  # of a process: a plan draws many pieces with one network
def _network(proposer: ModelProposer) -> TrainedModel:
    from scenegen.lang.checker import check_text
    from scenegen.learn.models.checkpoint import load_model

    made = load_model(Path(f"the {proposer.name}"), data=proposer.data)
    made = made.corrected(check_text(made.card.spec.source, made.card.spec.name))
    return made if proposer.steps is None else made.in_steps(proposer.steps)


def make_proposer(trained: TrainedModel) -> ModelProposer:
    from scenegen.learn.models.checkpoint import packed

    data = packed(trained.model, trained.card, trained.regions)
    return ModelProposer(trained.name, data, len(trained.card.labels), trained.steps)
