"""Grid tasks, the cells in which episodes begin, corridors, relations: all that is not compiled."""

import math

import numpy as np
import pytest

from experiments.tabular.features import by_relations
from experiments.tabular.grid import FREE, GOAL, OFF, ORDER, grid_task
from experiments.tabular.lines import corridors
from experiments.tabular.play import Scenes
from experiments.tabular.starts import every_cell, of_scenes
from scenegen.api.spec import parse
from scenegen.errors import RequestError
from scenegen.learn.curriculum.tasks import PhiBox

A = "object mug\nobject plate at (0.5, 0.5, 0)\ntask: closeTo(mug, plate, 0)\n"
B = "object spoon\nobject plate at (0.5, 0.5, 0)\ntask: leftOf(spoon, plate) & belowOf(spoon, plate)\n"


def offsets(task):
    """(x, y) of every cell of the board, in cells from the middle of the table."""
    column, row = np.divmod(np.arange(len(task.phi)), task.deep + 2)
    return column - (task.across + 1) // 2, row - (task.deep + 1) // 2


@pytest.mark.parametrize("size", [1, 3, 10])
def test_task_a_is_the_paper_s(size):
    task = grid_task(parse(A), 2 * size + 1)
    x, y = offsets(task)
    inside = (abs(x) <= size) & (abs(y) <= size)
    assert ((task.board.kind == OFF) == ~inside).all()
    assert ((task.board.kind == GOAL) == ((x == 0) & (y == 0))).all()
    distance = np.sqrt(x * x + y * y)
    assert np.allclose(task.phi[inside] / task.edge, -distance[inside])
    assert (task.level[inside] == np.ceil(distance[inside] - 1e-9)).all() and (task.level[~inside] == -1).all()
    assert task.levels == math.ceil(math.sqrt(2) * size)


def test_task_b_is_the_paper_s():
    task = grid_task(parse(B), 21)
    x, y = offsets(task)
    free = task.board.kind == FREE
    assert (free == ((np.maximum(x, y) > 0) & (abs(x) <= 10) & (abs(y) <= 10))).all()
    assert (task.level[free] == np.maximum(x, y)[free]).all()


def test_actions_lead_where_their_names_say():
    task = grid_task(parse(A), 7, order=("up", "left", "down", "right"))
    middle = np.flatnonzero(task.board.kind == GOAL)
    moved = (task.place_of(middle + task.board.moves) - task.place_of(middle)) / task.edge
    assert np.allclose(moved, [(0, 1), (-1, 0), (0, -1), (1, 0)])


def test_a_table_that_is_not_square_and_objects_that_are_held():
    spec = parse("workspace [0, 2] x [-1, 0]\nobject a, b\ntask: leftOf(a, b)\n")
    task = grid_task(spec, 8, moved="b", held={"a": (0.8, -0.5)})
    assert (task.across, task.deep, task.edge) == (8, 4, 0.25)
    inside = task.board.kind != OFF
    assert np.allclose(task.phi[inside], task.place_of(np.flatnonzero(inside))[:, 0] - 0.8)
    poses = np.zeros((1, 2, 3))
    for cell in np.flatnonzero(inside):
        poses[0, 1, :2] = task.place_of(np.array([cell]))
        assert task.cell_of(poses) == cell


@pytest.mark.parametrize(
    "text, settings, words",
    [
        (A, {"across": 1}, "`across` is 1"),
        (A, {"across": 5000}, "5000 by 5000 cells"),
        (A, {"across": 8}, "no cell of a grid of 8 by 8"),
        (A, {"across": 7, "moved": "mgu"}, "the spec has no object `mgu`"),
        (A, {"across": 7, "order": ("up", "up", "down", "left")}, "the moves"),
        (A, {"across": 7, "held": {"mug": (0.1, 0.1)}}, "every object has its place"),
        ("object a, b\ntask: leftOf(a, b)\n", {"across": 7}, "`a` and `b` could move"),
        ("object a, b\ntask: leftOf(a, b)\n", {"across": 7, "moved": "a"}, "`b` has no place"),
        (f"{A}require farFrom(mug, plate, 0.1)\n", {"across": 7}, "requires something"),
        (A.replace("0)\n", "2)\n", 2).replace("0.5, 2)", "0.5, 0)"), {"across": 7}, "every cell"),
    ],
)
def test_what_cannot_be_is_refused(text, settings, words):
    with pytest.raises(RequestError) as caught:
        grid_task(parse(text), **settings)
    [diagnostic] = caught.value.diagnostics
    assert words in diagnostic.title and diagnostic.help


def test_starts_of_every_cell():
    task = grid_task(parse(A), 13)
    starts = every_cell(task)
    assert sorted(starts.cells) == sorted(starts.anywhere) == sorted(task.unsatisfied)
    for level in range(1, task.levels + 1):
        cells = starts.cells[starts.first[level] : starts.first[level + 1]]
        assert len(cells) and (task.level[cells] == level).all()
    assert starts.first[1] == 0 and starts.first[-1] == len(starts.cells)


def test_starts_of_verified_scenes_are_all_cells_about_as_often():
    task = grid_task(parse(B), 13)
    starts = of_scenes(task, task.spec, 40)
    assert set(starts.cells) == set(task.unsatisfied)
    assert (np.diff(task.level[starts.cells]) >= 0).all()
    counts = np.bincount(starts.anywhere, minlength=len(task.phi))[task.unsatisfied]
    # 40 in the mean: Poisson
    assert 0.9 < starts.anywhere.size / len(task.unsatisfied) / 40 < 1.0  # some lie in cells whose middle is satisfied
    assert counts.min() > 5 and counts.max() < 110
    again = of_scenes(task, task.spec, 40)
    assert all((a == b).all() for a, b in zip(starts, again, strict=True))


def test_levels_are_of_one_label():
    task = grid_task(
        parse("object mug\nobject plate at (0.5, 0.5, 0)\na: leftOf(mug, plate)\nb: belowOf(mug, plate)"), 5
    )
    with pytest.raises(RequestError, match=r"`a` and `b`(.|\n)*under one label"):
        of_scenes(task, task.spec, 4)


def test_corridors_hold_every_cell_once():
    task = grid_task(parse(A), 15)
    lines = corridors(task, 3)
    assert sorted(lines.cells) == sorted(task.unsatisfied)
    assert lines.group[0] == 0 and lines.group[-1] == len(lines.first) - 1 and lines.first[-1] == len(lines.cells)
    x, y = offsets(task)
    assert (lines.steps[task.unsatisfied] == (abs(x) + abs(y))[task.unsatisfied]).all()
    for line in range(len(lines.first) - 1):  # outwards, one step at a time
        cells = lines.cells[lines.first[line] : lines.first[line + 1]]
        assert (np.diff(lines.steps[cells]) == 1).all()


def test_corridors_want_a_single_goal():
    with pytest.raises(RequestError, match="cells satisfy"):
        corridors(grid_task(parse(B), 9), 3)


def test_relations_make_nine_rows():
    task = grid_task(parse(A), 9)
    rows, count = by_relations(
        task, parse(A.replace("task: closeTo(mug, plate, 0)", "l: leftOf(mug, plate)\nb: belowOf(mug, plate)"))
    )
    x, y = offsets(task)
    assert count == 9
    for kind in range(9):
        mine = (rows == kind) & (task.board.kind != OFF)
        assert len(set(zip(np.sign(x[mine]), np.sign(y[mine]), strict=True))) == 1
    with pytest.raises(RequestError, match="same objects"):
        by_relations(task, parse(B))


def test_scenes_of_a_box_of_phi():
    task = grid_task(parse(A), 13)
    scenes = Scenes(task, task.unsatisfied)
    assert scenes.space.low == (task.phi[task.unsatisfied].min(),)
    assert scenes.space.high == pytest.approx((-task.edge,))
    box = PhiBox((-3.01 * task.edge,), (-1.99 * task.edge,))
    drawn = {scenes.draw(box)[0] for _ in range(2000)}
    wanted = {cell for cell in task.unsatisfied if box.holds((task.phi[cell],))}
    assert drawn == wanted
    # none in the box: the nearest
    assert scenes.draw(PhiBox((-0.5 * task.edge,), (-0.4 * task.edge,)))[1] == scenes.space.high[0]
    assert scenes.draw(PhiBox((-9.0,), (-8.0,)))[1] == scenes.space.low[0]
    assert ORDER[0] == "right"
    two = grid_task(parse(A + "other: leftOf(mug, plate)\n"), 13)
    with pytest.raises(RequestError, match="2 labels"):
        Scenes(two, two.unsatisfied)
