"""What vector environments have in common: seeds, episodes that begin again, limits of steps.

They behave exactly like `gymnasium.make_vec(..., vectorization_mode="sync")` with as many single environments and a
time limit.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv

from scenegen.curriculum.errors import count, refused
from scenegen.curriculum.request import check_options
from scenegen.curriculum.tasks import PhiBox
from scenegen.errors.learning import NO_EPISODE, NUMBER_OF_SEEDS
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Observations = npt.NDArray[np.float32]
Chooser = Callable[[int], Mapping[str, Any] | None]
Listener = Callable[[Array, Mask, Mask], None]


@dataclass(frozen=True, slots=True)
class Acted:
    """What a step did, (num_envs,) each. Of tables whose episode was over before it means nothing. `flags` are further
    entries of the info."""

    reward: Array
    success: Mask
    ended: Mask
    flags: Mapping[str, Mask]


class Many(VectorEnv[Observations, Any, Any]):
    """`num_envs` tables. `chooser`, if set, gives the options for table k's next episode whenever one begins without
    options. `listener`, if set, is called after every step, before tables are reset, with the rewards, which episodes
    ended, and which of these were successful, (num_envs,) each."""

    names: Sequence[str]  # the labels in the order of a curriculum's range
    about: str  # the entry of an info that has phi of a start

    def __init__(self, num_envs: int, max_episode_steps: int | None, autoreset_mode: str | AutoresetMode) -> None:
        super().__init__()
        self.num_envs = count("num_envs", num_envs)
        self._limit = None if max_episode_steps is None else count("max_episode_steps", max_episode_steps)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = [mode.value for mode in AutoresetMode]
            raise refused(UNKNOWN_CHOICE(what="autoreset mode", name=str(autoreset_mode), known=modes)) from None
        self.chooser: Chooser | None = None
        self.listener: Listener | None = None
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._begun = False
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._over = np.zeros(num_envs, dtype=np.bool_)

    @property
    @abstractmethod
    def space(self) -> PhiBox:
        """The range of phi for a curriculum."""

    @abstractmethod
    def _checked(self, actions: Any) -> npt.NDArray[Any]:
        """The actions of all tables. Raises gymnasium.error.InvalidAction."""

    @abstractmethod
    def _act(self, actions: npt.NDArray[Any], again: Mask) -> Acted:
        """Do checked actions; tables of `again` have no episode."""

    @abstractmethod
    def _seeded(self, number: int) -> None:
        """A table has got another generator of random numbers."""

    @abstractmethod
    def _start(self, chosen: Mask, options: dict[str, Any]) -> Mask:
        """Begin episodes on some tables; returns a mask of those that start satisfied. One that fails leaves all tables
        unchanged."""

    @abstractmethod
    def _seen(self) -> Observations:
        """The observations."""

    @abstractmethod
    def _infos(self, told: Mask, success: Mask, flags: Mapping[str, Mask]) -> dict[str, Any]:
        """The infos of the tables of `told`; without `flags` those of a start."""

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode on every table, or on those of `options["reset_mask"]`, (num_envs,) of bool."""
        seeds: Sequence[int | None]
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + k for k in range(self.num_envs)]
        elif isinstance(seed, Sequence) and not isinstance(seed, str | bytes):
            seeds = seed
        else:
            wanted = f"a python integer, or a list of {self.num_envs}"
            raise refused(WRONG_VALUE(argument="seed", value=repr(seed), wanted=wanted))
        if len(seeds) != self.num_envs:
            raise refused(NUMBER_OF_SEEDS(seeds=len(seeds), tables=self.num_envs))
        if options is not None and not isinstance(options, Mapping):
            check_options(options)
        options = dict(options or {})
        chosen = self.chosen(options.pop("reset_mask", None))
        for k in np.flatnonzero(chosen).tolist():
            if seeds[k] is not None or self._rngs[k] is None:
                self._rngs[k], _ = seeding.np_random(seeds[k])
                self._seeded(k)
        success = self._start_on(chosen, options)
        self._begun = True
        return self._seen(), self._infos(chosen, success, {})

    def step(self, actions: Any) -> tuple[Observations, Array, Mask, Mask, dict[str, Any]]:
        """Do an action on every table; tables that are reset in this step ignore theirs."""
        if not self._begun:
            raise refused(NO_EPISODE(state="no episode has begun", remedy="call reset()"), error.ResetNeeded)
        checked = self._checked(actions)
        again = self._over
        if self.autoreset_mode is AutoresetMode.DISABLED and again.any():
            over = ", ".join(map(str, np.flatnonzero(again)[:8]))
            state, remedy = f"the episode is over on table {over}", 'call reset(options={"reset_mask": ...})'
            raise refused(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        done = self._act(checked, again)
        self._steps += 1
        reward, success, ended = done.reward, done.success & ~again, done.ended & ~again
        flags = {name: mask & ~again for name, mask in done.flags.items()}
        late = np.zeros_like(ended) if self._limit is None else (self._steps >= self._limit) & ~again
        if self.listener is not None:
            self.listener(np.where(again, 0.0, reward), ended | late, success)
        if again.any():
            reward = np.where(again, 0.0, reward)
            success = np.where(again, self._start_on(again, {}), success)
        self._over = ended | late
        final: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            finished, self._over = self._over, np.zeros_like(ended)
            seen, last = self._seen(), np.full(self.num_envs, None, dtype=object)
            for k in np.flatnonzero(finished).tolist():
                last[k] = seen[k].copy()
            infos = self._infos(finished, success, flags)
            final = {
                "final_obs": last,
                "_final_obs": finished.copy(),
                "final_info": infos,
                "_final_info": finished.copy(),
            }
            success = np.where(finished, self._start_on(finished, {}), success)
            flags = {name: mask & ~finished for name, mask in flags.items()}
        infos = {**final, **self._infos(np.ones(self.num_envs, dtype=np.bool_), success, flags)}
        return self._seen(), reward, ended, late, infos

    def _start_on(self, chosen: Mask, options: dict[str, Any]) -> Mask:
        success = self._start(chosen, options)
        self._steps[chosen] = 0
        self._over[chosen] = False
        return success

    def chosen(self, mask: Any) -> Mask:
        """The tables to reset: those of a mask (num_envs,), all for None. Raises gymnasium.error.Error."""
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        if (
            not isinstance(mask, np.ndarray)
            or mask.shape != (self.num_envs,)
            or mask.dtype != np.bool_
            or not mask.any()
        ):
            wanted = f"an array of {self.num_envs} bools, at least one of them True"
            raise refused(WRONG_VALUE(argument="reset_mask", value=repr(mask), wanted=wanted))
        if not self._begun and not mask.all():
            state, remedy = "the first reset is one of all tables", "leave `reset_mask` out"
            raise refused(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        return mask


def masked(values: Mapping[str, Any], told: Mask) -> dict[str, Any]:
    """Each value with the mask of the tables that have it."""
    return {key: value for name, array in values.items() for key, value in ((name, array), (f"_{name}", told.copy()))}
