"""Exact scenes, evenly spread over phi: what the default recipes learn from.

The scenes come from the exact samplers, and which of them are kept depends on their phi alone: so among the scenes of
any phi they are distributed as the truth is, and none is a copy of another moved a little. Half of them lie evenly over
all that phi can be, from hopeless to solved; the other half evenly over [-top, top], where the task is nearly or just
solved: of experiment 2's range [-2.94, 0.1] that is a fifteenth, and the part that everyone asks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sized
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from scenegen.bounds.effort import StoppedError
from scenegen.engine.run import BESIDE, in_memory
from scenegen.errors import RequestError
from scenegen.errors.models import NOTHING_TO_LEARN, RARE_SCENES, TOO_FEW_BALANCED
from scenegen.lang.spec import CheckedSpec
from scenegen.models.examples import EVERY
from scenegen.sampling.auto import choose
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rarity import measure
from scenegen.sampling.request import MAX_SEED, Progress, Range, SampleRequest
from scenegen.sampling.tails import Rarity
from scenegen.sampling.vast import measure_vast
from scenegen.training.datasets.dataset import Dataset, labelled
from scenegen.training.datasets.gathering import Gathering

Ends = tuple[float, float]
Ranges = dict[str, Range]

MOST = 4096  # joint cells at most: 16 a label for two or three labels, 8 for four, 4 for six, 2 for twelve
PER_LABEL = 16  # cells of one label at most
TOGETHER = 12  # labels that are balanced jointly; further ones by themselves alone
JOINT_SHARE, MANY_SHARE = 0.5, 0.25  # of the scenes of two, and of more labels, are balanced jointly, the others by one
POOL = 3  # scenes drawn for each that is kept by joint balancing
MARGIN = 1e-3  # of the range: its very ends have no volume
NARROWER = 0.8  # of the range: a middle that is not narrower than this is not worth a half of its own
FEWEST = 4_000  # scenes of a part, however rare
WORK = 1 << 36  # visits of nodes that the parts may take together: some 100 s on one core
ENOUGH = 0.5  # of the scenes that were asked for


def balanced(spec: CheckedSpec, scenes: int, generator: torch.Generator, gathering: Gathering | None = None) -> Dataset:
    """`scenes` exact scenes, flat in phi: in each label by itself, and as far as possible in all labels together
    (the first twelve, where there are more).

    What is required holds in all scenes. Raises RequestError where a label cannot vary, or too little is in reach.
    """
    seed = int(torch.randint(2**62, (), generator=generator))
    gathering = gathering or Gathering()
    gathering.begin("measuring the range of phi")
    whole = reach(spec, seed, gathering.check, gathering.until)
    parts = [(place, ranges) for place, (label, ends) in enumerate(whole.items()) for ranges in _halves({label: ends})]
    share = round(_joint_share(whole) * scenes)
    wanted = scenes - share + POOL * share
    asked, found, origin = wanted, [], []
    gathering.begin("gathering scenes", wanted)
    before = 0
    for index, (place, ranges) in enumerate(parts):
        count = wanted * (index + 1) // len(parts) - wanted * index // len(parts)
        if count:
            plan = _planned(spec, ranges, count, (seed + index) % MAX_SEED, WORK // len(parts), gathering)
            wanted -= count - plan.wanted
            # no clock: time must not decide what is learnt; it may end the run
            found.append(in_memory(plan, gathering.budget(), _counted(gathering, before)).rows)
            origin.append(torch.full((found[-1].shape[1],), place))
            before += found[-1].shape[1]
            gathering.reach(before)
    rows = torch.from_numpy(np.concatenate(found, axis=1)).to(torch.float32)
    order = torch.randperm(rows.shape[1], generator=generator)
    rows = rows[:, order]
    if rows.shape[1] < ENOUGH * wanted:
        raise RequestError(TOO_FEW_BALANCED(found=rows.shape[1], wanted=wanted))
    data = labelled(spec, rows.contiguous())
    if len(whole) == 1:
        return data
    data = replace(data, balanced=torch.cat(origin)[order])
    scenes = min(scenes, round(scenes * len(data) / asked))
    kept, joint = _jointly(data.phi, list(whole.values()), scenes, generator)
    data = data.take(kept)
    assert data.balanced is not None
    return replace(data, balanced=torch.where(joint, torch.full_like(data.balanced, EVERY), data.balanced))


def _planned(spec: CheckedSpec, ranges: Ranges, count: int, seed: int, work: int, gathering: Gathering) -> Plan:
    """A plan for `count` scenes, or for as many as that much work is good for: what takes more is rare, and is learnt
    from fewer scenes."""
    request, budget = SampleRequest(ranges, count, seed, workers=1), gathering.budget()
    problem = make_problem(spec, request, budget)
    try:
        plan = choose(problem, budget)
    except RequestError:
        gathering.check()
        raise
    needed = plan.evaluations * (len(problem.core.nodes) + BESIDE)
    fewer = max(min(count, FEWEST), int(count * work / max(needed, 1.0)))
    if fewer >= count:
        return plan
    gathering.note(RARE_SCENES(labels=", ".join(ranges), fewer=fewer, count=count))
    return choose(make_problem(spec, replace(request, n=fewer), budget), budget)


def _counted(gathering: Gathering, before: int) -> Progress:
    """Counts the scenes of a part, of which `before` came before."""
    return lambda found, wanted, candidates: gathering.reach(before + found)


def _jointly(phi: Tensor, ends: list[Ends], scenes: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Which of the scenes with phi (L, M), in random order, to keep: some as they come, and of all others so many from
    each cell of the labels' product that the cells are filled as evenly as scenes allow. Returns indices (scenes,) in
    random order, and which of them are of the second kind."""
    share = round(_joint_share(ends) * scenes)
    plain = scenes - share  # chosen first: what thinning leaves over lacks the rare cells
    rest = phi[:, plain:]
    together = min(len(ends), TOGETHER)
    per = min(PER_LABEL, int(MOST ** (1.0 / together) + 1e-9))
    cell = torch.zeros(rest.shape[1], dtype=torch.int64)
    for values, (low, high) in zip(rest[:together], ends[:together], strict=True):
        cell = cell * per + ((values - low) / (high - low) * per).long().clamp(0, per - 1)
    _, index, counts = torch.unique(cell, return_inverse=True, return_counts=True)
    order = torch.argsort(index, stable=True)
    within = torch.empty_like(order)
    within[order] = torch.arange(len(order)) - torch.repeat_interleave(counts.cumsum(0) - counts, counts)
    # The first of every cell, then the second of every cell, and so on, until the share is full.
    thinned = plain + torch.argsort(within, stable=True)[:share]
    kept = torch.cat([torch.arange(plain), thinned])
    mixed = torch.randperm(len(kept), generator=generator)
    return kept[mixed], mixed >= plain


def _joint_share(labels: Sized) -> float:
    return 0.0 if len(labels) == 1 else JOINT_SHARE if len(labels) == 2 else MANY_SHARE


def _halves(ends: dict[str, Ends]) -> list[Ranges]:
    """All of the ranges, and their middles where those are narrower."""
    middles = {label: middle(both) for label, both in ends.items()}
    narrow = any(_width(middles[label]) < NARROWER * _width(ends[label]) for label in ends)
    return [{label: Range(*both) for label, both in part.items()} for part in ([ends, middles] if narrow else [ends])]


def reach(
    spec: CheckedSpec, seed: int, check: Callable[[], None] | None = None, deadline: float = math.inf
) -> dict[str, Ends]:
    """The range of phi of each label that scenes were found to have; `check` is called now and then, and must raise
    after the `deadline`, by the monotonic clock. Raises RequestError."""
    found = _measured(spec, seed, check, deadline)
    ends = {}
    for label, one in found.reaches.items():
        low, high = one.down.end, one.up.end
        if not low < high:
            raise RequestError(NOTHING_TO_LEARN(label=label, value=low))
        margin = MARGIN * (high - low)
        top = high - margin
        if top <= 0.0 < high:  # phi of `restsOn` ends at a millimetre: scenes that satisfy it stay in reach
            top = high * (1.0 - MARGIN)
        ends[label] = (low + margin, top)
    return ends


def _measured(spec: CheckedSpec, seed: int, check: Callable[[], None] | None, deadline: float) -> Rarity:
    """By chains, or by growth where these do not change surfaces, or find no scene that meets what is required."""
    if not spec.choices:
        lowest, highest = spec.box()
        found = measure(spec.core, lowest, highest, spec.labels, seed, check)
        if isinstance(found, Rarity):
            return found
    try:
        return measure_vast(spec, spec.labels, seed, deadline=deadline)
    except StoppedError:
        if check is not None:
            check()
        raise


def middle(ends: Ends) -> Ends:
    """From -top to top, where both signs occur."""
    low, high = ends
    return (max(low, -high), high) if low < 0.0 < high else ends


def _width(ends: Ends) -> float:
    return ends[1] - ends[0]
