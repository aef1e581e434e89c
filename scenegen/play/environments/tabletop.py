"""`scenegen/TableTop-v0`: move the objects of a table until they satisfy a spec, from a start of chosen difficulty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from gymnasium import Space, error

from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import RequestError, quoted
from scenegen.errors.learning import NO_UNMET_GOAL
from scenegen.errors.requests import CHOICES_NOT_HERE, TIME_NOT_HERE, WRONG_VALUE
from scenegen.lang.formula.core import Coord, part_of
from scenegen.lang.spec import chosen_options
from scenegen.learn.model import Model
from scenegen.play.environments.env import (
    Episodes,
    Mask,
    Observations,
    SceneRenderer,
    Start,
    StepOutcome,
    TableEnv,
    TableVectorEnv,
)
from scenegen.play.environments.goal import Goal, Scorer, as_gymnasium, load_spec, make_goal, one_of, refused
from scenegen.play.environments.library import Library, LibraryStream, Sampler, check_source, open_library
from scenegen.play.environments.request import (
    PhiRanges,
    StartRequest,
    check_options,
    everything,
    read_phi,
    read_scene,
)
from scenegen.play.environments.spaces import ActionMoves, ObservationEncoder, make_moves, make_views
from scenegen.play.tasks import MOTION_ID, PhiBox
from scenegen.pose import is_angle, owner, row_count, wrap_heading
from scenegen.sampling.request import Range

# --------------------------------------------------------------------------------------------------------------------
# The dynamics, for any number of tables at once: what a step does, and when an episode ends.


RewardKind = Literal["sparse", "dense"]

SATISFIED, OFF = 10.0, -10.0  # the paper's, section V
EDGE = 1e-9  # metres by which a centre may be over the edge, because twenty steps of 5 cm are not exactly a metre


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """B scenes: `rows` (3N, B) and phi (D, B). `slack` (B,) is the lowest allowed margin of the requirement: 0, or
    slightly less in a scene that was rounded."""

    rows: Array
    phi: Array
    slack: Array


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """What all environments of a spec share. `flat` are the rows of x and y that moves change, `low` and `high` (F, 1)
    their limits at the edges of the table; `turning` are the rows of headings.

    The reward is 10 if the goal is satisfied, -10 if an object left the table, 0 otherwise, as in the paper. The dense
    one adds `gain` times the increase of the goal's phi, which is that increase in steps. Without discount these sum
    up to phi of the last scene minus that of the first. (This is a potential in the sense of Ng, Harada and Russell,
    1999, except that the last scene's phi is rewarded too: an end well inside the goal earns more than one at its
    edge.)"""

    target: Goal
    score: Scorer
    moves: ActionMoves
    gain: float
    views: ObservationEncoder
    flat: npt.NDArray[np.intp]
    low: Array
    high: Array
    turning: npt.NDArray[np.intp]

    def success(self, tables: Tables) -> Mask:
        """Which scenes (B,) satisfy the goal."""
        return np.asarray(tables.phi[self.target.goal] >= 0.0)

    def step(self, tables: Tables, actions: npt.NDArray[Any]) -> tuple[Tables, StepOutcome]:
        """Do checked actions. An object that leaves the table stays at its edge and ends the episode; a move that would
        violate the requirement is not made at all."""
        rows = self.moves.apply(tables.rows, actions)
        flat = rows[self.flat]
        kept = np.minimum(np.maximum(flat, self.low), self.high)
        off: Mask = np.asarray((np.abs(flat - kept) > EDGE).any(axis=0))
        rows[self.flat] = kept
        if len(self.turning):
            rows[self.turning] = wrap_heading(np, rows[self.turning])
        phi = self.score(rows)
        blocked = np.zeros(len(off), dtype=np.bool_)
        if self.score.requires:
            phi, margin = phi[:-1], phi[-1]
            blocked = np.asarray((margin < tables.slack) & ~off)
            if blocked.any():
                rows, phi = np.where(blocked, tables.rows, rows), np.where(blocked, tables.phi, phi)
        goal = self.target.goal
        success = np.asarray((phi[goal] >= 0.0) & ~off)
        reward = SATISFIED * success + OFF * off
        if self.gain:
            reward = reward + self.gain * (phi[goal] - tables.phi[goal])
        return Tables(rows, phi, tables.slack), StepOutcome(
            reward, success, success | off, {"off_table": off, "blocked": blocked}
        )


def make_rules(
    spec: Spec,
    *,
    goal: str | Sequence[str] | None = None,
    moves: str = "grid",
    move: str | Sequence[str] | None = None,
    step: float | None = None,
    turn: float | None = None,
    reward: str = "sparse",
) -> Rules:
    """See TableTop for the arguments. Raises gymnasium.error.Error for invalid ones."""
    if spec.over_time is not None:
        raise refused(TIME_NOT_HERE(file=spec.definition.name), more=f"to learn motions make {MOTION_ID}")
    target = make_goal(spec, goal)
    if spec.require_scenes().choices:
        _refuse_surfaces(target)
    made, length = make_moves(spec.require_scenes(), moves, move, step, turn)
    changed = np.unique(made.rows)
    if move is not None:
        _refuse_idle(target, move, changed)
    angles = np.array([is_angle(row) for row in changed], dtype=bool)
    flat, turning = changed[~angles], changed[angles]
    low, high = (ends[flat][:, None] for ends in spec.require_scenes().box())
    one_of("reward", reward, get_args(RewardKind))
    gain = 1.0 / length if reward == "dense" else 0.0
    return Rules(target, Scorer(target), made, gain, make_views(spec.require_scenes()), flat, low, high, turning)


LOOK = 512  # scenes that satisfy a goal, and starts, of which surfaces are compared


def _refuse_surfaces(target: Goal) -> None:
    """Raises gymnasium.error.Error where the goal is met only with an object on other surfaces than starts have it on:
    moves go along x and y and never from one surface to another, so no episode from there could succeed."""
    label, source = target.names[target.goal], Sampler(target)
    try:
        met, starts = (source.draw({label: ends}, LOOK, 0, "base").poses for ends in (Range(0.0), Range(None, 0.0)))
    except RequestError:
        return  # there is no goal, or no start: the first reset says why
    spec = target.spec.require_scenes()
    good, begun = (
        np.stack([chosen_options(one, each.T) for one in spec.choices.values()], axis=1) for each in (met, starts)
    )
    together = set(map(tuple, good.tolist()))
    lost = float(np.mean([tuple(one) not in together for one in begun.tolist()]))
    if lost == 0.0 or len(met) < LOOK or len(together) > LOOK // 16:  # so many ways to stand are not all seen
        return
    column = next((k for k in range(good.shape[1]) if set(begun[:, k]) - set(good[:, k])), None)
    which = list(spec.choices)[column or 0]
    if column is None:
        name, where = quoted([spec.objects[one] for one in spec.choices]), "together on such surfaces"
    else:
        options = spec.choices[which].options
        name, where = f"`{spec.objects[which]}`", quoted([options[k].name for k in sorted(set(good[:, column]))])
    found = f"in {LOOK} scenes that satisfy `{label}`, {name} " + (
        f"never stand {where} as in {lost:.0%} of the starts" if column is None else f"is always on {where}"
    )
    why = f"no move takes {name} to another surface, and {found}"
    raise refused(CHOICES_NOT_HERE(what="an environment", name=spec.objects[which], why=why))


def _refuse_idle(target: Goal, move: object, rows: npt.NDArray[np.intp]) -> None:
    """Raises gymnasium.error.Error where no object that moves has a part in phi of the goal: it would stay what it is
    at the start. Others may move beside those that do: they can be in the way."""
    spec, label = target.spec.require_scenes(), target.names[target.goal]
    cores = [one.core for one in spec.members or (spec,)]
    read = {
        core.objects[node.object] for core in cores for node in part_of(core, (label,)).nodes if isinstance(node, Coord)
    }
    decide = [name for name in spec.objects if name in read]
    if read.isdisjoint(spec.objects[owner(row)] for row in rows.tolist()):
        wanted = f"an object that phi of `{label}` depends on: {quoted(decide)}" if decide else "another goal"
        raise refused(WRONG_VALUE(argument="move", value=repr(move), wanted=wanted))


# --------------------------------------------------------------------------------------------------------------------
# Where episodes start.


TINY = 1e-300  # "not satisfied" ends at a tiny negative number, which is shown as 0


class SceneStarts:
    """Provides the scenes at which episodes start. `phi` is the default request. The library is made when it is first
    needed: an environment that always gets its scenes from the caller never draws any."""

    def __init__(self, spec: Spec, rules: Rules, source: Any, phi: object) -> None:
        self.spec, self._target, self._source = spec, rules.target, source
        self._score = rules.score
        self._usual = None if phi is None else read_phi(rules.target, phi)
        self._library: Library | None = None
        check_source(source)

    @property
    def library(self) -> Library:
        """Raises gymnasium.error.Error if the source is invalid, or if every scene satisfies the goal."""
        if self._library is None:
            with as_gymnasium():
                self._library = open_library(self._target, self.spec, self._source)
        return self._library

    @property
    def space(self) -> PhiBox:
        """From the hardest to where each label is satisfied."""
        return self.library.space

    def stream(self, rng: np.random.Generator) -> LibraryStream:
        """Scenes from the seed of a generator."""
        return LibraryStream(self.library, int(rng.integers(2**63)))

    def read(self, options: object) -> StartRequest:
        """Check options. Raises gymnasium.error.Error, and InvalidBound for invalid ranges."""
        if options is None:  # most often
            return StartRequest()
        options = check_options(options)
        if options.get("scene") is not None:
            return StartRequest(scene=self._given(read_scene(self.spec, options["scene"])[:, None]))
        nearest, phi = bool(options.get("nearest", False)), options.get("phi")
        return StartRequest(
            ranges=None if phi is None else read_phi(self._target, phi, points=nearest), nearest=nearest
        )

    def task(self, request: StartRequest) -> list[tuple[float, float]]:
        """The lowest and highest requested phi of each label."""
        ranges = everything(self._target) if request.scene is not None else self._ranges(request)
        ends = zip(ranges.low, ranges.high, strict=True)
        return [(0.0 if -TINY < low < TINY else low, 0.0 if -TINY < high < TINY else high) for low, high in ends]

    def _given(self, rows: Array) -> Start:
        """A scene (3N, 1) that was verified when it was read."""
        phi, slack = self._score(rows), np.zeros(1)
        if self._score.requires:
            phi, slack = phi[:-1], np.minimum(phi[-1], 0.0)
        return rows[:, 0], phi[:, 0], float(slack[0])

    def draw(self, stream: LibraryStream, request: StartRequest) -> Start:
        """A scene in the requested range, and its phi. Raises gymnasium.error.InvalidBound if the range is out of
        reach."""
        ranges = self._ranges(request)
        try:
            return (*stream.take(ranges, nearest=request.nearest), 0.0)
        except RequestError as problem:
            raise refused(problem.diagnostics[0], error.InvalidBound, self._nearest(ranges)) from problem

    def _ranges(self, request: StartRequest) -> PhiRanges:
        if request.ranges is not None:
            return request.ranges
        if self._usual is not None:
            return self._usual
        if self.library.hard >= 0.0:
            raise refused(NO_UNMET_GOAL())
        return self.library.unsatisfied

    def _nearest(self, ranges: PhiRanges) -> str:
        """The reachable phi nearest to a range that is out of reach."""
        found, names = self.library.met(ranges), self._target.names
        parts = [f"phi of `{names[k]}` {found[k]:.4g}" for k in ranges.dims]
        return f"the nearest scene that was met has {' and '.join(parts)}"


# --------------------------------------------------------------------------------------------------------------------
# The environments.


class SceneEpisodes(Episodes[Rules, SceneStarts]):
    """Episodes that end when the goal is satisfied, or an object leaves its table."""

    about = "phi"
    flags = ("off_table", "blocked")

    def __init__(self, rules: Rules, starts: SceneStarts, tables: int = 1) -> None:
        target = rules.target
        self.names, self.labels = target.names, target.names[: target.labels]
        super().__init__(rules, starts, tables)
        shape = row_count(len(starts.spec.require_scenes().core.objects)), len(self.names)
        self._now = Tables(np.zeros((shape[0], tables)), np.zeros((shape[1], tables)), np.zeros(tables))

    def observation_space(self) -> Space[Any]:
        return self.rules.views.space()

    @property
    def rows(self) -> Array:
        return self._now.rows

    def _put(self, starts: Mapping[int, Start]) -> None:
        now = self._now
        for table, start in starts.items():
            now.rows[:, table], now.phi[:, table], now.slack[table] = start

    def act(self, actions: npt.NDArray[Any], over: Mask) -> StepOutcome:
        self._now, done = self.rules.step(self._now, actions)
        return done

    def satisfied(self) -> Mask:
        return self.rules.success(self._now)

    def seen(self) -> Observations:
        return self.rules.views(self._now.rows)

    def figures(self, success: Mask, flags: Mapping[str, Mask]) -> dict[str, npt.NDArray[Any]]:
        return {
            "phi": self._now.phi,
            "is_success": success,
            "off_table": flags["off_table"],
            "blocked": flags["blocked"],
            "task": self.tasks,
        }


class TableTop(TableEnv):
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
        easel = SceneRenderer(render_mode, view, size)
        scenes = load_spec(spec)
        rules = make_rules(scenes, goal=goal, moves=moves, move=move, step=step, turn=turn, reward=reward)
        self.rules, self.views = rules, rules.views
        super().__init__(SceneEpisodes(rules, SceneStarts(scenes, rules, source, phi)), easel)


class TableTopVector(TableVectorEnv):
    """`num_envs` tables. `autoreset_mode` is gymnasium's: "NextStep", "SameStep" or "Disabled" (reset with
    `options={"reset_mask": mask}`). `max_episode_steps` truncates; the other arguments are those of TableTop.

    `reset(seed=s)` seeds the tables with s, s + 1, ..., a list one by one. `chooser`, if set, gives the options for
    table k's next scene whenever an episode begins without options. `listener`, if set, is called after every step,
    before tables are reset, with the rewards, which episodes ended, and which of these were successful, (num_envs,)
    each.

    Raises what TableTop does; ResetNeeded also if the episode of a table without autoreset is over.
    """

    single = TableTop

    @property
    def rules(self) -> Rules:
        """What a step does."""
        assert isinstance(self.episodes, SceneEpisodes)
        return self.episodes.rules

    @property
    def views(self) -> ObservationEncoder:
        """What is seen of a scene."""
        return self.rules.views
