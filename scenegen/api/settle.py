"""What physics makes of scenes: where their objects come to rest, and what phi is there."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from numbers import Real
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.api.reading import reading_of
from scenegen.api.scenes import SceneSet
from scenegen.api.scenes import evaluate as score
from scenegen.api.settle_numbers import settle_by_numbers
from scenegen.api.settled import SettledScenes, Summary
from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES, WRONG_VALUE
from scenegen.export.setting import NOTHING, Own, world_of
from scenegen.export.world import World
from scenegen.formats.blocks import Block, joined
from scenegen.formats.files import check_writable
from scenegen.formats.registry import format_of
from scenegen.formats.settled import write_settled
from scenegen.formats.settled_blocks import MM, SettledBlock, Touch
from scenegen.lang.check import check_text
from scenegen.lang.spec import CheckedSpec
from scenegen.physics.attitude import upright
from scenegen.physics.contact import TABLE, Contact
from scenegen.physics.rest import ROUND, Rested, Resting, check_simulator, version_of
from scenegen.pose import as_poses, row_count
from scenegen.scene.data import SceneFile
from scenegen.scene.settled import SettledHeader, SimulatorData
from scenegen.validation import as_path, as_seconds

Array = npt.NDArray[np.float64]
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
    from scenegen.export.own_bodies import own_bodies_of

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
        Resting(bare, simulator.name, simulator.seconds, workers) as resting,
        closing(resting.rest(rounds())) as rested,
    ):
        for one in rested:
            yield _judged(spec, scenes, header, bare, one, *waiting.popleft())


def _judged(
    spec: CheckedSpec, scenes: SceneFile, header: SettledHeader, world: World, rested: Rested, planned: Array, on: Array
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
