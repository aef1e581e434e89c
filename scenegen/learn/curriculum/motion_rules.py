"""The rules of environments over time, of one or many: what was asked for, where episodes begin, what is seen."""

from __future__ import annotations

import hashlib
import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import Space, error, spaces

from scenegen.api.monitor import Monitor
from scenegen.api.motions import MotionSet, read_motions, sample_motions
from scenegen.api.spec import Spec, refuse_choices
from scenegen.errors import RequestError
from scenegen.errors.learning import MOTIONS_OF_ANOTHER_SPEC, NO_MOTION_IN_FILE, NOT_A_FIRST_SCENE, NOTHING_TO_MOVE
from scenegen.errors.requests import MISSING_ARGUMENT, OUT_OF_RANGE, UNKNOWN_LABEL, WRONG_VALUE
from scenegen.errors.time import NOT_OVER_TIME
from scenegen.lang.formula.timed import Signal, Timed
from scenegen.learn.curriculum.goal import as_gymnasium, names, number, one_of, refused
from scenegen.learn.curriculum.goal import refused as refusal
from scenegen.learn.curriculum.register import ID
from scenegen.learn.curriculum.request import PhiRanges, check_options, read_ranges
from scenegen.learn.curriculum.rules import ActionMoves, ObservationEncoder, load_spec, make_views
from scenegen.learn.curriculum.tasks import PhiBox
from scenegen.pose import LENGTHS, NAMES, PLACE, THETA, TWO_PI, along, as_rows, axis_of, owner, row_of
from scenegen.sampling.motions.monitor import BatchMonitor
from scenegen.sampling.motions.problem import MotionProblem
from scenegen.sampling.motions.scores import TraceScores, make_problem
from scenegen.sampling.request import Range, SampleRequest

# --------------------------------------------------------------------------------------------------------------------
# The actions of an environment over time: steps no longer than the spec allows.


Array = npt.NDArray[np.float64]

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
            raise refusal(OUT_OF_RANGE(argument="share", value=f"{share:g}", wanted="more than 0 and at most 1"))
        if not len(problem.movable):
            raise refusal(NOTHING_TO_MOVE(reason="the spec allows no object a step"))
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

Block = tuple[Array, Array]
"""First moments (B, N, 3) and phi of their motions (B, L)."""

_BLOCKS: OrderedDict[tuple[bytes, PhiRanges, int], Block] = OrderedDict()


@dataclass(frozen=True, slots=True, eq=False)
class MotionStarts:
    """First moments (N, 3) for a spec over time: drawn, or of `given` motions."""

    spec: Spec
    given: MotionSet | None = None
    phi: Array = field(init=False)  # (n, L) of the given motions
    _key: bytes = field(init=False)

    def __post_init__(self) -> None:
        what = repr(self.spec.over_time).encode()  # its meaning: texts that import others may be alike
        box = b"".join(end.tobytes() for end in self.spec.declared.box())
        object.__setattr__(self, "_key", hashlib.blake2b(what + box).digest())
        object.__setattr__(self, "phi", np.empty((0, len(self.spec.labels))))
        if self.given is not None:
            object.__setattr__(self, "phi", self._scored(self.given))

    @property
    def space(self) -> PhiBox:
        """The phi of the given motions, from the lowest to the highest of each label. Raises gymnasium.error.Error
        where none are given: what can be drawn takes long to find out."""
        if self.given is None:
            question = "a curriculum takes its starts from motions: draw some with `scenegen sample`"
            raise refused(MISSING_ARGUMENT(argument="source", question=question))
        good = self.phi[~np.isnan(self.phi).any(axis=1)]
        if not len(good):
            raise refused(NO_MOTION_IN_FILE(wanted="any phi"))
        return PhiBox(tuple(good.min(axis=0).tolist()), tuple(good.max(axis=0).tolist()))

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
                raise refused(NO_MOTION_IN_FILE(wanted=wanted), error.InvalidBound)
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


def open_motions(spec: Spec, source: MotionSet | str | Path | None) -> MotionStarts:
    """Raises gymnasium.error.Error for anything else than motions of the spec, or their file."""
    if source is None or isinstance(source, MotionSet):
        return MotionStarts(spec, source)
    if not isinstance(source, str | Path):
        wanted = "motions, or the path of their file"
        raise refused(WRONG_VALUE(argument="source", value=f"of type {type(source).__name__}", wanted=wanted))
    with as_gymnasium():
        return MotionStarts(spec, read_motions(source))


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


REWARDS = ("gain", "final")
FAR = 1e6  # bounds beyond are seen as this
EDGE = 1e-9  # metres by which a given scene may be over the edge


@dataclass(frozen=True, slots=True)
class StartWanted:
    """What a reset asks for: motions in these ranges, the nearest where there is none, or a `given` scene (N, 3)."""

    ranges: PhiRanges
    nearest: bool
    given: Array | None


@dataclass(frozen=True, slots=True)
class MotionRules:
    """Those of MotionTable. `nodes` are the formulas over time that are seen, `names` the numbers of an observation."""

    scenes: Spec
    timed: Timed
    problem: MotionProblem
    goal: tuple[str, ...]
    moves: MotionMoves
    final: bool
    starts: MotionStarts
    usual: PhiRanges
    views: ObservationEncoder
    nodes: tuple[int, ...]
    names: tuple[str, ...]

    def space(self) -> Any:
        """That of observations, a Box."""
        return spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def read(self, options: object) -> StartWanted:
        """The options of a reset. Raises gymnasium.error.Error."""
        given = dict(check_options(options))
        nearest = bool(given.get("nearest", False))
        if nearest and self.starts.given is None:
            wanted = "False, or give motions as `source`"
            raise refused(WRONG_VALUE(argument="nearest", value="True", wanted=wanted))
        ranges = self.usual if given.get("phi") is None else _ranges(self.scenes, self.goal, given["phi"])
        scene = None if given.get("scene") is None else self._given(given["scene"])
        return StartWanted(ranges, nearest, scene)

    def task(self, wanted: StartWanted) -> Array:
        """The range of phi of each label, (L, 2); infinite where it has none."""
        labels = self.timed.labels
        task: Mapping[str, Range] = {} if wanted.given is not None else wanted.ranges.phi(self.scenes.labels)
        ends = {name: (one.low, one.high) for name, one in task.items()}
        both = [ends.get(name, (None, None)) for name in labels]
        return np.array([(_end(low, -1.0), _end(high, 1.0)) for low, high in both]).reshape(len(labels), 2)

    def seen(self, rows: Array, moments: npt.NDArray[np.intp], bounds: Array) -> npt.NDArray[np.float32]:
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

    def _given(self, scene: object) -> Array:
        """A scene of the caller, (N, 3). Raises gymnasium.error.Error for one with which no motion begins."""
        if not isinstance(scene, Mapping | np.ndarray | list | tuple):
            wanted = "a pose (x, y, theta) for each object by name, or an array (N, 3)"
            raise refused(WRONG_VALUE(argument="scene", value=f"of type {type(scene).__name__}", wanted=wanted))
        with as_gymnasium():
            poses = np.array(Monitor(self.scenes).read(scene))
        if poses.ndim != 2:
            raise refused(WRONG_VALUE(argument="scene", value=f"of shape {poses.shape}", wanted="one scene: (N, 3)"))
        low, high = self.problem.lowest, self.problem.highest
        for thing, axis in np.argwhere((poses < low - EDGE) | (poses > high + EDGE)).tolist():
            if axis in LENGTHS or low[thing, axis] == high[thing, axis]:
                reason = f"`{self.problem.names[thing]}` is outside of its limits"
                raise refused(NOT_A_FIRST_SCENE(reason=reason))
        watch = BatchMonitor(self.timed, *self.scenes.declared.box(), True, 1)
        watch.add(as_rows(poses[None]))
        if not watch.possible[0]:
            raise refused(NOT_A_FIRST_SCENE(reason="it violates what the spec requires"))
        return poses


def make_motion_rules(
    spec: Spec | str | Path | None,
    goal: str | Sequence[str] | None,
    moves: str,
    share: float,
    reward: str,
    phi: object,
    source: MotionSet | str | Path | None,
) -> MotionRules:
    """From the arguments of MotionTable. Raises what it does."""
    one_of("reward", reward, REWARDS)
    scenes = load_spec(spec)
    timed = scenes.over_time
    if timed is None:
        raise refused(NOT_OVER_TIME(file=scenes.declared.name), more=f"for scenes make {ID}")
    with as_gymnasium():
        refuse_choices(scenes, "a motion")
        problem, _ = make_problem(scenes.declared, SampleRequest({}, 1))
    wanted = _labels(scenes, goal)
    made = MotionMoves(problem, moves, share)
    starts = open_motions(scenes, source)
    usual = _ranges(scenes, wanted, phi)
    views = make_views(scenes.declared)
    over_time = [k for k, node in enumerate(timed.nodes) if not isinstance(node, Signal)]
    nodes = tuple(sorted({*over_time, *timed.labels.values()}))
    named = {node: name for name, node in timed.labels.items()}
    called = [named.get(node, f"formula {k}") for k, node in enumerate(nodes)]
    ends = tuple(f"{name} {end}" for name in called for end in ("least", "most"))
    seen = (*views.names, "time left", *ends)
    return MotionRules(scenes, timed, problem, wanted, made, reward == "final", starts, usual, views, nodes, seen)


def _labels(scenes: Spec, goal: str | Sequence[str] | None) -> tuple[str, ...]:
    wanted = scenes.labels if goal is None else names("goal", goal, "a label")
    for name in wanted:
        if name not in scenes.labels:
            raise refused(UNKNOWN_LABEL(name=name, known=scenes.labels))
    if not wanted:
        raise refused(WRONG_VALUE(argument="goal", value="empty", wanted="a label, or leave it out"))
    return wanted


def _ranges(scenes: Spec, goal: Sequence[str], phi: object) -> PhiRanges:
    """The ranges of a request: (lo, hi) is for every label of the goal. Raises gymnasium.error.Error."""
    return read_ranges(scenes.labels, [scenes.labels.index(name) for name in goal], phi)


def _end(value: float | None, sign: float) -> float:
    return sign * math.inf if value is None else value
