"""`scenegen/Motion-v0`: make a motion that satisfies a spec over time, from a start from which there is one."""

from __future__ import annotations

import hashlib
import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import Space, error, spaces

from scenegen.api.monitor import Monitor
from scenegen.api.motions import MotionSet, read_motions, sample_motions
from scenegen.api.spec import Spec, refuse_choices
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.learning import MOTIONS_OF_ANOTHER_SPEC, NO_START_IN_FILE, NOT_A_FIRST_SCENE, NOTHING_TO_MOVE
from scenegen.errors.requests import MISSING_ARGUMENT, NOT_OVER_TIME, OUT_OF_RANGE, WRONG_VALUE
from scenegen.lang.formula.timed import Signal, Timed
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
from scenegen.play.environments.goal import as_gymnasium, load_spec, number, one_of, refused, wanted_labels
from scenegen.play.environments.request import PhiRanges, StartRequest, check_options, read_ranges
from scenegen.play.environments.spaces import ActionMoves, ObservationEncoder, make_views
from scenegen.play.tasks import ID, PhiBox
from scenegen.pose import LENGTHS, NAMES, PLACE, THETA, TWO_PI, along, axis_of, owner, row_of
from scenegen.sampling.motions.monitor import HIGH, LOW, BatchMonitor
from scenegen.sampling.motions.problem import MotionProblem
from scenegen.sampling.motions.scores import TraceScores, make_motion_problem
from scenegen.sampling.request import SampleRequest

# --------------------------------------------------------------------------------------------------------------------
# The actions of an environment over time: steps no longer than the spec allows.


KINDS = ("grid", "continuous")
WITHIN = 1.0 - 1e-9  # of the bound of a step: a distance computed from rounded poses must not exceed it
WAIT = "wait"


class MotionMoves:
    """Steps of a motion. "grid": action 0 waits, every other moves one object along x or y, or turns it, by
    `names`. "continuous": one number in [-1, 1] per object and coordinate, in units of what a step of the object may
    be; a displacement outside of the disc is shortened to it, and where one object moves in each step it is the one
    with the largest part of its bound, the others stay."""

    def __init__(self, problem: MotionProblem, kind: str, share: float) -> None:
        """`share` of the bound of each object is one move. Raises gymnasium.error.Error for another kind, a share that
        is not above 0 and at most 1, and where nothing can move."""
        one_of("moves", kind, KINDS)
        share = number("share", share, "steps")
        if not 0.0 < share <= 1.0:
            raise refused(OUT_OF_RANGE(argument="share", value=f"{share:g}", wanted="more than 0 and at most 1"))
        if not len(problem.movable):
            raise refused(NOTHING_TO_MOVE(reason="the spec allows no object a step"))
        self._one = problem.moves == "one"
        self._lowest, self._highest = problem.lowest.reshape(-1), problem.highest.reshape(-1)
        rows: list[int] = []
        amounts: list[float] = []
        names: list[str] = []
        for thing in problem.movable.tolist():
            reach = [(axis, problem.radius[thing]) for axis in PLACE] + [(THETA, problem.turn[thing])]
            for axis, most in reach:
                for sign in ((1.0, -1.0) if kind == "grid" else (1.0,)) if most > 0.0 else ():
                    rows.append(row_of(thing, axis))
                    amounts.append(sign * float(most) * share * WITHIN)
                    way = "" if kind == "continuous" else " +" if sign > 0 else " -"
                    names.append(f"{problem.names[thing]} {NAMES[axis]}{way}")
        if kind == "grid":  # waiting is a move of nothing
            rows, amounts, names = [rows[0], *rows], [0.0, *amounts], [WAIT, *names]
        self._moves = ActionMoves(
            "grid" if kind == "grid" else "continuous", np.array(rows), np.array(amounts), tuple(names)
        )
        self.names: Sequence[str] = names

    def space(self) -> Space[int] | spaces.Box:
        found: Space[int] | spaces.Box = self._moves.space()
        return found

    def checked(self, actions: object, count: int) -> npt.NDArray[Any]:
        """B actions as an array. Raises gymnasium.error.InvalidAction."""
        return self._moves.checked(actions, count)

    def after(self, rows: Array, actions: npt.NDArray[Any]) -> Array:
        """Poses (3N, B) after checked actions: centres stay within their limits."""
        if self._moves.kind == "continuous":
            actions = self._shortened(actions)
        moved = self._moves.apply(rows, actions)
        for axis in PLACE:
            at = along(axis)
            moved[at] = np.clip(moved[at], self._lowest[at, None], self._highest[at, None])
        at = along(THETA)
        theta = np.mod(moved[at], TWO_PI)
        moved[at] = np.where(moved[at] == rows[at], rows[at], np.where(theta < TWO_PI, theta, 0.0))
        return moved

    def _shortened(self, parts: Array) -> Array:
        """Displacements (B, K) within the unit disc, of one object alone where one moves in each step."""
        whose = np.array([owner(row) for row in self._moves.rows.tolist()])
        turns = np.array([axis_of(row) == THETA for row in self._moves.rows.tolist()])
        size = np.zeros((len(parts), whose.max() + 1))
        out = parts.copy()
        for thing in np.unique(whose):
            flat = (whose == thing) & ~turns
            far = np.hypot(*parts[:, flat].T) if flat.any() else np.zeros(len(parts))
            out[:, flat] /= np.maximum(far, 1.0)[:, None]
            turn = np.abs(parts[:, (whose == thing) & turns]).max(axis=1, initial=0.0)
            size[:, thing] = np.maximum(np.minimum(far, 1.0), turn)
        if self._one:
            out[whose != size.argmax(axis=1)[:, None]] = 0.0
        return out


# --------------------------------------------------------------------------------------------------------------------
# Where episodes over time start: at the first moments of motions whose phi lies in the wanted range.
#
# So from every start there is a motion of that phi. Motions are drawn in blocks, which all environments of a process
# share; each takes a block's motions in an order of its own.


BLOCK = 256  # motions drawn at once: the plan costs most of it
SECONDS = 60.0  # for a block
KEPT = 64  # blocks in memory

REQUESTS = 256  # whose order a stream remembers
EDGE = 1e-9  # metres by which a given scene may be over the edge

Block = tuple[Array, Array]
"""First moments (B, N, 3) and phi of their motions (B, L)."""

_BLOCKS: OrderedDict[tuple[bytes, PhiRanges, int], Block] = OrderedDict()


class MotionStarts:
    """First moments (N, 3) for a spec over time: drawn, or of `given` motions, whose phi is `phi`, (n, L). `goal` are
    the labels whose phi a single range is for, `usual` is the default request."""

    def __init__(
        self,
        spec: Spec,
        problem: MotionProblem,
        goal: Sequence[str],
        phi: object,
        source: MotionSet | str | Path | None,
    ) -> None:
        """Raises gymnasium.error.Error for a `source` that is neither motions of the spec nor their file, and for bad
        ranges."""
        self.spec, self.given, self._problem = spec, _given(source), problem
        what = repr(spec.over_time).encode()  # its meaning: texts that import others may be alike
        box = b"".join(end.tobytes() for end in spec.definition.box())
        self._key = hashlib.blake2b(what + box).digest()
        self.phi = np.empty((0, len(spec.labels))) if self.given is None else self._scored(self.given)
        self._goal = [spec.labels.index(name) for name in goal]
        self.usual = read_ranges(spec.labels, self._goal, phi)

    @property
    def space(self) -> PhiBox:
        """The phi of the given motions, from the lowest to the highest of each label. Raises gymnasium.error.Error
        where none are given: what can be drawn takes long to find out."""
        if self.given is None:
            question = "a curriculum takes its starts from motions: draw some with `scenegen sample`"
            raise refused(MISSING_ARGUMENT(argument="source", question=question))
        good = self.phi[~np.isnan(self.phi).any(axis=1)]
        if not len(good):
            raise refused(NO_START_IN_FILE(wanted="any phi", motions=True))
        return PhiBox(tuple(good.min(axis=0).tolist()), tuple(good.max(axis=0).tolist()))

    def read(self, options: object) -> StartRequest:
        """The options of a reset. Raises gymnasium.error.Error."""
        given = check_options(options)
        nearest, phi = bool(given.get("nearest", False)), given.get("phi")
        if nearest and self.given is None:
            wanted = "False, or give motions as `source`"
            raise refused(WRONG_VALUE(argument="nearest", value="True", wanted=wanted))
        ranges = None if phi is None else read_ranges(self.spec.labels, self._goal, phi)
        scene = None
        if given.get("scene") is not None:
            unknown = np.full(len(self.spec.labels), math.nan)
            scene = self._first_scene(given["scene"]).reshape(-1), unknown, 0.0
        return StartRequest(scene, ranges, nearest)

    def task(self, request: StartRequest) -> list[tuple[float, float]]:
        """The range of phi of each label; infinite where it has none."""
        if request.scene is not None:
            return [(-math.inf, math.inf)] * len(self.spec.labels)
        ranges = request.ranges or self.usual
        return list(zip(ranges.low, ranges.high, strict=True))

    def stream(self, rng: np.random.Generator) -> MotionStream:
        """Starts in an order of its own."""
        return MotionStream(self, rng)

    def draw(self, stream: MotionStream, request: StartRequest) -> Start:
        """The first moment of a motion in the requested range, and phi of that motion. Raises
        gymnasium.error.InvalidBound."""
        poses, phi = stream.take(request.ranges or self.usual, nearest=request.nearest)
        return poses.reshape(-1), phi, 0.0

    def block(self, ranges: PhiRanges, number: int, nearest: bool = False) -> Block:
        """Block `number` of starts in the ranges, at least one; given motions are one block, repeated. With `nearest`
        the given motions nearest to the ranges, where none is in them. Raises gymnasium.error.InvalidBound where there
        is no motion in them."""
        if self.given is not None:
            above, below = np.array(ranges.low) - self.phi, self.phi - np.array(ranges.high)
            away = np.maximum(np.maximum(above, below), 0.0).sum(axis=1)
            least = np.nanmin(away, initial=np.inf) if nearest else 0.0
            inside = away <= least
            if not inside.any():
                wanted = ranges.describe(self.spec.labels)
                raise refused(NO_START_IN_FILE(wanted=wanted, motions=True), error.InvalidBound)
            return np.asarray(self.given.poses[inside, 0]), np.asarray(self.phi[inside])
        key = (self._key, ranges, number)
        if key not in _BLOCKS:
            _BLOCKS[key] = self._drawn(ranges, number)
            if len(_BLOCKS) > KEPT:
                _BLOCKS.popitem(last=False)
        _BLOCKS.move_to_end(key)
        return _BLOCKS[key]

    def _drawn(self, ranges: PhiRanges, number: int) -> Block:
        seed = int.from_bytes(hashlib.blake2b(repr((ranges, number)).encode(), digest_size=4).digest()) >> 1
        phi = {name: (one.low, one.high) for name, one in ranges.phi(self.spec.labels).items()}
        closed = all(None not in ends for ends in phi.values())
        try:
            found = sample_motions(
                self.spec, phi, BLOCK, seed=seed, spread="flat" if phi and closed else "base", timeout=SECONDS,
                keep_partial=True, workers=1,
            )  # fmt: skip
        except RequestError as problem:
            raise refused(problem.diagnostics[0], error.InvalidBound) from problem
        return np.asarray(found.poses[:, 0]), np.stack([found.phi[name] for name in self.spec.labels], axis=1)

    def _scored(self, given: MotionSet) -> Array:
        timed = self.spec.over_time
        assert timed is not None
        moments = timed.horizon.moments
        if given.objects != self.spec.objects or given.poses.shape[1] != moments:
            facts = {"found": given.objects, "steps": given.poses.shape[1] - 1, "wanted": self.spec.objects}
            raise refused(MOTIONS_OF_ANOTHER_SPEC(**facts, horizon=moments - 1))
        with np.errstate(all="ignore"):
            scores = TraceScores(timed)(np.ascontiguousarray(given.poses.transpose(2, 3, 1, 0)))
        phi = scores[:-1].T.copy()
        phi[scores[-1] < 0.0] = math.nan  # never in a range: the spec's requirement does not hold
        return np.asarray(phi)

    def _first_scene(self, scene: object) -> Array:
        """A scene of the caller, (N, 3). Raises gymnasium.error.Error for one with which no motion begins."""
        if not isinstance(scene, Mapping | np.ndarray | list | tuple):
            wanted = "a pose (x, y, theta) for each object by name, or an array (N, 3)"
            raise refused(WRONG_VALUE(argument="scene", value=f"of type {type(scene).__name__}", wanted=wanted))
        with as_gymnasium():
            poses = np.array(Monitor(self.spec).read(scene))
        if poses.ndim != 2:
            raise refused(WRONG_VALUE(argument="scene", value=f"of shape {poses.shape}", wanted="one scene: (N, 3)"))
        low, high = self._problem.lowest, self._problem.highest
        for thing, axis in np.argwhere((poses < low - EDGE) | (poses > high + EDGE)).tolist():
            if axis in LENGTHS or low[thing, axis] == high[thing, axis]:
                reason = f"`{self._problem.names[thing]}` is outside of its limits"
                raise refused(NOT_A_FIRST_SCENE(reason=reason))
        assert self.spec.over_time is not None
        watch = BatchMonitor(self.spec.over_time, *self.spec.definition.box(), True, 1)
        watch.add(poses.reshape(-1, 1))
        if not watch.possible[0]:
            raise refused(NOT_A_FIRST_SCENE(reason="it violates what the spec requires"))
        return poses


def _given(source: MotionSet | str | Path | None) -> MotionSet | None:
    if source is None or isinstance(source, MotionSet):
        return source
    if not isinstance(source, str | Path):
        wanted = "motions, or the path of their file"
        raise refused(WRONG_VALUE(argument="source", value=f"of type {type(source).__name__}", wanted=wanted))
    with as_gymnasium():
        return read_motions(source)


class MotionStream:
    """Starts in the order of one environment."""

    def __init__(self, starts: MotionStarts, rng: np.random.Generator) -> None:
        self._starts, self._rng = starts, rng
        self._left: OrderedDict[PhiRanges, tuple[int, list[int]]] = OrderedDict()

    def take(self, ranges: PhiRanges, *, nearest: bool = False) -> tuple[Array, Array]:
        """The next start (N, 3), and phi of its motion (L,). Raises gymnasium.error.InvalidBound."""
        number, left = self._left.get(ranges, (-1, []))
        number += not left
        poses, phi = self._starts.block(ranges, number, nearest)
        left = left or self._rng.permutation(len(poses)).tolist()
        place = left.pop()
        self._left[ranges] = number, left
        self._left.move_to_end(ranges)
        if len(self._left) > REQUESTS:
            self._left.popitem(last=False)
        return np.array(poses[place]), phi[place]


# --------------------------------------------------------------------------------------------------------------------
# The environments.


REWARDS = ("gain", "final")
FAR = 1e6  # bounds beyond are seen as this


@dataclass(frozen=True, slots=True)
class MotionRules:
    """What all tables of a MotionTable share. `nodes` are the formulas over time that are seen, `names` the numbers of
    an observation."""

    timed: Timed
    problem: MotionProblem
    goal: tuple[str, ...]
    moves: MotionMoves
    final: bool
    views: ObservationEncoder
    nodes: tuple[int, ...]
    names: tuple[str, ...]

    def seen(self, rows: Array, moments: npt.NDArray[np.intp], bounds: Array) -> Observations:
        """Observations (B, K) of poses (3N, B), after so many moments (B,), with the bounds of `nodes`, (K, 2, B)."""
        horizon = self.timed.horizon
        left = (horizon.moments - moments) / horizon.steps
        ends = np.clip(bounds.reshape(2 * len(self.nodes), -1), -FAR, FAR)
        ends = ends / (1.0 + np.abs(ends))
        return np.concatenate([self.views(rows), left[:, None], ends.T], axis=1).astype(np.float32)

    def waiting(self, motions: Array) -> npt.NDArray[np.bool_]:
        """Whether the requirement holds in motions (T + 1, 3N, B)."""
        moments, _, count = motions.shape
        poses = motions.reshape(moments, len(self.problem.names), -1, count).transpose(1, 2, 0, 3)
        with np.errstate(all="ignore"):
            return np.asarray(self.problem.score(poses)[-1] >= 0.0)


def make_motion_rules(scenes: Spec, goal: tuple[str, ...], moves: str, share: float, reward: str) -> MotionRules:
    """From the arguments of MotionTable. Raises what it does."""
    timed = scenes.over_time
    assert timed is not None
    with as_gymnasium():
        refuse_choices(scenes, "a motion")
        problem = make_motion_problem(scenes.definition, SampleRequest({}, 1))
    made = MotionMoves(problem, moves, share)
    views = make_views(scenes.definition)
    over_time = [k for k, node in enumerate(timed.nodes) if not isinstance(node, Signal)]
    nodes = tuple(sorted({*over_time, *timed.labels.values()}))
    named = {node: name for name, node in timed.labels.items()}
    called = [named.get(node, f"formula {k}") for k, node in enumerate(nodes)]
    ends = tuple(f"{name} {end}" for name in called for end in ("least", "most"))
    seen = (*views.names, "time left", *ends)
    return MotionRules(timed, problem, goal, made, reward == "final", views, nodes, seen)


class MotionEpisodes(Episodes[MotionRules, MotionStarts]):
    """Motions, each at a moment of its own: steps, bounds of phi and observations are computed together."""

    about = "start"
    flags = ("blocked", "violated")

    def __init__(self, rules: MotionRules, starts: MotionStarts, tables: int = 1) -> None:
        self.names = self.labels = starts.spec.labels
        super().__init__(rules, starts, tables)
        timed, (low, high) = rules.timed, starts.spec.definition.box()
        self._watches = BatchMonitor(timed, low, high, True, tables)
        self._poses = np.zeros((timed.horizon.moments, len(low), tables))  # from the last moment seen on the same
        self._paid = np.zeros(tables)
        self.phi = np.zeros((len(self.names), tables))

    def observation_space(self) -> Space[Any]:
        return spaces.Box(-1.0, 1.0, (len(self.rules.names),), np.float32)

    @property
    def rows(self) -> Array:
        return np.asarray(self._poses[-1])

    def motion(self, table: int) -> Array:
        """The poses so far, (moments, N, 3), metres and radians."""
        moments = int(self._watches.seen[table])
        return self._poses[:moments, :, table].reshape(moments, len(self.starts.spec.objects), -1).copy()

    def _put(self, starts: Mapping[int, Start]) -> None:
        for table, (row, phi, _) in starts.items():
            self._poses[..., table], self.phi[:, table], self._paid[table] = row, phi, 0.0
        who = np.array(list(starts), dtype=np.intp)
        self._watches.begin(who)
        self._watches.add(self._poses[0][:, who], who)

    def act(self, actions: npt.NDArray[Any], over: Mask) -> StepOutcome:
        who = np.flatnonzero(~over)
        watches, before = self._watches, self._poses[-1][:, who]
        rows = self.rules.moves.after(before, actions[who])
        watches.add(rows, who)
        blocked, violated = np.zeros_like(over), np.zeros_like(over)
        bad = ~watches.possible[who]
        if bad.any():
            stay = who[bad]
            blocked[stay] = (rows[:, bad] != before[:, bad]).any(axis=0)
            rows[:, bad] = before[:, bad]
            watches.back(before[:, bad], stay)
            watches.add(before[:, bad], stay)
            violated[stay] = ~watches.possible[stay]
        for k, moment in enumerate((watches.seen[who] - 1).tolist()):
            self._poses[moment:, :, who[k]] = rows[:, k]
        low, high = watches.bounds([self.rules.timed.labels[name] for name in self.rules.goal]).min(axis=0)
        ended = violated | (watches.seen == self.rules.timed.horizon.moments)
        known = np.flatnonzero((low >= high) & ~ended & ~over)
        if len(known):
            ended[known] = self.rules.waiting(self._poses[..., known])
        if self.rules.final:
            reward = np.where(ended, low, 0.0)
        else:
            worth = np.where(np.isfinite(low), low, self._paid)  # nothing is certain yet
            reward, self._paid = worth - self._paid, worth
        flags = {"blocked": blocked, "violated": violated}
        return StepOutcome(reward, ended & ~violated & (low >= 0.0), ended, flags)

    def satisfied(self) -> Mask:
        return np.zeros(self.tables, dtype=np.bool_)

    def seen(self) -> Observations:
        watches = self._watches
        return self.rules.seen(self._poses[-1], watches.seen, watches.bounds(self.rules.nodes))

    def figures(self, success: Mask, flags: Mapping[str, Mask]) -> dict[str, npt.NDArray[Any]]:
        bounds = self._watches.bounds([self.rules.timed.labels[name] for name in self.names])
        return {
            "phi": bounds[:, LOW],
            "phi_high": bounds[:, HIGH],
            "is_success": success,
            "blocked": flags["blocked"],
            "violated": flags["violated"],
            "start": self.phi,
            "moment": self._watches.seen - 1,
            "task": self.tasks,
        }


class MotionTable(TableEnv):
    """Move objects for the T steps of a spec over time; the reward sums up to phi of the motion.

    `spec` is a Spec, the path of a spec file or its text; it has `time`. `goal` names the labels that count, by default
    all; phi of the goal is their minimum.

    `moves="grid"`: action 0 waits, every other moves one object by `share` of what a step of it may be, see
    `env.unwrapped.moves.names`. `moves="continuous"`: one number in [-1, 1] per object and coordinate, in these units;
    longer displacements are shortened to the bound, and where one object moves in each step (`moves one`), it is the
    one with the largest part of its bound. Objects stop at the edges of the workspace. A step after which the
    requirement can no longer hold is not made: the objects wait (`blocked`); if it cannot hold then either, the
    episode ends (`violated`).

    Observations are float32 in [-1, 1]: those of TableTop, the time left, as a share, and for each formula over time in
    the spec the least and the largest value that it can still have (`env.unwrapped.names`), x as x / (1 + |x|).

    `reward="gain"`: the increase of the least phi that the goal can still have (0 before the first step, so the first
    step is paid the whole of it); `reward="final"`: phi, in the last step. Both sum up to phi of the motion, unless it
    was `violated`.

    An episode is over when nothing to come matters for phi and waiting would meet the requirement, at the latest after
    T steps: `terminated`, as the observation has the time left; nothing is truncated.

    `info` has `phi` and `phi_high` (label -> what it can be at least and at most; both are phi at the end),
    `is_success` (over, the requirement holds, and phi of the goal >= 0), `blocked`, `violated`, `moment`, `task`: label
    -> [lowest, highest] requested phi, and `start`: label -> phi of the motion whose first moment this episode begins
    with, NaN for a given scene.

    `reset(options={"phi": (lo, hi)})` begins with the first moment of a motion whose phi of every label of the goal
    lies in that range, {"phi": {label: (lo, hi)}} and a PhiBox give ranges of single labels; None is an open end. `phi`
    of the constructor is used if the options have none, by default (0, None). {"scene": ...} begins with a given scene:
    {object: (x, y, theta)} or an array (N, 3). Motions are drawn as by `sample_motions`, or taken from `source`: a
    MotionSet or its file. With a `source`, {"nearest": True} takes the nearest of its motions if none is in the range,
    and `Curriculum` can choose phi.

    `render_mode="rgb_array"` draws the moment in a process that runs until `close`; `view` and `size` (width, height)
    are those of SceneSet.render, and as many pictures make a second of a film as moments make one of the motion.

    Raises errors of `gymnasium.error`: InvalidBound for phi out of reach, InvalidAction, ResetNeeded, MissingArgument,
    UnsupportedMode for an unknown render mode, and Error for the rest.
    """

    def __init__(
        self,
        spec: Spec | str | Path | None = None,
        *,
        goal: str | Sequence[str] | None = None,
        moves: str = "grid",
        share: float = 1.0,
        reward: str = "gain",
        phi: object = (0.0, None),
        source: MotionSet | str | Path | None = None,
        render_mode: str | None = None,
        view: str = "perspective",
        size: tuple[int, int] = (480, 360),
    ) -> None:
        easel = SceneRenderer(render_mode, view, size)
        one_of("reward", reward, REWARDS)
        scenes = load_spec(spec)
        if scenes.over_time is None:
            raise refused(NOT_OVER_TIME(file=scenes.definition.name), more=f"for scenes make {ID}")
        self.goal = wanted_labels(scenes, goal)
        self.rules = rules = make_motion_rules(scenes, self.goal, moves, share, reward)
        self.names = rules.names
        super().__init__(MotionEpisodes(rules, MotionStarts(scenes, rules.problem, self.goal, phi, source)), easel)
        self.metadata = {**self.metadata, "render_fps": 1.0 / rules.timed.horizon.dt}

    @property
    def motion(self) -> Array:
        """The poses so far, (moments, N, 3), metres and radians."""
        assert isinstance(self.episodes, MotionEpisodes)
        return self.episodes.motion(0)


class MotionVector(TableVectorEnv):
    """`num_envs` tables of `scenegen/Motion-v0`. `autoreset_mode` is gymnasium's: "NextStep", "SameStep" or "Disabled"
    (reset with `options={"reset_mask": mask}`). `max_episode_steps` truncates, before the end of a motion if it is less
    than T; the other arguments are those of MotionTable.

    `reset(seed=s)` seeds the tables with s, s + 1, ..., a list one by one. See TableTopVector for `chooser` and
    `listener`. Raises what MotionTable does; ResetNeeded also if the episode of a table without autoreset is over.
    """

    single = MotionTable

    def motion(self, number: int) -> Array:
        """The poses so far on a table, (moments, N, 3), metres and radians."""
        assert isinstance(self.episodes, MotionEpisodes)
        return self.episodes.motion(number)
