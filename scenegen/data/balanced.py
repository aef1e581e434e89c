"""Exact scenes, evenly spread over phi: what the default recipes learn from.

The scenes come from the exact samplers, and which of them are kept depends on their phi alone: so among the scenes of
any phi they are distributed as the truth is, and none is a copy of another moved a little. Half of them lie evenly over
all that phi can be, from hopeless to solved; the other half evenly over [-top, top], where the task is nearly or just
solved: of experiment 2's range [-2.94, 0.1] that is a fifteenth, and the part that everyone asks for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from scenegen.data.dataset import Dataset, labelled
from scenegen.data.gathering import Gathering
from scenegen.engine.exact import draw
from scenegen.engine.stream import Progress
from scenegen.errors import Diagnostic, RequestError
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.problem import pose
from scenegen.sampling.rarity import OutOfReach, measure
from scenegen.sampling.request import MAX_SEED, Range

Ends = tuple[float, float]
Ranges = dict[str, Range]

MOST = 4096  # joint cells at most: 16 a label for two or three labels, 8 for four, 4 for six, 2 for twelve
PER_LABEL = 16  # cells of one label at most
TOGETHER = 12  # labels that are balanced jointly; further ones by themselves alone
JOINT_SHARE = 0.7  # of the scenes of several labels are balanced jointly, the rest in each label by itself
POOL = 4  # scenes drawn for each that is kept by joint balancing
MARGIN = 1e-3  # of the range: its very ends have no volume
NARROWER = 0.8  # of the range: a middle that is not narrower than this is not worth a half of its own
ENOUGH = 0.5  # of the scenes that were asked for


def balanced(spec: CheckedSpec, scenes: int, generator: torch.Generator, gathering: Gathering | None = None) -> Dataset:
    """`scenes` exact scenes, flat in phi: in each label by itself, and as far as possible in all labels together
    (the first twelve, where there are more).

    What is required holds in all scenes. Raises RequestError where a label cannot vary, or too little is in reach.
    """
    seed = int(torch.randint(2**62, (), generator=generator))
    gathering = gathering or Gathering()
    gathering.begin("measuring the range of phi")
    whole = reach(spec, seed, gathering.check)
    parts = [ranges for label, ends in whole.items() for ranges in _halves({label: ends})]
    wanted = POOL * scenes if len(whole) > 1 else scenes
    found = []
    gathering.begin("gathering scenes", wanted)
    before = 0
    for index, ranges in enumerate(parts):
        count = wanted * (index + 1) // len(parts) - wanted * index // len(parts)
        if count:
            problem = pose(spec, ranges, n=count, seed=(seed + index) % MAX_SEED)
            # no clock: time must not decide what is learnt; it may end the run
            found.append(draw(problem, gathering.budget(), _counted(gathering, before)).rows)
            before += found[-1].shape[1]
            gathering.reach(before)
    rows = torch.from_numpy(np.concatenate(found, axis=1)).to(torch.float32)
    rows = rows[:, torch.randperm(rows.shape[1], generator=generator)]
    if rows.shape[1] < ENOUGH * wanted:
        title = f"only {rows.shape[1]:,} of {wanted:,} scenes for a balanced set are in reach"
        raise RequestError(Diagnostic(title, help="ask for fewer --scenes, or train on `--data uniform`"))
    data = labelled(spec, rows.contiguous())
    if len(whole) > 1:
        kept = _jointly(data.phi, list(whole.values()), min(scenes, len(data)), generator)
        data = Dataset(data.objects, data.labels, data.rows[:, kept].contiguous(), data.phi[:, kept].contiguous())
    return data


def _counted(gathering: Gathering, before: int) -> Progress:
    """Counts the scenes of a part, of which `before` came before."""
    return lambda found, wanted, candidates: gathering.reach(before + found)


def _jointly(phi: Tensor, ends: list[Ends], scenes: int, generator: torch.Generator) -> Tensor:
    """Which of the scenes with phi (L, M), in random order, to keep: most so that the cells of the labels' product get
    equal shares as far as they have them, the rest as they come. Returns indices (scenes,) in random order."""
    together = min(len(ends), TOGETHER)
    per = min(PER_LABEL, int(MOST ** (1.0 / together) + 1e-9))
    cell = torch.zeros(phi.shape[1], dtype=torch.int64)
    for values, (low, high) in zip(phi[:together], ends[:together], strict=True):
        cell = cell * per + ((values - low) / (high - low) * per).long().clamp(0, per - 1)
    _, index, counts = torch.unique(cell, return_inverse=True, return_counts=True)
    order = torch.argsort(index, stable=True)
    within = torch.empty_like(order)
    within[order] = torch.arange(len(order)) - torch.repeat_interleave(counts.cumsum(0) - counts, counts)
    # The first of every cell, then the second of every cell, and so on, until the share is full.
    rank = torch.argsort(within, stable=True)
    first = round(JOINT_SHARE * scenes)
    rest = rank[first:].sort().values[: scenes - first]
    kept = torch.cat([rank[:first], rest])
    return kept[torch.randperm(len(kept), generator=generator)]


def _halves(ends: dict[str, Ends]) -> list[Ranges]:
    """All of the ranges, and their middles where those are narrower."""
    middle = {label: _middle(both) for label, both in ends.items()}
    narrow = any(_width(middle[label]) < NARROWER * _width(ends[label]) for label in ends)
    return [{label: Range(*both) for label, both in part.items()} for part in ([ends, middle] if narrow else [ends])]


def reach(spec: CheckedSpec, seed: int, check: Callable[[], None] | None = None) -> dict[str, Ends]:
    """The range of phi of each label that scenes were found to have; `check` is called now and then. Raises
    RequestError."""
    lowest, highest = spec.box()
    found = measure(spec.core, lowest, highest, spec.labels, seed, check)
    if isinstance(found, OutOfReach):
        raise RequestError(Diagnostic("no scene was found that meets what the spec requires", help="require less"))
    ends = {}
    for label, one in found.reaches.items():
        low, high = one.down.end, one.up.end
        if not low < high:
            title = f"phi of `{label}` is {low:g} in every scene: there is nothing to learn"
            raise RequestError(Diagnostic(title, help="free an object, or drop the label"))
        margin = MARGIN * (high - low)
        ends[label] = (low + margin, high - margin)
    return ends


def _middle(ends: Ends) -> Ends:
    """From -top to top, where both signs occur."""
    low, high = ends
    return (max(low, -high), high) if low < 0.0 < high else ends


def _width(ends: Ends) -> float:
    return ends[1] - ends[0]
