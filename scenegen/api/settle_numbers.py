"""Settling scenes that differ in how many things there are: scenes of the same things together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from scenegen.formats.blocks import Block, counts_in
from scenegen.formats.settled_blocks import POSE, SettledBlock, Touch
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import row_count, rows_of
from scenegen.scene.data import SceneFile
from scenegen.scene.numbers import member_of
from scenegen.scene.settled import SettledHeader

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
