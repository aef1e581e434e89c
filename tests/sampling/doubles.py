"""Wrong samplers that look right: every scene is in the range, the distribution is not the true one.

What tests of distribution are worth is what they say of these.
"""

import numpy as np
import torch

from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import REQUIRE
from scenegen.learn.refine import refine
from scenegen.learn.robustness import Robustness
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest

from .plain import TURN, fits, truth, uniform

HITS = 60  # as many as the paper had for experiment 2
NOISE = 0.02  # metres, and turns
BATCH = 16_384


def projected(case, count, rng, *, level=True):
    """Uniform scenes moved onto phi by Newton steps along its gradient, (3N, count): onto the middle of each range, or
    without `level` onto values drawn uniformly from it. Scenes that do not arrive are dropped."""
    spec = check_text(case.text, "double")
    problem = make_problem(
        spec, SampleRequest({label: Range(*ends) for label, ends in case.ranges.items()}, n=count, spread="base")
    )
    ends = np.array(list(case.ranges.values()))
    kept, found = [], 0
    while found < count:
        rows = uniform(case, BATCH, rng)
        share = np.full((len(ends), BATCH), 0.5) if level else rng.random((len(ends), BATCH))
        low = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share
        high, target = low.copy(), low.copy()
        if REQUIRE in problem.core.labels:
            open_end = np.full((1, BATCH), np.inf)
            low, high = np.concatenate([low, 0.0 * open_end.clip(max=0)]), np.concatenate([high, open_end])
            target = np.concatenate([target, np.full((1, BATCH), 0.01)])
        low, high = low - 1e-9, high + 1e-9
        moved = refine(
            Robustness(problem.core), spec.workspace, *map(torch.from_numpy, (rows, target, low, high))
        ).numpy()
        on = np.abs(case.phi(moved) - target[: len(ends)]).max(axis=0) < 1e-8
        kept.append(moved[:, on & fits(case, moved)])
        found += kept[-1].shape[1]
    return np.concatenate(kept, axis=1)[:, :count]


def perturbed(case, count, rng):
    """A few true scenes, each moved by small noise again and again; what leaves the range or the table is dropped."""
    hits = truth(case, HITS, rng)
    scale = np.tile([NOISE, NOISE, NOISE * TURN], case.objects)[:, None]
    kept, found = [], 0
    while found < count:
        rows = hits[:, rng.integers(HITS, size=BATCH)] + scale * rng.standard_normal((len(hits), BATCH))
        rows[2::3] %= TURN
        on_table = (rows[0::3] >= 0) & (rows[0::3] <= case.size[0]) & (rows[1::3] >= 0) & (rows[1::3] <= case.size[1])
        kept.append(rows[:, on_table.all(axis=0) & fits(case, rows)])
        found += kept[-1].shape[1]
    return np.concatenate(kept, axis=1)[:, :count]


def spread_over_levels(case, count, rng):
    return projected(case, count, rng, level=False)


DOUBLES = {"onto the level": projected, "onto levels of the range": spread_over_levels, "perturbed hits": perturbed}
