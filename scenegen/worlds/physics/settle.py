"""What physics makes of scenes: where their objects come to rest, and what phi is there."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from importlib.metadata import version
from numbers import Real
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scenegen.api.reading import reading_of
from scenegen.api.scenes import SceneSet
from scenegen.api.scenes import evaluate as score
from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.geometry.attitude import Floats, standing, turn_between, upright
from scenegen.lang.checker import check_text
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.pose import as_poses, row_count, rows_of
from scenegen.processes.pool import Pool, check_workers
from scenegen.processes.process import cores
from scenegen.scenes.blocks import Block, counts_in, joined, member_of
from scenegen.scenes.data import SceneFile, SettledHeader, SimulatorData
from scenegen.scenes.files import check_writable
from scenegen.scenes.formats.registry import format_of
from scenegen.scenes.formats.settled import MM, POSE, SettledBlock, Touch, write_settled
from scenegen.validation import as_path, as_seconds
from scenegen.worlds.export import mjcf, sdf
from scenegen.worlds.export.setting import NOTHING, Own, world_of
from scenegen.worlds.export.world import World
from scenegen.worlds.physics.bodies import TABLE, Brick, Contact, InertialBody, board_of, piece_files, whole_of

# --------------------------------------------------------------------------------------------------------------------
# Where the objects of scenes come to rest, in PyBullet or MuJoCo, on several processes.
#
# The objects are those of files for simulators (`export.world`): convex pieces, mass, friction. They start where the
# scene has them, on an infinite table with the spec's boards, under gravity. Fixed objects cannot be moved.


# name -> its package. Names are those of packages, for which `needs` says how to install them.
SIMULATORS = ("mujoco", "pybullet")
TITLES = {"mujoco": "MuJoCo", "pybullet": "PyBullet"}
FINE = 1.0 / 960.0  # seconds: with pybullet's usual 240 steps a second, towers lean by up to 2 degrees
ROUND = 8  # scenes given to a process at a time: up to two seconds of a core


@dataclass(frozen=True, slots=True, eq=False)
class RestResult:
    """Of m scenes of N objects: `planned` and `poses` (m, N, 7), place and quaternion (w first) before and after, and
    what touched before, by scene. A simulation that diverged leaves NaN."""

    planned: Floats
    poses: Floats
    contacts: tuple[tuple[Contact, ...], ...]

    @property
    def shift(self) -> Floats:
        """(m, N): how far each object's origin is from where it was planned, in metres."""
        return np.asarray(np.linalg.norm(self.poses[..., :3] - self.planned[..., :3], axis=-1))

    @property
    def turn(self) -> Floats:
        """(m, N): by how much each is turned against the plan, about any axis, in degrees."""
        return turn_between(self.planned[..., 3:], self.poses[..., 3:])


class DropSimulator(Protocol):
    def rest(self, places: Floats, seconds: float) -> tuple[Floats, tuple[Contact, ...]]: ...


@dataclass(frozen=True, slots=True)
class MujocoSetup:
    """What a worker needs for MuJoCo: the model as XML."""

    model: str

    def world(self) -> DropSimulator:
        from scenegen.worlds.physics.drop_mujoco import MujocoWorld

        return MujocoWorld(self.model)


@dataclass(frozen=True, slots=True, eq=False)
class PybulletSetup:
    """What a worker needs for PyBullet: the bodies, and the files of their pieces."""

    bodies: Sequence[InertialBody]
    files: Sequence[Sequence[str | Brick]]
    boards: int

    def world(self) -> DropSimulator:
        from scenegen.worlds.physics.drop import PybulletWorld

        return PybulletWorld(self.bodies, self.files, friction=sdf.ROUGH, step=FINE, boards=self.boards)


class RestJob:
    """Scenes (m, N, 4): x, y, theta, z -> where they come to rest. The simulator is loaded with the first, in the
    worker."""

    def __init__(self, simulator: MujocoSetup | PybulletSetup, seconds: float) -> None:
        self._simulator, self._seconds = simulator, seconds
        self._world: DropSimulator | None = None

    def __call__(self, places: Floats) -> RestResult:
        if self._world is None:
            self._world = self._simulator.world()
        found = [self._world.rest(scene, self._seconds) for scene in places]
        poses = np.stack([one for one, _ in found])
        finite = np.isfinite(poses).all(axis=-1, keepdims=True)
        return RestResult(standing(places), np.where(finite, poses, np.nan), tuple(contacts for _, contacts in found))


class RestPool:
    """Lets scenes of a world's bodies come to rest on several processes, which start with the first scenes and run
    until `close`: use it as a context manager. Results do not depend on the number of processes.

    Raises RequestError for an unknown simulator, for one that is not installed, and for fewer than 1 worker.
    """

    def __init__(self, world: World, simulator: str, seconds: float, workers: int | None = None) -> None:
        check_simulator(simulator)
        workers = cores() if workers is None else check_workers(workers)
        self._opened = ExitStack()
        made: MujocoSetup | PybulletSetup
        if simulator == "mujoco":
            made = MujocoSetup(mjcf.bench(world).decode())
        else:
            bodies = [*map(whole_of, world.bodies), *(board_of(board, sdf.ROUGH) for board in world.boards)]
            files = self._opened.enter_context(piece_files(bodies))
            made = PybulletSetup(bodies, files, len(world.boards))
        self._pool: Pool[Floats, RestResult] = Pool(
            RestJob(made, seconds), workers, what="a process that simulates scenes", unit="round"
        )

    def __enter__(self) -> RestPool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        self._pool.close()
        self._opened.close()

    def rest(self, rounds: Iterable[Floats]) -> Generator[RestResult, None, None]:
        """What becomes of rounds of scenes (m, N, 4), each x, y, theta, z; in their order. Raises ScenegenError if a
        process fails."""
        return self._pool.map(rounds)


def check_simulator(name: str) -> None:
    """Raises RequestError for an unknown simulator, and for one that is not installed."""
    if name not in SIMULATORS:
        raise RequestError(UNKNOWN_CHOICE(what="simulator", name=str(name), known=SIMULATORS))
    need(name, f"to settle scenes in {TITLES[name]}")


def version_of(simulator: str) -> str:
    """The version that is installed."""
    return version(simulator)


# --------------------------------------------------------------------------------------------------------------------
# Settling scenes that differ in how many things there are: scenes of the same things together.


AT_ONCE = 4096  # scenes: the processes start again for each number of things among so many

Settle = Callable[[CheckedSpec, SceneFile, SettledHeader, Block], Iterable[SettledBlock]]


def settle_by_numbers(
    spec: CheckedSpec, scenes: SceneFile, header: SettledHeader, blocks: Iterable[Block], settle: Settle
) -> Iterator[SettledBlock]:
    """What becomes of the scenes of some blocks, in their order. `settle` is given scenes of the same objects, their
    spec and headers without those that are not there."""
    for block in blocks:
        for start in range(0, block.count, AT_ONCE):
            yield _settled(spec, scenes, header, block.part(start, start + AT_ONCE), settle)


def _settled(spec: CheckedSpec, scenes: SceneFile, header: SettledHeader, block: Block, settle: Settle) -> SettledBlock:
    names, count = header.objects, block.count
    shape = count, len(names)
    poses = np.full((*shape, len(POSE)), np.nan)
    shift, turn, moved = np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=bool)
    phi = np.full((len(header.labels), count), np.nan)
    contacts: list[tuple[Touch, ...]] = [()] * count
    on = block.rows[row_count(len(names)) :].T if scenes.choosers else None
    numbers = counts_in(scenes, block.rows)
    for some in np.unique(numbers, axis=1).T:
        which = np.flatnonzero((numbers == some[:, None]).all(axis=0))
        member = member_of(scenes, dict(zip((one.name for one in scenes.counts), some.tolist(), strict=True)))
        there = [one.name for one in member.objects]
        columns = np.array([names.index(name) for name in there])
        rows = np.array(
            [row for place in columns.tolist() for row in rows_of(place)]
            + [row_count(len(names)) + k for k, one in enumerate(scenes.choosers) if one.name in set(there)]
        )
        mine = next(one for one in spec.members if set(one.objects) == set(there))
        own = header.model_copy(update={"objects": there})
        done = 0
        for found in settle(mine, member, own, Block(block.rows[np.ix_(rows, which)], block.phi[:, which])):
            part = which[done : done + found.count]
            done += found.count
            at = np.ix_(part, columns)
            poses[at], shift[at], turn[at], moved[at] = found.poses, found.shift, found.turn, found.moved
            phi[:, part] = found.phi
            for scene, touches in zip(part.tolist(), found.contacts, strict=True):
                contacts[scene] = touches
    return SettledBlock(poses, shift, turn, moved, phi, tuple(contacts), on)


# --------------------------------------------------------------------------------------------------------------------
# Settled scenes as arrays, and in words.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SettledScenes:
    """Where n scenes of N objects came to rest.

    `poses` (n, N, 7) are x, y, z of each object's lowest point under the middle of its footprint, in metres, and its
    attitude as a quaternion qw, qx, qy, qz. Against the plan, `shift` (n, N) is how far that point moved, in metres,
    and `turn` (n, N) the angle by which the object turned, about any axis, in degrees; `moved` (n, N) says which
    objects moved farther than allowed. `phi` has by label the values (n,) at the settled poses, each object read as x,
    y and the heading of the nearest upright attitude. `contacts` are by scene the pairs of objects that touched before,
    None for the table, and how deep they were in each other, in metres. NaN where a simulation diverged, and for
    objects that are not there. `header` says the rest. `on` (n, M) is the surface that each object of
    `header.surfaces` stood on in the plan, counted from 1.
    """

    poses: Array
    shift: Array
    turn: Array
    moved: npt.NDArray[np.bool_]
    phi: Mapping[str, Array]
    contacts: tuple[tuple[Touch, ...], ...]
    header: SettledHeader
    on: Array | None = None

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        return f"<SettledScenes: {Summary.of(self.header, self._block()).last_line}>"

    @property
    def settled(self) -> npt.NDArray[np.bool_]:
        """(n,): which scenes settled: none of their objects moved farther than allowed."""
        return np.asarray(~self.moved.any(axis=1))

    @property
    def deepest(self) -> Array:
        """(n,): the depth of each scene's deepest contact before it was simulated, in metres."""
        return self._block().deepest

    def save(self, path: str | Path) -> Path:
        """Write them as .json, .jsonl or .parquet; the file appears whole or not at all. Raises RequestError,
        OutputError."""
        path = as_path("path", path)
        write_settled(path, self.header, [self._block()])
        return path

    def _block(self) -> SettledBlock:
        phi = np.array(list(self.phi.values())).reshape(len(self.phi), len(self))
        return SettledBlock(self.poses, self.shift, self.turn, self.moved, phi, self.contacts, self.on)


@dataclass(slots=True)
class Summary:
    """What became of the scenes of a run so far, in words."""

    header: SettledHeader
    scenes: int = 0
    far: int = 0
    shift: float = 0.0
    turn: float = 0.0
    depth: float = 0.0
    moved: Array | None = None

    @staticmethod
    def of(header: SettledHeader, block: SettledBlock) -> Summary:
        summary = Summary(header)
        summary.add(block)
        return summary

    def add(self, block: SettledBlock) -> None:
        """Count a block's scenes."""
        far = np.asarray(block.moved.any(axis=1))
        self.scenes += block.count
        self.far += int(far.sum())
        still = block.present & ~far[:, None]
        self.shift = max(self.shift, float(block.shift[still].max(initial=0.0)))
        self.turn = max(self.turn, float(block.turn[still].max(initial=0.0)))
        self.depth = max(self.depth, float(block.deepest.max(initial=0.0)))
        self.moved = block.moved.sum(axis=0) + (0 if self.moved is None else self.moved)

    @property
    def first_line(self) -> str:
        """How far objects moved where scenes settled, and how deep they were in each other before."""
        before = f"before, no contact was deeper than {MM * self.depth:.2f} mm"
        if self.far == self.scenes:
            return f"no scene settled; {before}"
        moved = f"{MM * self.shift:.2f} mm and {self.turn:.2f} degrees"
        return f"where scenes settled, objects moved by at most {moved}; {before}"

    @property
    def last_line(self) -> str:
        """How many scenes settled, and which objects moved too far in the others."""
        name, seconds = self.header.simulator.name, self.header.simulator.seconds
        text = f"{self.scenes - self.far:,} of {self.scenes:,} scenes settled ({name}, {seconds:g} s)"
        if not self.far or self.moved is None:
            return text
        order = [int(k) for k in np.argsort(-self.moved, kind="stable") if self.moved[k]]
        shown = ", ".join(f"`{self.header.objects[k]}` in {int(self.moved[k]):,}" for k in order[:5])
        more = f" and {len(order) - 5} more objects" if len(order) > 5 else ""
        return f"{text}; in {self.far:,} an object moved too far: {shown}{more}"


Told = Callable[[int, int | None], None]  # scenes simulated so far, and of how many, if that is known

SECONDS = 2.0
MAX_SHIFT = 0.002  # metres
MAX_TURN = 2.0  # degrees


def settle(
    scenes: SceneSet,
    simulator: str = "mujoco",
    *,
    seconds: float = SECONDS,
    max_shift: float = MAX_SHIFT,
    max_turn: float = MAX_TURN,
    meshes: str | Path | None = None,
    workers: int | None = None,
    progress: Told | None = None,
) -> SettledScenes:
    """Simulate every scene for some seconds, in "mujoco" or "pybullet": where its objects come to rest, how far that is
    from the plan, and phi there. Scenes in which an object moves more than `max_shift` metres or turns by more than
    `max_turn` degrees are marked, not left out.

    Objects collide with their own convex pieces, on an infinite table with the spec's boards; those that the spec holds
    in place cannot move. With `meshes`, the folder that the spec was in, objects with a mesh or URDF file have convex
    pieces, mass and friction from it, instead of a prism over their outline. Where scenes differ in how many things
    there are, objects that are not there are NaN. The results do not depend on `workers`, by default one per core.

    Raises RequestError where the simulator is not installed, for no scenes, and for limits that are not positive
    numbers, DataError for scenes that cannot be simulated.
    """
    if not isinstance(scenes, SceneSet):
        raise RequestError(WRONG_VALUE(argument="scenes", value=repr(scenes), wanted="a SceneSet"))
    if not len(scenes):
        raise RequestError(NO_SCENES())
    scenes.refuse_rest("settle")
    header = _header(scenes.header, simulator, seconds, max_shift, max_turn)
    found: list[SettledBlock] = []
    for block in _blocks(scenes.header, header, scenes.blocks(), _own(scenes.header, meshes), workers):
        found.append(block)
        if progress is not None:
            progress(sum(one.count for one in found), len(scenes))
    phi = np.concatenate([one.phi for one in found], axis=1)
    return SettledScenes(
        np.concatenate([one.poses for one in found]),
        np.concatenate([one.shift for one in found]),
        np.concatenate([one.turn for one in found]),
        np.concatenate([one.moved for one in found]),
        dict(zip(header.labels, phi, strict=True)),
        tuple(touches for one in found for touches in one.contacts),
        header,
        np.concatenate([one.on for one in found if one.on is not None]) if header.surfaces else None,
    )


def settle_file(
    source: Path,
    out: Path,
    simulator: str,
    *,
    seconds: float = SECONDS,
    max_shift: float = MAX_SHIFT,
    max_turn: float = MAX_TURN,
    meshes: str | Path | None = None,
    workers: int | None = None,
    progress: Told | None = None,
    spec: Spec | None = None,
) -> Summary:
    """The same from a scene file to a file of settled scenes, with a few scenes in memory at a time; `spec` is that of
    a file of poses alone. Raises what `settle` raises, and OutputError."""
    out = as_path("out", out)
    format_of(out)
    check_writable(out, source)
    check_simulator(simulator)
    reading = reading_of(source, spec)
    header = _header(reading.header, simulator, seconds, max_shift, max_turn)
    own = _own(reading.header, meshes)
    summary = Summary(header)

    def counted() -> Iterator[SettledBlock]:
        for block in _blocks(reading.header, header, reading.blocks, own, workers):
            summary.add(block)
            if progress is not None:
                progress(summary.scenes, reading.count)
            yield block
        if not summary.scenes:
            raise RequestError(NO_SCENES())

    write_settled(out, header, counted())
    return summary


def _own(scenes: SceneFile, meshes: str | Path | None) -> Own:
    if meshes is None:
        return NOTHING
    from scenegen.worlds.export.world import own_bodies_of

    return own_bodies_of(scenes, as_path("meshes", meshes))


def _header(scenes: SceneFile, simulator: str, seconds: float, max_shift: float, max_turn: float) -> SettledHeader:
    check_simulator(simulator)
    spec = check_text(scenes.spec.source, "the spec of the scenes")
    return SettledHeader(
        spec=scenes.spec,
        objects=[one.name for one in scenes.objects],
        labels=list(spec.labels),
        simulator=SimulatorData(name=simulator, version=version_of(simulator), seconds=as_seconds("seconds", seconds)),
        max_shift_mm=MM * _limit("max_shift", max_shift, "a number of metres above 0"),
        max_turn_deg=_limit("max_turn", max_turn, "a number of degrees above 0"),
        surfaces={
            one.name: [surface.on for surface in one.support.any] for one in scenes.choosers if one.support is not None
        },
    )


def _limit(name: str, value: object, wanted: str) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < float(value) < math.inf:
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted=wanted))
    return float(value)


def _blocks(
    scenes: SceneFile, header: SettledHeader, blocks: Iterable[Block], own: Own, workers: int | None
) -> Iterator[SettledBlock]:
    """What becomes of the scenes of some blocks, some at a time, in their order."""
    spec = check_text(scenes.spec.source, "the spec of the scenes")
    if not scenes.counts:
        yield from _same_objects(spec, scenes, header, blocks, own, workers)
        return

    def settle_some(member: CheckedSpec, file: SceneFile, mine: SettledHeader, block: Block) -> Iterator[SettledBlock]:
        return _same_objects(member, file, mine, [block], own, workers)

    yield from settle_by_numbers(spec, scenes, header, blocks, settle_some)


def _same_objects(
    spec: CheckedSpec,
    scenes: SceneFile,
    header: SettledHeader,
    blocks: Iterable[Block],
    own: Own,
    workers: int | None,
) -> Iterator[SettledBlock]:
    """The same of scenes of the same objects, a few at a time."""
    placed = row_count(len(header.objects))
    bare = world_of(scenes, joined([], placed + len(scenes.choosers), 0), own)
    # of rounds that are being simulated: poses (m, N, 3), and on which of its surfaces each chooser stands, (m, M)
    waiting: deque[tuple[Array, Array]] = deque()

    def rounds() -> Iterator[Array]:
        for block in blocks:
            poses = world_of(scenes, block).poses
            planned, on = as_poses(block.rows[:placed]), block.rows[placed:].T
            for start in range(0, block.count, ROUND):
                waiting.append((planned[start : start + ROUND], on[start : start + ROUND]))
                yield poses[start : start + ROUND][..., [0, 1, 3, 2]]

    simulator = header.simulator
    with (
        RestPool(bare, simulator.name, simulator.seconds, workers) as resting,
        closing(resting.rest(rounds())) as rested,
    ):
        for one in rested:
            yield _judged(spec, scenes, header, bare, one, *waiting.popleft())


def _judged(
    spec: CheckedSpec,
    scenes: SceneFile,
    header: SettledHeader,
    world: World,
    rested: RestResult,
    planned: Array,
    on: Array,
) -> SettledBlock:
    """What is said of some scenes that came to rest: `planned` (m, N, 3) are the poses before, `on` the surfaces."""
    fixed = np.array([body.fixed for body in world.bodies])
    rested = replace(rested, poses=np.where(fixed[:, None], rested.planned, rested.poses))  # without any rounding
    shift, turn = rested.shift, rested.turn
    moved = ~((MM * shift <= header.max_shift_mm) & (turn <= header.max_turn_deg))  # NaN has moved, too
    lost = np.asarray(np.isnan(rested.poses).any(axis=(1, 2)))
    read = np.where(fixed[:, None] | lost[:, None, None], planned, upright(rested.poses))
    found = score(spec, SceneSet(read, {}, scenes, on=on if scenes.choosers else None))
    phi = np.array(list(found.values())).reshape(len(header.labels), len(planned))
    names = header.objects

    def touch(contact: Contact) -> Touch:
        return None if contact.a == TABLE else names[contact.a], names[contact.b], contact.depth

    contacts = tuple(tuple(map(touch, one)) for one in rested.contacts)
    chosen = on if scenes.choosers else None
    return SettledBlock(rested.poses, shift, turn, moved, np.where(lost, np.nan, phi), contacts, chosen)
