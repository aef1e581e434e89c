"""Observations of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from scenegen.curriculum.moves import headings_of
from scenegen.lang.members import members_of
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import LENGTHS, NAMES, SIZE, THETA, X, axis_of, owner, row_of

Array = npt.NDArray[np.float64]

ONE = np.float32(1.0)


@dataclass(frozen=True, slots=True)
class Views:
    """Observations of a scene, float32 in [-1, 1]: for every object that the spec does not fix, x and y, from edge to
    edge of the workspace, and if phi or the requirement depends on its heading, the heading's cosine and sine; last,
    for every object that stands on one of several surfaces, which, as `on_numbers` say. `names` are their names:
    `mug.x`, `mug.y`, `knife.cos`, ..., `mug.on`.

    An object that may be missing has a further one, `block[4].present`, 1 if it is there; if not, all its numbers are
    0. `spare` are the rows of x of these objects."""

    places: npt.NDArray[np.intp]
    middle: Array
    scale: Array
    turned: npt.NDArray[np.intp]
    order: npt.NDArray[np.intp]
    spare: npt.NDArray[np.intp]
    names: tuple[str, ...]
    switches: tuple[Switch, ...]
    on_numbers: Mapping[str, float]

    def space(self) -> spaces.Box:
        return spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def __call__(self, rows: Array) -> npt.NDArray[np.float32]:
        """(3N, B) -> (B, K)."""
        seen_at = (rows[self.places] - self.middle) * self.scale
        for place, ends, numbers in self.switches:
            on = rows[self.places[place]]
            seen_at[place] = np.where(np.isnan(on), np.nan, numbers[np.searchsorted(ends, on)])
        if len(self.turned) or len(self.spare):
            theta, here = rows[self.turned], ~np.isnan(rows[self.spare])
            seen_at = np.concatenate([seen_at, np.cos(theta), np.sin(theta), here])[self.order]
        if len(self.spare):
            seen_at = np.where(np.isnan(seen_at), 0.0, seen_at)
        seen = np.ascontiguousarray(seen_at.T, dtype=np.float32)
        np.minimum(seen, ONE, out=seen)
        return np.maximum(seen, -ONE, out=seen)


Switch = tuple[int, Array, Array]
"""A row of the observations; up to which number of the switch each surface goes, but the last; what each is seen as."""


def on_numbers(spec: CheckedSpec) -> dict[str, float]:
    """What each surface is seen as that a choice of the spec names, by its name: the same for all objects, evenly from
    -1 to 1 in the order in which the spec names them."""
    names = list(dict.fromkeys(one.name for which in sorted(spec.choices) for one in spec.choices[which].options))
    return dict(zip(names, np.linspace(-1.0, 1.0, len(names)).tolist(), strict=True))


def make_views(spec: CheckedSpec) -> Views:
    """The observations for scenes of a spec."""
    depends = headings_of(spec, requirement=True)
    free = [index for index in range(len(spec.objects)) if index not in spec.fixed]
    places = [row_of(index, axis) for index in free for axis in LENGTHS]
    turned = [row_of(index, THETA) for index in free if index in depends]
    low, high = spec.box()
    shown = {choice.switch: spec.objects[which] for which, choice in spec.choices.items()}
    numbers = on_numbers(spec)
    switches = tuple(
        (place, np.array(one.ends[:-1]), np.array([numbers[each.name] for each in one.options]))
        for place, one in enumerate(spec.choices.values(), len(places))
    )
    places += [row_of(switch, X) for switch in shown]
    spare = [int(row) for row in members_of(spec).spare if owner(int(row)) in free]
    keys = [(owner(row), axis_of(row)) for row in places] + [(owner(row), SIZE + k) for k in range(2) for row in turned]
    keys += [(owner(row), SIZE + 2) for row in spare]
    order = sorted(range(len(keys)), key=lambda place: keys[place])
    called = (*NAMES, "cos", "sin", "present")
    names = tuple(
        f"{shown[thing]}.on" if thing in shown else f"{spec.objects[thing]}.{called[axis]}"
        for thing, axis in (keys[k] for k in order)
    )
    at = np.array(places, dtype=np.intp)
    middle, half = (low[at] + high[at]) / 2.0, (high[at] - low[at]) / 2.0
    turned_ = np.array(turned, dtype=np.intp)
    return Views(
        at,
        middle[:, None],
        1.0 / half[:, None],
        turned_,
        np.array(order, dtype=np.intp),
        np.array(spare, dtype=np.intp),
        names,
        switches,
        numbers,
    )
