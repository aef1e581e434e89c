"""Each kind of move keeps the uniform distribution: scenes of plain rejection stay scenes of plain rejection. Lifting
objects off the table: how often it is worth it, and that copies part by it. How long a population is moved, and
which part of it is taken. Growth changes what things stand on, and moves what carries together with what it
carries, without a bias.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.sampling.growth import moves
from scenegen.sampling.growth.insertion import attempt, score_poses
from scenegen.sampling.growth.model import MoveTally
from scenegen.sampling.growth.moves import MoveSettings, cluster, jump, reinsert, relocate, sweep
from scenegen.sampling.growth.population import (
    ALIKE_EFFECT,
    MAX_LIFT_TRIES,
    REDRAWN,
    RELOCATED,
    TRUSTED_SWEEPS,
    AncestorEffect,
    distinct_particles,
    pick_part,
    settle,
    shared_places,
    tempered_shares,
)
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
    for thing in particles.placed_objects:
        moves._walk(particles, thing, MoveSettings({}), MoveTally())


def redraw(particles):
    for thing in particles.placed_objects:
        reinsert(particles, thing, particles.model.room(thing, particles.stage), 1, MoveTally())


def redraw_of_many(particles):
    for thing in particles.placed_objects:
        reinsert(particles, thing, particles.model.room(thing, particles.stage), 8, MoveTally())


def relocated(particles):
    for group in particles.model.groups.values():
        if len(group) > 1:
            relocate(particles, [thing for thing in group if thing in particles.placed_objects], 8, MoveTally())


def shift(particles):
    for thing, group in particles.model.groups.items():
        if len(group) > 1:
            moves._shift(particles, thing, group, MoveSettings({}), MoveTally())


def turn(particles):
    for thing, group in particles.model.groups.items():
        if len(group) > 1:
            moves._turn(particles, thing, group, MoveTally())


def swap(particles):
    for kin in particles.model.kin:
        first, second = particles.rng.choice(len(kin), size=2, replace=False)
        moves._swap(particles, kin[first], kin[second], "swap", MoveTally())


def shuffle(particles):
    for kin in particles.model.kin:
        order = particles.rng.random((len(kin), particles.count)).argsort(axis=0)
        moves._trade(particles, kin, order, "shuffle", MoveTally())


def trade(particles):
    for few, others in particles.model.mixed:
        moves._trades(particles, few, others, "trade", MoveTally())


def jumps(particles):
    for thing in particles.placed_objects:
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


def views(model, rows):
    """Coordinates that phi reads, differences of objects, and phi itself."""
    pairs = [(a, b) for a in range(0, len(rows), 3) for b in range(0, a, 3)]
    return [
        *(rows[row] for row in sorted(model.graph.rows)),
        *(rows[a + axis] - rows[b + axis] for a, b in pairs for axis in (0, 1)),
        *(np.hypot(rows[a] - rows[b], rows[a + 1] - rows[b + 1]) for a, b in pairs),
        model.problem.phi(rows)[0],
    ]


def p_value(model, rows, truth):
    seen = zip(views(model, rows), views(model, truth), strict=True)
    p = [stats.ks_2samp(one, two, method="asymp").pvalue for one, two in seen]
    return min(p) * len(p)


@pytest.fixture(scope="module")
def made():
    known = {}

    def of(name):
        if name not in known:
            model = machine_of(*SPECS[name])
            known[name] = model, plain(model.problem, COUNT, 1), plain(model.problem, 2 * COUNT, 2)
        return known[name]

    return of


@pytest.mark.long
@pytest.mark.parametrize(("name", "move"), CASES, ids=[f"{name}-{move.__name__}" for name, move in CASES])
def test_the_uniform_distribution_stays(name, move, made):
    model, start, truth = made(name)
    particles = everything_placed(model, start)
    for _ in range(11):
        move(particles)
    rows = particles.scenes
    assert (model.problem.cells.find(model.problem.phi(rows)) >= 0).all()
    assert (rows[sorted(model.graph.rows)] != start[sorted(model.graph.rows)]).any(axis=0).mean() > 0.3
    assert p_value(model, rows, truth) > 1e-3
    for index, table in enumerate(particles.held):  # what is remembered of the choices is right
        np.testing.assert_array_equal(table, ways_held(model, index, rows))


def drifting(particles):
    """Walks whose steps are a little longer to the right."""
    for thing in particles.placed_objects:
        row = 3 * thing
        step = (2.0 * particles.rng.random(particles.count) - 0.9) * 0.1
        attempt(particles, (thing,), {row: particles.scenes[row] + step}, kind="walk", tally=MoveTally())


def careless(particles):
    """Redraws of poses from the room, those that two branches hold twice as often."""
    for thing in particles.placed_objects:
        room = particles.model.room(thing, particles.stage)
        boxes = room.boxes(particles.scenes, particles.cell, particles.model.effort)
        poses = boxes.draw(1, particles.rng)[:, 0]
        rows = particles.model.constraints[thing].rows
        new, free = dict(zip(rows, poses, strict=True)), boxes.volumes.sum(axis=0) > 0.0
        attempt(particles, (thing,), new, free, kind="walk", tally=MoveTally())


def greedy(particles):
    """Tries in the room, of which one is taken wherever there is one, however many branches hold it."""
    for thing in particles.placed_objects:
        room = particles.model.room(thing, particles.stage)
        boxes = room.boxes(particles.scenes, particles.cell, particles.model.effort)
        poses = boxes.draw(8, particles.rng)
        value, _ = score_poses(particles, boxes, poses, thing, particles.stage)
        which = value.argmax(axis=0)
        taken = np.flatnonzero(value.max(axis=0) > 0.0)
        for row, values in zip(particles.model.constraints[thing].rows, poses, strict=True):
            particles.scenes[row, taken] = values[which[taken], taken]


@pytest.mark.parametrize(("name", "move"), [("discs", drifting), ("overlapping", careless), ("overlapping", greedy)])
def test_moves_that_do_not_keep_it_are_seen(name, move):
    text = "closeTo(a, (0.4, 0.5), 0.2) | closeTo(a, (0.6, 0.5), 0.3)"
    model = machine_of(*SPECS[name]) if name in SPECS else machine_of(text)
    particles = everything_placed(model, plain(model.problem, COUNT, 1))
    for _ in range(11):
        move(particles)
    assert p_value(model, particles.scenes, plain(model.problem, 2 * COUNT, 2)) < 1e-6


@pytest.mark.parametrize("text", [
    "leftOf(a, b) & closeTo(b, c, 0.2) | belowOf(a, b) & closeTo(a, c, 0.2) | leftOf(b, a) & closeTo(c, b, 0.3)",
    "closeTo(a, b, 0.2) | closeTo(b, c, 0.2) | closeTo(a, c, 0.2)",
])  # fmt: skip
@pytest.mark.parametrize("move", [walk, redraw_of_many, jumps, everything])
def test_before_its_last_object_a_choice_counts_by_its_chance(text, move):
    """Two of three objects are placed: scenes that promise more are so much more frequent, and moves keep it so."""
    model = machine_of(text)
    rng, some = np.random.default_rng(5), 30_000
    promised = everything_placed(model, anywhere(model.problem, some), stage=1)
    assert len(np.unique(promised.chances[0])) > 1
    kept = promised.scenes[:, rng.random(some) * promised.chances[0].max() < promised.chances[0]]
    start, truth = kept[:, :COUNT], kept[:, COUNT : 3 * COUNT]
    particles = everything_placed(model, start, stage=1)
    for _ in range(9):
        move(particles)
    assert (particles.scenes[0] != start[0]).mean() > 0.2
    np.testing.assert_array_equal(particles.held[0], ways_held(model, 0, particles.scenes, 1))
    placed = [3 * thing + axis for thing in model.order[:2] for axis in (0, 1)]
    one, two = (np.array([*rows[placed], rows[0] - rows[3], rows[1] - rows[4]]) for rows in (particles.scenes, truth))
    p = [stats.ks_2samp(*pair, method="asymp").pvalue for pair in zip(one, two, strict=True)]
    assert min(p) * len(p) > 1e-3


TWO_SETTINGS = """
object plate[2] = cylinder(0.13, 0.02), fork[2] = box(0.02, 0.2, 0.01)
require noOverlap()
task: forall i in 1..2: leftOf(fork[i], plate[i]) & closeTo(fork[i], plate[i], 0.2)
"""


def test_many_places_are_tried_where_few_are_free():
    often, tries = zip(*(tempered_shares(free, RELOCATED) for free in (1.0, 0.3, 0.05, 0.01)), strict=True)
    assert tries[0] == 1 and list(tries) == sorted(tries) and tries[-1] <= MAX_LIFT_TRIES
    assert often == (RELOCATED,) * 4
    assert 0.0 < tempered_shares(0.001, RELOCATED)[0] < RELOCATED  # seldom
    assert tempered_shares(1e-5, RELOCATED)[0] == 0.0  # not at all


@pytest.mark.long
def test_copies_part_by_lifts_and_stay_alike_without():
    """800 copies of 20 scenes: what ten sweeps leave of a design effect of 40."""
    model = machine_of(TWO_SETTINGS, POSITIVE)
    few = plain(model.problem, 20, 1)
    redraws, relocations = (dict.fromkeys(model.order, tempered_shares(0.15, often)) for often in (REDRAWN, RELOCATED))
    effects = []
    for kinds in (("redraw", "shift", "turn", "relocate"), ("shift", "turn")):
        particles = everything_placed(model, few[:, np.arange(800) % 20])
        particles.families = [np.arange(800) % 20]
        for _ in range(10):
            sweep(particles, MoveSettings({}, kinds, redraws, relocations))
        effects.append(AncestorEffect(model)(particles))
    assert effects[0] < 3.0 < 12.0 < effects[1]


def copies(index):
    """Particles of which some are copies of others."""
    model = machine_of("leftOf(a, b) & leftOf(b, c)")
    particles = everything_placed(model, anywhere(model.problem, max(index) + 1))
    particles.take(np.array(index))
    return particles


def test_scenes_that_share_a_place_are_told():
    particles = copies([0, 0, 0, 1, 2, 2])
    assert shared_places(particles) == pytest.approx((3 * 2 + 0 + 2 * 1) / 6)
    assert distinct_particles(particles, np.arange(6)).tolist() == [0, 3, 4]
    assert distinct_particles(particles, np.array([2, 5, 1, 3])).tolist() == [2, 5, 3]
    # one object that has moved is not enough, all must
    particles.scenes[[0, 1, 2], 1] += 0.1
    assert distinct_particles(particles, np.arange(6)).tolist() == [0, 3, 4]
    particles.scenes[3:, 1] += 0.1
    assert distinct_particles(particles, np.arange(6)).tolist() == [0, 1, 3, 4]
    assert shared_places(particles) == pytest.approx((2 * 1 + 0 + 2 * 1) / 6)


def test_a_place_that_went_to_another_object_is_still_shared():
    particles = copies([0, 0])
    particles.scenes[[0, 1, 3, 4], 1] = particles.scenes[[3, 4, 0, 1], 1]
    particles.scenes[6:, 1] += 0.1
    assert shared_places(particles) == 1.0 and len(distinct_particles(particles, np.arange(2))) == 1


def test_a_part_has_as_many_scenes_of_each_cell_and_asks_for_nothing_else():
    rng, cell = np.random.default_rng(0), np.repeat([0, 1, 2], [40, 40, 20])
    taken = np.zeros(100)
    for _ in range(400):
        some = pick_part(cell, 5.0, rng)
        assert len(set(some)) == 20 and np.ptp(np.bincount(cell[some])) <= 1
        taken[some] += 1
    for number, share in ((0, 20 / 3 / 40), (1, 20 / 3 / 40), (2, 20 / 3 / 20)):  # everyone of a cell equally often
        counts = taken[cell == number]
        assert np.abs(counts / 400 - share).max() < 5 * np.sqrt(share / 400)
    assert sorted(pick_part(cell, 1.0, rng)) == list(range(100))


def run(effects, count=500, wanted=100.0, grown=100.0):
    """`settle` where the design effect falls as told and a sweep takes one evaluation."""
    model = SimpleNamespace(work=0.0)
    particles = SimpleNamespace(model=model, count=count, placed_objects=(), scenes=np.zeros((3, count)))
    model.graph = SimpleNamespace(rows=frozenset())

    def sweep():
        model.work += 1.0

    return settle(particles, sweep, lambda _: effects(model.work), grown, wanted)


def test_sweeps_end_once_the_particles_are_enough():
    best, now = run(lambda work: 2.0)
    assert best.sweeps == now.sweeps == 4 and now.thin == pytest.approx(1.0 / (ALIKE_EFFECT - 1.0))
    assert now.taken_effect == pytest.approx(ALIKE_EFFECT)


def test_sweeps_that_help_go_on_and_those_that_do_not_end_early():
    falling, _ = run(lambda work: 1.0 + 30.0 * np.exp(-work / 20.0), wanted=2000.0)
    flat, now = run(lambda work: 8.0, wanted=2000.0)
    assert falling.sweeps > 40 and falling.thin < 3.0
    assert flat.sweeps == 4 and flat.thin == pytest.approx(7.0 / (ALIKE_EFFECT - 1.0))  # the fewest: more bring nothing
    assert now.sweeps > 4


def test_sweeps_that_bring_little_for_long_end():
    """The effect falls by a half in 16 sweeps, which is less than they cost: 17 are enough to see that."""
    slow = lambda work: 1.0 + 8.0 * 0.5 ** (work / 16.0)  # noqa: E731
    best, now = run(slow, wanted=4000.0, grown=1.0)
    assert best.sweeps == 4 and now.sweeps == 17
    # where growing costs more, the same sweeps are worth it
    best, now = run(slow, wanted=4000.0, grown=1000.0)
    assert best.sweeps > 17


def test_of_trusted_numbers_of_sweeps_the_cheapest_is_taken():
    """Scenes that come apart in the end: a slightly larger population is cheaper than four times the sweeps."""
    best, now = run(lambda work: 1.6 if work < 45.0 else 1.4, wanted=5000.0)
    assert now.sweeps >= 45 and now.thin == 1.0
    assert TRUSTED_SWEEPS <= best.sweeps < 20 and best.thin == pytest.approx(0.6 / (ALIKE_EFFECT - 1.0))


RACK = """object rack at (0.5, 0.7, SOUTH)
object bottle[3] on any of [rack.slot[1], rack.slot[2], rack.slot[3], rack.slot[4], rack.slot[5], rack.slot[6]]
require noCollision()
task: leftOf(bottle[1], bottle[2])"""
CARRIED = """workspace [0, 0.8] x [0, 0.8]
object tray, plate on any of [tray, workspace], apple on any of [plate, tray, workspace]
require noCollision()
task: restsOn(apple, plate)"""


def drawn(text, method, n, **options):
    return scenegen.sample(scenegen.parse(text), n=n, seed=5, method=method, **options)


def shares(scenes, chooser, surfaces):
    """How often an object with a choice stands on each of its surfaces."""
    return np.bincount(scenes.on[:, chooser].astype(int) - 1, minlength=surfaces) / len(scenes)


@pytest.mark.long
def test_slots_of_a_rack_are_equally_likely_and_bottles_anywhere_in_them():
    scenes = drawn(RACK, "growth", 1200)
    for bottle in range(3):
        np.testing.assert_allclose(shares(scenes, bottle, 6), 1.0 / 6.0, atol=0.055)  # 5 standard errors


@pytest.mark.long
def test_what_is_carried_by_choice_is_as_rejection_has_it():
    grown, drawn_alone = (drawn(CARRIED, method, 1000) for method in ("growth", "rejection"))
    for chooser, surfaces in ((0, 2), (1, 3)):
        one, other = (shares(scenes, chooser, surfaces) for scenes in (grown, drawn_alone))
        assert (other > 0.01).sum() >= 2  # some stand elsewhere
        np.testing.assert_allclose(one, other, atol=0.1)  # 4 standard errors, if a scene of growth is worth half of one
    tray = [scenes.poses[:, list(scenes.objects).index("tray")] for scenes in (grown, drawn_alone)]
    for axis in range(2):
        quarters = [np.quantile(poses[:, axis], (0.25, 0.5, 0.75)) for poses in tray]
        np.testing.assert_allclose(*quarters, atol=0.06)
