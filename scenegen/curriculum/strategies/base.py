"""The base class of strategies: checked settings, the axis of difficulty, and a state that can be saved."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from scenegen.curriculum.strategies.axis import Axis
from scenegen.curriculum.strategies.settings import Settings, checked
from scenegen.curriculum.tasks import Outcome, PhiBox
from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import NOT_A_GENERATOR, NOT_A_STATE, OTHER_STATE, PARTIAL_STATE

FORMER = {"asked": "tasks"}  # names in saved states of version 0.1, and what they are called now


class Base(ABC):
    """A strategy over all the phi in `space`; everything random comes from `rng`.

    Calls may come in any order: outcomes may be late, in another order, missing, or for tasks that the caller chose. An
    outcome whose first scene lies outside of the space, or is NaN, is ignored.
    """

    settings_class: ClassVar[type[Settings]] = Settings
    memory: ClassVar[tuple[str, ...]] = ()
    """Attributes (`name`, or `part.name`) that change from episode to episode: numbers, arrays and lists of numbers.
    `begin` sets them."""

    fixed_shapes: ClassVar[bool] = True
    """Whether the arrays in `memory` keep the shapes that `begin` gives them."""

    settings: Settings

    def __init__(self, space: PhiBox, rng: np.random.Generator, **settings: Any) -> None:
        """Raises RequestError for a bad space, an unknown setting, or a value out of its range."""
        self.settings = checked(self.settings_class, self.name(), settings)
        if not isinstance(rng, np.random.Generator):
            raise RequestError(NOT_A_GENERATOR(value=repr(rng)))
        self.axis = Axis(space, self.settings.labels)
        self.space, self.rng = space, rng
        self.begin()

    @classmethod
    def name(cls) -> str:
        """The strategy's name: that of its file, and in the table."""
        return cls.__module__.rpartition(".")[2]

    @abstractmethod
    def begin(self) -> None:
        """Set what `next_task` and `report` work with, `memory` included."""

    @abstractmethod
    def next_task(self) -> PhiBox:
        """The phi of the next episode's first scene."""

    @abstractmethod
    def report(self, outcome: Outcome) -> None:
        """Takes the outcome of an episode."""

    def log(self) -> dict[str, float]:
        """A few numbers that show the strategy's progress, for plots."""
        return {}

    def state(self) -> dict[str, Any]:
        """Everything that is needed to continue from here, as plain data for JSON."""
        memory = {name: attrgetter(name)(self) for name in self.memory}
        return {**self._who(), **_plain({"rng": self.rng.bit_generator.state, "memory": memory})}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `state`, including that of the generator. Raises DataError for a state of another strategy,
        another space or other settings."""
        if not isinstance(state, Mapping):
            raise DataError(NOT_A_STATE(value=repr(state)))
        for part, mine in self._who().items():
            if state.get(part) != mine:
                raise DataError(OTHER_STATE(part=part, found=str(state.get(part)), wanted=str(mine)))
        memory = state.get("memory")
        if not isinstance(memory, Mapping):
            raise self._not_whole()
        memory = {FORMER.get(name, name): saved for name, saved in memory.items()}
        if set(memory) != set(self.memory):
            raise self._not_whole()
        found = {name: self._like(attrgetter(name)(self), saved) for name, saved in memory.items()}
        try:
            self.rng.bit_generator.state = state["rng"]
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(OTHER_STATE(part="random generator", found=str(error))) from error
        for name, value in found.items():
            path, _, last = name.rpartition(".")
            setattr(attrgetter(path)(self) if path else self, last, value)

    def _like(self, mine: Any, saved: Any) -> Any:
        """A saved value as a value of this type. Raises DataError for another type; lists and arrays may have other
        lengths."""
        if isinstance(mine, np.ndarray):
            try:
                array = np.array(saved, dtype=mine.dtype)
            except (TypeError, ValueError, OverflowError):
                raise self._not_whole() from None
            free = not self.fixed_shapes and (array.ndim == mine.ndim or not array.size)
            if array.shape != mine.shape and not free:
                raise self._not_whole()
            return array
        if not (_numbers(saved) if isinstance(mine, list) else _number(saved)):
            raise self._not_whole()
        return _plain(saved)

    def _not_whole(self) -> DataError:
        return DataError(PARTIAL_STATE(strategy=self.name()))

    def _who(self) -> dict[str, Any]:
        space = {"low": list(self.space.low), "high": list(self.space.high)}
        return {"strategy": self.name(), "space": space, "settings": self.settings.model_dump(mode="json")}


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(value: object) -> bool:
    """Whether it is a list of numbers, or of lists of them."""
    return isinstance(value, list) and all(
        _number(one) or (isinstance(one, list) and all(map(_number, one))) for one in value
    )


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, list) else value
