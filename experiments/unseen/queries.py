"""What a model of a random spec is asked for, and the truth that its scenes are held against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from experiments.unseen.patience import CpuBudget
from scenegen.errors import RequestError
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest

Array = npt.NDArray[np.float64]
Ends = Mapping[str, tuple[float, float]]

QUANTILES = (0.2, 0.5, 0.8)  # of phi in a balanced training set: far from solved, nearly, solved
JOINT = 3  # joint values of two labels
SCENES = 2000  # that are compared with as many
HALF, SHARE = 0.0125, 0.01  # half the width of a band: metres or radians at most, and of the label's range
PATIENCE = 60.0  # CPU seconds for the truth of a query; what takes longer is reported as not measured


@dataclass(frozen=True, slots=True)
class Query:
    """Wanted phi by label; labels that are not named are free. `half` is half the width of each label's band."""

    wanted: Mapping[str, float]
    half: Mapping[str, float]

    def __str__(self) -> str:
        return ", ".join(f"{label} {value:.4g}" for label, value in self.wanted.items())

    @property
    def ranges(self) -> dict[str, Range]:
        return {
            label: Range(value - self.half[label], value + self.half[label]) for label, value in self.wanted.items()
        }


def queries(spec: CheckedSpec, reach: Ends, seed: int, patience: float = PATIENCE) -> tuple[list[Query], list[str]]:
    """Three quantiles of each label, and joint values of each two labels that follow each other; and which joint values
    were not found, and why. `reach` has the ends of each label's phi."""
    half = {label: min(HALF, SHARE * (high - low)) for label, (low, high) in reach.items()}
    found = [Query({label: value}, half) for label, ends in reach.items() for value in quantiles(ends)]
    missing = []
    for one, other in zip(spec.labels, spec.labels[1:], strict=False):
        for index, value in enumerate(quantiles(reach[one])[:JOINT]):
            query = Query({one: value}, half)
            try:
                _, phi = truth(spec, query, 16, seed + index, patience)
            except RequestError as error:
                missing.append(f"{query} and a value of {other}: {error.diagnostics[0].title}")
                continue
            second = np.sort(phi[spec.labels.index(other)])
            found.append(Query({one: value, other: float(second[(4, 8, 11)[index % 3]])}, half))
    return found, missing


def middle(ends: tuple[float, float]) -> tuple[float, float]:
    """From -top to top, where both signs occur."""
    low, high = ends
    return (max(low, -high), high) if low < 0.0 < high else ends


def quantiles(ends: tuple[float, float]) -> list[float]:
    """Of a distribution that is half uniform over the ends and half over their middle."""
    places = np.linspace(*ends, 2001)
    low, high = middle(ends)
    rank = 0.5 * (places - ends[0]) / (ends[1] - ends[0]) + 0.5 * np.clip((places - low) / (high - low), 0.0, 1.0)
    return [float(np.interp(share, rank, places)) for share in QUANTILES]


def truth(spec: CheckedSpec, query: Query, count: int, seed: int, patience: float = PATIENCE) -> tuple[Array, Array]:
    """Exact scenes (3N, count) in the bands of a query, in random order, and their phi (L, count). Raises RequestError
    where they are too rare to be had in so many CPU seconds."""
    problem = make_problem(spec, SampleRequest(query.ranges, count, seed, spread="base"))
    sampled = draw(problem, CpuBudget(patience))
    if sampled.shortfall is not None:
        raise RequestError(sampled.shortfall)
    order = np.random.default_rng(seed).permutation(sampled.count)
    return sampled.rows[:, order], sampled.phi[: len(spec.labels), order]
