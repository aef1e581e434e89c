"""Which atom decides each label, for many scenes at once."""

from __future__ import annotations

import torch
from torch import Tensor

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, last_uses
from scenegen.lang.fold import Algebra, fold
from scenegen.primitives import PRIMITIVES
from scenegen.robustness.namespace import TORCH

_CHUNK = 32_768


def deciding(core: Core, rows: Tensor) -> Tensor:
    """The node of the atom that decides each label, (3N, B) storage -> (L, B) int64, on the device of `rows`.

    An atom decides where its margin is the label's phi; of several, the first on the way down, as `eval` names it.
    """
    dead = last_uses(core)
    parts = [_chunk(core, dead, part) for part in torch.split(rows, _CHUNK, dim=1)]
    return torch.cat(parts, dim=1) if parts else torch.empty(len(core.labels), 0, dtype=torch.int64, device=rows.device)


@torch.no_grad()
def _chunk(core: Core, dead: list[list[int]], rows: Tensor) -> Tensor:
    values = fold(core.nodes, _Winners(rows), dead=dead)
    found = [values[node][1] for node in core.labels.values()]
    return torch.stack([atom.expand(rows.shape[1]) for atom in found if atom is not None])


_Value = tuple[Tensor, Tensor | None]
"""A node's number and, of a formula, the atom that it comes from."""


class _Winners(Algebra[_Value]):
    def __init__(self, rows: Tensor) -> None:
        self._rows = rows

    def constant(self, index: int, node: Const) -> _Value:
        return self._rows.new_tensor(node.value), None

    def coordinate(self, index: int, node: Coord) -> _Value:
        return self._rows[node.row], None

    def apply(self, index: int, node: Apply, args: list[_Value]) -> _Value:
        numbers = [number for number, _ in args]
        return PRIMITIVES[node.primitive].evaluate(TORCH, *node.shapes, *numbers), None

    def atom(self, index: int, node: Atom, margin: _Value) -> _Value:
        return margin[0], torch.tensor(index, device=self._rows.device)

    def junction(self, index: int, node: Junction, args: list[_Value]) -> _Value:
        (value, winner), *others = args
        assert winner is not None
        for other, its in others:
            assert its is not None
            better = other < value if node.kind == "min" else other > value
            value, winner = torch.where(better, other, value), torch.where(better, its, winner)
        return value, winner
