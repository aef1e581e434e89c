"""The base class of strategies: checked settings, the axis of difficulty, and a state that can be saved."""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from numbers import Real
from operator import attrgetter
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import NOT_A_REACH, NOT_A_STATE, TOO_MANY_CELLS
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_SETTING, WRONG_SETTING, WRONG_VALUE
from scenegen.play.tasks import Outcome, PhiBox


class DifficultyAxis:
    """Difficulty in `space`, along those `labels` (positions; None: all) whose range is not a single value; `count` of
    them. It is 0 at the easy end of a range, where phi is highest, 1 at the hard end.

    With several labels the hardest counts: a scene is as hard as the label that is furthest on its way from its highest
    to its lowest phi, just as the phi of a conjunction is the minimum of its parts. So the scenes between two
    difficulties form a shell around the easy corner. It consists of L boxes; one is drawn by its volume. The shells
    fill the range and contain the mixed scenes (one label easy, another hard), which the straight line between the two
    corners would miss.
    """

    def __init__(self, space: PhiBox, labels: Sequence[int] | None = None) -> None:
        check(space)
        named = range(len(space.low)) if labels is None else labels
        for label in named:
            if not 0 <= label < len(space.low):
                last = len(space.low) - 1
                wanted, hint = f"from 0 to {last}", "labels are counted in the spec's order"
                raise RequestError(OUT_OF_RANGE(argument="labels", value=label, wanted=wanted, hint=hint))
        self.space = space
        self.along = tuple(label for label in sorted(set(named)) if space.low[label] < space.high[label])
        self.count = len(self.along)
        self._ends = tuple((k, space.high[k], space.high[k] - space.low[k]) for k in self.along)

    def shares(self, phi: Sequence[float]) -> tuple[float, ...] | None:
        """How far along its way each label of `along` is, in [0, 1]; None outside of the space, and for NaN."""
        if not self.space.holds(tuple(phi)):
            return None
        return tuple(min(1.0, (high - phi[k]) / width) for k, high, width in self._ends)

    def difficulty(self, phi: Sequence[float]) -> float | None:
        """The share of the hardest label, in [0, 1]; None outside of the space."""
        shares = self.shares(phi)
        return None if shares is None else max(shares, default=0.0)

    def box(self, near: Sequence[float], far: Sequence[float]) -> PhiBox:
        """Scenes whose labels of `along` have shares from `near` to `far`; the other labels have their whole range."""
        low, high = list(self.space.low), list(self.space.high)
        for (k, top, width), easy, hard in zip(self._ends, near, far, strict=True):
            # a share of 1 is the low end itself, without rounding of the product
            low[k] = max(low[k], top - hard * width) if hard < 1.0 else low[k]
            high[k] = max(low[k], top - max(easy, 0.0) * width)
        return PhiBox(tuple(low), tuple(high))

    def shell(self, near: float, far: float) -> list[tuple[float, PhiBox]]:
        """The boxes, with their volumes in shares, that make up the difficulties from `near` to `far`. Box i contains
        the scenes whose i-th label is the hardest; labels before it are easier than `near`, so that boxes do not
        overlap."""
        if not self.count:
            return [(1.0, self.space)]
        found = []
        for i in range(self.count):
            after = self.count - 1 - i
            volume = near**i * (far - near) * far**after
            if volume > 0.0 or i == 0:
                box = self.box([0.0] * i + [near] + [0.0] * after, [near] * i + [far] * (1 + after))
                found.append((volume, box))
        return found


def pick(boxes: Sequence[tuple[float, PhiBox]], rng: np.random.Generator) -> PhiBox:
    """One of the boxes by their volumes; a single box is returned without using a random number."""
    if len(boxes) == 1:
        return boxes[0][1]
    left = rng.random() * math.fsum(volume for volume, _ in boxes)
    for volume, box in boxes:
        left -= volume
        if left < 0.0:
            return box
    return boxes[-1][1]


def check(space: PhiBox) -> None:
    """Raises RequestError unless `space` has as many lows as highs, all finite, each low at most its high."""
    if not isinstance(space, PhiBox) or not all(_two_numbers(ends) for ends in (space.low, space.high)):
        raise RequestError(NOT_A_REACH(value=repr(space)))
    if len(space.low) != len(space.high) or not space.low:
        raise RequestError(NOT_A_REACH(low=len(space.low), high=len(space.high)))
    for label, (low, high) in enumerate(zip(space.low, space.high, strict=True)):
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise RequestError(NOT_A_REACH(label=label, low=low, high=high))


def _two_numbers(ends: object) -> bool:
    return isinstance(ends, tuple) and all(isinstance(end, Real) for end in ends)


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def draw_index(weights: Floats, rng: np.random.Generator) -> int:
    """An index, drawn by weights >= 0 that are not all 0."""
    upto = weights.cumsum()
    found = int(upto.searchsorted(rng.random() * upto[-1], side="right"))
    return min(found, len(weights) - 1)  # the product may round up to the last sum


def random_index(count: int, rng: np.random.Generator) -> int:
    """An index below `count`."""
    return int(rng.random() * count)


def update_rate(rate: Floats, heard: Ints, part: int, score: float, span: int) -> None:
    """Move a part's rate towards a score: at first the mean of all outcomes, with the initial guess as one observation;
    after `span` outcomes a running mean with step 1 / span."""
    heard[part] += 1
    rate[part] += (score - rate[part]) / min(int(heard[part]) + 1, span)


class Settings(BaseModel):
    """The settings of all strategies; subclasses add fields with defaults and bounds.

    `labels`: positions, in the spec's order, of the labels that the curriculum controls. The others have their whole
    range. None is all labels.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    labels: tuple[int, ...] | None = Field(default=None, min_length=1)


Some = TypeVar("Some", bound=Settings)


def check_settings(kind: type[Some], owner: str, values: Mapping[str, object]) -> Some:
    """The settings of strategy `owner`. Raises RequestError for an unknown one or a value out of its range."""
    try:
        return kind.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]) if first["loc"] else ""
        known, of = tuple(kind.model_fields), f"strategy `{owner}`"
        if first["type"] == "extra_forbidden":
            raise RequestError(UNKNOWN_SETTING(owner=of, name=name, known=known)) from error
        message = first["msg"].removeprefix("Value error, ")
        if name not in known:  # an error about several settings together
            raise RequestError(WRONG_SETTING(owner=of, reason=message, name="", known=known)) from error
        reason, usual = f"{message[:1].lower()}{message[1:]}", str(kind.model_fields[name].default)
        raise RequestError(WRONG_SETTING(owner=of, name=name, reason=reason, usual=usual)) from error


FORMER_NAMES = {"asked": "tasks"}  # names in saved states of version 0.1, and what they are called now


class Base(ABC):
    """A strategy over all the phi in `space`; everything random comes from `rng`.

    Calls may come in any order: outcomes may be late, in another order, missing, or for tasks that the caller chose. An
    outcome whose first scene lies outside of the space, or is NaN, is ignored.
    """

    name: ClassVar[str]
    settings_class: ClassVar[type[Settings]] = Settings
    memory: ClassVar[tuple[str, ...]] = ()
    """Attributes (`name`, or `part.name`) that change from episode to episode: numbers, arrays and lists of numbers.
    `begin` sets them."""

    fixed_shapes: ClassVar[bool] = True
    """Whether the arrays in `memory` keep the shapes that `begin` gives them."""

    settings: Settings

    def __init__(self, space: PhiBox, rng: np.random.Generator, **settings: Any) -> None:
        """Raises RequestError for a bad space, an unknown setting, or a value out of its range."""
        self.settings = check_settings(self.settings_class, self.name, settings)
        if not isinstance(rng, np.random.Generator):
            wanted = "a numpy.random.Generator: np.random.default_rng(0)"
            raise RequestError(WRONG_VALUE(argument="rng", value=repr(rng), wanted=wanted))
        self.axis = DifficultyAxis(space, self.settings.labels)
        self.space, self.rng = space, rng
        self.begin()

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
        return {**self._identity(), **_plain({"rng": self.rng.bit_generator.state, "memory": memory})}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `state`, including that of the generator. Raises DataError for a state of another strategy,
        another space or other settings."""
        if not isinstance(state, Mapping):
            raise DataError(NOT_A_STATE(value=repr(state)))
        for part, mine in self._identity().items():
            if state.get(part) != mine:
                raise DataError(NOT_A_STATE(part=part, found=str(state.get(part)), wanted=str(mine)))
        memory = state.get("memory")
        if not isinstance(memory, Mapping):
            raise self._state_error()
        memory = {FORMER_NAMES.get(name, name): saved for name, saved in memory.items()}
        if set(memory) != set(self.memory):
            raise self._state_error()
        found = {name: self._like(attrgetter(name)(self), saved) for name, saved in memory.items()}
        try:
            self.rng.bit_generator.state = state["rng"]
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(NOT_A_STATE(part="random generator", found=str(error))) from error
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
                raise self._state_error() from None
            free = not self.fixed_shapes and (array.ndim == mine.ndim or not array.size)
            if array.shape != mine.shape and not free:
                raise self._state_error()
            return array
        if not (_numbers(saved) if isinstance(mine, list) else _number(saved)):
            raise self._state_error()
        return _plain(saved)

    def _state_error(self) -> DataError:
        return DataError(NOT_A_STATE(strategy=self.name))

    def _identity(self) -> dict[str, Any]:
        space = {"low": list(self.space.low), "high": list(self.space.high)}
        return {"strategy": self.name, "space": space, "settings": self.settings.model_dump(mode="json")}


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


DEFAULT_CELLS = (16, 6, 4, 3)  # per label, of one, two, three and four labels; of more, two
MAX_CELLS = 4096
MAX_VAIN = 3  # attempts until a cell without scenes is closed


class Levels:
    """`count` levels of equal difference in difficulty, 0 the easiest; of several labels, shells.

    A source may have no scene for a level, and return the nearest one: the outcome belongs to the requested level.
    Outcomes of tasks that the caller chose count by their phi.
    """

    def __init__(self, axis: DifficultyAxis, count: int) -> None:
        self.axis, self.count = axis, count
        self._boxes = [axis.shell(level / count, (level + 1) / count) for level in range(count)]
        self._named = {box: level for level, boxes in enumerate(self._boxes) for _, box in boxes}

    def box(self, level: int, rng: np.random.Generator) -> PhiBox:
        """A box of the level's, by its volume."""
        return pick(self._boxes[level], rng)

    def index_of(self, outcome: Outcome) -> int | None:
        """The level that an outcome belongs to, None if it lies outside of the space."""
        named = self._named.get(outcome.task)
        if named is not None:
            return named
        difficulty = self.axis.difficulty(outcome.phi)
        return None if difficulty is None else min(int(difficulty * self.count), self.count - 1)


class DifficultyGrid:
    """A grid over all labels of the axis, `per` cells along each; the first label's index changes slowest.

    Many cells may be out of reach (two labels that no scene violates badly together), and all their scenes would come
    from the border of the reachable region. So an outcome belongs to the cell of its first scene, and a cell that never
    had a scene is closed after a few attempts. Outcomes of tasks that the caller chose count by their phi.

    `open` is 1 for cells that may have scenes, 0 for closed ones; `vain` counts the failed attempts for cells that
    never had a scene, and is -1 for the others. Raises RequestError for more than MAX_CELLS cells.
    """

    memory = ("cells.open", "cells.vain")
    """The names for the `memory` of a strategy whose grid is its attribute `cells`."""
    open: Floats
    vain: Ints

    def __init__(self, axis: DifficultyAxis, per: int | None = None) -> None:
        per = per or (DEFAULT_CELLS[axis.count - 1] if 0 < axis.count <= len(DEFAULT_CELLS) else 2)
        self.axis, self.per, self.count = axis, per, per**axis.count
        if self.count > MAX_CELLS:
            raise RequestError(TOO_MANY_CELLS(labels=axis.count, per=per, count=self.count, limit=MAX_CELLS))
        edges = [(k / per, (k + 1) / per) for k in range(per)]
        corners = [zip(*cell, strict=True) for cell in itertools.product(edges, repeat=axis.count)]
        self._boxes = [axis.box(*corner) if axis.count else axis.space for corner in corners]
        self._named = {box: cell for cell, box in enumerate(self._boxes)}
        self.open, self.vain = np.ones(self.count), np.zeros(self.count, dtype=np.int64)

    def box(self, cell: int) -> PhiBox:
        """The cell's box."""
        return self._boxes[cell]

    def random_open(self, rng: np.random.Generator) -> int:
        """A cell that is open."""
        return draw_index(self.open, rng)

    def index_of(self, outcome: Outcome) -> int | None:
        """The cell that an outcome belongs to, None if it lies outside of the space. Records cells without scenes."""
        requested = self._named.get(outcome.task)
        if requested is not None and not outcome.task.holds(outcome.phi):
            self._count_miss(requested)
            requested = None
        cell = self._cell_at(outcome.phi) if requested is None else requested
        if cell is not None and self.vain[cell] >= 0:
            self.vain[cell], self.open[cell] = -1, 1.0
        return cell

    def _count_miss(self, cell: int) -> None:
        if self.vain[cell] < 0:
            return
        self.vain[cell] += 1
        if self.vain[cell] >= MAX_VAIN and self.open.sum() > 1.0:
            self.open[cell] = 0.0

    def _cell_at(self, phi: tuple[float, ...]) -> int | None:
        shares = self.axis.shares(phi)
        if shares is None:
            return None
        cell = 0
        for share in shares:
            cell = cell * self.per + min(int(share * self.per), self.per - 1)
        return cell
