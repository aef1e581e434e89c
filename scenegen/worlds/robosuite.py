"""A drop-in for the `placement_initializer` of robosuite's environments: objects start where a spec wants them.

Starts are verified scenes, drawn ahead: at a range of phi, or at the next task of a strategy. They are placed in the
simulator's frame, and read back from it. `init_states` writes starts as LIBERO keeps them.
"""

from __future__ import annotations

import copy
import math
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeGuard

import numpy as np

from scenegen.api.request import Phi, read_phi
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import make_header, poses7, stored_rows
from scenegen.api.spec import Spec, check_spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.files import HELD_ELSEWHERE, SAME_NAME
from scenegen.errors.learning import NO_EPISODE, NOT_A_TASK
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.errors.worlds import PLACEMENT
from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import turned
from scenegen.lang.formula.interpret import phi as score
from scenegen.learn.curriculum.tasks import Outcome, PhiBox, Strategy
from scenegen.needs import need
from scenegen.pose import as_poses, as_rows, row_count
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.arrange import held, held_elsewhere, with_switches
from scenegen.scenes.data import RequestData
from scenegen.scenes.files import whole_file
from scenegen.validation import as_int, as_number, as_path, as_point, as_seconds

if TYPE_CHECKING:
    from scenegen.learn.curriculum.library import Library, LibraryStream


Wanted: TypeAlias = Phi | PhiBox | Strategy | Callable[[], Phi | PhiBox | None] | None
"""A range of phi (see `scenegen.sample`), a strategy, or a function that gives a range for each start."""

FIRST, MOST = 1024, 16_384  # scenes of the first draw at a range, and of later ones at most
RANGES = 64  # ranges whose scenes are kept, the most recent ones
STREAM = 12  # the stream of random numbers of starts; api/batches.py and others have streams of their own


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """A verified scene: `poses` (N, 7), see `SceneSet.poses7`, `phi` by label, `on` (M,) of objects on one of several
    surfaces, and the strategy's task."""

    poses: Array
    phi: Mapping[str, float]
    on: Array | None
    task: PhiBox | None = None


class StartSource(Protocol):
    def take(self) -> Start:
        """The next scene. Raises RequestError."""
        ...


class RangeStarts:
    """Scenes with phi in a range that `wanted` gives for each. Draws grow from FIRST to MOST scenes; a range that is
    asked for again goes on with its own scenes."""

    def __init__(self, spec: Spec, wanted: Callable[[], Phi | PhiBox | None], seed: int, timeout: float) -> None:
        self._spec, self._wanted, self._seed, self._timeout = spec, wanted, seed, timeout
        self._draws = 0
        self._streams: OrderedDict[tuple[tuple[str, Range], ...], Iterator[Start]] = OrderedDict()

    def take(self) -> Start:
        wanted = self._wanted()
        if isinstance(wanted, PhiBox):
            if not len(wanted.low) == len(wanted.high) == len(self._spec.labels):
                raise RequestError(NOT_A_TASK(count=len(wanted.low), labels=self._spec.labels))
            ends = zip(self._spec.labels, wanted.low, wanted.high, strict=True)
            wanted = {label: (low, high) for label, low, high in ends}
        ranges = read_phi(self._spec, wanted)
        key = tuple(sorted(ranges.items(), key=lambda item: item[0]))
        if key not in self._streams:
            self._streams[key] = self._stream(ranges)
            if len(self._streams) > RANGES:
                self._streams.popitem(last=False)
        self._streams.move_to_end(key)
        try:
            return next(self._streams[key])
        except RequestError:
            del self._streams[key]  # a generator that raised has ended
            raise

    def _stream(self, ranges: Mapping[str, Range]) -> Iterator[Start]:
        count = FIRST
        while True:
            source = np.random.SeedSequence([self._seed, STREAM, self._draws])
            self._draws += 1
            seed = int(source.generate_state(1)[0])
            request = SampleRequest(
                ranges, count, seed=seed, timeout=self._timeout, keep_partial=True, workers=1, strict=True
            )  # in this process: simulators do not like to be forked
            scenes = draw_scenes(self._spec, request)
            places = scenes.poses7()
            for index in np.random.default_rng(source).permutation(len(scenes)).tolist():
                phi = {label: float(values[index]) for label, values in scenes.phi.items()}
                yield Start(places[index], phi, None if scenes.on is None else scenes.on[index])
            count = min(4 * count, MOST)


class StrategyStarts:
    """Scenes at the next task of a strategy, or at the nearest phi there is."""

    def __init__(self, spec: Spec, goal: str | None, strategy: Strategy, seed: int) -> None:
        self._spec, self._goal, self._strategy, self._seed = spec, goal, strategy, seed
        self._header = make_header(spec.checked, {}, RequestData(phi={}, n=1, spread="flat"))
        self._stream: LibraryStream | None = None  # made at the first start: it draws thousands of scenes

    def take(self) -> Start:
        with as_request_errors():
            return self._take()

    def _take(self) -> Start:
        from scenegen.learn.curriculum.library import LibraryStream
        from scenegen.learn.curriculum.request import read_phi as read_task

        if self._stream is None:
            self._stream = LibraryStream(_library(self._spec, self._goal), self._seed)
        task = self._strategy.next_task()
        if not isinstance(task, PhiBox):
            raise RequestError(NOT_A_TASK(value=repr(task)))
        target = self._stream.library.target
        row, phi = self._stream.take(read_task(target, task, points=True), nearest=True)
        rows = np.asarray(row)[:, None]
        count = row_count(len(self._spec.objects))
        on = stored_rows(self._spec.checked, rows)[count:].T if self._spec.checked.choices else None
        places = poses7(self._header, as_poses(rows[:count]), on, tensor=False, dtype="float64")
        found = dict(zip(self._spec.labels, map(float, phi), strict=False))
        return Start(places[0], found, None if on is None else on[0], task)


def make_starts(spec: Spec, wanted: Wanted, goal: str | None, seed: int, timeout: float) -> StartSource:
    """Raises RequestError for an invalid range."""
    if is_strategy(wanted):
        need("gymnasium", "for starts chosen by a strategy")
        return StrategyStarts(spec, goal, wanted, seed)
    if callable(wanted):
        return RangeStarts(spec, wanted, seed, timeout)
    fixed: Any = wanted
    if not isinstance(fixed, PhiBox):
        read_phi(spec, fixed)
    return RangeStarts(spec, lambda: fixed, seed, timeout)


def is_strategy(wanted: object) -> TypeGuard[Strategy]:
    return all(callable(getattr(wanted, call, None)) for call in ("next_task", "report"))


def phi_space(spec: Spec, goal: str | None = None) -> PhiBox:
    """The range of phi to train on, for a strategy: from the hardest thousandth of scenes to satisfied. `goal` is the
    label to satisfy, by default all. Raises RequestError where there is nothing to learn."""
    need("gymnasium", "for starts chosen by a strategy")
    with as_request_errors():
        return _library(spec, goal).space


def _library(spec: Spec, goal: str | None) -> Library:
    from scenegen.learn.curriculum.goal import make_goal
    from scenegen.learn.curriculum.library import open_library

    return open_library(make_goal(spec, goal), spec, None)


@contextmanager
def as_request_errors() -> Iterator[None]:
    """Turns the errors of environments, which are gymnasium's, into RequestError."""
    from gymnasium import error

    try:
        yield
    except error.Error as problem:
        diagnostic = getattr(problem, "diagnostic", None)
        if diagnostic is None:
            raise
        raise RequestError(diagnostic) from problem


# --------------------------------------------------------------------------------------------------------------------
# A drop-in for the `placement_initializer` of robosuite's environments: objects start where a spec wants them.


# --------------------------------------------------------------------------------------------------------------------
# The spec's table in the world of a simulator, and quaternions (w, x, y, z).


Numbers: TypeAlias = Sequence[float] | Array


@dataclass(frozen=True, slots=True)
class TableFrame:
    """Where the spec's point (0, 0) at the height of the table is, in metres, and by how much the spec's x axis is
    turned against the world's, in radians, counter-clockwise."""

    origin: tuple[float, float, float]
    turn: float = 0.0

    def place(self, pose: Numbers) -> tuple[Array, Array]:
        """A pose x, y, z, qw, qx, qy, qz of the spec's frame: its place and quaternion in the world."""
        x, y, z, qw, qx, qy, qz = pose
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        at = np.array([cosine * x - sine * y, sine * x + cosine * y, z]) + self.origin
        return at, times((math.cos(self.turn / 2.0), 0.0, 0.0, math.sin(self.turn / 2.0)), (qw, qx, qy, qz))

    def pose(self, at: Numbers, quaternion: Numbers) -> tuple[float, float, float]:
        """The reverse for a body: x, y and heading in the spec's frame. The heading is the turn about the vertical
        that comes nearest to the attitude."""
        x, y = at[0] - self.origin[0], at[1] - self.origin[1]
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        heading = 2.0 * math.atan2(quaternion[3], quaternion[0]) - self.turn
        return cosine * x + sine * y, cosine * y - sine * x, heading


def times(first: Numbers, second: Numbers) -> Array:
    """The product of two quaternions: the second rotation, then the first."""
    a, b, c, d = first
    w, x, y, z = second
    return np.array(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ]
    )


def inverse(quaternion: Numbers) -> Array:
    """The reverse rotation of a unit quaternion."""
    w, x, y, z = quaternion
    return np.array([w, -x, -y, -z])


def upright(model: Any) -> Array:
    """The quaternion of an object that stands as it should at heading 0.

    robosuite's objects may have an `init_quat`; many of LIBERO's have to be turned about x or y first: `rotation` is
    then a range of angles in radians for `rotation_axis`, or maps axes to ranges. Turns about z are headings.
    """
    rotation, axis = getattr(model, "rotation", None), getattr(model, "rotation_axis", None)
    turns = rotation if isinstance(rotation, Mapping) else {axis: rotation}
    found = np.array([1.0, 0.0, 0.0, 0.0])
    for index, name in enumerate("xy"):
        angles = turns.get(name)
        if angles is None:
            continue
        half = 0.5 * (float(np.mean([min(angles), max(angles)])) if isinstance(angles, Iterable) else float(angles))
        turn = np.array([math.cos(half), 0.0, 0.0, 0.0])
        turn[1 + index] = math.sin(half)
        found = times(turn, found)
    return times(found, model.init_quat) if getattr(model, "init_quat", None) is not None else found


Placed: TypeAlias = dict[str, tuple[tuple[float, float, float], Array, Any]]
"""Object name -> (place, quaternion (w, x, y, z), object), as robosuite's samplers give it."""

HELD = 1e-3, 0.01  # metres and radians by which a held object may be off in a simulation
TRIES = 1000  # scenes that are tried until one keeps clear of fixtures


class Placement:
    """Places the objects of an environment as a spec wants them, at a requested phi.

    `phi` is a range as `scenegen.sample` takes it, a strategy of `scenegen.curriculum`, or a function that gives a
    range for each reset. `goal` is the label that a strategy is about. `names` maps objects of the spec to names in
    the environment; others have the same name in both. The spec's coordinates are relative to `reference_pos`, metres
    in the world, and turned by `turn` radians: with -pi / 2, the spec's x axis points to the right as the robot sees
    it, and its y axis away from the robot. `z_offset`, one for all or by object of the environment, lifts objects above
    what they stand on. `rest` places the objects that the spec does not have. Objects may be given here or by the
    environment (`add_objects`). The same seed and requests give the same scenes.

    Raises RequestError for arguments that are none, and `sample` raises it where no scene has the requested phi.
    """

    def __init__(
        self,
        spec: Spec,
        phi: Wanted = None,
        *,
        names: Mapping[str, str] | None = None,
        reference_pos: Iterable[float] = (0.0, 0.0, 0.0),
        turn: float = 0.0,
        z_offset: float | Mapping[str, float] = 0.0,
        goal: str | None = None,
        rest: Any = None,
        mujoco_objects: Any = None,
        ensure_valid_placement: bool = True,
        seed: int = 0,
        timeout: float = 60.0,
        name: str = "Placement",
    ) -> None:
        check_spec(spec)
        self.name, self.spec, self.rest = name, spec, rest
        self.names = _names(spec, {} if names is None else names)
        self.reference_pos = as_point("reference_pos", reference_pos)
        self.turn = as_number("turn", turn)
        self.z_offset = (
            {key: as_number(f"z_offset[{key!r}]", lift) for key, lift in z_offset.items()}
            if isinstance(z_offset, Mapping)
            else as_number("z_offset", z_offset)
        )
        self.ensure_valid_placement = ensure_valid_placement
        self.mujoco_objects: list[Any] = []
        self.start: Start | None = None
        self._strategy = phi if is_strategy(phi) else None
        self._starts = make_starts(spec, phi, goal, as_int("seed", seed), as_seconds("timeout", timeout))
        self._frame = TableFrame(self.reference_pos, self.turn)
        self._header = make_header(spec.checked, {}, RequestData(phi={}, n=1, spread="flat"))
        if mujoco_objects is not None:
            self.add_objects(mujoco_objects)

    def add_objects(self, mujoco_objects: Any) -> None:
        """More objects of the environment: one, or a list of them."""
        several = isinstance(mujoco_objects, list | tuple)
        self.mujoco_objects += mujoco_objects if several else [mujoco_objects]

    def reset(self) -> None:
        """Forget the objects; environments do this before they add those of a new model."""
        self.mujoco_objects = []

    def use_in(self, env: Any) -> None:
        """Replace the sampler of an environment that takes none, such as PickPlace, from its next reset on. Its own
        sampler goes on to place the objects that the spec does not have."""
        env = getattr(env, "unwrapped", env)
        make = getattr(env, "_get_placement_initializer", None)

        def replace() -> None:
            own = env.placement_initializer
            self.mujoco_objects, self.rest = list(own.mujoco_objects), own
            env.placement_initializer = self

        if make is not None:

            def remake() -> None:
                make()
                replace()

            env._get_placement_initializer = remake  # called for each new model
        replace()

    def sample(self, fixtures: Placed | None = None, reference: Any = None, on_top: bool = True) -> Placed:
        """The next scene: every object's place, quaternion and model, and what `fixtures` has.

        `reference` is the name of a fixture, on whose top the scene then is (`on_top`), or a point that takes the place
        of `reference_pos`. Raises RequestError where no scene has the requested phi or keeps clear of the fixtures, and
        for objects that spec and environment do not share.
        """
        placed: Placed = dict(fixtures or {})
        objects = self._objects(placed)
        self._frame = TableFrame(self._origin(placed, reference, on_top), self.turn)
        for _ in range(TRIES):
            start = self._starts.take()
            found = self._placed(start, objects, on_top)
            if not (placed and self.ensure_valid_placement) or _clear(found, placed):
                break
        else:
            raise RequestError(PLACEMENT(tried=TRIES, fixtures=tuple(placed)))
        self.start = start
        placed |= found
        left = [one for one in self.mujoco_objects if one.name not in placed]
        return _rest(self.rest, left, placed) if left else placed

    @property
    def phi(self) -> dict[str, float]:
        """phi of the last start, by label. Raises RequestError before the first."""
        return dict(self._started().phi)

    def poses(self, sim: Any) -> Array:
        """(N, 3): where the spec's objects are in a simulation now, in the spec's frame: x and y in metres, heading in
        radians. Objects that the environment does not have are where the start put them. Raises RequestError before
        the first start."""
        start = self._started()
        there = {one.name: one for one in self.mujoco_objects}
        found = np.empty((len(self.spec.objects), 3))
        for which, own in enumerate(self.spec.objects):
            model = there.get(self.names[own])
            if model is None:
                pose = start.poses[which]
                found[which] = pose[0], pose[1], 2.0 * np.arctan2(pose[6], pose[3])
                continue
            body = sim.model.body_name2id(model.root_body)
            attitude = times(sim.data.body_xquat[body], inverse(upright(model)))
            found[which] = self._frame.pose(sim.data.body_xpos[body], attitude)
        return found

    def phi_in(self, sim: Any) -> dict[str, float]:
        """phi of each label where the objects are in a simulation now. An object that the spec holds counts as in its
        place; raises RequestError where it is off by more than 1 mm or 0.01 rad, and before the first start."""
        start, checked = self._started(), self.spec.checked
        rows = turned(as_rows(self.poses(sim)[None]))
        moved = held_elsewhere(checked, rows, *HELD)
        if moved is not None:
            raise RequestError(HELD_ELSEWHERE(**held(checked, moved[0]), place="in the simulation"))
        rows = with_switches(checked, self._header, rows, None if start.on is None else start.on[None])
        return {label: float(value[0]) for label, value in score(checked.core, list(rows), NUMPY).items()}

    def report(self, success: bool, total: float = 0.0, steps: int = 0) -> None:
        """Tell the strategy how the episode ended that began with the last start; nothing without a strategy."""
        start = self._started()
        if self._strategy is not None and start.task is not None:
            values = tuple(start.phi.values())
            self._strategy.report(Outcome(start.task, values, bool(success), float(total), int(steps)))

    def _started(self) -> Start:
        if self.start is None:
            raise RequestError(NO_EPISODE(state="no scene was placed yet", remedy="reset the environment first"))
        return self.start

    def _objects(self, placed: Placed) -> list[tuple[int, Any]]:
        """The spec's objects by number, each with its model; those that are held in place may have none."""
        there = {one.name: one for one in self.mujoco_objects}
        twice = tuple(name for name in self.names.values() if name in placed)
        if twice:
            raise RequestError(PLACEMENT(fixed=twice))
        found = []
        for which, name in enumerate(self.names.values()):
            if name in there:
                found.append((which, there[name]))
            elif which not in self.spec.checked.fixed:
                raise RequestError(PLACEMENT(name=name, known=tuple(there)))
        strangers = tuple(name for name in there if name not in {*self.names.values(), *placed})
        if strangers and self.rest is None:
            raise RequestError(PLACEMENT(strangers=strangers))
        return found

    def _origin(self, placed: Placed, reference: Any, on_top: bool) -> tuple[float, float, float]:
        if reference is None:
            return self.reference_pos
        if not isinstance(reference, str):
            return as_point("reference", reference)
        if reference not in placed:
            raise RequestError(PLACEMENT(reference=reference, known=tuple(placed)))
        at, _, model = placed[reference]
        x, y, z = as_point("reference", at)
        return x, y, z + (float(model.top_offset[-1]) if on_top else 0.0)

    def _placed(self, start: Start, objects: list[tuple[int, Any]], on_top: bool) -> Placed:
        found: Placed = {}
        for which, model in objects:
            (x, y, z), quaternion = self._frame.place(start.poses[which].tolist())
            lift = self.z_offset
            z += lift.get(model.name, 0.0) if isinstance(lift, dict) else lift
            if on_top:
                z -= model.bottom_offset[-1]
            found[model.name] = (float(x), float(y), float(z)), times(quaternion, upright(model)), model
        return found


def _names(spec: Spec, names: Mapping[str, str]) -> dict[str, str]:
    """The environment's name of each object of the spec. Raises RequestError."""
    if not isinstance(names, Mapping):
        wanted = 'names by name: names={"mug": "Can"}'
        raise RequestError(WRONG_VALUE(argument="names", value=repr(names), wanted=wanted))
    for own in names:
        if own not in spec.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(own), known=spec.objects))
    found = {own: names.get(own, own) for own in spec.objects}
    for name, count in Counter(found.values()).items():
        if count > 1:
            raise RequestError(SAME_NAME(name=name, objects="objects"))
    return found


def _clear(found: Placed, fixtures: Placed) -> bool:
    """Whether no object is over a fixture, by the test of robosuite: circles around both, or one above the other."""
    for (x, y, z), _, model in found.values():
        for (a, b, c), _, other in fixtures.values():
            near = np.hypot(x - a, y - b) <= other.horizontal_radius + model.horizontal_radius
            if near and z - c <= other.top_offset[-1] - model.bottom_offset[-1]:
                return False
    return True


def _rest(sampler: Any, left: list[Any], placed: Placed) -> Placed:
    """The objects that remain, placed by robosuite's samplers, which keep clear of what is placed."""
    for part in getattr(sampler, "samplers", {"": sampler}).values():
        mine = [one for one in left if any(one is other for other in part.mujoco_objects)]
        if mine:
            own = copy.copy(part)
            own.mujoco_objects = mine
            placed = own.sample(fixtures=placed)
    missing = tuple(one.name for one in left if one.name not in placed)
    if missing:
        raise RequestError(PLACEMENT(strangers=missing))
    return placed


# --------------------------------------------------------------------------------------------------------------------
# Start states for evaluation: what LIBERO reads as its init states.
#
# A state is what robosuite's `sim.get_state().flatten()` gives: the time, then qpos, then qvel. LIBERO keeps an array
# (n, D) of them for each task, in float64, in a file of `torch.save`; its evaluation takes row i for episode i.


@dataclass(frozen=True, eq=False)
class InitStates:
    """`states` (n, D), and phi of each by label, (n,): as the scene was verified to have it, and read back from the
    simulation with the state set."""

    states: Array
    phi: Mapping[str, Array]
    read: Mapping[str, Array]

    def save(self, path: str | Path) -> Path:
        """Write the states as LIBERO has them (`TASK.pruned_init`); the file appears whole or not at all. Raises
        OutputError, and RequestError where torch is not installed."""
        need("torch", "to write init states")
        import torch

        path = as_path("path", path)
        with whole_file(path) as file:
            torch.save(self.states, file)
        return path


def init_states(env: Any, placement: Placement, n: int) -> InitStates:
    """n states of an environment of robosuite or LIBERO, with the objects where the placement wants them.

    The environment is reset once; what the placement does not place stays as it is then. Give the placement the
    environment's objects: for LIBERO, mujoco_objects=list(env.env.objects_dict.values()). Raises RequestError, also for
    an object of the spec that has no free joint.
    """
    n = as_int("n", n)
    if n < 1:
        raise RequestError(OUT_OF_RANGE(argument="n", value=n, wanted="1 or more"))
    env.reset()
    sim = env.sim
    begun = sim.get_state()
    states, phi, read = [], [], []
    for _ in range(n):
        sim.set_state(begun)
        for at, quaternion, model in placement.sample().values():
            joints = list(model.joints)
            if joints:
                sim.data.set_joint_qpos(joints[0], np.concatenate([at, quaternion]))
                sim.data.set_joint_qvel(joints[0], np.zeros(6))
            elif model.name in placement.names.values():
                raise RequestError(PLACEMENT(jointless=model.name))
        sim.forward()
        states.append(sim.get_state().flatten())
        phi.append(placement.phi)
        read.append(placement.phi_in(sim))
    return InitStates(np.array(states, dtype=np.float64), _columns(phi), _columns(read))


def _columns(rows: list[dict[str, float]]) -> dict[str, Array]:
    return {label: np.array([row[label] for row in rows]) for label in rows[0]}
