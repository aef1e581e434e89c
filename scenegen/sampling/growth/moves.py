"""Local moves: Metropolis steps that change one object, or a few, and score what touches these alone.

All keep the uniform distribution over the scenes that meet the clauses in force: walks, swaps and rigid motions are
symmetric; for redraws see reinsert.py. A kind of move and its objects are drawn once for all scenes, steps for each
scene alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.pose import PLACE, THETA, X, Y, owner, row_of
from scenegen.sampling.growth.attempt import attempt
from scenegen.sampling.growth.choose import cluster, jump
from scenegen.sampling.growth.hop import carry, hop, ready
from scenegen.sampling.growth.particles import Particles
from scenegen.sampling.growth.reinsert import reinsert, relocate
from scenegen.sampling.growth.surfaces import hops
from scenegen.sampling.growth.tally import Tally

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]

LIFTS = ("redraw", "relocate")
KINDS = (*LIFTS, "shift", "turn", "jump", "cluster")
FINEST = 9  # step lengths go down to the box's over 2 to this power
TRIES = 4  # places tried for an object, before a plan knows better
REDRAWS = 0.25  # redraws of an object for each walk
DEAR = 4.0  # times fewer of them where the room has to be contracted first
JUMPS = 0.25  # jumps between the ways of a choice for each walk
CLUSTERS = 6  # cluster moves in a sweep
TRADES = 2  # trades of places for each object of a small class, with objects of others
MOST_TRADES = 8
SHUFFLES = 0.25  # shuffles of all kin for each sweep
SWAPS = 0.5  # swaps for each object that has kin


@dataclass(frozen=True, slots=True)
class Settings:
    """What a plan freezes: `steps[k]` (FINEST + 1,) are the odds of the step lengths of object k; `kinds` are the kinds
    of move made besides walks: those of KINDS, `hop` (with carrying, see hop.py), `swap c` and `shuffle c` for class c
    of kin. None: all but shuffles.
    `redraws` and `relocations` are how often an object, and all that hangs from it, is lifted for each of its turns,
    and how many places are tried then; `jumps` is how often an object jumps between the ways of a choice."""

    steps: Mapping[int, Array]
    kinds: tuple[str, ...] | None = None
    redraws: Mapping[int, tuple[float, int]] = field(default_factory=dict)
    relocations: Mapping[int, tuple[float, int]] = field(default_factory=dict)
    jumps: float = JUMPS

    def makes(self, kind: str) -> bool:
        return not kind.startswith("shuffle") if self.kinds is None else kind in self.kinds

    def odds(self, thing: int) -> Array:
        found = self.steps.get(thing)
        return np.full(FINEST + 1, 1.0 / (FINEST + 1)) if found is None else found


def sweep(particles: Particles, settings: Settings, tally: Tally | None = None, most: int | None = None) -> float:
    """Every placed object gets its turn, or `most` of them; returns the mean share of scenes that took a walk."""
    machine, rng, placed = particles.machine, particles.rng, particles.placed
    taken = 0.0
    hopping = [one for one in hops(machine) if settings.makes("hop") and ready(particles, one)]
    hoppers = {one.thing for one in hopping if one.choice is not None}  # a hop redraws them, and needs no contraction
    hoppers -= machine.graph.stands.keys()
    turns = rng.permutation(len(placed))[:most]
    for place in turns:
        thing = placed[place]
        taken += _walk(particles, thing, settings, tally)
        room = machine.room(thing, particles.stage)
        often, tries = settings.redraws.get(thing, (REDRAWS / DEAR if room.nodes else REDRAWS, TRIES))
        if settings.makes("redraw") and thing not in hoppers and rng.random() < often:
            reinsert(particles, thing, room, tries, tally)
        group = [one for one in machine.groups[thing] if machine.at[one] <= particles.stage]
        if len(group) > 1 and settings.makes("shift"):
            _shift(particles, thing, group, settings, tally)
        if len(group) > 1 and settings.makes("turn"):
            _turn(particles, thing, group, tally)
        often, tries = settings.relocations.get(thing, (REDRAWS, TRIES))
        if len(group) > 1 and settings.makes("relocate") and rng.random() < often:
            relocate(particles, group, tries, tally)
        if settings.makes("jump") and thing not in machine.graph.stands and rng.random() < settings.jumps:
            jump(particles, thing, tally)
    if settings.makes("cluster"):
        for _ in range(CLUSTERS):
            cluster(particles, tally)
    for one in hopping:
        hop(particles, one, tally)
        carry(particles, one, tally)
    for index, kin in enumerate(machine.kin):
        here = [block for block in kin if all(machine.at[thing] <= particles.stage for thing in block)]
        if len(here) < 2:
            continue
        if settings.makes(f"shuffle {index}"):
            if rng.random() < SHUFFLES:
                _shuffle(particles, here, f"shuffle {index}", tally)
        elif settings.makes(f"swap {index}"):
            for _ in range(max(1, int(min(len(here), len(turns)) * SWAPS))):
                first, second = rng.choice(len(here), size=2, replace=False)
                _swap(particles, here[first], here[second], f"swap {index}", tally)
    for index, (few, others) in enumerate(machine.mixed):
        kind = f"trade {index}"
        if settings.makes(kind):
            _trades(particles, few, others, kind, tally)
    return taken / max(1, len(turns))


def _walk(particles: Particles, thing: int, settings: Settings, tally: Tally | None) -> float:
    machine, rng = particles.machine, particles.rng
    rows = [row for row in machine.touch[thing].rows if owner(row) == thing]  # its switch is left to hops
    if len(rows) == 3:  # place and heading together, or one of them
        which = rng.integers(4)
        rows = rows if which < 2 else rows[:2] if which == 2 else rows[2:]
    power = int(rng.choice(FINEST + 1, p=settings.odds(thing)))
    factor = 0.5 * 2.0 ** (-power + rng.random() - 0.5)
    new = {}
    for row in rows:
        width = _width(particles, row)
        new[row] = particles.scenes[row] + (2.0 * rng.random(particles.count) - 1.0) * (factor * width)
    good = attempt(particles, (thing,), new)
    share = float(good.mean())
    if tally is not None:
        tally.note("walk", len(good), int(good.sum()))
        table = tally.steps.setdefault(thing, np.zeros((2, FINEST + 1)))
        table[0, power] += 1.0
        table[1, power] += share
    return share


def _width(particles: Particles, row: int) -> Array | float:
    graph = particles.machine.graph
    if graph.low.shape[1] == 1:
        return float(graph.high[row, 0] - graph.low[row, 0])
    width: Array = (graph.high[row] - graph.low[row])[particles.cell]
    return width


def _swap(
    particles: Particles, first: tuple[int, ...], second: tuple[int, ...], kind: str, tally: Tally | None
) -> None:
    """Two blocks take each other's poses, member by member."""
    _trade(particles, [first, second], np.array([[1], [0]]), kind, tally)


def _shuffle(particles: Particles, kin: Sequence[tuple[int, ...]], kind: str, tally: Tally | None) -> None:
    """Blocks of one kind take each other's poses, in a random order for each scene."""
    _trade(particles, kin, particles.rng.random((len(kin), particles.count)).argsort(axis=0), kind, tally)


def _trades(particles: Particles, few: Sequence[int], others: Sequence[int], kind: str, tally: Tally | None) -> None:
    """Objects of a small class trade places with others of the same footprints."""
    machine, rng = particles.machine, particles.rng
    here = [thing for thing in few if machine.at[thing] <= particles.stage]
    there = [thing for thing in others if machine.at[thing] <= particles.stage]
    if not here or not there:
        return
    for _ in range(min(MOST_TRADES, TRADES * len(here))):
        _swap(particles, (here[rng.integers(len(here))],), (there[rng.integers(len(there))],), kind, tally)


def _trade(
    particles: Particles, blocks: Sequence[tuple[int, ...]], order: Index, kind: str, tally: Tally | None
) -> None:
    """Block i takes the poses of block order[i], (blocks, P) or (blocks, 1)."""
    touch = particles.machine.touch
    new: dict[int, Array] = {}
    for members in zip(*blocks, strict=True):
        for rows in zip(*(touch[thing].rows for thing in members), strict=True):
            values = np.take_along_axis(particles.scenes[list(rows)], order, axis=0)
            new.update(zip(rows, values, strict=True))
    good = attempt(particles, [thing for block in blocks for thing in block], new)
    if tally is not None:
        tally.note(kind, len(good), int(good.sum()))


def _shift(particles: Particles, thing: int, group: Sequence[int], settings: Settings, tally: Tally | None) -> None:
    """An object and all that hang from it by one step."""
    rng, count = particles.rng, particles.count
    factor = 0.5 * 2.0 ** -(FINEST * rng.random())
    new = {}
    touch = particles.machine.touch
    rows = [[row for one in group for row in touch[one].rows if row == row_of(one, axis)] for axis in PLACE]
    for along in rows:
        if along:
            width = float((particles.machine.problem.highest - particles.machine.problem.lowest)[along].min())
            step = (2.0 * rng.random(count) - 1.0) * (factor * width)
            for row in along:
                new[row] = particles.scenes[row] + step
    good = attempt(particles, tuple(group), new)
    if tally is not None:
        tally.note("shift", len(good), int(good.sum()))


def _turn(particles: Particles, thing: int, group: Sequence[int], tally: Tally | None) -> None:
    """All that hang from an object around it, headings included."""
    machine, rng = particles.machine, particles.rng
    x, y = row_of(thing, X), row_of(thing, Y)
    angle = (2.0 * rng.random(particles.count) - 1.0) * (np.pi * 2.0 ** -(FINEST * rng.random()))
    cos, sin = np.cos(angle), np.sin(angle)
    new: dict[int, Array] = {}
    for one in group:
        rows = machine.touch[one].rows
        if one != thing:
            if row_of(one, X) not in rows or row_of(one, Y) not in rows:
                return
            dx, dy = (
                particles.scenes[row_of(one, X)] - particles.scenes[x],
                particles.scenes[row_of(one, Y)] - particles.scenes[y],
            )
            new[row_of(one, X)] = particles.scenes[x] + cos * dx - sin * dy
            new[row_of(one, Y)] = particles.scenes[y] + sin * dx + cos * dy
        if row_of(one, THETA) in rows:
            if not machine.circular(row_of(one, THETA)):
                return
            new[row_of(one, THETA)] = particles.scenes[row_of(one, THETA)] + angle
    good = attempt(particles, tuple(group), new)
    if tally is not None:
        tally.note("turn", len(good), int(good.sum()))
