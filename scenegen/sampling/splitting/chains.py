"""Many Metropolis chains side by side, one array per moving row, and how they are resampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.sampling.cells import Cells
from scenegen.sampling.splitting.chain_state import ChainState, Tape
from scenegen.sampling.splitting.move_registry import MOVES
from scenegen.sampling.splitting.moves import Deck, Draw, Proposal, Tuning, bring_home

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]

_GENERATIONS = 12  # remembered generations of ancestors: the first chains, and later copies at growing intervals


@dataclass(frozen=True, slots=True)
class Region:
    """Where chains may go: phi of every label from `low` to `high`, (L,) each.

    `weights` (cells,) favour cells of the range: chains then follow the base distribution times the weight of their
    cell, and a cell of weight 0 is closed. None if all scenes have the same weight.
    """

    low: Array
    high: Array
    weights: Array | None = None

    def holds(self, phi: Sequence[Array]) -> Mask:
        """Which of B scenes lie within; NaN does not."""
        inside = np.ones(phi[0].shape, dtype=bool)
        for value, low, high in zip(phi, self.low, self.high, strict=True):
            if low > -np.inf:
                inside &= value >= low
            if high < np.inf:
                inside &= value <= high
        return inside

    def weigh(self, phi: Sequence[Array], cells: Cells) -> Array:
        """The weight of B scenes. Those outside the region get an arbitrary weight."""
        assert self.weights is not None
        return self.weights[which_cell(phi, cells)]


def which_cell(phi: Sequence[Array], cells: Cells) -> Index:
    """The cell of B scenes, (B,); scenes out of the range get the nearest cell. Cells have equal widths along a
    label."""
    found = np.zeros(phi[0].shape, dtype=np.intp)
    for label, edge in zip(cells.bounded, cells.edges, strict=True):
        count = len(edge) - 1
        along = (phi[label] - edge[0]) * (count / (edge[-1] - edge[0]))
        along = np.nan_to_num(along, nan=0.0, posinf=count, neginf=0.0)
        found = found * count + np.clip(along, 0, count - 1).astype(np.intp)
    return found


@dataclass(slots=True)
class Chains:
    """P chains: `rows` D arrays (P,), `phi` L arrays (P,). `fresh` marks those that have moved on their own since they
    were last copied or taken. `pool` has the scenes for difference moves; it does not change while these moves use
    it."""

    chain_state: ChainState
    tape: Tape
    cells: Cells
    rng: np.random.Generator
    rows: list[Array]
    phi: list[Array]
    region: Region
    fresh: Mask
    pool: list[Array]
    decks: tuple[Deck, Deck]
    weight: Array | None = None
    evaluations: int = 0
    families: list[Index] = field(default_factory=list)

    @classmethod
    def start(cls, chain_state: ChainState, tape: Tape, cells: Cells, count: int, rng: np.random.Generator) -> Chains:
        """Chains at the base distribution, allowed everywhere."""
        rows = chain_state.draw(count, rng)
        phi = tape(rows)
        anywhere = np.full(len(phi), -np.inf)
        return cls(
            chain_state,
            tape,
            cells,
            rng,
            rows,
            phi,
            Region(anywhere, -anywhere),
            np.ones(count, dtype=bool),
            list(rows),
            _decks(chain_state, rng),
            evaluations=count,
        )

    @property
    def count(self) -> int:
        return len(self.rows[0])

    def some(self, count: int) -> Chains:
        """Independent copies of at most `count` of the chains, spread over all of them."""
        index = np.arange(0, self.count, max(1, self.count // count))[:count]
        weight = None if self.weight is None else self.weight[index]
        return Chains(
            self.chain_state,
            self.tape,
            self.cells,
            self.rng,
            [row[index] for row in self.rows],
            [value[index] for value in self.phi],
            self.region,
            self.fresh[index],
            self.pool,
            _decks(self.chain_state, self.rng),
            weight,
        )

    def narrow(self, region: Region, islands: int = 1) -> float:
        """Restrict the chains to a region: survivors are resampled to the old number in proportion to the change of
        their weight. Returns the share that survived (0: none did, and the chains are unchanged).

        With several islands (blocks of equally many chains), each is refilled from its own survivors only (from all, if
        it has none), so that islands stay independent of each other.
        """
        alive = region.holds(self.phi)
        gain = alive.astype(np.float64)
        if region.weights is not None:
            gain[alive] *= region.weigh([value[alive] for value in self.phi], self.cells)
        if self.weight is not None:
            gain /= self.weight
        total = gain.sum()
        if not total > 0.0:
            return 0.0
        share = float(alive.mean())
        size = self.count // islands
        blocks = []
        for start in range(0, self.count, size):
            own = gain[start : start + size].sum()
            mine, offset = (gain[start : start + size] / own, start) if own > 0.0 else (gain / total, 0)
            blocks.append(_systematic(mine, self.rng, size) + offset)
        self._copy(blocks[0] if islands == 1 else np.concatenate(blocks))
        self.region = region
        self.weight = None if region.weights is None else region.weigh(self.phi, self.cells)
        return share

    def _copy(self, index: Index) -> None:
        self.families.append(np.arange(self.count))
        if len(self.families) > _GENERATIONS:
            self.families = self.families[::2]
        self.rows = [row[index] for row in self.rows]
        self.phi = [value[index] for value in self.phi]
        self.families = [family[index] for family in self.families]
        # The first copy still counts as unique; `index` is in order.
        first = np.ones(self.count, dtype=bool)
        first[1:] = index[1:] != index[:-1]
        self.fresh = self.fresh[index] & first
        self.pool = list(self.rows)

    def move(self, kind: str, tuning: Tuning) -> tuple[float, Proposal]:
        """One move of all chains. Returns the share of chains that took it, and what was proposed."""
        draw = Draw(self.chain_state, *self.decks, self.rows, self.pool, tuning, tuning.scale[kind], self.rng)
        proposal = MOVES[kind](draw)
        if not proposal.rows:
            return 0.0, proposal
        values, taken = bring_home(self.chain_state, proposal)
        rows = list(self.rows)
        for row, value in zip(proposal.rows, values, strict=True):
            rows[row] = value
        phi = self.tape(rows)
        held = self.region.holds(phi)
        taken = held if taken is None else taken & held
        if self.weight is not None:
            weight = self.region.weigh(phi, self.cells)
            taken &= self.rng.random(self.count) * self.weight < weight
            self.weight = np.where(taken, weight, self.weight)
        for row in proposal.rows:
            self.rows[row] = np.where(taken, rows[row], self.rows[row])
        self.phi = [np.where(taken, new, old) for new, old in zip(phi, self.phi, strict=True)]
        if proposal.parting:
            self.fresh |= taken
        self.evaluations += self.count
        return float(np.count_nonzero(taken)) / self.count, proposal

    def run(self, moves: int, tuning: Tuning) -> float:
        """That many moves by the frozen tuning; returns the mean acceptance rate."""
        kinds = list(tuning.weight)
        weights = np.fromiter(tuning.weight.values(), dtype=np.float64)
        # Systematic resampling: in any run each kind gets its rounded share, and is never left out by chance.
        chosen = self.rng.permutation(_systematic(weights / weights.sum(), self.rng, moves))
        return float(np.mean([self.move(kinds[kind], tuning)[0] for kind in chosen])) if moves else 0.0

    def reflect(self, tuning: Tuning) -> None:
        """Each of the tuning's mirrors once, in random order."""
        for index in self.rng.permutation(len(tuning.mirrors)):
            self.move(tuning.mirrors[index], tuning)

    def take(self) -> Index:
        """The chains to take a scene from now: those that have moved since they were last taken or copied."""
        index = np.flatnonzero(self.fresh)
        self.fresh = np.zeros(self.count, dtype=bool)
        return index


def _systematic(share: Array, rng: np.random.Generator, count: int) -> Index:
    """`count` indices drawn with the given probabilities, by systematic resampling (Kitagawa 1996), in order."""
    place = np.cumsum(share)
    place *= count / place[-1]
    points = np.arange(count) + rng.random()
    return np.minimum(np.searchsorted(place, points, side="right"), len(share) - 1).astype(np.intp)


def _decks(chain_state: ChainState, rng: np.random.Generator) -> tuple[Deck, Deck]:
    return Deck(chain_state.dimension, rng), Deck(len(chain_state.parts), rng)
