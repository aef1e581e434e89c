"""`scenegen/TableTop-v0`: move the objects of a table until they satisfy a spec, from a start of chosen difficulty."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.scene_arrays import make_header, stored_rows
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.errors.learning import NO_EPISODE
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.curriculum.goal import as_gymnasium, refused
from scenegen.learn.curriculum.reset import Resets
from scenegen.learn.curriculum.rules import Tables, load_spec, make_rules
from scenegen.learn.curriculum.scene_stream import LibraryStream
from scenegen.learn.curriculum.tasks import PhiBox
from scenegen.learn.model import Model
from scenegen.needs import need
from scenegen.pose import as_poses, row_count
from scenegen.scenes.data import RequestData, SceneFile
from scenegen.scenes.stage import heights_of, varying

if TYPE_CHECKING:
    from scenegen.show.render.worker import LiveRenderer


# --------------------------------------------------------------------------------------------------------------------
# The pictures of `render()`, by scenegen's own renderer.


MODES = ("rgb_array",)


def check_render(mode: str | None, view: str, size: tuple[int, int]) -> None:
    """Raises gymnasium.error.UnsupportedMode for an unknown mode, and Error for an invalid view or size, and if
    pybullet is not installed."""
    if mode is not None and mode not in MODES:
        raise refused(UNKNOWN_CHOICE(what="render mode", name=str(mode), known=MODES), error.UnsupportedMode)
    if not isinstance(view, str):
        raise refused(WRONG_VALUE(argument="view", value=repr(view), wanted="the name of a view"))
    sides = size if isinstance(size, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(side, int | np.integer) for side in sides):
        wanted = "(width, height) in whole pixels"
        raise refused(WRONG_VALUE(argument="size", value=repr(size), wanted=wanted))
    if mode is not None:
        from scenegen.show.render.worker import check_request

        with as_gymnasium():
            check_request((view,), size, None)
            need("pybullet", "to draw pictures")


class SceneRenderer:
    """Draws scenes of a spec, one at a time."""

    def __init__(self, spec: CheckedSpec, view: str, size: tuple[int, int]) -> None:
        self._spec, self._look = spec, (view, size)
        self._live: LiveRenderer | None = None
        self._header: SceneFile | None = None

    def draw(self, row: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
        """A scene (3N,) as (height, width, 3). The first one determines how high the camera looks."""
        from scenegen.show.render.worker import LiveRenderer

        count = row_count(len(self._spec.objects))
        poses, on = as_poses(row[:count]), stored_rows(self._spec, row[:, None])[count:].T
        with as_gymnasium():
            if self._live is None:
                header = make_header(self._spec, {"method": "environment"}, RequestData(phi={}, n=1, spread="base"))
                self._header = header
                shown = SceneSet(poses[None], {}, header, on=on if self._spec.choices else None).file()
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


Array = npt.NDArray[np.float64]


class TableTop(gymnasium.Env[npt.NDArray[np.float32], Any]):
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

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 - gymnasium's

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
        check_render(render_mode, view, size)
        self.scenes = load_spec(spec)
        self.rules = make_rules(self.scenes, goal=goal, moves=moves, move=move, step=step, turn=turn, reward=reward)
        self.moves, self.views = self.rules.moves, self.rules.views
        self.action_space = self.moves.space()
        self.observation_space = self.views.space()  # type: ignore[assignment]
        self.render_mode = render_mode
        self.resets = Resets(self.scenes, self.rules, source, phi)
        self.easel = SceneRenderer(self.scenes.drawn, view, size)
        self._feed: LibraryStream | None = None
        self._tables: Tables | None = None
        self._over = False

    @property
    def space(self) -> PhiBox:
        """The range of phi for a curriculum: of each label, from the hardest to where it is satisfied."""
        return self.resets.library.space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Begin an episode; see the class for options."""
        request = self.resets.read(options)  # before the seed is used: a bad request changes nothing
        super().reset(seed=seed)
        if seed is not None:
            self._feed = None
        if request.scene is not None:
            self._tables = request.scene
        else:
            if self._feed is None:
                self._feed = self.resets.stream(self.np_random)
            row, phi = self.resets.draw(self._feed, request)
            self._tables = Tables(row[:, None], phi[:, None], np.zeros(1))
        self._task = self.resets.task(request)
        self._over = False
        return self.views(self._tables.rows)[0], self._info(bool(self.rules.success(self._tables)[0]), False, False)

    def step(self, action: Any) -> tuple[npt.NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Do an action. Raises gymnasium.error.InvalidAction, and ResetNeeded if the episode is over."""
        if self._tables is None or self._over:
            state = "the episode is over" if self._over else "no episode has begun"
            raise refused(NO_EPISODE(state=state, remedy="call reset()"), error.ResetNeeded)
        done = self.rules.step(self._tables, self.moves.checked(action, 1))
        self._tables = done.tables
        success, off = bool(done.success[0]), bool(done.off[0])
        self._over = success or off
        info = self._info(success, off, bool(done.blocked[0]))
        return self.views(done.tables.rows)[0], float(done.reward[0]), self._over, False, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The scene as (height, width, 3) if `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        if self._tables is None:
            raise refused(NO_EPISODE(state="there is nothing to draw yet", remedy="call reset()"), error.ResetNeeded)
        return self.easel.draw(self._tables.rows[:, 0])

    def close(self) -> None:
        """End the process that draws, if there is one."""
        self.easel.close()

    def _info(self, success: bool, off: bool, blocked: bool) -> dict[str, Any]:
        assert self._tables is not None
        target = self.rules.target
        phi = self._tables.phi[:, 0].tolist()
        return {
            "phi": dict(zip(target.names, phi, strict=True)),
            "is_success": success,
            "off_table": off,
            "blocked": blocked,
            "task": dict(zip(target.names, self._task.copy(), strict=True)),
        }
