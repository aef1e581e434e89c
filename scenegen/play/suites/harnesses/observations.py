"""What a world observes, as harnesses take it: pictures, and other numbers, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import ScenegenError
from scenegen.errors.worlds import WORLD_FAILS

# what a robot knows of itself, by the names that our worlds and others give it; all else is of its surroundings
PROPRIOCEPTION = ("hand", "fingers", "joints", "agent_pos")
UNNAMED = "state"  # the name of an observation that is one array


@dataclass(frozen=True, slots=True)
class SplitObservation:
    """`pictures` (H, W, 3) and `numbers` (n,), by name, in the order of the names; in a mapping of a mapping a name is
    `outer.inner`. Text is in neither."""

    pictures: dict[str, npt.NDArray[np.uint8]]
    numbers: dict[str, Array]

    @property
    def robot(self) -> Array:
        """(n,): what the robot knows of itself."""
        return _join(self.numbers[name] for name in PROPRIOCEPTION if name in self.numbers)

    @property
    def surroundings(self) -> Array:
        """(n,): all other numbers, in the order of their names."""
        return _join(self.numbers[name] for name in self.numbers if name not in PROPRIOCEPTION)


def split_observation(observation: Any) -> SplitObservation:
    """The pictures and the numbers in an observation: a mapping, or one array."""
    pictures, numbers = {}, {}
    for name, value in sorted(_leaves(observation if isinstance(observation, Mapping) else {UNNAMED: observation})):
        array = np.asarray(value)
        if array.dtype == np.uint8 and array.ndim == 3 and array.shape[2] == 3:
            pictures[name.removeprefix("pixels.")] = array
        elif array.dtype.kind in "biuf":
            numbers[name] = np.asarray(array, dtype=np.float64).ravel()
    return SplitObservation(pictures, numbers)


def action_box(world: str, env: Any) -> tuple[Array, Array]:
    """The lowest and the highest action of an environment, (n,) each, from its `action_space`. Raises ScenegenError."""
    space = getattr(env, "action_space", None)
    low, high = getattr(space, "low", None), getattr(space, "high", None)
    if low is None or high is None or np.ndim(low) != 1:
        how, reason = "does not say what its actions are", f"`action_space` is {space!r}, and not a Box (n,)"
        raise ScenegenError(WORLD_FAILS(what="the world", name=world, how=how, reason=reason))
    return np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)


def _leaves(observation: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in observation.items():
        found += _leaves(value, f"{before}{name}.") if isinstance(value, Mapping) else [(f"{before}{name}", value)]
    return found


def _join(arrays: Any) -> Array:
    return np.concatenate([np.empty(0), *arrays])
