"""Local moves: Metropolis steps that change one object, or a few, and score what touches these alone.

All keep the uniform distribution over the scenes that meet the clauses in force: walks, swaps and rigid motions are
symmetric; for redraws see below. A kind of move and its objects are drawn once for all scenes, steps for each
scene alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.pose import FLAT, PLACE, THETA, X, Y, owner, row_of
from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.insertion import NUMBERS, attempt, held_of_all, scored
from scenegen.sampling.growth.machine import Machine, MoveTally, Particles, chance
from scenegen.sampling.growth.room import FreePoses, SupportPoses, make_room
from scenegen.sampling.growth.support_moves import carry, hop, hops, ready

# --------------------------------------------------------------------------------------------------------------------
# Moves that lift something off the table and put it down elsewhere: several places are tried in every scene at once.
#
# One try finds a free place in one scene of fifty on a full table, so an object would hardly ever leave the hole in
# which it was placed. The tries of a scene are drawn independently of where the object stands, and one of those that
# meet all clauses is taken (multiple-try Metropolis with independent proposals, Liu et al. 2000): with equal weights
# always, else with the probability that keeps the distribution. Dozens of tries in numpy cost little more than one.


def reinsert(particles: Particles, thing: int, room: FreePoses | SupportPoses, tries: int, tally: MoveTally) -> None:
    """Move one object to one of `tries` poses in its room."""
    machine, rng, stage = particles.machine, particles.rng, particles.stage
    rows = list(machine.touch[thing].rows)
    boxes = room.boxes(particles.scenes, particles.cell, machine.effort)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw(tries, rng)
    value, _ = scored(particles, boxes, poses, thing, stage)
    hits = int(np.count_nonzero(value))
    _note(tally, "redraw", thing, value.size, hits)
    if not hits:
        return
    density = boxes.density(particles.scenes[rows][:, None])[0]
    own = np.where(density > 0.0, 1.0 / np.where(density > 0.0, density, 1.0), np.inf)
    tried, column = np.nonzero(value)
    fresh = dict(zip(rows, poses[:, tried, column], strict=True))
    value[tried, column] *= _chances(particles, (thing,), fresh, column)
    own *= _chances_now(particles, (thing,))
    which, taken = _choose(value, own, rng)
    _set(particles, (thing,), {row: poses[place, which, taken] for place, row in enumerate(rows)}, taken)


def relocate(particles: Particles, group: Sequence[int], tries: int, tally: MoveTally) -> None:
    """Move objects that hang together to one of `tries` places, as they stand to each other."""
    machine, rng = particles.machine, particles.rng
    graph, cell, count = machine.graph, particles.cell, particles.count
    moved: dict[int, Array] = {}
    good = np.ones((tries, count), dtype=bool)
    for axis in PLACE:
        along = [row_of(one, axis) for one in group if row_of(one, axis) in machine.touch[one].rows]
        if not along:
            continue
        low, high = graph.low[along][:, cell], graph.high[along][:, cell]
        step = low[0] + rng.random((tries, count)) * (high[0] - low[0]) - particles.scenes[along[0]]
        for row, least, most in zip(along, low, high, strict=True):
            value = particles.scenes[row] + step
            good &= (value >= least) & (value <= most)
            moved[row] = value
    _keep(particles, group, moved, good)
    hits = int(np.count_nonzero(good))
    _note(tally, "relocate", group[0], good.size, hits)
    if not hits:
        return
    value = good.astype(np.float64)
    tried, column = np.nonzero(good)
    fresh = {row: values[tried, column] for row, values in moved.items()}
    value[tried, column] *= _chances(particles, group, fresh, column)
    which, taken = _choose(value, _chances_now(particles, group), rng)
    _set(particles, group, {row: values[which, taken] for row, values in moved.items()}, taken)


def _keep(particles: Particles, group: Sequence[int], moved: dict[int, Array], good: Bool) -> None:
    """Take out of `good` (M, P) the places of a group, `moved` row -> (M, P), at which some clause is not met. What
    keeps its members apart stays met, for they move as one."""
    machine, cell, scenes, stage = particles.machine, particles.cell, particles.scenes, particles.stage
    tried, scene = np.nonzero(good)
    size = max(1, NUMBERS // max(1, len(scenes)))
    for begin in range(0, len(tried), size):
        number, column = tried[begin : begin + size], scene[begin : begin + size]
        for thing in group:
            touch = machine.touch[thing]
            rows = [moved[row][number, column] if row in moved else scenes[row, column] for row in range(len(scenes))]
            there = cell[column]
            met = touch.meets(rows, there, stage, machine.effort.check)
            left = np.ones(len(column), dtype=bool) if met is None else met.copy()
            machine.count(6 * stage, len(column))
            if met is not None:
                machine.count(len(touch.values(len(touch.in_force(stage)), ()).steps), len(column))
            if touch.layers and left.any():
                x, y, theta = (rows[row_of(thing, axis)] for axis in FLAT)
                touch.clear((x, y, theta), scenes, there, stage, left, column, group)
            good[number[~left], column[~left]] = False
            number, column = number[left], column[left]
            if not len(number):
                break


def _choose(value: Array, own: Array, rng: np.random.Generator) -> tuple[Index, Index]:
    """Which try is taken, and in which scenes one is: `value` (M, P) of the tries, `own` (P,) of how things are."""
    edges = np.cumsum(value, axis=0)
    total = edges[-1]
    which = np.minimum((edges <= rng.random(len(own)) * total).sum(axis=0), len(value) - 1)
    picked = value[which, np.arange(len(own))]
    taken = np.flatnonzero((picked > 0.0) & (rng.random(len(own)) * (total - picked + own) < total))
    return which[taken], taken


def _note(tally: MoveTally, kind: str, thing: int, tried: int, free: int) -> None:
    tally.note(kind, tried, free)
    tally.note(f"{kind} of {thing}", tried, free)


def _tables(
    particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index
) -> dict[int, tuple[Bool, Array]]:
    """For every choice that touches some of the things: which of its ways hold, (W, B), and its chance, (B,), where
    they stand at rows `fresh` (B,) in scenes `column` (B,)."""
    touched = particles.touching(things)
    if not touched or not len(column):
        return {}
    machine, cell, stage = particles.machine, particles.cell[column], particles.stage
    rows = [fresh[row] if row in fresh else particles.scenes[row, column] for row in range(len(particles.scenes))]
    found = {}
    for index, held in zip(touched, held_of_all(machine, touched, rows, cell, stage), strict=True):
        known = particles.held[index]
        assert known is not None
        table = known[:, column]
        table[list(touched[index])] = held
        found[index] = table, chance(table, machine.outlooks[index][:, stage], cell)
    return found


def _chances(particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index) -> Array:
    """The product of the chances of choices, (B,), where `things` stand at rows `fresh` (B,) in scenes `column`."""
    out = np.ones(len(column))
    for _, chances in _tables(particles, things, fresh, column).values():
        out *= chances
    return out


def _chances_now(particles: Particles, things: Sequence[int]) -> Array:
    """The same of the scenes as they are, (P,)."""
    out = np.ones(particles.count)
    for index in particles.touching(things):
        out *= particles.chances[index]
    return out


def _set(particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index) -> None:
    """Put `things` at rows `fresh` (B,) in scenes `column`, and note what that makes of choices."""
    tables = _tables(particles, things, fresh, column)
    for row, values in fresh.items():
        particles.scenes[row, column] = values
    for index, (table, chances) in tables.items():
        known = particles.held[index]
        assert known is not None
        known[:, column] = table
        particles.chances[index, column] = chances


# --------------------------------------------------------------------------------------------------------------------
# Moves between the ways of a choice: an object jumps to where another way puts it, a cluster moves as one.


WAYS = 12  # ways that an object may jump between at a time
LARGEST = 40  # objects up to which clusters are looked for
SCALES = 4.0  # clusters are held together by distances down to the table's width over 2 to this power
FAR = 0.5  # share of their moves that go anywhere: across what lies between two parts of the table


def jump(particles: Particles, thing: int, tally: MoveTally) -> None:
    """Redraw an object where some way of a choice that touches it would have it: a mixture over the ways' rooms,
    which do not depend on where it stands now (an independence move, Tierney 1994)."""
    machine, rng = particles.machine, particles.rng
    touch = machine.touch[thing]
    if not touch.ways:
        return
    index = list(touch.ways)[int(rng.integers(len(touch.ways)))]
    placed, switched = set(particles.placed), machine.graph.switched  # heights say little of where things are
    asked = [
        tuple(one for one in clauses if thing in one.objects and one.objects <= placed and one.node not in switched)
        for clauses in (machine.graph.choices[index].ways[number].clauses for number in touch.ways[index])
    ]
    branches = [clauses for clauses in asked if clauses]
    if not branches:
        return
    if len(branches) > WAYS:
        branches = [branches[k] for k in np.sort(rng.choice(len(branches), WAYS, replace=False))]
    room = _room(machine, thing, touch.in_force(particles.stage), branches)
    boxes = room.boxes(particles.scenes, particles.cell, machine.effort)
    machine.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw_evenly(rng)
    before, after = boxes.even_density(particles.scenes[list(touch.rows)]), boxes.even_density(poses)
    allowed = (after > 0.0) & (rng.random(particles.count) * after < before)
    attempt(particles, (thing,), dict(zip(touch.rows, poses, strict=True)), allowed, kind="jump", tally=tally)


def _room(machine: Machine, thing: int, clauses: tuple[Clause, ...], branches: list[tuple[Clause, ...]]) -> FreePoses:
    key = "jump", thing, len(clauses), *(id(one) for branch in branches for one in branch)
    if key not in machine.rooms:
        machine.rooms[key] = make_room(machine.problem, machine.touch[thing], clauses, branches)
    return machine.rooms[key]


def cluster(particles: Particles, tally: MoveTally) -> None:
    """Move all that hangs together with one object, by distances up to a random one, by one step. Taken only where
    nothing else comes so near, so that the way back starts from the same cluster."""
    machine, rng = particles.machine, particles.rng
    if not machine.graph.choices:
        return
    free = machine.graph.rows
    things = [thing for thing in particles.placed if row_of(thing, X) in free and row_of(thing, Y) in free]
    if not 2 <= len(things) <= LARGEST:
        return
    x, y = (particles.scenes[[row_of(thing, axis) for thing in things]] for axis in PLACE)
    width = float((machine.problem.highest - machine.problem.lowest)[row_of(things[0], X)])
    reach = width * 2.0 ** -(1.0 + (SCALES - 1.0) * rng.random())
    near = (np.abs(x[:, None] - x) <= reach) & (np.abs(y[:, None] - y) <= reach)
    member = np.zeros((len(things), particles.count), dtype=bool)
    member[rng.integers(len(things))] = True
    for _ in range(len(things)):
        more = (near & member).any(axis=1)
        if (more == member).all():
            break
        member = more
    longest = width if rng.random() < FAR else 0.5 * width * 2.0 ** -(SCALES * rng.random())
    step = (2.0 * rng.random((2, particles.count)) - 1.0) * longest
    new_x, new_y = np.where(member, x + step[0], x), np.where(member, y + step[1], y)
    close = (np.abs(new_x[:, None] - new_x) <= reach) & (np.abs(new_y[:, None] - new_y) <= reach)
    allowed = ~(close & member & ~member[:, None]).any(axis=(0, 1)) & ~member.all(axis=0)
    new: dict[int, Array] = {}
    for place, thing in enumerate(things):
        new[row_of(thing, X)], new[row_of(thing, Y)] = new_x[place], new_y[place]
    attempt(particles, things, new, allowed, kind="cluster", tally=tally)


LIFTS = ("redraw", "relocate")
KINDS = (*LIFTS, "shift", "turn", "jump", "cluster")
FINEST = 9  # step lengths go down to the box's over 2 to this power
TRIES = 4  # places tried for an object, before a plan knows better
REDRAWS = 0.25  # redraws of an object for each walk
DEAR = 4.0  # times fewer of them where the room has to be contracted first
JUMPS = 0.25  # jumps between the ways of a choice for each walk
CLUSTERS = 6  # cluster moves in a sweep
TRADES = 2  # trades of places for each object of a small class, with objects of others
MOST_TRADES = 8  # of them in a sweep
SHUFFLES = 0.25  # shuffles of all kin for each sweep
SWAPS = 0.5  # swaps for each object that has kin


@dataclass(frozen=True, slots=True)
class MoveSettings:
    """What a plan freezes: `steps[k]` (FINEST + 1,) are the odds of the step lengths of object k; `kinds` are the kinds
    of move made besides walks: those of KINDS, `hop` (with carrying), `swap c` and `shuffle c` for class c of kin;
    None: all but shuffles. `redraws` and `relocations` are how often an object, and all that hangs from it, is lifted
    for each of its turns, and how many places are tried then; `jumps` is how often an object jumps between the ways of
    a choice."""

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


def sweep(
    particles: Particles, settings: MoveSettings, tally: MoveTally | None = None, most: int | None = None
) -> float:
    """Every placed object gets its turn, or `most` of them; returns the mean share of scenes that took a walk."""
    tally = MoveTally() if tally is None else tally
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


def _walk(particles: Particles, thing: int, settings: MoveSettings, tally: MoveTally) -> float:
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
    share = float(attempt(particles, (thing,), new, kind="walk", tally=tally).mean())
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


def _swap(particles: Particles, first: tuple[int, ...], second: tuple[int, ...], kind: str, tally: MoveTally) -> None:
    """Two blocks take each other's poses, member by member."""
    _trade(particles, [first, second], np.array([[1], [0]]), kind, tally)


def _shuffle(particles: Particles, kin: Sequence[tuple[int, ...]], kind: str, tally: MoveTally) -> None:
    """Blocks of one kind take each other's poses, in a random order for each scene."""
    _trade(particles, kin, particles.rng.random((len(kin), particles.count)).argsort(axis=0), kind, tally)


def _trades(particles: Particles, few: Sequence[int], others: Sequence[int], kind: str, tally: MoveTally) -> None:
    """Objects of a small class trade places with others of the same footprints."""
    machine, rng = particles.machine, particles.rng
    here = [thing for thing in few if machine.at[thing] <= particles.stage]
    there = [thing for thing in others if machine.at[thing] <= particles.stage]
    if not here or not there:
        return
    for _ in range(min(MOST_TRADES, TRADES * len(here))):
        _swap(particles, (here[rng.integers(len(here))],), (there[rng.integers(len(there))],), kind, tally)


def _trade(particles: Particles, blocks: Sequence[tuple[int, ...]], order: Index, kind: str, tally: MoveTally) -> None:
    """Block i takes the poses of block order[i], (blocks, P) or (blocks, 1)."""
    touch = particles.machine.touch
    new: dict[int, Array] = {}
    for members in zip(*blocks, strict=True):
        for rows in zip(*(touch[thing].rows for thing in members), strict=True):
            values = np.take_along_axis(particles.scenes[list(rows)], order, axis=0)
            new.update(zip(rows, values, strict=True))
    attempt(particles, [thing for block in blocks for thing in block], new, kind=kind, tally=tally)


def _shift(particles: Particles, thing: int, group: Sequence[int], settings: MoveSettings, tally: MoveTally) -> None:
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
    attempt(particles, tuple(group), new, kind="shift", tally=tally)


def _turn(particles: Particles, thing: int, group: Sequence[int], tally: MoveTally) -> None:
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
    attempt(particles, tuple(group), new, kind="turn", tally=tally)
