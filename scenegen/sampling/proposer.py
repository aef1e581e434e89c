"""The interface of anything that proposes scenes for target values of phi: in practice, trained models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from scenegen.arrays import Array
from scenegen.search.effort import NEVER, Stop


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

    @property
    def regions(self) -> Sequence[Array]:
        """How phi is distributed among all scenes, as far as it knows: each (L, 2 + m), see `make_targets`."""

    def mix(self, rows: Any, ends: tuple[Any, Any], box: tuple[Array, Array], seed: int, stop: Stop = NEVER) -> Any:
        """Scenes, a tensor (3N, B), after random moves that do not change the uniform distribution over the scenes
        with phi within `ends`, (L, B) each, and poses within `box`, (3N,) each; those that are not there already stay
        as they are. It may do without, and return them all as they are. Raises what `stop` raises."""

    def __call__(self, phi: Any, generator: Any, stop: Stop = NEVER) -> Any:
        """Target phi, a tensor (L, B) of all labels, the requirement's last, and a torch.Generator -> scenes, a tensor
        (3N, B), in metres and radians. Raises what `stop` raises."""
