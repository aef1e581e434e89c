"""The interface of models that evaluation needs; `scenegen.api.model.Model` implements it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from scenegen.lang.spec import CheckedSpec

if TYPE_CHECKING:
    from scenegen.models.trained import TrainedModel


class ModelSpec(Protocol):
    """The spec that the model was trained on."""

    @property
    def checked(self) -> CheckedSpec: ...
    @property
    def labels(self) -> tuple[str, ...]: ...


class Model(Protocol):
    """A trained model together with its spec."""

    trained: TrainedModel

    @property
    def spec(self) -> ModelSpec: ...
