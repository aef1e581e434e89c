"""Where the rows of a spec's members are among those of all objects, where the spec draws how many things there are."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.lang.spec import CheckedSpec
from scenegen.pose import X, row_of, rows_of

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]


def rows_among(spec: CheckedSpec, member: CheckedSpec) -> Index:
    """The rows of a member's storage in that of all objects; switches of choices have rows as objects have."""
    place = {name: number for number, name in enumerate(spec.core.objects)}
    return np.array([row for name in member.core.objects for row in rows_of(place[name])], dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """The members of a spec in their order, with the `rows` of each. `spare` are rows of x of the objects that may be
    missing; each that is there adds its `weight` to the number of the member."""

    specs: tuple[CheckedSpec, ...]
    rows: tuple[Index, ...]
    spare: Index
    weight: Index

    def of(self, rows: Array) -> Iterator[tuple[int, Index]]:
        """The members that B scenes, (3N, B) with NaN for what is not there, are of, and which scenes those are."""
        member = self.weight @ ~np.isnan(rows[self.spare])
        if len(member) == 1:
            yield int(member[0]), np.zeros(1, dtype=np.intp)
            return
        for number in np.unique(member).tolist():
            yield number, np.flatnonzero(member == number)


def members_of(spec: CheckedSpec) -> Members:
    """The members of a spec; of one that draws no numbers itself alone."""
    specs = spec.members or (spec,)
    place = {name: number for number, name in enumerate(spec.core.objects)}
    spare: list[int] = []
    weight: list[int] = []
    for which, one in enumerate(spec.counts):
        further = math.prod(len(other.numbers) for other in spec.counts[which + 1 :])
        for number in range(one.least + 1, one.most + 1):
            if one.assets:  # one of them is there: it alone says the number
                spare.append(row_of(place[f"{one.name}:{one.assets[number - 1]}"], X))
                weight.append(further * (number - 1))
                continue
            spare.append(row_of(place[f"{one.name}[{number}]"], X))
            weight.append(further)
    each = tuple(rows_among(spec, member) for member in specs)
    return Members(specs, each, np.array(spare, dtype=np.intp), np.array(weight, dtype=np.intp))
