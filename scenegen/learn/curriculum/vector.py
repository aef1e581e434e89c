"""Many tables at once: phi, moves and observations are computed together, at a fraction of the time."""

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
from gymnasium.vector.utils import batch_space

from scenegen.errors.learning import NO_EPISODE, NUMBER_OF_SEEDS
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.learn.curriculum.env import TableTop
from scenegen.learn.curriculum.goal import count, refused
from scenegen.learn.curriculum.request import check_options
from scenegen.learn.curriculum.reset import StartRequest
from scenegen.learn.curriculum.rules import Tables
from scenegen.learn.curriculum.scene_stream import LibraryStream, StartScene
from scenegen.learn.curriculum.tasks import PhiBox
from scenegen.pose import row_count

# --------------------------------------------------------------------------------------------------------------------
# What vector environments have in common: seeds, episodes that begin again, limits of steps.
#
# They behave exactly like `gymnasium.make_vec(..., vectorization_mode="sync")` with as many single environments and a
# time limit.


Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Observations = npt.NDArray[np.float32]
Chooser = Callable[[int], Mapping[str, Any] | None]
Listener = Callable[[Array, Mask, Mask], None]


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """What a step did, (num_envs,) each. Of tables whose episode was over before it means nothing. `flags` are further
    entries of the info."""

    reward: Array
    success: Mask
    ended: Mask
    flags: Mapping[str, Mask]


class BatchedTableEnv(VectorEnv[Observations, Any, Any]):
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
    def _act(self, actions: npt.NDArray[Any], again: Mask) -> StepOutcome:
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


class TableTopVector(BatchedTableEnv):
    """`num_envs` tables. `autoreset_mode` is gymnasium's: "NextStep", "SameStep" or "Disabled" (reset with
    `options={"reset_mask": mask}`). `max_episode_steps` truncates; the other arguments are those of TableTop.

    `reset(seed=s)` seeds the tables with s, s + 1, ..., a list one by one. `chooser`, if set, gives the options for
    table k's next scene whenever an episode begins without options. `listener`, if set, is called after every step,
    before tables are reset, with the rewards, which episodes ended, and which of these were successful, (num_envs,)
    each.

    Raises what TableTop does; ResetNeeded also if the episode of a table without autoreset is over.
    """

    def __init__(
        self,
        num_envs: int = 1,
        spec: Any = None,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ) -> None:
        super().__init__(num_envs, max_episode_steps, autoreset_mode)
        one = TableTop(spec, **settings)  # its rules, scenes and pictures are used for all tables
        self._one = one
        self.rules, self.moves, self.views, self.scenes = one.rules, one.moves, one.views, one.scenes
        self.metadata = {**TableTop.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = one.render_mode
        self.single_action_space, self.single_observation_space = one.action_space, one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        self.names, self.about = self.rules.target.names[: self.rules.target.labels], "phi"
        self._feeds: list[LibraryStream | None] = [None] * num_envs
        self._tables: Tables | None = None
        self._tasks = np.empty((num_envs, len(self.rules.target.names), 2))

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum: of each label, from the hardest to where it is satisfied."""
        return self._one.space

    def render(self) -> tuple[Any, ...] | None:
        """A picture of every table if `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if self._tables is None:
            raise refused(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
        return tuple(self._one.easel.draw(row) for row in self._tables.rows.T)

    def close_extras(self, **kwargs: Any) -> None:
        """End the process that draws, if there is one."""
        self._one.close()

    def _checked(self, actions: Any) -> npt.NDArray[Any]:
        return self.moves.checked(actions, self.num_envs)

    def _act(self, actions: npt.NDArray[Any], again: Mask) -> StepOutcome:
        assert self._tables is not None
        done = self.rules.step(self._tables, actions)
        self._tables = done.tables
        flags = {"off_table": done.off, "blocked": done.blocked}
        return StepOutcome(done.reward, done.success, done.success | done.off, flags)

    def _seeded(self, number: int) -> None:
        self._feeds[number] = None

    def _start(self, chosen: Mask, options: dict[str, Any]) -> Mask:
        resets = self._one.resets
        given = resets.read(options)
        places = np.flatnonzero(chosen)
        begun = []  # all scenes first, then the tables: a request that fails leaves the tables unchanged
        for k in places.tolist():
            request = given
            if self.chooser is not None and given.scene is None and given.ranges is None:
                request = resets.read(self.chooser(k))
            if request.scene is not None:
                one = request.scene
                begun.append((k, one.rows[:, 0], one.phi[:, 0], one.slack[0], resets.task(request)))
            else:
                row, phi = self._draw_start(k, request)
                begun.append((k, row, phi, 0.0, resets.task(request)))
        if self._tables is None:
            shape = (
                (row_count(len(self.scenes.drawn.core.objects)), self.num_envs),
                (len(self.rules.target.names), self.num_envs),
            )
            self._tables = Tables(np.zeros(shape[0]), np.zeros(shape[1]), np.zeros(self.num_envs))
        tables = self._tables
        for k, row, phi, slack, task in begun:
            tables.rows[:, k], tables.phi[:, k], tables.slack[k], self._tasks[k] = row, phi, slack, task
        return self.rules.success(tables) & chosen

    def _draw_start(self, number: int, request: StartRequest) -> StartScene:
        """A table's next scene, and its phi."""
        stream, rng = self._feeds[number], self._rngs[number]
        if stream is None:
            assert rng is not None
            stream = self._feeds[number] = self._one.resets.stream(rng)
        return self._one.resets.draw(stream, request)

    def _seen(self) -> Observations:
        assert self._tables is not None
        return self.views(self._tables.rows)

    def _infos(self, told: Mask, success: Mask, flags: Mapping[str, Mask]) -> dict[str, Any]:
        """Combines the infos of single tables like SyncVectorEnv: missing values are zeros."""
        assert self._tables is not None
        names, none = self.rules.target.names, np.zeros_like(told)
        phi = {name: np.where(told, self._tables.phi[k], 0.0) for k, name in enumerate(names)}
        task = {name: np.where(told[:, None], self._tasks[:, k], 0.0) for k, name in enumerate(names)}
        values = {
            "phi": masked(phi, told),
            "is_success": success & told,
            "off_table": flags.get("off_table", none) & told,
            "blocked": flags.get("blocked", none) & told,
            "task": masked(task, told),
        }
        return masked(values, told)
