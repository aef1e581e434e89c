"""Many tables at once: phi, moves and observations are computed together.

It behaves exactly like `gymnasium.make_vec(..., vectorization_mode="sync")` with as many `TableTop` and a time limit,
at a fraction of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from scenegen.curriculum.env import TableTop
from scenegen.curriculum.errors import count, refused
from scenegen.curriculum.request import check_options
from scenegen.curriculum.reset import StartRequest
from scenegen.curriculum.rules import Tables
from scenegen.curriculum.scene_stream import SceneStream, StartScene
from scenegen.curriculum.tasks import PhiBox
from scenegen.errors.learning import NO_EPISODE, NUMBER_OF_SEEDS
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.pose import row_count

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Observations = npt.NDArray[np.float32]
Chooser = Callable[[int], Mapping[str, Any] | None]
Listener = Callable[[Array, Mask, Mask], None]


class TableTopVector(VectorEnv[Observations, Any, Any]):
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
        super().__init__()
        self.num_envs = count("num_envs", num_envs)
        self._limit = None if max_episode_steps is None else count("max_episode_steps", max_episode_steps)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = [mode.value for mode in AutoresetMode]
            raise refused(UNKNOWN_CHOICE(what="autoreset mode", name=str(autoreset_mode), known=modes)) from None
        one = TableTop(spec, **settings)  # its rules, scenes and pictures are used for all tables
        self._one = one
        self.rules, self.moves, self.views, self.scenes = one.rules, one.moves, one.views, one.scenes
        self.metadata = {**TableTop.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = one.render_mode
        self.single_action_space, self.single_observation_space = one.action_space, one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        self.chooser: Chooser | None = None
        self.listener: Listener | None = None
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._feeds: list[SceneStream | None] = [None] * num_envs
        self._tables: Tables | None = None
        self._tasks = np.empty((num_envs, len(self.rules.target.names), 2))
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._over = np.zeros(num_envs, dtype=np.bool_)

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum: of each label, from the hardest to where it is satisfied."""
        return self._one.space

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
                self._feeds[k] = None
        success = self._begin(chosen, options)
        return self._seen(), self._infos(chosen, success, np.zeros_like(chosen), np.zeros_like(chosen))

    def step(self, actions: Any) -> tuple[Observations, Array, Mask, Mask, dict[str, Any]]:
        """Do an action on every table; tables that are reset in this step ignore theirs."""
        if self._tables is None:
            raise refused(NO_EPISODE(state="no episode has begun", remedy="call reset()"), error.ResetNeeded)
        checked = self.moves.checked(actions, self.num_envs)
        again = self._over
        if self.autoreset_mode is AutoresetMode.DISABLED and again.any():
            over = ", ".join(map(str, np.flatnonzero(again)[:8]))
            state, remedy = f"the episode is over on table {over}", 'call reset(options={"reset_mask": ...})'
            raise refused(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        done = self.rules.step(self._tables, checked)
        self._tables = done.tables
        self._steps += 1
        reward, success, blocked = done.reward, done.success & ~again, done.blocked & ~again
        ended, off = (done.success | done.off) & ~again, done.off & ~again
        late = np.zeros_like(ended) if self._limit is None else (self._steps >= self._limit) & ~again
        if self.listener is not None:
            self.listener(np.where(again, 0.0, reward), ended | late, success)
        if again.any():
            reward = np.where(again, 0.0, reward)
            success = np.where(again, self._begin(again, {}), success)
        self._over = ended | late
        final: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            finished, self._over = self._over, np.zeros_like(ended)
            seen, last = self._seen(), np.full(self.num_envs, None, dtype=object)
            for k in np.flatnonzero(finished).tolist():
                last[k] = seen[k].copy()
            infos = self._infos(finished, success, off, blocked)
            final = {
                "final_obs": last,
                "_final_obs": finished.copy(),
                "final_info": infos,
                "_final_info": finished.copy(),
            }
            success = np.where(finished, self._begin(finished, {}), success)
            off, blocked = off & ~finished, blocked & ~finished
        infos = {**final, **self._infos(everyone, success, off, blocked)}
        return self._seen(), reward, ended, late, infos

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
        if self._tables is None and not mask.all():
            state, remedy = "the first reset is one of all tables", "leave `reset_mask` out"
            raise refused(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        return mask

    def _begin(self, chosen: Mask, options: dict[str, Any]) -> Mask:
        """New scenes on some tables; returns a mask of the tables that start satisfied."""
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
        self._steps[places] = 0
        self._over[places] = False
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

    def _infos(self, told: Mask, success: Mask, off: Mask, blocked: Mask) -> dict[str, Any]:
        """Combines the infos of single tables like SyncVectorEnv: missing values are zeros."""
        assert self._tables is not None
        names = self.rules.target.names
        phi = {name: np.where(told, self._tables.phi[k], 0.0) for k, name in enumerate(names)}
        task = {name: np.where(told[:, None], self._tasks[:, k], 0.0) for k, name in enumerate(names)}
        values = {
            "phi": _masked(phi, told),
            "is_success": success & told,
            "off_table": off & told,
            "blocked": blocked & told,
            "task": _masked(task, told),
        }
        return _masked(values, told)


def _masked(values: Mapping[str, Any], told: Mask) -> dict[str, Any]:
    """Each value with the mask of the tables that have it."""
    return {key: value for name, array in values.items() for key, value in ((name, array), (f"_{name}", told.copy()))}
