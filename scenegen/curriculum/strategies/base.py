"""What all strategies have: checked settings, the axis of difficulty, and a state that can be saved."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from scenegen.curriculum.strategies.axis import Axis
from scenegen.curriculum.strategies.settings import Settings, checked
from scenegen.curriculum.tasks import Outcome, PhiBox
from scenegen.errors import DataError, Diagnostic, RequestError


class Base(ABC):
    """A strategy over all the phi in `space`; everything random comes from `rng`.

    Any order of calls will do: outcomes may come late, in another order, never, or for tasks of somebody else. An
    outcome whose first scene lies outside of the space, or is NaN, is passed over.
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
            title = f"a strategy draws from a numpy.random.Generator, not from {rng!r}"
            raise RequestError(Diagnostic(title, help="give np.random.default_rng(0)"))
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
        """Hear how an episode went."""

    def log(self) -> dict[str, float]:
        """A few numbers worth a curve each: where the strategy is."""
        return {}

    def state(self) -> dict[str, Any]:
        """All that is needed to go on from here, as plain data that JSON holds."""
        memory = {name: attrgetter(name)(self) for name in self.memory}
        return {**self._who(), **_plain({"rng": self.rng.bit_generator.state, "memory": memory})}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a `state`, the generator's included. Raises DataError for that of another strategy, another space
        or other settings."""
        if not isinstance(state, Mapping):
            raise DataError(Diagnostic(f"a state is a mapping, not {state!r}", help="use what state() gave"))
        for part, mine in self._who().items():
            if state.get(part) != mine:
                title = f"this state is of another {part}: {state.get(part)}, not {mine}"
                raise DataError(Diagnostic(title, help="restore into a strategy made like the one that was saved"))
        memory = state.get("memory")
        if not isinstance(memory, Mapping) or set(memory) != set(self.memory):
            raise self._not_whole()
        found = {name: self._like(attrgetter(name)(self), saved) for name, saved in memory.items()}
        try:
            self.rng.bit_generator.state = state["rng"]
        except (KeyError, TypeError, ValueError) as error:
            title = f"this state is of another random generator: {error}"
            raise DataError(Diagnostic(title, help="restore with a generator of the same kind")) from error
        for name, value in found.items():
            path, _, last = name.rpartition(".")
            setattr(attrgetter(path)(self) if path else self, last, value)

    def _like(self, mine: Any, saved: Any) -> Any:
        """A saved value as one of ours. Raises DataError for one of another kind; lists and arrays may grow."""
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
        return DataError(Diagnostic(f"this state is not a whole one of `{self.name()}`", help="use what state() gave"))

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
