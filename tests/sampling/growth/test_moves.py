"""Each kind of move keeps the uniform distribution: scenes of plain rejection stay scenes of plain rejection."""

import numpy as np
import pytest
from scipy import stats

from scenegen.sampling.growth import moves
from scenegen.sampling.growth.insertion import attempt, scored
from scenegen.sampling.growth.machine import MoveTally
from scenegen.sampling.growth.moves import MoveSettings, cluster, jump, reinsert, relocate, sweep
from scenegen.sampling.request import Range

from .made import POSITIVE, anywhere, everything_placed, machine_of, plain, ways_held

COUNT = 2000
DISCS = "object p[3] = cylinder(0.12, 0.1)\nobject q = cylinder(0.12, 0.1)\nrequire noOverlap()\n"
SPECS = {
    "discs": (DISCS + "task: leftOf(p[1], q)", POSITIVE),
    "group": ("closeTo(a, b, 0.3) & closeTo(c, b, 0.3) & angle(a, EAST, 1.0)", POSITIVE),
    "branches": ("closeTo(a, (0.4, 0.5), 0.2) & leftOf(a, b) | closeTo(a, (0.6, 0.5), 0.3) & leftOf(b, a)",
                 {"task": Range(0.02)}),
    "ways": ("(leftOf(a, b) & leftOf(b, c)) | (leftOf(a, c) & leftOf(b, c))", {"task": Range(0.02)}),
    "chains": ("(closeTo(a, b, 0.2) & closeTo(b, c, 0.2)) | (leftOf(a, b) & belowOf(b, c) & closeTo(a, c, 0.4))",
               POSITIVE),
    "sides": ("closeTo(b, a, 0.15) & (leftOf(a, c) & belowOf(c, b) | leftOf(c, a) & belowOf(b, c))", POSITIVE),
    "boxes": ("workspace [0, 0.6] x [0, 0.5]\nobject a = box(0.2, 0.1, 0.1), b = box(0.2, 0.1, 0.1)\n"
              "require noOverlap()\nrequire insideWorkspace()\ntask: farFrom(a, b, 0.0)", POSITIVE),
}  # fmt: skip


def walk(particles):
    for thing in particles.placed:
        moves._walk(particles, thing, MoveSettings({}), MoveTally())


def redraw(particles):
    for thing in particles.placed:
        reinsert(particles, thing, particles.machine.room(thing, particles.stage), 1, MoveTally())


def redraw_of_many(particles):
    for thing in particles.placed:
        reinsert(particles, thing, particles.machine.room(thing, particles.stage), 8, MoveTally())


def relocated(particles):
    for group in particles.machine.groups.values():
        if len(group) > 1:
            relocate(particles, [thing for thing in group if thing in particles.placed], 8, MoveTally())


def shift(particles):
    for thing, group in particles.machine.groups.items():
        if len(group) > 1:
            moves._shift(particles, thing, group, MoveSettings({}), MoveTally())


def turn(particles):
    for thing, group in particles.machine.groups.items():
        if len(group) > 1:
            moves._turn(particles, thing, group, MoveTally())


def swap(particles):
    for kin in particles.machine.kin:
        first, second = particles.rng.choice(len(kin), size=2, replace=False)
        moves._swap(particles, kin[first], kin[second], "swap", MoveTally())


def shuffle(particles):
    for kin in particles.machine.kin:
        moves._shuffle(particles, kin, "shuffle", MoveTally())


def trade(particles):
    for few, others in particles.machine.mixed:
        moves._trades(particles, few, others, "trade", MoveTally())


def jumps(particles):
    for thing in particles.placed:
        jump(particles, thing, MoveTally())


def clusters(particles):
    for _ in range(4):
        cluster(particles, MoveTally())


def everything(particles):
    sweep(particles, MoveSettings({}), MoveTally())


CASES = [
    ("discs", walk), ("discs", redraw), ("discs", redraw_of_many),
    ("discs", swap), ("discs", shuffle), ("discs", trade), ("discs", everything),
    ("group", walk), ("group", redraw), ("group", relocated), ("group", shift), ("group", turn), ("group", everything),
    ("branches", walk), ("branches", redraw), ("branches", redraw_of_many), ("branches", everything),
    ("ways", walk), ("ways", redraw), ("ways", redraw_of_many), ("ways", everything),
    ("ways", jumps),
    ("chains", jumps),
    ("chains", redraw_of_many),
    ("chains", clusters),
    ("chains", everything),
    ("sides", relocated), ("sides", everything),
    ("boxes", walk), ("boxes", redraw), ("boxes", redraw_of_many), ("boxes", swap), ("boxes", everything),
]  # fmt: skip


def views(machine, rows):
    """Coordinates that phi reads, differences of objects, and phi itself."""
    pairs = [(a, b) for a in range(0, len(rows), 3) for b in range(0, a, 3)]
    return [
        *(rows[row] for row in sorted(machine.graph.rows)),
        *(rows[a + axis] - rows[b + axis] for a, b in pairs for axis in (0, 1)),
        *(np.hypot(rows[a] - rows[b], rows[a + 1] - rows[b + 1]) for a, b in pairs),
        machine.problem.phi(rows)[0],
    ]


def p_value(machine, rows, truth):
    seen = zip(views(machine, rows), views(machine, truth), strict=True)
    p = [stats.ks_2samp(one, two, method="asymp").pvalue for one, two in seen]
    return min(p) * len(p)


@pytest.fixture(scope="module")
def made():
    known = {}

    def of(name):
        if name not in known:
            machine = machine_of(*SPECS[name])
            known[name] = machine, plain(machine.problem, COUNT, 1), plain(machine.problem, 2 * COUNT, 2)
        return known[name]

    return of


@pytest.mark.long
@pytest.mark.parametrize(("name", "move"), CASES, ids=[f"{name}-{move.__name__}" for name, move in CASES])
def test_the_uniform_distribution_stays(name, move, made):
    machine, start, truth = made(name)
    particles = everything_placed(machine, start)
    for _ in range(11):
        move(particles)
    rows = particles.scenes
    assert (machine.problem.cells.find(machine.problem.phi(rows)) >= 0).all()
    assert (rows[sorted(machine.graph.rows)] != start[sorted(machine.graph.rows)]).any(axis=0).mean() > 0.3
    assert p_value(machine, rows, truth) > 1e-3
    for index, table in enumerate(particles.held):  # what is remembered of the choices is right
        np.testing.assert_array_equal(table, ways_held(machine, index, rows))


def drifting(particles):
    """Walks whose steps are a little longer to the right."""
    for thing in particles.placed:
        row = 3 * thing
        step = (2.0 * particles.rng.random(particles.count) - 0.9) * 0.1
        attempt(particles, (thing,), {row: particles.scenes[row] + step}, kind="walk", tally=MoveTally())


def careless(particles):
    """Redraws of poses from the room, those that two branches hold twice as often."""
    for thing in particles.placed:
        room = particles.machine.room(thing, particles.stage)
        boxes = room.boxes(particles.scenes, particles.cell, particles.machine.effort)
        poses = boxes.draw(1, particles.rng)[:, 0]
        rows = particles.machine.touch[thing].rows
        new, free = dict(zip(rows, poses, strict=True)), boxes.volumes.sum(axis=0) > 0.0
        attempt(particles, (thing,), new, free, kind="walk", tally=MoveTally())


def greedy(particles):
    """Tries in the room, of which one is taken wherever there is one, however many branches hold it."""
    for thing in particles.placed:
        room = particles.machine.room(thing, particles.stage)
        boxes = room.boxes(particles.scenes, particles.cell, particles.machine.effort)
        poses = boxes.draw(8, particles.rng)
        value, _ = scored(particles, boxes, poses, thing, particles.stage)
        which = value.argmax(axis=0)
        taken = np.flatnonzero(value.max(axis=0) > 0.0)
        for row, values in zip(particles.machine.touch[thing].rows, poses, strict=True):
            particles.scenes[row, taken] = values[which[taken], taken]


@pytest.mark.parametrize(("name", "move"), [("discs", drifting), ("overlapping", careless), ("overlapping", greedy)])
def test_moves_that_do_not_keep_it_are_seen(name, move):
    text = "closeTo(a, (0.4, 0.5), 0.2) | closeTo(a, (0.6, 0.5), 0.3)"
    machine = machine_of(*SPECS[name]) if name in SPECS else machine_of(text)
    particles = everything_placed(machine, plain(machine.problem, COUNT, 1))
    for _ in range(11):
        move(particles)
    assert p_value(machine, particles.scenes, plain(machine.problem, 2 * COUNT, 2)) < 1e-6


@pytest.mark.parametrize("text", [
    "leftOf(a, b) & closeTo(b, c, 0.2) | belowOf(a, b) & closeTo(a, c, 0.2) | leftOf(b, a) & closeTo(c, b, 0.3)",
    "closeTo(a, b, 0.2) | closeTo(b, c, 0.2) | closeTo(a, c, 0.2)",
])  # fmt: skip
@pytest.mark.parametrize("move", [walk, redraw_of_many, jumps, everything])
def test_before_its_last_object_a_choice_counts_by_its_chance(text, move):
    """Two of three objects are placed: scenes that promise more are so much more frequent, and moves keep it so."""
    machine = machine_of(text)
    rng, some = np.random.default_rng(5), 30_000
    promised = everything_placed(machine, anywhere(machine.problem, some), stage=1)
    assert len(np.unique(promised.chances[0])) > 1
    kept = promised.scenes[:, rng.random(some) * promised.chances[0].max() < promised.chances[0]]
    start, truth = kept[:, :COUNT], kept[:, COUNT : 3 * COUNT]
    particles = everything_placed(machine, start, stage=1)
    for _ in range(9):
        move(particles)
    assert (particles.scenes[0] != start[0]).mean() > 0.2
    np.testing.assert_array_equal(particles.held[0], ways_held(machine, 0, particles.scenes, 1))
    placed = [3 * thing + axis for thing in machine.order[:2] for axis in (0, 1)]
    one, two = (np.array([*rows[placed], rows[0] - rows[3], rows[1] - rows[4]]) for rows in (particles.scenes, truth))
    p = [stats.ks_2samp(*pair, method="asymp").pvalue for pair in zip(one, two, strict=True)]
    assert min(p) * len(p) > 1e-3
