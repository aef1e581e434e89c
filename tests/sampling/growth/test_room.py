"""No scene is lost where an object's box is contracted, and volumes are shares of that box."""

import numpy as np
import pytest

from scenegen.sampling.request import Range

from .made import POSITIVE, anywhere, machine_of, plain

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


def rooms(machine, rows, moving=False):
    """For each object, its stage and its room given the others' poses in the scenes."""
    cell = np.zeros(rows.shape[1], dtype=np.intp)
    for stage, thing in enumerate(machine.order):
        at = len(machine.order) - 1 if moving else stage
        yield thing, stage, machine.room(thing, at).boxes(rows, cell, machine.effort)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", SPECS)
def test_where_the_clauses_hold_the_pose_lies_in_some_branch(name, moving):
    machine = machine_of(*SPECS[name])
    good = plain(machine.problem, 300)
    for thing, _, boxes in rooms(machine, good, moving):
        poses = good[list(machine.touch[thing].rows)]
        found = holding(boxes, poses[:, None])[0]
        assert found.min() >= 1
        np.testing.assert_array_equal(boxes.holding(poses), found)
        assert (boxes.volumes.sum(axis=0) > 0).all()


@pytest.mark.parametrize("name", SPECS)
def test_a_branch_says_what_share_of_the_box_it_is(name):
    machine = machine_of(*SPECS[name])
    rows, rng = anywhere(machine.problem, 40), np.random.default_rng(0)
    for thing, _, boxes in rooms(machine, rows):
        mine = list(machine.touch[thing].rows)
        low, high = machine.graph.low[mine, :1, None], machine.graph.high[mine, :1, None]
        draws = low + (high - low) * rng.random((len(mine), 2000, rows.shape[1]))
        held = holding(boxes, draws)
        # the volumes add up to the mean number of branches that hold a point of the box
        total = boxes.volumes.sum(axis=0)
        error = np.sqrt(held.var(axis=0) / 2000 + 1e-9)
        assert (np.abs(held.mean(axis=0) - total) < 5 * error + 1e-3).all()


def test_draws_are_uniform_over_the_room_by_volume():
    """Two branches that overlap: a draw lands in each by its volume, and evenly within."""
    machine = machine_of(*SPECS["either side"])
    ((_, _, boxes),) = rooms(machine, np.zeros((3, 1)))
    assert boxes.low.shape[1] == 2
    np.testing.assert_allclose(boxes.volumes[:, 0] / boxes.volumes.sum(), [0.16 / 0.52, 0.36 / 0.52], atol=1e-3)
    poses = boxes.draw(20_000, np.random.default_rng(1))[:, :, 0]
    first = poses[0] < 0.3  # x in [0.1, 0.3]: in the first branch only
    assert abs(first.mean() - 0.08 / 0.52) < 0.01
    assert abs(np.mean(boxes.holding(poses[:, :, None]) == 2) - 2 * 0.2 * 0.4 / 0.52) < 0.015


def test_an_object_that_cannot_be_placed_has_no_room():
    """It must be within 10 cm of a point and of another object, which stands far off."""
    machine = machine_of("closeTo(a, b, 0.1) & closeTo(a, (0.2, 0.2), 0.1)")
    rows = np.array([[0.9], [0.9], [0.0]] * 2)
    for thing, stage, boxes in rooms(machine, rows):
        assert (boxes.volumes.sum(axis=0) == 0.0).all() == (stage == 1), thing


def test_the_box_of_the_graph_holds_every_scene():
    for text, ranges in SPECS.values():
        machine = machine_of(text, ranges)
        good, graph = plain(machine.problem, 300), machine.graph
        assert ((good >= graph.low[:, :1]) & (good <= graph.high[:, :1])).all()
