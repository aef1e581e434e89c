"""Branches: which atom decides phi of each label.

phi is a tree of min and max over atoms, so on a level set exactly one atom of each label has the wanted value: the set
is a union of faces, one for each atom that can decide. A network that knows which face to draw from has a simple
piece to learn, with one atom to hold at the value and the others on the right side of it; which face is drawn, and how
often, is a table of its own that no adversary and no regression can collapse. For disjunctions (experiment 3) a face
lies in one disjunct, so none is lost. Where objects stand on one of several surfaces, which ones these are is part of
the branch: the choice is drawn from the table, and is an input of the network.
"""

from __future__ import annotations

import torch
from torch import Tensor

from scenegen.lang.spec import CheckedSpec
from scenegen.pose import X, row_of
from scenegen.robustness.deciding import deciding

MOST = 96  # branches of a model; rarer ones share the last
OTHER = -1  # in a table of branches: no atom is known to decide


def ways_of(spec: CheckedSpec, rows: Tensor) -> Tensor:
    """What makes the branch of each scene of (3N, M) storage, (W, M) int64: of each label the node of the atom that
    decides it, and of each choice of the spec which surface it is."""
    found = [deciding(spec.core, rows)]
    for choice in spec.choices.values():
        ends = torch.tensor(choice.ends[:-1], dtype=rows.dtype)
        found.append(torch.bucketize(rows[row_of(choice.switch, X)].contiguous(), ends, right=True)[None])
    return torch.cat(found)


def survey(spec: CheckedSpec, rows: Tensor) -> tuple[Tensor, Tensor]:
    """The branch of each scene and what the branches are: (M,) int64 and (K, W) int64, most frequent first. Where there
    are more than MOST, the last stands for all the rest and holds OTHER."""
    ways, index, counts = torch.unique(ways_of(spec, rows).T, dim=0, return_inverse=True, return_counts=True)
    order = torch.sort(counts, descending=True, stable=True).indices
    place = torch.empty_like(order)
    place[order] = torch.arange(len(order), device=order.device)
    branch, table = place[index], ways[order]
    if len(table) > MOST:
        branch = branch.clamp_max(MOST - 1)
        table = torch.cat([table[: MOST - 1], torch.full_like(table[:1], OTHER)])
    return branch, table
