"""`scenegen/TableTop-v0`: move the objects of a table until they satisfy a spec, from a start of chosen difficulty.

An environment of one table plays one of `Episodes`, a vector environment `num_envs`; it behaves exactly like
`gymnasium.make_vec(..., vectorization_mode="sync")` with as many single ones and a time limit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors.learning import NO_EPISODE
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.learn.model import Model
from scenegen.play.environments.episodes import Episodes, Observations, SceneStarts
from scenegen.play.environments.goal import load_spec
from scenegen.play.environments.gym_errors import as_count, gym_error
from scenegen.play.environments.rendering import RENDER_MODES, SceneRenderer
from scenegen.play.environments.request import check_options
from scenegen.play.environments.rules import Mask, make_rules
from scenegen.play.tasks import PhiBox


class TableTop(gymnasium.Env[Observations, Any]):
    """Move objects step by step until a spec is satisfied.

    `spec` is a Spec, the path of a spec file (.spec) or its text; `goal` names the labels to satisfy (phi >= 0), by
    default all of them. phi of the goal is their minimum.

    `moves="grid"`: an action is a number; `env.unwrapped.moves.names` says which object it moves, by `step` metres
    (default: a twentieth of the table) along x or y, and if phi depends on its heading also by `turn` radians (a
    sixteenth of a turn). `moves="continuous"`: an action is one number in [-1, 1] per object and coordinate, in units
    of `step` and `turn`, and all objects move at once. `move` names the objects that are moved, by default all that the
    spec does not fix. A move that would violate a requirement (`require noOverlap()`) is not made. An object that is
    moved off the table stays at its edge, and the episode is over.

    `reward="sparse"`: 10 when the goal is reached, -10 off the table, 0 otherwise; "dense" adds the increase of the
    goal's phi, in steps.

    Observations are float32 in [-1, 1], see `env.unwrapped.views.names`: x and y from edge to edge of the table, and
    the cosine and sine of each heading that phi or a requirement depends on. Objects that the spec fixes are left out.
    Of objects that may be missing, `object block[3..8]`, a further number says whether they are there; if not, all
    their numbers are 0, and moves of them change nothing.

    `info` has `phi` (label -> value), `is_success`, `off_table`, `blocked` (the last move was not made), and `task`:
    label -> [lowest, highest] requested phi of the start, infinite for an open end.

    `reset(options={"phi": (lo, hi)})` begins with a verified scene whose phi of the goal lies in that range, evenly
    spread over it; {"phi": {label: (lo, hi)}} and a PhiBox give ranges of single labels; None is an open end. `phi` of
    the constructor is the range used if the options have none; its default is all scenes that do not satisfy the goal
    yet, except the hardest thousandth. {"scene": ...} begins with a given scene: a Scene, {object: (x, y, theta)}, or
    an array (N, 3). {"nearest": True} takes the nearest existing scenes if phi is out of reach; if ranges of several
    labels have few scenes ready, also scenes outside of the ranges by up to a sixteenth of the labels' reach.

    Scenes come from the exact sampler, or from `source`: a model trained on the spec, or scenes, or the path of either.
    The same seed and the same requests give the same scenes, each used once. Scenes of a file are used again when all
    others of about the same phi were used; with "nearest", also scenes whose phi is hard to find. (A draw is limited to
    20 seconds, with "nearest" to 2: if the scenes of a spec take longer, a slower machine gives others.)

    Episodes have no end of their own: gymnasium.make adds a limit of 100 steps (`max_episode_steps=`).

    `render_mode="rgb_array"` draws in a process that runs until `close`; `view` and `size` (width, height) are those of
    SceneSet.render.

    Raises errors of `gymnasium.error`: InvalidBound for phi out of reach, InvalidAction for NaN and actions out of
    range, ResetNeeded, MissingArgument, UnsupportedMode, and Error for the rest, a spec with mistakes included.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # noqa: RUF012 - gymnasium's

    def __init__(
        self,
        spec: Spec | str | Path | None = None,
        *,
        goal: str | Sequence[str] | None = None,
        moves: str = "grid",
        move: str | Sequence[str] | None = None,
        step: float | None = None,
        turn: float | None = None,
        reward: str = "sparse",
        phi: object = None,
        source: Model | SceneSet | str | Path | None = None,
        render_mode: str | None = None,
        view: str = "perspective",
        size: tuple[int, int] = (480, 360),
    ) -> None:
        self.easel = SceneRenderer(render_mode, view, size)
        self.scenes = load_spec(spec)
        self.rules = make_rules(self.scenes, goal=goal, moves=moves, move=move, step=step, turn=turn, reward=reward)
        self.moves, self.views = self.rules.moves, self.rules.views
        self.starts = SceneStarts(self.scenes, self.rules, source, phi)
        self.episodes = Episodes(self.rules, self.starts)
        observation_space: Any = self.views.space()
        self.action_space, self.observation_space = self.moves.space(), observation_space
        self.render_mode = self.easel.mode
        self._began = self._ended = False

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum: of each label, from the hardest to where it is satisfied."""
        return self.starts.space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode; see the class for options."""
        request = self.starts.read(options)  # before the seed is used: a bad request changes nothing
        super().reset(seed=seed)
        if seed is not None:
            self.episodes.forget(0)
        self.episodes.begin({0: request}, lambda _: self.np_random)
        self._began, self._ended = True, False
        infos = self.episodes.infos(self.episodes.success(), self.episodes.no_flags)
        return self.episodes.observations()[0], _single_info(infos, self.episodes.names)

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Do an action. Raises gymnasium.error.InvalidAction, and ResetNeeded if the episode is over."""
        if not self._began or self._ended:
            state = "the episode is over" if self._began else "no episode has begun"
            raise gym_error(NO_EPISODE(state=state, remedy="call reset()"), error.ResetNeeded)
        outcome = self.episodes.act(self.moves.as_actions(action, 1))
        self._ended = bool(outcome.terminated[0])
        info = _single_info(self.episodes.infos(outcome.success, outcome.flags), self.episodes.names)
        return self.episodes.observations()[0], float(outcome.reward[0]), self._ended, False, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The scene as (height, width, 3) if `render_mode` is "rgb_array"."""
        pictures = _pictures(self.episodes, self.easel, self._began)
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()


def _single_info(infos: Mapping[str, npt.NDArray[Any]], names: Sequence[str]) -> dict[str, Any]:
    """The info of the only table, in plain numbers."""
    found: dict[str, Any] = {}
    for name, value in infos.items():
        if value.ndim == 1:
            found[name] = value.item()
        else:
            only = value[:, 0]
            found[name] = dict(zip(names, only.tolist() if value.ndim == 2 else only.copy(), strict=True))
    return found


def _pictures(episodes: Episodes, easel: SceneRenderer, began: bool) -> tuple[npt.NDArray[np.uint8], ...] | None:
    if easel.mode is None:
        return None
    if not began:
        raise gym_error(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
    return tuple(easel.draw(episodes.starts.spec.definition, row) for row in episodes.rows.T)


NextOptions = Callable[[int], Mapping[str, Any] | None]
StepListener = Callable[[Array, Mask, Mask], None]


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
        self.num_envs = as_count("num_envs", num_envs)
        self._max_steps = None if max_episode_steps is None else as_count("max_episode_steps", max_episode_steps)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = [mode.value for mode in AutoresetMode]
            raise gym_error(UNKNOWN_CHOICE(what="autoreset mode", name=str(autoreset_mode), known=modes)) from None
        single = TableTop(spec, **settings)
        self.episodes, self.easel = single.episodes.with_tables(num_envs), single.easel
        self.scenes, self.starts = single.scenes, single.starts
        self.rules, self.moves, self.views = single.rules, single.moves, single.views
        self.metadata = {**single.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = single.render_mode
        self.single_action_space, self.single_observation_space = single.action_space, single.observation_space
        self.action_space = batch_space(single.action_space, num_envs)
        self.observation_space = batch_space(single.observation_space, num_envs)
        self.chooser: NextOptions | None = None
        self.listener: StepListener | None = None
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._began = False
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._ended = np.zeros(num_envs, dtype=np.bool_)

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum, as that of a single environment."""
        return self.starts.space

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
            raise gym_error(WRONG_VALUE(argument="seed", value=repr(seed), wanted=wanted))
        if len(seeds) != self.num_envs:
            wanted = f"one, or {self.num_envs}: one for each table"
            raise gym_error(WRONG_VALUE(argument="seed", value=f"{len(seeds)} seeds", wanted=wanted))
        if options is not None and not isinstance(options, Mapping):
            check_options(options)
        options = dict(options or {})
        tables = self.tables_to_reset(options.pop("reset_mask", None))
        for k in np.flatnonzero(tables).tolist():
            if seeds[k] is not None or self._rngs[k] is None:
                self._rngs[k], _ = seeding.np_random(seeds[k])
                self.episodes.forget(k)
        success = self._start(tables, options)
        self._began = True
        return self.episodes.observations(), self._infos(success, self.episodes.no_flags, tables)

    def step(self, actions: Any) -> tuple[Observations, Array, Mask, Mask, dict[str, Any]]:
        """Do an action on every table; tables that are reset in this step ignore theirs."""
        if not self._began:
            raise gym_error(NO_EPISODE(state="no episode has begun", remedy="call reset()"), error.ResetNeeded)
        checked = self.moves.as_actions(actions, self.num_envs)
        resets = self._ended
        if self.autoreset_mode is AutoresetMode.DISABLED and resets.any():
            tables = ", ".join(map(str, np.flatnonzero(resets)[:8]))
            state, remedy = f"the episode is over on table {tables}", 'call reset(options={"reset_mask": ...})'
            raise gym_error(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        outcome = self.episodes.act(checked)
        self._steps += 1
        reward, success, terminated = outcome.reward, outcome.success & ~resets, outcome.terminated & ~resets
        flags = {name: mask & ~resets for name, mask in outcome.flags.items()}
        truncated = np.zeros_like(terminated)
        if self._max_steps is not None:
            truncated = (self._steps >= self._max_steps) & ~resets
        if self.listener is not None:
            self.listener(np.where(resets, 0.0, reward), terminated | truncated, success)
        if resets.any():
            reward = np.where(resets, 0.0, reward)
            success = np.where(resets, self._start(resets, {}), success)
        self._ended = terminated | truncated
        final: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._ended.any():
            finished, self._ended = self._ended, np.zeros_like(terminated)
            observations, last = self.episodes.observations(), np.full(self.num_envs, None, dtype=object)
            for k in np.flatnonzero(finished).tolist():
                last[k] = observations[k].copy()
            infos = self._infos(success, flags, finished)
            final = {
                "final_obs": last,
                "_final_obs": finished.copy(),
                "final_info": infos,
                "_final_info": finished.copy(),
            }
            success = np.where(finished, self._start(finished, {}), success)
            flags = {name: mask & ~finished for name, mask in flags.items()}
        everywhere = np.ones(self.num_envs, dtype=np.bool_)
        infos = {**final, **self._infos(success, flags, everywhere)}
        return self.episodes.observations(), reward, terminated, truncated, infos

    def _start(self, tables: Mask, options: dict[str, Any]) -> Mask:
        """Begin episodes on some tables; returns a mask of those that start satisfied."""
        request = self.starts.read(options)
        chooser = self.chooser if request.scene is None and request.ranges is None else None
        requests = {
            k: request if chooser is None else self.starts.read(chooser(k)) for k in np.flatnonzero(tables).tolist()
        }
        self.episodes.begin(requests, self._rng)
        self._steps[tables] = 0
        self._ended[tables] = False
        return self.episodes.success() & tables

    def _infos(self, success: Mask, flags: Mapping[str, Mask], tables: Mask) -> dict[str, Any]:
        return _masked_infos(self.episodes.infos(success, flags), self.episodes.names, tables)

    def _rng(self, table: int) -> np.random.Generator:
        rng = self._rngs[table]
        assert rng is not None
        return rng

    def tables_to_reset(self, mask: Any) -> Mask:
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
            raise gym_error(WRONG_VALUE(argument="reset_mask", value=repr(mask), wanted=wanted))
        if not self._began and not mask.all():
            state, remedy = "the first reset is one of all tables", "leave `reset_mask` out"
            raise gym_error(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        return mask

    def render(self) -> tuple[Any, ...] | None:
        """A picture of every table if `render_mode` is "rgb_array"."""
        return _pictures(self.episodes, self.easel, self._began)

    def close_extras(self, **kwargs: Any) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()


def _masked_infos(infos: Mapping[str, npt.NDArray[Any]], names: Sequence[str], tables: Mask) -> dict[str, Any]:
    """The infos of some tables, as SyncVectorEnv combines those of single ones: missing values are zeros, and each
    comes with the mask of the tables that have it. What is returned stays as it is."""

    def masked_copy(value: npt.NDArray[Any]) -> npt.NDArray[Any]:
        copy = value.copy()
        copy[~tables] = 0
        return copy

    found: dict[str, Any] = {}
    for name, value in infos.items():
        if value.ndim == 1:
            found[name] = masked_copy(value)
        else:
            found[name] = {}
            for label, values in zip(names, value, strict=True):
                found[name] |= {label: masked_copy(values), f"_{label}": tables.copy()}
        found[f"_{name}"] = tables.copy()
    return found
