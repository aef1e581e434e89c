"""Graphs of many specs as one, for a network that learns from all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import torch
from torch import Tensor

from scenegen.learn.models.graph import TENSORS, AlikeAtoms, FormulaGraph, MarginForm, join_alike
from scenegen.pose import SIZE


def union(graphs: Sequence[FormulaGraph]) -> FormulaGraph:
    """The disjoint union: all that the graphs hold, one after another. `ranks` stay those in each spec."""

    def firsts(sizes: Sequence[int]) -> list[int]:
        return [0, *accumulate(sizes)][:-1]

    objects, atoms = firsts([one.objects for one in graphs]), firsts([one.atoms for one in graphs])
    junctions, labels = firsts([one.junctions for one in graphs]), firsts([one.labels for one in graphs])
    ties = firsts([len(one.ties) for one in graphs])
    forms: dict[MarginForm, list[AlikeAtoms]] = {}
    for one, atom, thing, tie in zip(graphs, atoms, objects, ties, strict=True):
        for form, alike in one.forms.items():
            moved = AlikeAtoms(alike.atoms + atom, alike.reads + SIZE * thing, alike.numbers, alike.ties + tie)
            forms.setdefault(form, []).append(moved)

    def moved_by(name: str, *shifts: list[int]) -> Tensor:
        """A table of indices, each column shifted by where its graph begins."""
        parts = [getattr(one, name) for one in graphs]
        columns = torch.tensor(list(zip(*shifts, strict=True)))
        return torch.cat(
            [part + (shift if part.ndim == 2 else shift[0]) for part, shift in zip(parts, columns, strict=True)]
        )

    things = torch.cat([one.carrier for one in graphs])
    begins = torch.tensor(objects).repeat_interleave(torch.tensor([one.objects for one in graphs]))
    shifted = {
        "ties": moved_by("ties", atoms, objects, [0] * len(graphs)),
        "below": moved_by("below", atoms, junctions),
        "roots": moved_by("roots", atoms, labels),
        "label_of": moved_by("label_of", labels),
        "carrier": torch.where(things >= 0, things + begins, things),
        "carried": moved_by("carried", ties, ties),
        "spec": moved_by("spec", list(range(len(graphs)))),
    }
    others = [name for name in TENSORS if name not in shifted]
    return FormulaGraph(
        **shifted,
        **{name: torch.cat([getattr(one, name) for one in graphs]) for name in others},
        members=tuple(mine + atom for one, atom in zip(graphs, atoms, strict=True) for mine in one.members),
        ranks=tuple(rank for one in graphs for rank in one.ranks),
        specs=len(graphs),
        storeys=max(one.storeys for one in graphs),
        forms={form: join_alike(found) for form, found in forms.items()},
    )
