"""What physics makes of scenes: where their objects come to rest, and what phi is there."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.reading import reading_of
from scenegen.api.scenes import Scene, SceneSet
from scenegen.api.scenes import evaluate as score
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import NEEDED_HERE, NO_SCENES, WRONG_VALUE
from scenegen.geometry.workspace import upright
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.pose import as_poses, row_count, rows_of
from scenegen.scenes.blocks import Block, counts_in, join_blocks, member_of
from scenegen.scenes.data import SceneFile, SettledHeader, SimulatorData
from scenegen.scenes.files import check_writable
from scenegen.scenes.formats.jsonl import block_of
from scenegen.scenes.formats.registry import format_of
from scenegen.scenes.formats.settled import MM, POSE, SettledBlock, Touch, write_settled
from scenegen.validation import as_path, as_seconds
from scenegen.worlds.export.world import NOTHING, Own, World, world_of
from scenegen.worlds.physics.bodies import TABLE, Contact
from scenegen.worlds.physics.settling import worst_objects
from scenegen.worlds.physics.simulation import ROUND_SCENES, RestResult, check_simulator, resting, version_of


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
    `header.surfaces` stood on in the plan, count_blocks from 1.
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
        return f"<SettledScenes: {Summary.from_block(self.header, self._block()).last_line}>"

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
    def from_block(header: SettledHeader, block: SettledBlock) -> Summary:
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
        worst = worst_objects(self.header.objects, self.moved)
        return f"{text}; in {self.far:,} an object moved too far: {worst}"


SettleProgress = Callable[[int, int | None], None]  # scenes simulated so far, and of how many, if that is known

SETTLE_SECONDS = 2.0
MAX_SHIFT = 0.002  # metres
MAX_TURN = 2.0  # degrees


def settle(
    scenes: SceneSet,
    simulator: str = "mujoco",
    *,
    seconds: float = SETTLE_SECONDS,
    max_shift: float = MAX_SHIFT,
    max_turn: float = MAX_TURN,
    meshes: str | Path | None = None,
    workers: int | None = None,
    progress: SettleProgress | None = None,
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
    for block in _blocks(scenes.header, header, scenes.blocks(), _own_bodies(scenes.header, meshes), workers):
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
    seconds: float = SETTLE_SECONDS,
    max_shift: float = MAX_SHIFT,
    max_turn: float = MAX_TURN,
    meshes: str | Path | None = None,
    workers: int | None = None,
    progress: SettleProgress | None = None,
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
    own = _own_bodies(reading.header, meshes)
    summary = Summary(header)

    def count_blocks() -> Iterator[SettledBlock]:
        for block in _blocks(reading.header, header, reading.blocks, own, workers):
            summary.add(block)
            if progress is not None:
                progress(summary.scenes, reading.count)
            yield block
        if not summary.scenes:
            raise RequestError(NO_SCENES())

    write_settled(out, header, count_blocks())
    return summary


def _own_bodies(scenes: SceneFile, meshes: str | Path | None) -> Own:
    if meshes is None:
        return NOTHING
    from scenegen.worlds.own_body import own_bodies_of

    return own_bodies_of(scenes, as_path("meshes", meshes))


def _header(scenes: SceneFile, simulator: str, seconds: float, max_shift: float, max_turn: float) -> SettledHeader:
    check_simulator(simulator)
    spec = scenes.spec.checked_spec
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
    spec = scenes.spec.checked_spec
    if not scenes.counts:
        yield from _same_objects(spec, scenes, header, blocks, own, workers)
        return
    for block in blocks:
        for start in range(0, block.count, SCENES_AT_ONCE):
            yield _by_numbers(spec, scenes, header, block.part(start, start + SCENES_AT_ONCE), own, workers)


def _same_objects(
    spec: CheckedSpec, scenes: SceneFile, header: SettledHeader, blocks: Iterable[Block], own: Own, workers: int | None
) -> Iterator[SettledBlock]:
    """The same of scenes of the same objects, a few at a time."""
    placed = row_count(len(header.objects))
    bare = world_of(scenes, join_blocks([], placed + len(scenes.choosers), 0), own)
    # of rounds that are being simulated: poses (m, N, 3), and on which of its surfaces each chooser stands, (m, M)
    waiting: deque[tuple[Array, Array]] = deque()

    def rounds() -> Iterator[Array]:
        for block in blocks:
            poses = world_of(scenes, block).poses
            planned, on = as_poses(block.rows[:placed]), block.rows[placed:].T
            for start in range(0, block.count, ROUND_SCENES):
                waiting.append((planned[start : start + ROUND_SCENES], on[start : start + ROUND_SCENES]))
                yield poses[start : start + ROUND_SCENES][..., [0, 1, 3, 2]]

    simulator = header.simulator
    with resting(bare, simulator.name, simulator.seconds, workers) as rest, closing(rest(rounds())) as rested:
        for one in rested:
            yield _settled_block(spec, scenes, header, bare, one, *waiting.popleft())


def _settled_block(
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


SCENES_AT_ONCE = 4096  # scenes: the processes start again for each number of things among so many


def _by_numbers(
    spec: CheckedSpec, scenes: SceneFile, header: SettledHeader, block: Block, own: Own, workers: int | None
) -> SettledBlock:
    """What becomes of the scenes of a block, each without the objects that are not there."""
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
        there_header = header.model_copy(update={"objects": there})
        done = 0
        some_scenes = Block(block.rows[np.ix_(rows, which)], block.phi[:, which])
        for found in _same_objects(mine, member, there_header, [some_scenes], own, workers):
            part = which[done : done + found.count]
            done += found.count
            at = np.ix_(part, columns)
            poses[at], shift[at], turn[at], moved[at] = found.poses, found.shift, found.turn, found.moved
            phi[:, part] = found.phi
            for scene, touches in zip(part.tolist(), found.contacts, strict=True):
                contacts[scene] = touches
    return SettledBlock(poses, shift, turn, moved, phi, tuple(contacts), on)


def load_pybullet(
    scene: Scene, client: Any = 0, *, table: bool = True, meshes: str | Path | None = None
) -> dict[str, int]:
    """Add a scene, such as `scenes[3]`, to a running PyBullet: objects with mass, inertia, friction and collision
    shapes, on a table unless `table` is false; no floor, no gravity, no camera.

        client = pybullet.connect(pybullet.DIRECT)
        bodies = scenegen.load_pybullet(scenes[3], client)
        where, turn = pybullet.getBasePositionAndOrientation(bodies["mug"], client)

    `client` is what `pybullet.connect` returned, or a BulletClient. Returns the number of each object's body. PyBullet
    speaks of a body's centre of mass: an object's own frame, in the middle of its footprint at its lowest point, lies
    by its local inertial position (`getDynamicsInfo(...)[3]`) below that. The table's top is z = 0.

    Raises RequestError where PyBullet is not installed or the client is not connected, DataError where an object stands
    beyond any table, and for files in `meshes` that cannot be used: the folder that the spec was in, from which objects
    with a mesh or URDF file then have convex pieces, mass and friction.
    """
    need("pybullet", "for `load_pybullet()`")
    from scenegen.worlds.physics.bullet import load

    if not isinstance(scene, Scene):
        raise RequestError(NEEDED_HERE(what="one scene", value=repr(scene), remedy="pick one of a set: scenes[0]"))
    header = member_of(scene.header, scene.counts) if scene.header.counts else scene.header
    world = world_of(header, block_of([scene.data()], header, tuple(scene.phi)), _own_bodies(header, meshes))
    if scene.rest is not None:
        world = replace(world, rest=scene.rest[None, ~np.isnan(scene.rest[:, 0])])
    return load(world, getattr(client, "_client", client), table=table)
