"""Local moves: Metropolis steps that change one object, or a few, and score what touches these alone.

All keep the uniform distribution over the scenes that meet the clauses in force: walks, swaps and rigid motions are
symmetric; for redraws see below. A kind of move and its objects are drawn once for all scenes, steps for each
scene alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.pose import FLAT, PLACE, THETA, X, Y, owner, row_of
from scenegen.sampling.growth.graph import Clause, narrows_any
from scenegen.sampling.growth.insertion import MAX_POSES_AT_ONCE, attempt, choices_after, score_poses
from scenegen.sampling.growth.model import GrowthModel, MoveTally, Particles
from scenegen.sampling.growth.room import FreePoses, SupportPoses, make_room
from scenegen.sampling.growth.support_moves import FINEST_STEP, is_ready, move_with_load, support_moves, switch_support


def reinsert(particles: Particles, thing: int, room: FreePoses | SupportPoses, tries: int, tally: MoveTally) -> None:
    """Move one object to one of `tries` poses in its room.

    One try finds a free place in one scene of fifty on a full table, so an object would hardly ever leave the hole in
    which it was placed. The tries of a scene are drawn independently of where the object stands, and one of those that
    meet all clauses is taken (multiple-try Metropolis with independent proposals, Liu et al. 2000): with equal weights
    always, else with the probability that keeps the distribution. Dozens of tries in numpy cost little more than one.
    """
    model, rng, stage = particles.model, particles.rng, particles.stage
    rows = list(model.constraints[thing].rows)
    boxes = room.boxes(particles.scenes, particles.cell, model.effort)
    model.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw(tries, rng)
    value, _ = score_poses(particles, boxes, poses, thing, stage)
    hits = int(np.count_nonzero(value))
    _note(tally, "redraw", thing, value.size, hits)
    if not hits:
        return
    density = boxes.density(particles.scenes[rows][:, None])[0]
    own = np.where(density > 0.0, 1.0 / np.where(density > 0.0, density, 1.0), np.inf)
    tried, column = np.nonzero(value)
    fresh = dict(zip(rows, poses[:, tried, column], strict=True))
    value[tried, column] *= _chances_after(particles, (thing,), fresh, column)
    own *= _chances_now(particles, (thing,))
    which, taken = _choose_try(value, own, rng)
    _put(particles, (thing,), {row: poses[place, which, taken] for place, row in enumerate(rows)}, taken)


def relocate(particles: Particles, group: Sequence[int], tries: int, tally: MoveTally) -> None:
    """Move objects that hang together to one of `tries` places, as they stand to each other."""
    model, rng = particles.model, particles.rng
    graph, cell, count = model.graph, particles.cell, particles.count
    moved: dict[int, Array] = {}
    good = np.ones((tries, count), dtype=bool)
    for axis in PLACE:
        along = [row_of(one, axis) for one in group if row_of(one, axis) in model.constraints[one].rows]
        if not along:
            continue
        low, high = graph.low[along][:, cell], graph.high[along][:, cell]
        step = low[0] + rng.random((tries, count)) * (high[0] - low[0]) - particles.scenes[along[0]]
        for row, least, most in zip(along, low, high, strict=True):
            value = particles.scenes[row] + step
            good &= (value >= least) & (value <= most)
            moved[row] = value
    _drop_violations(particles, group, moved, good)
    hits = int(np.count_nonzero(good))
    _note(tally, "relocate", group[0], good.size, hits)
    if not hits:
        return
    value = good.astype(np.float64)
    tried, column = np.nonzero(good)
    fresh = {row: values[tried, column] for row, values in moved.items()}
    value[tried, column] *= _chances_after(particles, group, fresh, column)
    which, taken = _choose_try(value, _chances_now(particles, group), rng)
    _put(particles, group, {row: values[which, taken] for row, values in moved.items()}, taken)


def _drop_violations(particles: Particles, group: Sequence[int], moved: dict[int, Array], good: Bool) -> None:
    """Take out of `good` (M, P) the places of a group, `moved` row -> (M, P), at which some clause is not met. What
    keeps its members apart stays met, for they move as one."""
    model, cell, scenes, stage = particles.model, particles.cell, particles.scenes, particles.stage
    tried, scene = np.nonzero(good)
    size = max(1, MAX_POSES_AT_ONCE // max(1, len(scenes)))
    for begin in range(0, len(tried), size):
        number, column = tried[begin : begin + size], scene[begin : begin + size]
        for thing in group:
            constraints = model.constraints[thing]
            rows = [moved[row][number, column] if row in moved else scenes[row, column] for row in range(len(scenes))]
            there = cell[column]
            met = constraints.meets(rows, there, stage, model.effort.check)
            left = np.ones(len(column), dtype=bool) if met is None else met.copy()
            model.count(6 * stage, len(column))
            if met is not None:
                model.count_values(constraints.values(len(constraints.clauses_at(stage)), ()), len(column))
            if constraints.layers and left.any():
                x, y, theta = (rows[row_of(thing, axis)] for axis in FLAT)
                constraints.drop_near((x, y, theta), scenes, there, stage, left, column, group)
            good[number[~left], column[~left]] = False
            number, column = number[left], column[left]
            if not len(number):
                break


def _choose_try(value: Array, own: Array, rng: np.random.Generator) -> tuple[Index, Index]:
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


def _try_choices(
    particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index
) -> dict[int, tuple[Bool, Array]]:
    """`choices_after` where `things` stand at rows `fresh` (B,) in scenes `column` (B,)."""
    if not len(column):
        return {}
    rows = [fresh[row] if row in fresh else particles.scenes[row, column] for row in range(len(particles.scenes))]
    return choices_after(particles, things, rows, column)


def _chances_after(particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index) -> Array:
    """The product of the chances of choices, (B,), where `things` stand at rows `fresh` (B,) in scenes `column`."""
    out = np.ones(len(column))
    for _, chances in _try_choices(particles, things, fresh, column).values():
        out *= chances
    return out


def _chances_now(particles: Particles, things: Sequence[int]) -> Array:
    """The same of the scenes as they are, (P,)."""
    out = np.ones(particles.count)
    for index in particles.touching(things):
        out *= particles.chances[index]
    return out


def _put(particles: Particles, things: Sequence[int], fresh: dict[int, Array], column: Index) -> None:
    """Put `things` at rows `fresh` (B,) in scenes `column`, and note what that makes of choices."""
    tables = _try_choices(particles, things, fresh, column)
    for row, values in fresh.items():
        particles.scenes[row, column] = values
    for index, (table, chances) in tables.items():
        known = particles.held[index]
        assert known is not None
        known[:, column] = table
        particles.chances[index, column] = chances


MAX_JUMP_WAYS = 12  # ways that an object may jump between at a time
MAX_CLUSTER_OBJECTS = 40  # objects up to which clusters are looked for
CLUSTER_SCALES = 4.0  # clusters are held together by distances down to the table's width over 2 to this power
FAR_CLUSTER_SHARE = 0.5  # share of their moves that go anywhere: across what lies between two parts of the table


def jump(particles: Particles, thing: int, tally: MoveTally) -> None:
    """Redraw an object where some way of a choice that touches it would have it: a mixture over the ways' rooms,
    which do not depend on where it stands now (an independence move, Tierney 1994)."""
    model, rng = particles.model, particles.rng
    constraints = model.constraints[thing]
    if not constraints.ways:
        return
    index = list(constraints.ways)[int(rng.integers(len(constraints.ways)))]
    placed, switched = set(particles.placed_objects), model.graph.switched  # heights say little of where things are
    asked = [
        tuple(one for one in clauses if thing in one.objects and one.objects <= placed and one.node not in switched)
        for clauses in (model.graph.choices[index].ways[number].clauses for number in constraints.ways[index])
    ]
    branches = [clauses for clauses in asked if clauses]
    if not branches or not narrows_any(model.problem, chain(*branches), constraints.rows):
        return
    if len(branches) > MAX_JUMP_WAYS:
        branches = [branches[k] for k in np.sort(rng.choice(len(branches), MAX_JUMP_WAYS, replace=False))]
    room = _jump_room(model, thing, constraints.clauses_at(particles.stage), branches)
    boxes = room.boxes(particles.scenes, particles.cell, model.effort)
    model.count(6 * len(room.nodes) * len(room.branches), particles.count)
    poses = boxes.draw_evenly(rng)
    before, after = boxes.even_density(particles.scenes[list(constraints.rows)]), boxes.even_density(poses)
    allowed = (after > 0.0) & (rng.random(particles.count) * after < before)
    attempt(particles, (thing,), dict(zip(constraints.rows, poses, strict=True)), allowed, kind="jump", tally=tally)


def _jump_room(
    model: GrowthModel, thing: int, clauses: tuple[Clause, ...], branches: list[tuple[Clause, ...]]
) -> FreePoses:
    key = "jump", thing, len(clauses), *(id(one) for branch in branches for one in branch)
    if key not in model.rooms:
        model.rooms[key] = make_room(model.problem, model.constraints[thing], clauses, branches)
    return model.rooms[key]


def cluster(particles: Particles, tally: MoveTally) -> None:
    """Move all that hangs together with one object, by distances up to a random one, by one step. Taken only where
    nothing else comes so near, so that the way back starts from the same cluster."""
    model, rng = particles.model, particles.rng
    if not model.graph.choices:
        return
    free = model.graph.rows
    things = [thing for thing in particles.placed_objects if row_of(thing, X) in free and row_of(thing, Y) in free]
    if not 2 <= len(things) <= MAX_CLUSTER_OBJECTS:
        return
    x, y = (particles.scenes[[row_of(thing, axis) for thing in things]] for axis in PLACE)
    width = float((model.problem.highest - model.problem.lowest)[row_of(things[0], X)])
    reach = width * 2.0 ** -(1.0 + (CLUSTER_SCALES - 1.0) * rng.random())
    near = (np.abs(x[:, None] - x) <= reach) & (np.abs(y[:, None] - y) <= reach)
    member = np.zeros((len(things), particles.count), dtype=bool)
    member[rng.integers(len(things))] = True
    for _ in range(len(things)):
        more = (near & member).any(axis=1)
        if (more == member).all():
            break
        member = more
    longest = width if rng.random() < FAR_CLUSTER_SHARE else 0.5 * width * 2.0 ** -(CLUSTER_SCALES * rng.random())
    step = (2.0 * rng.random((2, particles.count)) - 1.0) * longest
    new_x, new_y = np.where(member, x + step[0], x), np.where(member, y + step[1], y)
    close = (np.abs(new_x[:, None] - new_x) <= reach) & (np.abs(new_y[:, None] - new_y) <= reach)
    allowed = ~(close & member & ~member[:, None]).any(axis=(0, 1)) & ~member.all(axis=0)
    new: dict[int, Array] = {}
    for place, thing in enumerate(things):
        new[row_of(thing, X)], new[row_of(thing, Y)] = new_x[place], new_y[place]
    attempt(particles, things, new, allowed, kind="cluster", tally=tally)


LIFT_KINDS = ("redraw", "relocate")
MOVE_KINDS = (*LIFT_KINDS, "shift", "turn", "jump", "cluster")
DEFAULT_TRIES = 4  # places tried for an object, before a plan knows better
REDRAWS = 0.25  # redraws of an object for each walk
DEAR = 4.0  # times fewer of them where the room has to be contracted first
JUMPS = 0.25  # jumps between the ways of a choice for each walk
CLUSTERS = 6  # cluster moves in a sweep
TRADES = 2  # trades of places for each object of a small class, with objects of others
MAX_TRADES = 8  # of them in a sweep
SHUFFLES = 0.25  # shuffles of all kin for each sweep
SWAPS = 0.5  # swaps for each object that has kin


@dataclass(frozen=True, slots=True)
class MoveSettings:
    """What a plan freezes: `steps[k]` (FINEST_STEP + 1,) are the odds of the step lengths of object k; `kinds` are the
    kinds of move made besides walks: those of MOVE_KINDS, "hop" (both moves of supports), "swap c" and "shuffle c" for
    class c of kin; None: all but shuffles. `redraws` and `relocations` are how often an object, and all that hangs from
    it, is lifted for each of its turns, and how many places are tried then; `jumps` is how often an object jumps
    between the ways of a choice."""

    steps: Mapping[int, Array]
    kinds: tuple[str, ...] | None = None
    redraws: Mapping[int, tuple[float, int]] = field(default_factory=dict)
    relocations: Mapping[int, tuple[float, int]] = field(default_factory=dict)
    jumps: float = JUMPS

    def makes(self, kind: str) -> bool:
        return not kind.startswith("shuffle") if self.kinds is None else kind in self.kinds

    def odds(self, thing: int) -> Array:
        found = self.steps.get(thing)
        return np.full(FINEST_STEP + 1, 1.0 / (FINEST_STEP + 1)) if found is None else found


def sweep(
    particles: Particles, settings: MoveSettings, tally: MoveTally | None = None, most: int | None = None
) -> float:
    """Every placed object gets its turn, or `most` of them; returns the mean share of scenes that took a walk."""
    tally = MoveTally() if tally is None else tally
    model, rng, placed = particles.model, particles.rng, particles.placed_objects
    taken = 0.0
    hopping = [one for one in support_moves(model) if settings.makes("hop") and is_ready(particles, one)]
    hoppers = {one.thing for one in hopping if one.choice is not None}  # a hop redraws them, and needs no contraction
    hoppers -= model.graph.stands.keys()
    turns = rng.permutation(len(placed))[:most]
    for place in turns:
        thing = placed[place]
        taken += _walk(particles, thing, settings, tally)
        room = model.room(thing, particles.stage)
        often, tries = settings.redraws.get(thing, (REDRAWS / DEAR if room.nodes else REDRAWS, DEFAULT_TRIES))
        if settings.makes("redraw") and thing not in hoppers and rng.random() < often:
            reinsert(particles, thing, room, tries, tally)
        group = [one for one in model.groups[thing] if model.at[one] <= particles.stage]
        if len(group) > 1 and settings.makes("shift"):
            _shift(particles, thing, group, settings, tally)
        if len(group) > 1 and settings.makes("turn"):
            _turn(particles, thing, group, tally)
        often, tries = settings.relocations.get(thing, (REDRAWS, DEFAULT_TRIES))
        if len(group) > 1 and settings.makes("relocate") and rng.random() < often:
            relocate(particles, group, tries, tally)
        if settings.makes("jump") and thing not in model.graph.stands and rng.random() < settings.jumps:
            jump(particles, thing, tally)
    if settings.makes("cluster"):
        for _ in range(CLUSTERS):
            cluster(particles, tally)
    for one in hopping:
        switch_support(particles, one, tally)
        move_with_load(particles, one, tally)
    for index, kin in enumerate(model.kin):
        here = [block for block in kin if all(model.at[thing] <= particles.stage for thing in block)]
        if len(here) < 2:
            continue
        if settings.makes(f"shuffle {index}"):
            if rng.random() < SHUFFLES:
                order = rng.random((len(here), particles.count)).argsort(axis=0)
                _trade(particles, here, order, f"shuffle {index}", tally)
        elif settings.makes(f"swap {index}"):
            for _ in range(max(1, int(min(len(here), len(turns)) * SWAPS))):
                first, second = rng.choice(len(here), size=2, replace=False)
                _swap(particles, here[first], here[second], f"swap {index}", tally)
    for index, (few, others) in enumerate(model.mixed):
        kind = f"trade {index}"
        if settings.makes(kind):
            _trades(particles, few, others, kind, tally)
    return taken / max(1, len(turns))


def _walk(particles: Particles, thing: int, settings: MoveSettings, tally: MoveTally) -> float:
    model, rng = particles.model, particles.rng
    rows = [row for row in model.constraints[thing].rows if owner(row) == thing]  # its switch is left to hops
    if len(rows) == 3:  # place and heading together, or one of them
        which = rng.integers(4)
        rows = rows if which < 2 else rows[:2] if which == 2 else rows[2:]
    power = int(rng.choice(FINEST_STEP + 1, p=settings.odds(thing)))
    factor = 0.5 * 2.0 ** (-power + rng.random() - 0.5)
    new = {}
    for row in rows:
        width = _width(particles, row)
        new[row] = particles.scenes[row] + (2.0 * rng.random(particles.count) - 1.0) * (factor * width)
    share = float(attempt(particles, (thing,), new, kind="walk", tally=tally).mean())
    table = tally.steps.setdefault(thing, np.zeros((2, FINEST_STEP + 1)))
    table[0, power] += 1.0
    table[1, power] += share
    return share


def _width(particles: Particles, row: int) -> Array | float:
    graph = particles.model.graph
    if graph.low.shape[1] == 1:
        return float(graph.high[row, 0] - graph.low[row, 0])
    width: Array = (graph.high[row] - graph.low[row])[particles.cell]
    return width


def _swap(particles: Particles, first: tuple[int, ...], second: tuple[int, ...], kind: str, tally: MoveTally) -> None:
    """Two blocks take each other's poses, member by member."""
    _trade(particles, [first, second], np.array([[1], [0]]), kind, tally)


def _trades(particles: Particles, few: Sequence[int], others: Sequence[int], kind: str, tally: MoveTally) -> None:
    """Objects of a small class trade places with others of the same footprints."""
    model, rng = particles.model, particles.rng
    here = [thing for thing in few if model.at[thing] <= particles.stage]
    there = [thing for thing in others if model.at[thing] <= particles.stage]
    if not here or not there:
        return
    for _ in range(min(MAX_TRADES, TRADES * len(here))):
        _swap(particles, (here[rng.integers(len(here))],), (there[rng.integers(len(there))],), kind, tally)


def _trade(particles: Particles, blocks: Sequence[tuple[int, ...]], order: Index, kind: str, tally: MoveTally) -> None:
    """Block i takes the poses of block order[i], (blocks, P) or (blocks, 1)."""
    constraints = particles.model.constraints
    new: dict[int, Array] = {}
    for members in zip(*blocks, strict=True):
        for rows in zip(*(constraints[thing].rows for thing in members), strict=True):
            values = np.take_along_axis(particles.scenes[list(rows)], order, axis=0)
            new.update(zip(rows, values, strict=True))
    attempt(particles, [thing for block in blocks for thing in block], new, kind=kind, tally=tally)


def _shift(particles: Particles, thing: int, group: Sequence[int], settings: MoveSettings, tally: MoveTally) -> None:
    """An object and all that hang from it by one step."""
    rng, count = particles.rng, particles.count
    factor = 0.5 * 2.0 ** -(FINEST_STEP * rng.random())
    new = {}
    constraints = particles.model.constraints
    rows = [[row for one in group for row in constraints[one].rows if row == row_of(one, axis)] for axis in PLACE]
    for along in rows:
        if along:
            width = float((particles.model.problem.highest - particles.model.problem.lowest)[along].min())
            step = (2.0 * rng.random(count) - 1.0) * (factor * width)
            for row in along:
                new[row] = particles.scenes[row] + step
    attempt(particles, tuple(group), new, kind="shift", tally=tally)


def _turn(particles: Particles, thing: int, group: Sequence[int], tally: MoveTally) -> None:
    """All that hang from an object around it, headings included."""
    model, rng = particles.model, particles.rng
    x, y = row_of(thing, X), row_of(thing, Y)
    angle = (2.0 * rng.random(particles.count) - 1.0) * (np.pi * 2.0 ** -(FINEST_STEP * rng.random()))
    cos, sin = np.cos(angle), np.sin(angle)
    new: dict[int, Array] = {}
    for one in group:
        rows = model.constraints[one].rows
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
            if not model.is_circular(row_of(one, THETA)):
                return
            new[row_of(one, THETA)] = particles.scenes[row_of(one, THETA)] + angle
    attempt(particles, tuple(group), new, kind="turn", tally=tally)
