"""Which atom decides each label, for many scenes at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor

from scenegen.lang.closest import Closest, least
from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, last_uses
from scenegen.lang.fold import Algebra, fold
from scenegen.pose import THETA
from scenegen.primitives import PRIMITIVES, Footprint, Namespace
from scenegen.primitives.namespace import Turning
from scenegen.robustness.namespace import TORCH

_CHUNK = 32_768


def deciding(core: Core, rows: Tensor) -> Tensor:
    """The node of the atom that decides each label, (3N, B) storage -> (L, B) int64, on the device of `rows`.

    An atom decides where its margin is the label's phi; of several, the first on the way down, as `eval` names it.
    """
    dead = last_uses(core)
    parts = [decided(core, dead, part.__getitem__, part)[1] for part in torch.split(rows, _CHUNK, dim=1)]
    if not parts:
        return torch.empty(len(core.labels), 0, dtype=torch.int64, device=rows.device)
    return torch.cat(parts, dim=1).long()


@torch.no_grad()
def decided(
    core: Core,
    dead: list[list[int]],
    coordinate: Callable[[int], Tensor],
    rows: Tensor,
    closest: Mapping[int, Closest] = MappingProxyType({}),
) -> tuple[Tensor, Tensor]:
    """phi (L, B) of storage (3N, B), and the node of the atom that decides it, (L, B) int32. coordinate(row) is a row
    of the storage. Of the clearances in `closest`, only those that may decide are computed, on the CPU; `dead` is as
    in scenegen.robustness.tape. Which of several atoms decides is then open."""
    values: list[_Value] = []
    algebra = _Winners(coordinate, rows, closest, values)
    fold(core.nodes, algebra, dead=dead, free=algebra.free, values=values)
    found = [values[node] for node in core.labels.values()]
    phi, atoms = ([value.expand(rows.shape[1]) for value in each] for each in zip(*found, strict=True))
    return torch.stack(phi), torch.stack(atoms)


_Value = tuple[Tensor, Tensor]
"""A node's number and, of a formula, the atom that it comes from."""


class _Winners(Algebra[_Value]):
    """See `decided`; `values` are those of the nodes so far."""

    def __init__(
        self,
        coordinate: Callable[[int], Tensor],
        rows: Tensor,
        closest: Mapping[int, Closest],
        values: list[_Value],
    ) -> None:
        self._coordinate, self._rows, self._closest, self._values = coordinate, rows, closest, values
        self._turning = Turning(TORCH)  # each heading is turned once
        self._left_out = {node for some in closest.values() for node in some.nodes}
        self._none = torch.tensor(-1, dtype=torch.int32, device=rows.device)

    def free(self, value: _Value) -> None:
        self._turning.drop(value[0])

    def constant(self, index: int, node: Const) -> _Value:
        return self._rows.new_tensor(node.value), self._none

    def coordinate(self, index: int, node: Coord) -> _Value:
        value = self._coordinate(node.row)
        if node.axis == THETA:
            self._turning.keep(value)
        return value, self._none

    def apply(self, index: int, node: Apply, args: list[_Value]) -> _Value:
        if index in self._left_out:
            return self._none, self._none
        numbers = [number for number, _ in args]
        return PRIMITIVES[node.primitive].evaluate(cast(Namespace, self._turning), *node.shapes, *numbers), self._none

    def atom(self, index: int, node: Atom, margin: _Value) -> _Value:
        return margin[0], torch.tensor(index, dtype=torch.int32, device=self._rows.device)

    def junction(self, index: int, node: Junction, args: list[_Value]) -> _Value:
        if index in self._closest:
            closest = self._closest[index]
            args = [*self._least(closest), *(self._values[arg] for arg in closest.others)]
        (value, winner), *others = args
        for other, its in others:
            better = other < value if node.kind == "min" else other > value
            value, winner = torch.where(better, other, value), torch.where(better, its, winner)
        return value, winner

    def _least(self, closest: Closest) -> list[_Value]:
        """The least clearance with its atom, or all of them."""
        of, gap = self._values, PRIMITIVES["gap"].evaluate

        def of_arrays(a: Footprint, b: Footprint, *numbers: Any) -> Any:
            return gap(TORCH, a, b, *map(torch.from_numpy, numbers)).numpy()

        which = np.full(self._rows.shape[1], closest.atoms[0], np.int32)
        found = least(closest, {arg: of[arg][0].numpy() for arg in closest.needs}, of_arrays, which)
        if found is not None:
            return [(torch.from_numpy(found), torch.from_numpy(which))]
        pairs = [(shapes, pair) for shapes, group in closest.groups for pair in group]
        return [
            (gap(self._turning, *shapes, *(of[arg][0] for arg in pair)), self._none.new_tensor(atom))
            for (shapes, pair), atom in zip(pairs, closest.atoms, strict=True)
        ]
