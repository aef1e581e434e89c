"""Where a problem's scenes are measured: against one reference drawn from the truth."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.measure import Array, Values, covered, in_range, ks_distance, rows_of, shares
from experiments.plan import Plan, Sizes
from experiments.problems import Problem
from scenegen.api.sample import sample
from scenegen.api.spec import Spec

REFERENCE = 99  # the seed


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the tables: one set of values per seed. `family` is a model's name, `recipe` its recipe."""

    name: str
    runs: tuple[Values, ...]
    family: str = ""
    recipe: str = ""


@dataclass(frozen=True, slots=True)
class Bench:
    """A problem, how much is measured, and the true scenes (3N, R) that coverage is about."""

    problem: Problem
    spec: Spec
    sizes: Sizes
    seeds: tuple[int, ...]
    reference: Array

    def covered(self, rows: Array) -> float:
        """Coverage of the reference by as many of the scenes (3N, n)."""
        return covered(self.reference, rows)

    def distance(self, rows: Array) -> float:
        """How far the scenes (3N, n) are from the reference in the coordinate in which they are furthest."""
        return ks_distance(self.reference, rows)

    def handed(self, rows: Array, speed: float, asked: int) -> Values:
        """Of scenes (3N, n) that were handed out for the range, at so many a second, where `asked` were wanted."""
        return shares(self.problem, rows, "handed") | {
            "handed": rows.shape[1] / asked,
            "handed_in_range": in_range(self.problem, self.spec, rows),
            "handed_coverage": self.covered(rows),
            "handed_ks": self.distance(rows),
            "handed_speed": speed,
        }


def bench(plan: Plan, problem: Problem) -> Bench:
    """With a reference from the exact sampler."""
    spec = problem.load()
    return Bench(problem, spec, plan.sizes, plan.seeds, truth(spec, problem, plan.sizes.covered, REFERENCE))


def truth(spec: Spec, problem: Problem, count: int, seed: int) -> Array:
    """(3N, count) true scenes with phi as wanted, give or take BAND."""
    return rows_of(sample(spec, problem.band, count, seed=seed, spread="base", workers=1))
