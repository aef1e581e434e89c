"""Proposers for tests, good and bad; they pickle, and load torch when they propose."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.learn.guided import make_plan
from scenegen.sampling.engine.run import in_memory
from scenegen.search.effort import Budget


@dataclass(frozen=True)
class Uniform:
    """Uniform scenes over a box of poses, whatever phi is wanted."""

    box: tuple
    name: str = "uniform"
    digest: str = "uniform"

    info = {}  # noqa: RUF012
    regions = ()

    def mix(self, rows, ends, box, seed, stop=None):
        return rows

    def __call__(self, phi, generator, stop=None):
        from scenegen.learn.refine import draw

        return draw(*self.box, phi.shape[1], generator)


@dataclass(frozen=True)
class Constant:
    """The same scene each time."""

    columns: tuple
    name: str = "hopeless"
    digest: str = "hopeless"

    info = {}  # noqa: RUF012
    regions = ()

    def mix(self, rows, ends, box, seed, stop=None):
        return rows

    def __call__(self, phi, generator, stop=None):
        import torch

        return torch.tensor(self.columns, dtype=torch.float32)[:, None].expand(-1, phi.shape[1]).clone()


def guided(problem, proposer, budget=None):
    """What comes of a proposer's scenes."""
    budget = Budget() if budget is None else budget
    return in_memory(make_plan(problem, budget, proposer), budget)
