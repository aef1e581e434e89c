"""Exact scenes of random specs, as many as training takes, and batches of them."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from experiments.any.union import union
from experiments.unseen.patience import CpuBudget
from experiments.unseen.queries import middle
from scenegen.api.spec import parse
from scenegen.errors import ScenegenError
from scenegen.geometry import PRIMITIVES
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.frames import frames_of
from scenegen.learn.models.graph import FormulaGraph, graph_of
from scenegen.learn.robustness import Robustness
from scenegen.learn.robustness.deciding import deciding_atoms
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import StoppedError

KNOWN = " ".join(sorted(PRIMITIVES))  # what new weights know
SCENES = 192  # of each range of each label: all of phi, what `middle` says of it, and as they occur
FEWEST = 16  # of these, or the range is left out
PATIENCE = 1.0  # CPU seconds for a range; what takes longer is left out
MOST_ATOMS = 120  # of a spec that is learnt from
ALONE = 0.4  # of the scenes with several labels: only the label that they were drawn by is told
OTHERS = 0.5  # chance that another is told as well, in the rest
BANDS = ((0.0, 0.34), (0.33, 0.67), (0.66, 1.0), (0.9, 1.0))  # of the scenes of a range by phi, each in its frames


@dataclass(frozen=True, slots=True)
class Lesson:
    """Exact scenes of a spec: rows (3N, M), phi (L, M) with that of what is required, the deciding atoms (L, M) as
    places among the graph's, and the label (M,) that each scene was drawn by. `parts` are graphs in frames and the
    scenes that they hold."""

    parts: tuple[tuple[FormulaGraph, Tensor], ...]
    rows: Tensor
    phi: Tensor
    deciders: Tensor
    by: Tensor


def lesson(text: str, seed: int = 0) -> Lesson | None:
    """The scenes of a spec; None where it means nothing, is too large, or its scenes are too rare."""
    try:
        spec = parse(text).checked
    except ScenegenError:
        return None
    frames = frames_of(spec)
    graph = graph_of(frames, KNOWN)
    if not 0 < graph.atoms <= MOST_ATOMS:
        return None
    parts: list[tuple[Tensor, int]] = []
    for place, label in enumerate(spec.labels):
        whole = exact(spec, {label: Range(None, None)}, seed)
        if whole is None:
            continue
        phi = Robustness(spec.core).rows(whole)[place]
        low, high = float(phi.min()), float(phi.max())
        if not low < high:
            continue
        ranges = {Range(low, high), Range(*middle((low, high)))}
        parts += [(found, place) for ends in ranges if (found := exact(spec, {label: ends}, seed)) is not None]
    if not parts:
        return None
    rows = torch.cat([part for part, _ in parts], 1)
    by = torch.cat([torch.full((part.shape[1],), place) for part, place in parts])
    with torch.no_grad():
        phi = Robustness(frames.core).rows(rows)
    framed, first = list[tuple[FormulaGraph, Tensor]](), 0
    for part, place in parts:
        order = first + torch.argsort(phi[place, first : first + part.shape[1]])
        first += len(order)
        framed.append((graph, order))
        for begin, end in BANDS:
            band = order[int(begin * len(order)) : max(1, int(end * len(order)))]
            ends = float(phi[place, band[0]]), float(phi[place, band[-1]])
            framed.append((graph.in_frames(frames, {spec.labels[place]: ends}), band))
    return Lesson(tuple(framed), rows, phi, graph.places(deciding_atoms(frames.core, rows)), by)


def exact(spec: CheckedSpec, ranges: dict[str, Range], seed: int) -> Tensor | None:
    """Exact scenes (3N, SCENES) float32, flat in the ranges; None where they are too rare."""
    budget = CpuBudget(PATIENCE)
    try:
        problem = make_problem(spec, SampleRequest(ranges, SCENES, seed, spread="flat", workers=1), budget)
        found = draw(problem, budget)
    except (ScenegenError, StoppedError):
        return None
    return torch.from_numpy(np.ascontiguousarray(found.rows)).float() if found.count >= FEWEST else None


class Stream:
    """Mutable: the lessons so far; `next` is the number of the next spec."""

    def __init__(self, text: Callable[[int], str], begin: int = 0) -> None:
        self._text = text
        self.next = begin
        self.lessons: list[Lesson] = []

    def grow(self, count: int) -> None:
        """So many further lessons."""
        while count > 0:
            found = lesson(self._text(self.next))
            self.next += 1
            if found is not None:
                self.lessons.append(found)
                count -= 1

    def batch(
        self, specs: int, scenes: int, choice: random.Random, generator: torch.Generator
    ) -> tuple[FormulaGraph, Tensor, Tensor, Tensor]:
        """The union of some graphs, and scenes of each: rows (3N, B), what is wanted and which atoms decide, (L, B)."""
        chosen = choice.sample(self.lessons, specs)
        parts = [choice.choice(one.parts) for one in chosen]
        rows, wanted, deciders, first = [], [], [], 0
        for one, (graph, held) in zip(chosen, parts, strict=True):
            some = held[torch.randint(len(held), (scenes,), generator=generator)]
            rows.append(one.rows[:, some])
            wanted.append(_told(one, some, generator))
            mine = one.deciders[:, some]
            deciders.append(torch.where(mine >= 0, mine + first, mine))
            first += graph.atoms
        return union([graph for graph, _ in parts]), torch.cat(rows), torch.cat(wanted), torch.cat(deciders)


def _told(one: Lesson, some: Tensor, generator: torch.Generator) -> Tensor:
    """phi (L, B) of some scenes with NaN where it is not told; of what is required it never is."""
    labels, count = len(one.phi), len(some)
    more = torch.rand(1, count, generator=generator) >= ALONE
    told = (torch.rand(labels, count, generator=generator) < OTHERS) & more
    told[one.by[some], torch.arange(count)] = True
    told &= ~one.parts[0][0].required[:, None]
    return torch.where(told, one.phi[:, some], torch.nan)
