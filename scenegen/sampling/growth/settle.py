"""How long a population is moved once it has grown, and which share of it is worth taking.

Scenes of a common ancestor are alike. Sweeps of moves make them differ; where these take long, it is cheaper to grow a
larger population and to take a random part of it: of N scenes with design effect e, a random part of N / k has only
1 + (e - 1) / k. Which part is taken must not depend on what the scenes are like, nor on their ancestors: copies carry
the weight that their scene had. So a plan follows the design effect from sweep to sweep, and settles for as many as
bring the wanted scenes at the least cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.pose import PLACE, X, Y, row_of
from scenegen.sampling.growth.particles import Particles

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

ALIKE = 1.5  # design effect of common ancestors from which on scenes count as apart
LOST = 0.04  # share of the scenes that may be left out because they share an object's place with another
LONGEST = 400  # sweeps at most
FEW = 4  # sweeps at least
SURE = 12  # sweeps from which on scenes that seem to differ are trusted to do so: a larger population tells more
PAID = 0.4  # share of what all scenes will cost that may be spent to see how many sweeps are best
SET_UP = 0.5  # what a further population costs however small it is, of what one as large as the first one does
NOISE = 1.1  # the design effect is known to about so much
TRIED, HELPED = 0.15, 0.8  # the same, as long as scenes are nearly as much alike as in the beginning
FAR, DEARER, STILL = 4.0, 1.2, 2.0  # times the best number and cost at which the search ends if scenes are still alike


@dataclass(frozen=True, slots=True)
class Settled:
    """`sweeps` are made, then one scene in `thin` is taken at random. `effect` is the design effect of common ancestors
    that is left among all scenes by then, `cost` what a sweep takes, in evaluations."""

    sweeps: int
    thin: float
    effect: float
    cost: float

    @property
    def left(self) -> float:
        """The design effect among the scenes that are taken."""
        return 1.0 + (self.effect - 1.0) / self.thin


def settle(
    particles: Particles,
    sweep: Callable[[], object],
    alike: Callable[[Particles], float],
    grown: float,
    wanted: float,
) -> tuple[Settled, Settled]:
    """What is best for the pieces of a plan, and how the given particles stand in the end: they are its first piece.

    `sweep` moves the particles once, `alike` gives their design effect; growing them took `grown` evaluations, and
    `wanted` scenes are to be had. Sweeps end where the particles themselves are enough, have taken a good part of what
    all wanted scenes will cost, or are far more than the best number and dearer, and the scenes still much alike; of
    their numbers, the one is taken that makes all scenes cheapest, of at least SURE if these are apart in the end.
    """
    machine = particles.machine
    begun, done = machine.work, 0
    best: Settled | None = None
    sure: Settled | None = None
    cheapest, surest, slowest = np.inf, np.inf, 0.0
    while True:
        block = max(1, done // 3)
        for _ in range(block):
            sweep()
        done += block
        if done < FEW:
            continue
        effect = alike(particles)
        thin = max(1.0, (effect - 1.0) / (ALIKE - 1.0), partners(particles) / (2.0 * LOST))
        each = (machine.work - begun) / done
        now = Settled(done, thin, effect, each)
        pieces = wanted * thin / particles.count - 1.0
        rest = 0.0 if pieces <= 0.0 else SET_UP + pieces
        cost = each * done + rest * (grown + each * done)
        if cost < cheapest:
            cheapest, best = cost, now
        if cost < surest and done >= SURE:
            surest, sure = cost, now
        slowest = max(slowest, thin)
        assert best is not None
        spent = (machine.work - begun) / cheapest
        enough = pieces <= 0.0 or (thin <= 1.0 and done >= SURE)
        helps = cost <= NOISE * cheapest  # the last sweeps have made the whole cheaper
        over = done >= LONGEST or (done >= FAR * best.sweeps and cost > DEARER * cheapest and thin >= STILL)
        if enough or over or (not helps and spent > (PAID if thin < HELPED * slowest else TRIED)):
            return ((sure or now) if thin <= 1.0 else best), now


def part_of(cell: Index, thin: float, rng: np.random.Generator) -> Index:
    """One in `thin` of the scenes at random, as many of each cell as that goes: their indices, in random order."""
    order = rng.permutation(len(cell))
    number = np.empty(len(cell), dtype=np.intp)  # of each scene among those of its cell
    by_cell = np.argsort(cell[order], kind="stable")
    sizes = np.bincount(cell[order][by_cell])
    number[by_cell] = np.arange(len(cell)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return order[np.argsort(number, kind="stable")][: int(np.ceil(len(cell) / thin))]


def partners(particles: Particles) -> float:
    """The mean number of other scenes with which a scene shares some object's place."""
    values, scene = _places(particles, np.arange(particles.count))
    shared = np.zeros((particles.count, particles.count), dtype=bool)
    for distance in range(1, len(values)):
        same = np.flatnonzero(values[distance:] == values[:-distance])
        if not len(same):
            break
        shared[scene[same], scene[same + distance]] = True
    np.fill_diagonal(shared, val=False)
    return float((shared | shared.T).sum()) / particles.count


def apart(particles: Particles, order: Index) -> Index:
    """The scenes of `order` that share no object's place with one before them."""
    values, number = _places(particles, order)
    if not len(values):
        return order
    again = np.concatenate([[False], values[1:] == values[:-1]])
    keep = np.ones(len(order), dtype=bool)
    first = number[np.maximum.accumulate(np.where(again, 0, np.arange(len(values))))]
    keep[number[again & (number != first)]] = False
    return order[keep]


def _places(particles: Particles, order: Index) -> tuple[Array, Index]:
    """What tells the place of each placed object in the scenes of `order`, and the number of its scene there, both
    sorted by place, then by number. Moves go by random steps, so equal places are copies."""
    free = particles.machine.graph.rows
    rows = [
        row_of(thing, X if row_of(thing, X) in free else Y)
        for thing in particles.placed
        if any(row_of(thing, axis) in free for axis in PLACE)
    ]
    values = particles.scenes[rows][:, order].ravel()
    number = np.tile(np.arange(len(order)), len(rows))
    sorting = np.lexsort((number, values))
    return values[sorting], number[sorting]
