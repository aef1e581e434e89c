"""The stages that the plan of a splitting run finds, and a piece that goes through them one by one."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import numpy as np

from scenegen.bounds.effort import NEVER, Stop
from scenegen.sampling.problem import Problem
from scenegen.sampling.splitting.chain_state import Tape, frame_of
from scenegen.sampling.splitting.chains import Chains, Region
from scenegen.sampling.splitting.moves import Tuning

SPLIT = 4  # random stream of splitting (plan and pieces), separate from those of base draws and rejection


@dataclass(frozen=True, slots=True)
class Stage:
    """Restrict the chains to `region`, then make `moves` moves by `tuning`. `counts` says whether the share that
    survives is a factor of the probability: not between cells."""

    region: Region
    tuning: Tuning
    moves: int
    counts: bool


@dataclass(slots=True)
class Begun:
    """A piece after its first `stages` stages. `probability` is its estimate of that of their regions: 0 if no chain
    survived."""

    chains: Chains
    stages: int = 0
    probability: float = 1.0

    def follow(self, stage: Stage) -> None:
        """One more stage. Raises what `stop` raises."""
        self.stages += 1
        share = self.chains.narrow(stage.region) if self.probability else 0.0
        if stage.counts or not share:
            self.probability *= share
        if share:
            self.chains.run(stage.moves, stage.tuning)


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, SPLIT, piece + 1])))


def begin(problem: Problem, chains: int, number: int, stop: Stop = NEVER) -> Begun:
    """Piece `number`, of so many chains, before its first stage."""
    frame = frame_of(problem)
    rng = generator(problem.request.seed, number)
    return Begun(Chains.start(frame, Tape(frame, stop=stop), problem.cells, chains, rng))


def go_on(stored: bytes, stop: Stop = NEVER) -> Begun:
    """A piece that was begun before, perhaps in another process."""
    begun: Begun = pickle.loads(stored)  # noqa: S301 - from our own process
    begun.chains.tape = Tape(begun.chains.chain_state, stop=stop)  # the time that is left is another one now
    return begun
