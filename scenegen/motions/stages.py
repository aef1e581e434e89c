"""The stages that the plan of motions finds, and a piece that goes through them one by one."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import numpy as np

from scenegen.bounds.effort import NEVER, Stop
from scenegen.motions.chains import Chains
from scenegen.motions.problem import Array, MotionProblem
from scenegen.sampling.splitting.chains import Region

STREAM = 11  # random numbers of motions, separate from those of scenes


@dataclass(frozen=True, slots=True)
class Stage:
    """Restrict the chains to a region (None: to none in addition), then make `moves` moves; `mixture` is how often
    each change is made, (K,). `counts` says whether the share that survives is a factor of the probability."""

    region: Region | None
    mixture: Array
    moves: int
    counts: bool = False


def generator(seed: int, piece: int) -> np.random.Generator:
    """Random numbers of piece k; the plan's are those of piece -1, and the pilot has its own."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, STREAM, piece + 2])))


@dataclass(slots=True)
class Begun:
    """A piece after its first `stages` stages. `probability` is its estimate of that of their regions: 0 if no chain
    survived; `taken` is how many moves each chain took in the last stage, on average."""

    chains: Chains
    stages: int = 0
    probability: float = 1.0
    taken: float = 0.0

    def follow(self, stage: Stage) -> None:
        """One more stage. Raises what the chains' `stop` raises."""
        self.stages += 1
        if stage.region is not None and self.probability:
            share = self.chains.narrow(stage.region)
            if stage.counts or not share:
                self.probability *= share
        if self.probability:
            self.taken = self.chains.run(stage.moves, stage.mixture)


def begin(problem: MotionProblem, chains: int, number: int, stop: Stop = NEVER) -> Begun:
    """Piece `number`, of so many chains, before its first stage."""
    return Begun(Chains.start(problem, chains, generator(problem.request.seed, number), stop))


def go_on(stored: bytes, stop: Stop = NEVER) -> Begun:
    """A piece that was begun before, perhaps in another process."""
    begun: Begun = pickle.loads(stored)  # noqa: S301 - from our own process
    begun.chains.stop = stop  # the time that is left is another one now
    return begun
