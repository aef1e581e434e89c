"""Which atom decides each label, for many scenes at once."""

from __future__ import annotations

import torch
from torch import Tensor

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, last_uses
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
    values: list[Tensor | None] = [None] * len(core.nodes)
    winners: list[Tensor | None] = [None] * len(core.nodes)
    for index, node in enumerate(core.nodes):
        match node:
            case Const(value):
                values[index] = rows.new_tensor(value)
            case Coord():
                values[index] = rows[node.row]
            case Apply(primitive, args, shapes):
                values[index] = PRIMITIVES[primitive].evaluate(TORCH, *shapes, *(values[arg] for arg in args))
            case Atom(margin):
                values[index] = values[margin]
                winners[index] = torch.tensor(index, device=rows.device)
            case Junction(kind, args):
                values[index], winners[index] = _fold(kind, args, values, winners)
        for child in dead[index]:
            values[child] = winners[child] = None
    found = [winners[node] for node in core.labels.values()]
    return torch.stack([winner.expand(rows.shape[1]) for winner in found if winner is not None])


def _fold(
    kind: str, args: tuple[int, ...], values: list[Tensor | None], winners: list[Tensor | None]
) -> tuple[Tensor, Tensor]:
    value, winner = values[args[0]], winners[args[0]]
    assert value is not None and winner is not None
    for arg in args[1:]:
        other, its = values[arg], winners[arg]
        assert other is not None and its is not None
        better = other < value if kind == "min" else other > value
        value, winner = torch.where(better, other, value), torch.where(better, its, winner)
    return value, winner
