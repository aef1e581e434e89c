"""The interface of anything that proposes scenes for target values of phi: in practice, trained models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol


class Proposer(Protocol):
    """It can be pickled, and is sent to other processes with a plan. Tensors are torch's; torch is not imported here,
    because the exact samplers work without torch and their table of methods names this type."""

    @property
    def name(self) -> str:
        """Its name in messages."""

    @property
    def digest(self) -> str:
        """A hash of everything that the proposals depend on."""

    @property
    def info(self) -> Mapping[str, object]:
        """What scene files say about it in addition to its name."""

    def __call__(self, phi: Any, generator: Any) -> Any:
        """Target phi, a tensor (L, B) of all labels, the requirement's last, and a torch.Generator -> scenes, a tensor
        (3N, B), in metres and radians."""
