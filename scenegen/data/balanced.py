"""Exact scenes, evenly spread over phi: what the default recipes learn from.

The scenes come from the exact samplers, so within a narrow band of phi they follow the true conditional distribution,
and none is a copy of another moved a little. Half of them lie evenly over all that phi can be, from hopeless to solved;
the other half evenly over [-top, top], where the task is nearly or just solved: of experiment 2's range [-2.94, 0.1]
that is a fifteenth, and the part that everyone asks for.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import torch

from scenegen.data.dataset import Dataset, labelled
from scenegen.engine.exact import draw
from scenegen.errors import Diagnostic, RequestError
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.problem import Budget, pose
from scenegen.sampling.rarity import OutOfReach, measure
from scenegen.sampling.request import MAX_SEED, Range

Ends = tuple[float, float]
Array = npt.NDArray[np.float64]
Ranges = dict[str, Range]

JOINTLY = 3  # labels that are balanced together, in the product of their ranges; more are balanced one by one
JOINT_SHARE = 0.7  # of the scenes are balanced jointly, the rest in each label while the others are as they come
MARGIN = 1e-3  # of the range: its very ends have no volume
NARROWER = 0.8  # of the range: a middle that is not narrower than this is not worth a half of its own
ENOUGH = 0.5  # of the scenes that were asked for


def balanced(spec: CheckedSpec, scenes: int, generator: torch.Generator) -> Dataset:
    """`scenes` exact scenes, flat in phi.

    Two or three labels are balanced jointly as far as pruned rejection reaches the combinations of their values, and
    one by one besides; more labels are balanced one by one. What is required holds in all scenes. Raises RequestError
    where a label cannot vary, or too little is in reach.
    """
    seed = int(torch.randint(2**62, (), generator=generator))
    whole = reach(spec, seed)
    found: list[Array] = []
    if 1 < len(whole) <= JOINTLY:
        for ranges, count in _shared(_halves(whole), round(JOINT_SHARE * scenes)):
            found += _draw(spec, ranges, count, seed + len(found), "rejection")
    rest = scenes - sum(part.shape[1] for part in found)
    singles = [ranges for label, ends in whole.items() for ranges in _halves({label: ends})]
    for ranges, count in _shared(singles, rest):
        found += _draw(spec, ranges, count, seed + len(found), "auto")
    rows = np.concatenate(found, axis=1) if found else np.empty((3 * len(spec.objects), 0))
    if rows.shape[1] < ENOUGH * scenes:
        title = f"only {rows.shape[1]:,} of {scenes:,} balanced scenes are in reach"
        raise RequestError(Diagnostic(title, help="ask for fewer --scenes, or train on `--data uniform`"))
    order = torch.randperm(rows.shape[1], generator=generator)
    return labelled(spec, torch.from_numpy(rows).to(torch.float32)[:, order].contiguous())


def _draw(spec: CheckedSpec, ranges: Ranges, count: int, seed: int, method: str) -> list[Array]:
    """The scenes of one request, or as many as are in reach without a clock: time must not decide what is learnt."""
    if not count:
        return []
    problem = pose(spec, ranges, n=count, seed=seed % MAX_SEED)
    try:
        return [draw(problem, Budget(math.inf), method=method).rows]
    except RequestError:
        if method == "auto":
            raise
        return []  # combinations that rejection cannot reach are left to the labels by themselves


def _shared(parts: list[Ranges], scenes: int) -> list[tuple[Ranges, int]]:
    """The scenes in equal shares."""
    ends = [scenes * index // len(parts) for index in range(len(parts) + 1)]
    return [(part, high - low) for part, low, high in zip(parts, ends[:-1], ends[1:], strict=True)]


def _halves(ends: dict[str, Ends]) -> list[Ranges]:
    """All of the ranges, and their middles where those are narrower."""
    middle = {label: _middle(both) for label, both in ends.items()}
    narrow = any(_width(middle[label]) < NARROWER * _width(ends[label]) for label in ends)
    return [{label: Range(*both) for label, both in part.items()} for part in ([ends, middle] if narrow else [ends])]


def reach(spec: CheckedSpec, seed: int) -> dict[str, Ends]:
    """The range of phi of each label that scenes were found to have. Raises RequestError."""
    lowest, highest = spec.box()
    found = measure(spec.core, lowest, highest, spec.labels, seed)
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
