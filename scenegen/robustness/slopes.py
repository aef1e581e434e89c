"""phi of many scenes, and its gradient where it is wanted, through the atom that decides.

Of a hard min or max only the deciding atom has a gradient, and it reads few objects. So phi is computed without
gradients, which leaves out most clearances of a conjunction of many; then each atom is differentiated by itself, in the
scenes that it decides. Atoms that are alike but for the objects that they speak of are differentiated together.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor

from scenegen.lang.closest import find, last_uses_of
from scenegen.lang.core import Atom, Coord, Core, Node, part
from scenegen.lang.headings import bare_rows
from scenegen.pose import SIZE
from scenegen.robustness.compile import Robustness
from scenegen.robustness.deciding import decided
from scenegen.robustness.headings import coordinates


class Slopes:
    """Of the labels of a core formula, for plain tensors on the CPU."""

    def __init__(self, core: Core) -> None:
        self._core = part(core, tuple(core.labels))
        self._closest = find(self._core)
        self._dead = last_uses_of(self._core, self._closest)
        self._bare = bare_rows(self._core)
        self._forms: dict[tuple[Node, ...], Robustness] = {}
        self._pieces: dict[int, tuple[Robustness, list[int]]] = {}

    def __call__(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """(3N, B) storage -> phi (L, B), and the node of the atom that decides it, (L, B) int32."""
        return decided(self._core, self._dead, coordinates(rows.__getitem__, self._bare), rows, self._closest)

    def gradient(self, rows: Tensor, atoms: Tensor) -> Tensor:
        """The gradients (3N, B) of the margins of atoms (B,), as a call names them, in scenes (3N, B)."""
        order = atoms.argsort(stable=True)
        found, counts = atoms[order].unique_consecutive(return_counts=True)
        together: dict[Robustness, list[tuple[list[int], Tensor]]] = {}
        for atom, scenes in zip(found.tolist(), order.split(counts.tolist()), strict=True):
            form, reads = self._piece(atom)
            together.setdefault(form, []).append((reads, scenes))
        result = torch.zeros_like(rows)
        for form, parts in together.items():
            if not form.objects:
                continue  # a constant
            scenes = torch.cat([some for _, some in parts])
            place = torch.cat([torch.tensor(reads)[:, None].expand(-1, len(some)) for reads, some in parts], dim=1)
            here = rows[place, scenes].requires_grad_()
            with torch.enable_grad():
                margin = form.rows(here, check=False)[0]
            result[place, scenes] = torch.autograd.grad(margin, here, torch.ones_like(margin))[0]
        return result

    def _piece(self, atom: int) -> tuple[Robustness, list[int]]:
        """The margin of an atom as a formula of its own objects alone, which atoms that are alike share; and their rows
        of the storage."""
        if atom not in self._pieces:
            margin = cast(Atom, self._core.nodes[atom]).margin
            alone = part(Core(self._core.nodes, {"": margin}, self._core.objects), [""])
            objects = list(dict.fromkeys(node.object for node in alone.nodes if isinstance(node, Coord)))
            nodes = tuple(
                Coord(objects.index(node.object), node.axis) if isinstance(node, Coord) else node
                for node in alone.nodes
            )
            if nodes not in self._forms:
                names = tuple(self._core.objects[which] for which in objects)
                self._forms[nodes] = Robustness(Core(nodes, {"": len(nodes) - 1}, names))
            reads = [SIZE * which + axis for which in objects for axis in range(SIZE)]
            self._pieces[atom] = self._forms[nodes], reads
        return self._pieces[atom]
