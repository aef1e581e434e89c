"""Weights are unbiased: the mean over many islands is the probability that a formula gives. No scene is lost where an
object's box is contracted, and volumes are shares of that box. Whether footprints are a distance apart, against the
clearance itself. Incremental scoring says what an evaluation of the whole formula says, at every stage.
"""

import math

import numpy as np
import pytest

from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import Box, Circle, Polygon
from scenegen.lang.formula.core import Coord, Junction, children
from scenegen.sampling.growth.constraints import _edge_gap, keeps_distance
from scenegen.sampling.growth.insertion import _drop_violations, open_ways
from scenegen.sampling.growth.moves import MoveSettings
from scenegen.sampling.growth.population import Grown, Step, grow
from scenegen.sampling.growth.sampler import log_base
from scenegen.sampling.request import Range
from scenegen.search.contract import push_down

from ..plain import square_line
from .made import POSITIVE, anywhere, everything_placed, machine_of, node_values, plain, ways_held


def estimates(text, ranges=POSITIVE, *, islands=200, each=16, tries=2, sweeps=0, seed=0, **words):
    """Each island's estimate of the probability, (islands,)."""
    model = machine_of(text, ranges, **words)
    count = islands * each
    cell, island = np.zeros(count, dtype=np.intp), np.arange(count) % islands
    steps = [Step(tries, sweeps)] * len(model.order)
    with np.errstate(divide="ignore"):
        grown = grow(model, cell, island, steps, MoveSettings({}), np.random.default_rng(seed))
    assert isinstance(grown, Grown)
    return np.exp(grown.log_share + log_base(model)).sum(axis=1), grown


def lens(d, r, s):
    """The area of two discs, of radii r and s at a distance d, together."""
    one = r * r * math.acos((d * d + r * r - s * s) / (2 * d * r))
    two = s * s * math.acos((d * d + s * s - r * r) / (2 * d * s))
    both = one + two - 0.5 * math.sqrt((-d + r + s) * (d + r - s) * (d - r + s) * (d + r + s))
    return math.pi * (r * r + s * s) - both


TWO = "object a = cylinder(0.15, 0.1), b = cylinder(0.1, 0.1)\nrequire noOverlap()\n"
# name -> spec, range, probability
KNOWN = {
    "two discs": (TWO + "task: farFrom(a, b, 0.0)", POSITIVE, 1 - square_line(0.25)),
    "two discs, within a box": (
        "object a = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1)\nrequire noOverlap()\nrequire insideWorkspace()\n"
        "task: closeTo(a, b, 0.5)", {"task": Range(0.1, 0.4)}, 0.8**4 * (square_line(0.5) - square_line(0.25))),
    "three in order": ("leftOf(a, b) & leftOf(b, c)", POSITIVE, 1 / 6),
    "in order, with gaps": ("leftOf(a, b) & leftOf(b, c)", {"task": Range(0.2)}, 0.6**3 / 6),
    "overlapping branches": (
        "closeTo(a, (0.4, 0.5), 0.2) | closeTo(a, (0.6, 0.5), 0.3)", POSITIVE, lens(0.2, 0.2, 0.3)),
    "a heading either way": ("angle(a, EAST, 0.4) | angle(a, NORTH, 0.6)", POSITIVE, 2.0 / (2 * math.pi)),
    "overlapping ways": ("(leftOf(a, b) & leftOf(b, c)) | (leftOf(a, c) & leftOf(b, c))", POSITIVE, 1 / 3),
    "three ways, one in another": (
        "(leftOf(a, b) & leftOf(b, c)) | leftOf(a, c) & leftOf(b, c) | leftOf(b, a) & leftOf(c, a)", POSITIVE, 2 / 3),
    "a way for a third": ("leftOf(a, b) | leftOf(b, c) | leftOf(c, a)", {"task": Range(0.0)}, 1.0),
}  # fmt: skip


@pytest.mark.parametrize("sweeps", [0, 1])
@pytest.mark.parametrize("name", KNOWN)
def test_the_mean_over_islands_is_the_probability(name, sweeps):
    text, ranges, truth = KNOWN[name]
    found, _ = estimates(text, ranges, sweeps=sweeps)
    error = found.std(ddof=1) / math.sqrt(len(found))
    assert abs(found.mean() - truth) < 4 * error + 1e-6
    assert error < 0.05 * truth  # precise enough to see what a missing weight would do


def test_overlapping_branches_that_count_twice_would_be_seen(monkeypatch):
    """The same test rejects weights that do not look at how many branches hold a pose."""
    text, ranges, truth = KNOWN["overlapping branches"]
    monkeypatch.setattr(
        "scenegen.sampling.growth.room.Boxes.branches_with", lambda self, poses: np.ones(poses.shape[1:])
    )
    found, _ = estimates(text, ranges)
    assert abs(found.mean() - truth) > 10 * found.std(ddof=1) / math.sqrt(len(found))


def test_the_pose_that_is_taken_is_uniform_over_the_free_ones():
    """One disc held in place: the other is uniform over what it leaves, whatever the number of tries."""
    fixed = {"a": (0.5, 0.5, 0.0)}
    _, grown = estimates(TWO + "task: farFrom(a, b, 0.0)", fixed=fixed, each=100, tries=3)
    x, y = grown.particles.scenes[3:5]
    assert np.hypot(x - 0.5, y - 0.5).min() >= 0.25
    free = 1 - math.pi * 0.25**2
    corner = (x < 0.25) & (y < 0.25)
    ring = np.hypot(x - 0.5, y - 0.5) < 0.35
    for share, truth in ((corner.mean(), 0.0625 / free), (ring.mean(), math.pi * (0.35**2 - 0.25**2) / free)):
        assert abs(share - truth) < 4 * math.sqrt(truth / len(x))


def test_the_shares_of_overlapping_ways_are_right():
    """Of the scenes in which c is last, half have a before b: the way that asks for it is no reason for more."""
    text, ranges, _ = KNOWN["overlapping ways"]
    _, grown = estimates(text, ranges, each=100, tries=4)
    a, b, c = grown.particles.scenes[0::3]
    assert (c > np.maximum(a, b)).all()
    assert abs((a < b).mean() - 0.5) < 4 * 0.5 / math.sqrt(len(a) / 2)
    assert abs(c.mean() - 0.75) < 4 * 0.2 / math.sqrt(len(a) / 2)


SPECS = {
    "near": ("closeTo(a, b, 0.3) & leftOf(a, b)", POSITIVE),
    "either side": ("closeTo(a, (0.3, 0.5), 0.2) | closeTo(a, (0.6, 0.5), 0.3)", POSITIVE),
    "headings": ("angle(a, EAST, 0.4) & closeTo(a, (0.5, 0.5), 0.3)", {"task": Range(0.02)}),
    "bins": ("object a, b\nregion one = rect(0, 0, 0.3, 0.3)\nregion two = circle((0.7, 0.7), 0.2)\n"
             "task: forall i in [a, b]: inside(i, one) | inside(i, two)", POSITIVE),
    "a range": ("closeTo(a, b, 0.3) & leftOf(a, b)", {"task": Range(0.05, 0.1)}),
    "boxes": ("object a = box(0.2, 0.1, 0.1), b = box(0.1, 0.1, 0.1)\nrequire insideWorkspace()\n"
              "task: leftOf(a, b) & closeTo(a, b, 0.4)", {"task": Range(0.1)}),
}  # fmt: skip


def holding(boxes, poses):
    """How many branches hold each pose, (R, M, P) -> (M, P), by their ends."""
    low, high = boxes.low[:, :, None], (boxes.low + boxes.width)[:, :, None]
    inside = ((poses[:, None] >= low) & (poses[:, None] <= high)).all(axis=0)
    return (inside & (boxes.volumes > 0.0)[:, None]).sum(axis=0)


def rooms(model, rows, moving=False):
    """For each object, its stage and its room given the others' poses in the scenes."""
    cell = np.zeros(rows.shape[1], dtype=np.intp)
    for stage, thing in enumerate(model.order):
        at = len(model.order) - 1 if moving else stage
        yield thing, stage, model.room(thing, at).boxes(rows, cell, model.effort)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", SPECS)
def test_where_the_clauses_hold_the_pose_lies_in_some_branch(name, moving):
    model = machine_of(*SPECS[name])
    good = plain(model.problem, 300)
    for thing, _, boxes in rooms(model, good, moving):
        poses = good[list(model.constraints[thing].rows)]
        found = holding(boxes, poses[:, None])[0]
        assert found.min() >= 1
        np.testing.assert_array_equal(boxes.branches_with(poses), found)
        assert (boxes.volumes.sum(axis=0) > 0).all()


@pytest.mark.parametrize("name", SPECS)
def test_a_branch_says_what_share_of_the_box_it_is(name):
    model = machine_of(*SPECS[name])
    rows, rng = anywhere(model.problem, 40), np.random.default_rng(0)
    for thing, _, boxes in rooms(model, rows):
        mine = list(model.constraints[thing].rows)
        low, high = model.graph.low[mine, :1, None], model.graph.high[mine, :1, None]
        draws = low + (high - low) * rng.random((len(mine), 2000, rows.shape[1]))
        held = holding(boxes, draws)
        # the volumes add up to the mean number of branches that hold a point of the box
        total = boxes.volumes.sum(axis=0)
        error = np.sqrt(held.var(axis=0) / 2000 + 1e-9)
        assert (np.abs(held.mean(axis=0) - total) < 5 * error + 1e-3).all()


def test_draws_are_uniform_over_the_room_by_volume():
    """Two branches that overlap: a draw lands in each by its volume, and evenly within."""
    model = machine_of(*SPECS["either side"])
    ((_, _, boxes),) = rooms(model, np.zeros((3, 1)))
    assert boxes.low.shape[1] == 2
    np.testing.assert_allclose(boxes.volumes[:, 0] / boxes.volumes.sum(), [0.16 / 0.52, 0.36 / 0.52], atol=1e-3)
    poses = boxes.draw(20_000, np.random.default_rng(1))[:, :, 0]
    first = poses[0] < 0.3  # x in [0.1, 0.3]: in the first branch only
    assert abs(first.mean() - 0.08 / 0.52) < 0.01
    assert abs(np.mean(boxes.branches_with(poses[:, :, None]) == 2) - 2 * 0.2 * 0.4 / 0.52) < 0.015


def test_an_object_that_cannot_be_placed_has_no_room():
    """It must be within 10 cm of a point and of another object, which stands far off."""
    model = machine_of("closeTo(a, b, 0.1) & closeTo(a, (0.2, 0.2), 0.1)")
    rows = np.array([[0.9], [0.9], [0.0]] * 2)
    for thing, stage, boxes in rooms(model, rows):
        assert (boxes.volumes.sum(axis=0) == 0.0).all() == (stage == 1), thing


def test_the_box_of_the_graph_holds_every_scene():
    for text, ranges in SPECS.values():
        model = machine_of(text, ranges)
        good, graph = plain(model.problem, 300), model.graph
        assert ((good >= graph.low[:, :1]) & (good <= graph.high[:, :1])).all()


SHAPES = {
    "disc": Circle(0.05),
    "box": Box(0.2, 0.1),
    "square": Box(0.1, 0.1),
    "triangle": Polygon(((0.0, 0.0), (0.12, 0.0), (0.02, 0.1))),
    "off its origin": Polygon(((0.1, 0.1), (0.2, 0.1), (0.2, 0.25), (0.1, 0.2))),
}
PAIRS = [(a, b) for a in SHAPES for b in SHAPES]


def poses(count=4000):
    rng = np.random.default_rng(0)
    at, other = (rng.random((3, count)) * [[0.3], [0.3], [2.0 * np.pi]] for _ in range(2))
    return tuple(at), tuple(other)


@pytest.mark.parametrize(("a", "b"), PAIRS)
@pytest.mark.parametrize("least", [-0.03, 0.0, 0.04])
def test_it_says_what_the_clearance_says(a, b, least):
    at, other = poses()
    gap = PRIMITIVES["gap"].evaluate(NUMPY, SHAPES[a], SHAPES[b], *at, *other)
    for limit in (least, np.full(len(gap), least)):
        np.testing.assert_array_equal(keeps_distance(SHAPES[a], SHAPES[b], at, other, limit), gap >= limit)
    assert 0.02 < np.mean(gap >= least) < 0.98


@pytest.mark.parametrize(("a", "b"), [pair for pair in PAIRS if "disc" not in pair])
def test_no_edge_parts_footprints_by_more_than_their_clearance(a, b):
    at, other = poses()
    gap = PRIMITIVES["gap"].evaluate(NUMPY, SHAPES[a], SHAPES[b], *at, *other)
    beyond = _edge_gap(SHAPES[a], SHAPES[b], at, other)
    assert (beyond <= gap + 1e-12).all()
    np.testing.assert_allclose(beyond[gap < 0.0], gap[gap < 0.0], atol=1e-12)


SMALL = "workspace [0, 0.6] x [0, 0.5]\n"
SPECS_TOUCH = {
    "discs": (SMALL + "object a = cylinder(0.05, 0.1), b = cylinder(0.06, 0.1), c = cylinder(0.07, 0.1)\n"
              "require noOverlap()\nrequire insideWorkspace()\ntask: leftOf(a, b) | leftOf(a, c)", POSITIVE, None),
    "boxes": (SMALL + "object a = box(0.1, 0.06, 0.1), b = box(0.12, 0.05, 0.1), c = cylinder(0.05, 0.1)\n"
              "require noOverlap()\ntask: farFrom(a, c, 0.1)", POSITIVE, None),
    "polygons": (SMALL + "object a = prism([(0, 0), (0.12, 0), (0, 0.1)], 0.05), b = box(0.1, 0.06, 0.1)\n"
                 "object c = cylinder(0.04, 0.1)\nrequire noOverlap()\ntask: closeTo(a, b, 0.4)", POSITIVE, None),
    "held": (SMALL + "object a = box(0.1, 0.06, 0.1), b = box(0.12, 0.05, 0.1), c = cylinder(0.05, 0.1)\n"
             "require noOverlap()\ntask: farFrom(a, (0.3, 0.2), 0.1)", POSITIVE, {"b": (0.3, 0.25, 0.7)}),
    "regions": (SMALL + "object a = box(0.1, 0.06, 0.1), b = cylinder(0.04, 0.1)\nregion tray = rect(0, 0, 0.4, 0.35)\n"
                "require noOverlap()\ntask: inside(a, tray) & inside(b, tray)", POSITIVE, None),
    "several pairs": (SMALL + "object a = box(0.1, 0.06, 0.1), b = box(0.12, 0.05, 0.1), c = cylinder(0.03, 0.1)\n"
                      "require noOverlap()\ntask: farFrom(a, b, 0.12) & farFrom(b, a, 0.11) & farFrom(a, c, 0.05)",
                      {"task": Range(0.02)}, None),
    "a range": (SMALL + "object a = cylinder(0.05, 0.1), b = cylinder(0.06, 0.1)\nrequire noOverlap()\n"
                "task: closeTo(a, b, 0.3)", {"task": Range(0.02, 0.1)}, None),
}  # fmt: skip


@pytest.fixture(params=SPECS_TOUCH)
def model(request):
    text, ranges, fixed = SPECS_TOUCH[request.param]
    return machine_of(text, ranges, fixed=fixed)


def demanded(problem):
    """What the request asks of nodes of the core, pushed down: node -> ends."""
    return push_down(problem.core, problem.demand())


def free_objects(core, node, held):
    """The objects that a node reads, but those held."""
    found, waiting = set(), [node]
    while waiting:
        at = core.nodes[waiting.pop()]
        if isinstance(at, Coord):
            found.add(at.object)
        waiting += children(at)
    return found - held


def test_stage_by_stage_it_is_the_whole_formula(model):
    """Scene by scene, against the scalar interpreter, whatever clauses and pairs were made of the formula."""
    problem, core, count = model.problem, model.problem.core, 200
    rows = anywhere(problem, count)
    values = node_values(core, rows)
    held = {thing for thing in range(len(core.objects)) if problem.lowest[3 * thing] == problem.highest[3 * thing]}
    wanted = demanded(problem)
    cell = np.zeros(count, dtype=np.intp)
    running = np.ones(count, dtype=bool)
    for stage, thing in enumerate(model.order):
        constraints, placed = model.constraints[thing], set(model.order[: stage + 1])
        met = constraints.meets(list(rows), cell, stage)
        running &= True if met is None else met
        constraints.drop_near((rows[3 * thing], rows[3 * thing + 1], rows[3 * thing + 2]), rows, cell, stage, running)
        whole = np.ones(count, dtype=bool)
        for node, (low, high) in wanted.items():
            if free_objects(core, node, held) <= placed and not _is_choice(model, node):
                whole &= (values[node] >= low) & (values[node] <= high)
        np.testing.assert_array_equal(running, whole, err_msg=f"stage {stage}")
    for choice in range(len(model.graph.choices)):
        running &= ways_held(model, choice, rows).any(axis=0)
    final = problem.cells.find(problem.phi(rows)) >= 0
    np.testing.assert_array_equal(running, final)
    assert 3 <= final.sum() <= count - 20


def _is_choice(model, node):
    at = model.problem.core.nodes[node]
    return isinstance(at, Junction) and len(free_objects(model.problem.core, node, set())) > 1


def test_a_move_is_scored_like_the_whole_scene(model):
    """One object of a good scene goes anywhere else: what touches it says whether the scene is still good."""
    problem, rng = model.problem, np.random.default_rng(1)
    good = plain(problem, 120)
    for thing in model.order:
        new = good.copy()
        for row in model.constraints[thing].rows:
            new[row] = anywhere(problem, new.shape[1], rng.integers(1 << 30))[row]
        truth = problem.cells.find(problem.phi(new)) >= 0
        for some in (slice(None), slice(0, 9)):  # both ways of going about it: all scenes, or the few left
            said = np.zeros(len(truth), dtype=bool)
            said[some] = True
            if model.graph.choices:
                continue
            _drop_violations(everything_placed(model, good), (thing,), list(new), good, said)
            np.testing.assert_array_equal(said[some], truth[some])
        assert truth.any() and not truth.all()


def test_cells_have_their_own_ends():
    """Scored for its own cell each, a scene is good where it lies in that cell."""
    model = machine_of("leftOf(a, b) & farFrom(a, b, 0.1)", {"task": Range(0.1, 0.5)}, spread="flat")
    problem, count = model.problem, 4000
    rows = anywhere(problem, count)
    cell = np.random.default_rng(2).integers(problem.cells.count, size=count)
    good = np.ones(count, dtype=bool)
    for stage, thing in enumerate(model.order):
        met = model.constraints[thing].meets(list(rows), cell, stage)
        good &= True if met is None else met
        model.constraints[thing].drop_near(tuple(rows[3 * thing : 3 * thing + 3]), rows, cell, stage, good)
    for choice in range(len(model.graph.choices)):
        good &= open_ways(model, {choice: range(2)}, list(rows), cell, len(model.order) - 1).any(axis=0)
    np.testing.assert_array_equal(good, problem.cells.find(problem.phi(rows)) == cell)
    assert good.sum() > 10
