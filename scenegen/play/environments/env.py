"""Environments of gymnasium, of one table and of many: seeds, episodes, infos and pictures.

What happens on the tables is said once, for any number of them, by `Episodes`: of scenes (tabletop.py) and of motions
(motion.py). An environment of one table plays one of these, a vector environment `num_envs`; it behaves exactly like
`gymnasium.make_vec(..., vectorization_mode="sync")` with as many single ones and a time limit.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, Self, TypeVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import Space, error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from scenegen.api.scene_arrays import make_header, stored_rows
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors.learning import NO_EPISODE
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.play.environments.goal import as_gymnasium, count, refused
from scenegen.play.environments.request import StartRequest, check_options
from scenegen.play.tasks import PhiBox
from scenegen.pose import as_poses, row_count
from scenegen.scenes.data import RequestData, SceneFile, heights_of, varying

if TYPE_CHECKING:
    from scenegen.pictures.render.worker import LiveRenderer

Mask = npt.NDArray[np.bool_]
Observations = npt.NDArray[np.float32]
Start = tuple[Array, Array, float]
"""The first scene of an episode, (3N,); its phi, or that of the motion that it is from, (D,); and the lowest allowed
margin of the requirement: 0, or slightly less in a scene that was rounded."""

# --------------------------------------------------------------------------------------------------------------------
# The pictures of `render()`, by scenegen's own renderer.


MODES = ("rgb_array",)


class SceneRenderer:
    """Draws scenes of a spec, one at a time. Raises gymnasium.error.UnsupportedMode for an unknown mode, and Error for
    an invalid view or size, and if pybullet is not installed."""

    def __init__(self, mode: str | None, view: str, size: tuple[int, int]) -> None:
        if mode is not None and mode not in MODES:
            raise refused(UNKNOWN_CHOICE(what="render mode", name=str(mode), known=MODES), error.UnsupportedMode)
        if not isinstance(view, str):
            raise refused(WRONG_VALUE(argument="view", value=repr(view), wanted="the name of a view"))
        sides = size if isinstance(size, tuple | list) else ()
        if len(sides) != 2 or not all(isinstance(side, int | np.integer) for side in sides):
            wanted = "(width, height) in whole pixels"
            raise refused(WRONG_VALUE(argument="size", value=repr(size), wanted=wanted))
        if mode is not None:
            from scenegen.pictures.render.worker import check_request

            with as_gymnasium():
                check_request((view,), size, None)
                need("pybullet", "to draw pictures")
        self.mode, self._look = mode, (view, size)
        self._live: LiveRenderer | None = None
        self._header: SceneFile | None = None

    def draw(self, spec: CheckedSpec, row: Array) -> npt.NDArray[np.uint8]:
        """A scene (3N,) as (height, width, 3). The first one determines how high the camera looks."""
        from scenegen.pictures.render.worker import LiveRenderer

        rows = row_count(len(spec.objects))
        poses, on = as_poses(row[:rows]), stored_rows(spec, row[:, None])[rows:].T
        with as_gymnasium():
            if self._live is None:
                header = make_header(spec, {"method": "environment"}, RequestData(phi={}, n=1, spread="base"))
                self._header = header
                shown = SceneSet(poses[None], {}, header, on=on if spec.choices else None).file()
                self._live = LiveRenderer(shown, *self._look)
            if self._header is not None and varying(self._header):
                heights = heights_of(self._header, on)
                assert heights is not None
                poses = np.concatenate([poses, heights[0][:, None]], axis=1)
            return self._live.draw(poses)

    def close(self) -> None:
        """End the process that draws."""
        if self._live is not None:
            self._live.close()
            self._live = None


# --------------------------------------------------------------------------------------------------------------------
# Episodes on any number of tables.


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """What a step did, (B,) each. Of tables whose episode was over before it means nothing. `flags` are further entries
    of the info."""

    reward: Array
    success: Mask
    ended: Mask
    flags: Mapping[str, Mask]


class Starts(Protocol):
    """Where episodes start. One is shared by all tables; a stream of it is one table's own."""

    spec: Spec

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum."""

    def read(self, options: object) -> StartRequest:
        """Check the options of `reset`. Raises gymnasium.error.Error, and InvalidBound for invalid ranges."""

    def stream(self, rng: np.random.Generator) -> Any:
        """What `draw` takes its starts from, in the order of a generator."""

    def draw(self, stream: Any, request: StartRequest) -> Start:
        """A start as requested, of a request without a scene. Raises gymnasium.error.InvalidBound for a range out of
        reach."""

    def task(self, request: StartRequest) -> list[tuple[float, float]]:
        """The lowest and highest requested phi of each of the D labels."""


class Actions(Protocol):
    """The actions of an environment."""

    @property
    def names(self) -> Sequence[str]:
        """What each action, or part of one, does."""

    def space(self) -> Space[Any]:
        """That of one action."""

    def checked(self, actions: Any, count: int) -> npt.NDArray[Any]:
        """B actions as an array. Raises gymnasium.error.InvalidAction."""


class EpisodeRules(Protocol):
    """What all environments of a spec share."""

    @property
    def moves(self) -> Actions:
        """What an agent does."""


R = TypeVar("R", bound=EpisodeRules)
S = TypeVar("S", bound=Starts)


class Episodes(ABC, Generic[R, S]):
    """Episodes on B tables side by side. `names` are the D labels whose phi is recorded; `labels`, the first of these,
    are those of a curriculum's range; `about` is the entry of an info that has phi of a start."""

    names: Sequence[str]
    labels: Sequence[str]
    about: ClassVar[str]
    flags: ClassVar[tuple[str, ...]]  # those of `StepOutcome`

    def __init__(self, rules: R, starts: S, tables: int = 1) -> None:
        self.rules, self.starts, self.tables = rules, starts, tables
        self.tasks = np.zeros((len(self.names), tables, 2))
        self.unflagged = {flag: np.zeros(tables, dtype=np.bool_) for flag in self.flags}
        self._streams: list[Any] = [None] * tables

    def many(self, tables: int) -> Self:
        """The same on another number of tables."""
        return type(self)(self.rules, self.starts, tables)

    @property
    @abstractmethod
    def rows(self) -> Array:
        """The scenes as they are now, (3N, B)."""

    @abstractmethod
    def observation_space(self) -> Space[Any]:
        """That of one table."""

    @abstractmethod
    def act(self, actions: npt.NDArray[Any], over: Mask) -> StepOutcome:
        """Do checked actions; tables of `over` have no episode."""

    @abstractmethod
    def satisfied(self) -> Mask:
        """Which starts satisfy the goal."""

    @abstractmethod
    def seen(self) -> Observations:
        """The observations, (B, K)."""

    @abstractmethod
    def figures(self, success: Mask, flags: Mapping[str, Mask]) -> dict[str, npt.NDArray[Any]]:
        """What infos say of all tables: (B,), or of each label, (D, B) and (D, B, 2)."""

    @abstractmethod
    def _put(self, starts: Mapping[int, Start]) -> None:
        """Begin episodes on some tables."""

    def forget(self, table: int) -> None:
        """A table has got another generator of random numbers."""
        self._streams[table] = None

    def begin(self, requests: Mapping[int, StartRequest], rng: Callable[[int], np.random.Generator]) -> None:
        """Begin episodes on some tables, each with its generator. A request that fails leaves all tables unchanged."""
        found: dict[int, Start] = {}
        tasks, starts = [], self.starts
        for table, request in requests.items():
            start = request.scene
            if start is None:
                if self._streams[table] is None:
                    self._streams[table] = starts.stream(rng(table))
                start = starts.draw(self._streams[table], request)
            found[table] = start
            tasks.append(starts.task(request))
        for table, task in zip(found, tasks, strict=True):
            for place, ends in enumerate(task):
                self.tasks[place, table] = ends
        self._put(found)


# --------------------------------------------------------------------------------------------------------------------
# One table.


PLAYING = np.zeros(1, dtype=np.bool_)


class TableEnv(gymnasium.Env[Observations, Any]):
    """Episodes on one table, as an environment of gymnasium."""

    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012 - gymnasium's

    def __init__(self, episodes: Episodes[Any, Any], easel: SceneRenderer) -> None:
        self.episodes, self.easel = episodes, easel
        self.starts: Starts
        self.scenes, self.starts, self.moves = episodes.starts.spec, episodes.starts, episodes.rules.moves
        self.action_space, self.observation_space = episodes.rules.moves.space(), episodes.observation_space()
        self.render_mode = easel.mode
        self._begun, self._over = False, PLAYING

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum: of each label, from the hardest to where it is satisfied; of motions that
        of the source's. Raises gymnasium.error.Error for motions without a source."""
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
        self._begun, self._over = True, PLAYING
        success, flags = self.episodes.satisfied(), self.episodes.unflagged
        return self.episodes.seen()[0], _single(self.episodes.figures(success, flags), self.episodes.names)

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Do an action. Raises gymnasium.error.InvalidAction, and ResetNeeded if the episode is over."""
        if not self._begun or self._over[0]:
            state = "the episode is over" if self._begun else "no episode has begun"
            raise refused(NO_EPISODE(state=state, remedy="call reset()"), error.ResetNeeded)
        done = self.episodes.act(self.moves.checked(action, 1), self._over)
        self._over = done.ended
        info = _single(self.episodes.figures(done.success, done.flags), self.episodes.names)
        return self.episodes.seen()[0], float(done.reward[0]), bool(done.ended[0]), False, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The scene as (height, width, 3) if `render_mode` is "rgb_array"."""
        drawn = _pictures(self.episodes, self.easel, self._begun)
        return None if drawn is None else drawn[0]

    def close(self) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()


def _single(figures: Mapping[str, npt.NDArray[Any]], names: Sequence[str]) -> dict[str, Any]:
    """The info of the only table, in plain numbers."""
    found: dict[str, Any] = {}
    for name, value in figures.items():
        if value.ndim == 1:
            found[name] = value.item()
        else:
            only = value[:, 0]
            found[name] = dict(zip(names, only.tolist() if value.ndim == 2 else only.copy(), strict=True))
    return found


def _pictures(
    episodes: Episodes[Any, Any], easel: SceneRenderer, begun: bool
) -> tuple[npt.NDArray[np.uint8], ...] | None:
    if easel.mode is None:
        return None
    if not begun:
        raise refused(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
    return tuple(easel.draw(episodes.starts.spec.definition, row) for row in episodes.rows.T)


# --------------------------------------------------------------------------------------------------------------------
# Many tables.


Chooser = Callable[[int], Mapping[str, Any] | None]
Listener = Callable[[Array, Mask, Mask], None]


class TableVectorEnv(VectorEnv[Observations, Any, Any]):
    """`num_envs` tables of the environment `single`. `chooser`, if set, gives the options for table k's next episode
    whenever one begins without options. `listener`, if set, is called after every step, before tables are reset, with
    the rewards, which episodes ended, and which of these were successful, (num_envs,) each."""

    single: ClassVar[type[TableEnv]]

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
        one: Any = self.single
        made: TableEnv = one(spec, **settings)
        self.episodes, self.easel = made.episodes.many(num_envs), made.easel
        self.scenes, self.starts, self.moves = made.scenes, made.starts, made.moves
        self.metadata = {**made.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = made.render_mode
        self.single_action_space, self.single_observation_space = made.action_space, made.observation_space
        self.action_space = batch_space(made.action_space, num_envs)
        self.observation_space = batch_space(made.observation_space, num_envs)
        self.chooser: Chooser | None = None
        self.listener: Listener | None = None
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._begun = False
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._over = np.zeros(num_envs, dtype=np.bool_)

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
            raise refused(WRONG_VALUE(argument="seed", value=repr(seed), wanted=wanted))
        if len(seeds) != self.num_envs:
            wanted = f"one, or {self.num_envs}: one for each table"
            raise refused(WRONG_VALUE(argument="seed", value=f"{len(seeds)} seeds", wanted=wanted))
        if options is not None and not isinstance(options, Mapping):
            check_options(options)
        options = dict(options or {})
        chosen = self.chosen(options.pop("reset_mask", None))
        for k in np.flatnonzero(chosen).tolist():
            if seeds[k] is not None or self._rngs[k] is None:
                self._rngs[k], _ = seeding.np_random(seeds[k])
                self.episodes.forget(k)
        success = self._start(chosen, options)
        self._begun = True
        return self.episodes.seen(), self._infos(success, self.episodes.unflagged, chosen)

    def step(self, actions: Any) -> tuple[Observations, Array, Mask, Mask, dict[str, Any]]:
        """Do an action on every table; tables that are reset in this step ignore theirs."""
        if not self._begun:
            raise refused(NO_EPISODE(state="no episode has begun", remedy="call reset()"), error.ResetNeeded)
        checked = self.moves.checked(actions, self.num_envs)
        again = self._over
        if self.autoreset_mode is AutoresetMode.DISABLED and again.any():
            over = ", ".join(map(str, np.flatnonzero(again)[:8]))
            state, remedy = f"the episode is over on table {over}", 'call reset(options={"reset_mask": ...})'
            raise refused(NO_EPISODE(state=state, remedy=remedy), error.ResetNeeded)
        done = self.episodes.act(checked, again)
        self._steps += 1
        reward, success, ended = done.reward, done.success & ~again, done.ended & ~again
        flags = {name: mask & ~again for name, mask in done.flags.items()}
        late = np.zeros_like(ended) if self._limit is None else (self._steps >= self._limit) & ~again
        if self.listener is not None:
            self.listener(np.where(again, 0.0, reward), ended | late, success)
        if again.any():
            reward = np.where(again, 0.0, reward)
            success = np.where(again, self._start(again, {}), success)
        self._over = ended | late
        final: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            finished, self._over = self._over, np.zeros_like(ended)
            seen, last = self.episodes.seen(), np.full(self.num_envs, None, dtype=object)
            for k in np.flatnonzero(finished).tolist():
                last[k] = seen[k].copy()
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
        return self.episodes.seen(), reward, ended, late, infos

    def _start(self, chosen: Mask, options: dict[str, Any]) -> Mask:
        """Begin episodes on some tables; returns a mask of those that start satisfied."""
        given = self.starts.read(options)
        requests = {}
        for k in np.flatnonzero(chosen).tolist():
            choose = self.chooser is not None and given.scene is None and given.ranges is None
            requests[k] = self.starts.read(self.chooser(k)) if choose and self.chooser is not None else given
        self.episodes.begin(requests, self._rng)
        self._steps[chosen] = 0
        self._over[chosen] = False
        return self.episodes.satisfied() & chosen

    def _infos(self, success: Mask, flags: Mapping[str, Mask], told: Mask) -> dict[str, Any]:
        return _masked(self.episodes.figures(success, flags), self.episodes.names, told)

    def _rng(self, table: int) -> np.random.Generator:
        rng = self._rngs[table]
        assert rng is not None
        return rng

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

    def render(self) -> tuple[Any, ...] | None:
        """A picture of every table if `render_mode` is "rgb_array"."""
        return _pictures(self.episodes, self.easel, self._begun)

    def close_extras(self, **kwargs: Any) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()


def _masked(figures: Mapping[str, npt.NDArray[Any]], names: Sequence[str], told: Mask) -> dict[str, Any]:
    """The infos of the tables of `told`, as SyncVectorEnv combines those of single ones: missing values are zeros, and
    each comes with the mask of the tables that have it."""
    found: dict[str, Any] = {}
    for name, value in figures.items():
        if value.ndim == 1:
            found[name] = _copied(value, told)
        else:
            found[name] = {}
            for label, one in zip(names, value, strict=True):
                found[name] |= {label: _copied(one, told), f"_{label}": told.copy()}
        found[f"_{name}"] = told.copy()
    return found


def _copied(value: npt.NDArray[Any], told: Mask) -> npt.NDArray[Any]:
    """What is returned stays as it is."""
    copy = value.copy()
    copy[~told] = 0
    return copy
