"""Scenes of a file that differ in how many things there are, as training data of one number: a model has one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenegen.formats.blocks import Block, Reading, counts_in
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import row_count, rows_of
from scenegen.scene.numbers import element, member_of, numbers_in
from scenegen.training.datasets.arrange import order_of, refuse_numbers


def of_member(reading: Reading, spec: CheckedSpec) -> tuple[Reading, str | None]:
    """The scenes with the things that `spec` has, as a file of these alone, and how many things that are, in words; a
    file whose scenes all have the same things as it is. Raises DataError where no scene of the file can have the spec's
    objects."""
    header = reading.header
    if not header.counts:
        return reading, None
    names = [one.name for one in header.objects]
    there = np.array([[name in spec.objects for name in names]])
    try:
        wanted = numbers_in(names, header.counts, there)[:, 0]
    except ValueError:
        order_of(spec, names)  # says what differs
        refuse_numbers(header, "training")
        raise
    member = member_of(header, dict(zip((one.name for one in header.counts), wanted.tolist(), strict=True)))
    here = {one.name for one in member.objects}
    rows = [row for which, name in enumerate(names) if name in here for row in rows_of(which)]
    rows += [row_count(len(names)) + which for which, one in enumerate(header.choosers) if one.name in here]

    def blocks() -> Iterator[Block]:
        for block in reading.blocks:
            mine = np.flatnonzero((counts_in(header, block.rows) == wanted[:, None]).all(axis=0))
            yield Block(block.rows[np.array(rows)[:, None], mine], block.phi[:, mine])

    counted = " and ".join(element(one, number) for one, number in zip(header.counts, wanted.tolist(), strict=True))
    return replace(reading, header=member, blocks=blocks(), count=None), counted
