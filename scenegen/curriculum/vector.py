"""Many tables at once: phi, moves and observations are computed together, at a fraction of the time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from scenegen.curriculum.env import TableTop
from scenegen.curriculum.errors import refused
from scenegen.curriculum.many import Acted, Many, Mask, Observations, masked
from scenegen.curriculum.reset import StartRequest
from scenegen.curriculum.rules import Tables
from scenegen.curriculum.scene_stream import SceneStream, StartScene
from scenegen.curriculum.tasks import PhiBox
from scenegen.errors.learning import NO_EPISODE
from scenegen.pose import row_count


class TableTopVector(Many):
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
        self._feeds: list[SceneStream | None] = [None] * num_envs
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

    def _act(self, actions: npt.NDArray[Any], again: Mask) -> Acted:
        assert self._tables is not None
        done = self.rules.step(self._tables, actions)
        self._tables = done.tables
        flags = {"off_table": done.off, "blocked": done.blocked}
        return Acted(done.reward, done.success, done.success | done.off, flags)

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
