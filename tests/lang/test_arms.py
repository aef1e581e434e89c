"""Robots: what keeps true in every scene, and what is wrong with specs and files of arms. Scenes worked out on paper
stand in tests/golden/lang/relations."""

import math
import re

import numpy as np
import pytest
import torch

import scenegen
from experiments.arms.oracle import rooms
from scenegen.errors import SpecError
from scenegen.geometry import MATH, NUMPY, PRIMITIVES, Box, Circle
from scenegen.geometry.footprint import Polygon, place_box
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.formula.capped import find_capped
from scenegen.lang.formula.interpret import evaluate, phi
from scenegen.learn.robustness import Robustness
from scenegen.resources import grammar_file
from scenegen.sampling.growth.constraints import make_values
from scenegen.sampling.growth.graph import make_graph, narrows_any
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.contract import contract, push_down, start
from scenegen.search.tape import make_batches, make_tape
from scenegen.things.arms import ArmError, read_arm, shipped_arm, shipped_arms

HEAD = "robot arm = panda at (0.5, -0.25, NORTH)\nobject can, lemon, bottle, crackerbox\n"
SPECS = {
    "held": HEAD + "task: graspable(can, arm) & graspable(lemon, arm, 3 cm)\nway: armClear(can, arm)",
    "free": "robot arm = panda\nobject can, lemon, bottle\ntask: graspable(can, arm)\nway: armClear(lemon, arm)",
    "chosen": "robot arm = panda at (0.5, -0.25, NORTH)\nobject shelfunit at (0.5, 0.8, SOUTH), bottle\n"
    "object can on any of [shelfunit.shelf[1], shelfunit.shelf[2], workspace]\n"
    "task: reachable(can, arm)\nway: handRoom(can, arm, 15 deg, 2 cm) >= 0 & armRoom(bottle, arm, 1 cm) >= 0",
    "limited": 'robot arm = arm("a", heights = [0, 1], nearest = [0.1, 0.3], farthest = [0.7, 0.9], '
    "bearing = [-2, 1.5], base = [0.2, 0.2, 0.1], hand = [0.08, 0.02, 0.02, 0.05, 0.2, 0.06, 0.1])\nobject can, lemon\n"
    "task: reachable(can, arm)\nway: graspable(lemon, arm)",
    "beside": "robot arm = so101 at (0.5, 0.2, NORTH)\nobject can, lemon\n"
    "task: reachable(can, arm)\nway: graspable(lemon, arm, 0)",
}
BOXES = (1.0, 0.1, 1e-3, 0.0)


def scenes_of(spec, seed, count):
    lowest, highest = spec.box()
    return lowest[:, None] + (highest - lowest)[:, None] * np.random.default_rng(seed).random((len(lowest), count))


@pytest.mark.long
@pytest.mark.parametrize("name", SPECS)
def test_bounds_hold_all_scenes_and_contraction_loses_none(name):
    spec, rng = check_text(SPECS[name]), np.random.default_rng(0)
    rows = scenes_of(spec, 1, 24)
    values = np.stack([np.broadcast_to(one, rows.shape[1]) for one in evaluate(spec.core, list(rows), NUMPY)])
    lowest, highest = (ends[:, None] for ends in spec.box())
    tape = make_tape(spec.core, *spec.box())
    for width in BOXES:
        size = rng.random(rows.shape) * (highest - lowest) * width
        low, high = np.maximum(rows - size, lowest), np.minimum(rows + size, highest)
        wanted = [
            {node: (values[node, k] - 1e-9, values[node, k] + 1e-9) for node in spec.core.labels.values()}
            for k in range(rows.shape[1])
        ]
        for batches in (None, make_batches(tape.nodes, fewest=1, worth=0)):
            lo, hi = start(tape, [push_down(spec.core, ends) for ends in wanted], low, high)
            assert contract(tape.nodes, lo, hi, batches=batches).all()
            for row, node in tape.rows.items():
                assert ((lo[node] <= rows[row]) & (rows[row] <= hi[node])).all()
            for at, node in enumerate(tape.where):
                if node >= 0:
                    room = 1e-9 * (1 + np.abs(values[at]))
                    assert (lo[node] - room <= values[at]).all() and (values[at] <= hi[node] + room).all()


@pytest.mark.long
@pytest.mark.parametrize("name", SPECS)
def test_readers_agree(name):
    spec = check_text(SPECS[name])
    rows = scenes_of(spec, 2, 40)
    of_numpy = phi(spec.core, list(rows), NUMPY)
    of_torch = Robustness(spec.core).rows(torch.from_numpy(rows)).numpy()
    for at, (label, values) in enumerate(of_numpy.items()):
        np.testing.assert_allclose(of_torch[at], values, atol=1e-12)
        of_math = [phi(spec.core, rows[:, k].tolist(), MATH)[label] for k in range(10)]
        np.testing.assert_allclose(of_math, values[:10], atol=1e-12)
    points = torch.from_numpy(rows).requires_grad_()
    Robustness(spec.core).rows(points).sum().backward()
    assert torch.isfinite(points.grad).all() and (points.grad != 0).any()


@pytest.mark.parametrize("name", SPECS)
def test_clearances_that_cannot_decide_are_left_out(name):
    core = check_text(SPECS[name]).core
    rows = scenes_of(check_text(SPECS[name]), 3, 300)
    near = 0.2 * rows  # all within a fifth of the table: most hands are in the way of something
    near[:, 7] = np.nan
    # where surfaces are drawn, so are heights: nothing is left out
    assert bool(find_capped(core.nodes, core.labels.values()).skipped) == (name != "chosen")
    for some in (rows, near):
        whole, pruned = evaluate(core, list(some), NUMPY), evaluate(core, list(some), NUMPY, None, core.labels.values())
        for node in core.labels.values():
            np.testing.assert_array_equal(pruned[node], whole[node])
        again = make_values(core, list(core.labels.values()))(list(some[:, None, :]))
        for found, node in zip(again, core.labels.values(), strict=True):
            np.testing.assert_array_equal(np.broadcast_to(found, (1, 300))[0], np.broadcast_to(whole[node], 300))


def test_rooms_of_growth_are_contracted_by_what_narrows_them_alone():
    spec = check_text(HEAD + "task: graspable(can, arm)")
    problem = make_problem(spec, SampleRequest(n=1, phi={"task": Range(0.0, None)}, seed=0))
    graph = make_graph(problem)
    rows = list(problem.tape.rows)
    (choice,) = graph.choices
    assert not narrows_any(problem, [choice.ways[0].whole], rows)
    assert any(narrows_any(problem, [one], rows) for one in graph.clauses)


@pytest.mark.parametrize("other", [Box(0.1, 0.03), Circle(0.04), Polygon(((0.0, 0.0), (0.1, 0.0), (0.0, 0.07)))])
def test_a_placed_box_is_the_polygon_of_its_corners(other):
    placed, rng = place_box(Box(0.02, 0.05), (0.03, -0.01), 0.7), np.random.default_rng(3)
    pose = [*rng.uniform(-0.1, 0.1, (2, 500)), rng.uniform(0, 7, 500)]
    pose += [*rng.uniform(-0.1, 0.1, (2, 500)), rng.uniform(0, 7, 500)]
    gap = PRIMITIVES["gap"].evaluate
    np.testing.assert_allclose(
        gap(NUMPY, placed, other, *pose), gap(NUMPY, Polygon(placed.vertices), other, *pose), atol=1e-12
    )


@pytest.mark.long
@pytest.mark.parametrize("shape", [Box(0.1, 0.03), Circle(0.04), Polygon(((0.0, 0.0), (0.1, 0.0), (0.0, 0.07)))])
def test_the_way_is_as_far_as_its_nearest_point(shape):
    rng = np.random.default_rng(4)
    x, y, theta = rng.uniform(-0.2, 0.2, 300), rng.uniform(-0.2, 0.2, 300), rng.uniform(0, 7, 300)
    ends = rng.uniform(-0.2, 0.2, (4, 300))
    ends[2:, :10] = ends[:2, :10]  # a way without length
    found = PRIMITIVES["pathGap"].evaluate(NUMPY, shape, x, y, theta, *ends)
    shares = np.linspace(0.0, 1.0, 4001)[:, None]
    points = [ends[axis] + shares * (ends[axis + 2] - ends[axis]) for axis in (0, 1)]
    gaps = PRIMITIVES["gap"].evaluate(NUMPY, shape, Circle(0.0), x, y, theta, *points, 0.0).min(axis=0)
    apart = gaps > 0.0
    assert 50 < apart.sum() < 290
    np.testing.assert_allclose(found[apart], gaps[apart], atol=1e-4)
    assert (found[~apart] <= 1e-12).all() and (found[~apart] >= gaps[~apart] - 0.05).all()
    np.testing.assert_allclose(found[:10], gaps[:10], atol=1e-12)


@pytest.mark.long
def test_scenes_are_in_reach_and_say_the_yaw():
    spec = scenegen.parse(HEAD + "require noOverlap()\ntask: forall p in others(arm): graspable(p, arm)")
    scenes = scenegen.sample(spec, (0.0, None), n=30, seed=1)
    arm = shipped_arm("panda")
    away = np.hypot(scenes.poses[:, 1:, 0] - 0.5, scenes.poses[:, 1:, 1] + 0.25)
    tops = [shape.height for shape in spec.checked.shapes[1:]]
    rings = np.array([arm.ring.reach_at(top - 0.02) for top in tops])
    assert ((away >= rings[:, 0]) & (away <= rings[:, 1])).all()
    assert "handRoom(can, arm, 45 deg)" in [
        atom.text.removesuffix(" >= 0") for atom in spec.checked.core.nodes if hasattr(atom, "text")
    ]


def test_a_tip_beside_the_last_axis_is_where_the_oracle_has_it():
    """1 cm high and 4 m away from each other, so that the reach decides alone; poses about the base's own frame."""
    arm, rng, count = shipped_arm("so101"), np.random.default_rng(0), 400
    bearings, radii = rng.uniform(-math.pi, math.pi, count), rng.uniform(0.0, 0.32, count)
    places = np.column_stack([radii * np.cos(bearings), radii * np.sin(bearings), np.zeros(count)])
    headings = rng.uniform(-math.pi, math.pi, count)
    text = (
        "workspace [-1, 1] x [-1, 1]\nrobot arm = so101 at (0, 0, 90 deg)\nobject a = cylinder(5 mm, {top:g})\n"
        "task: armReach(a, arm, 0) >= 0\nway: min(handRoom(a, arm, 30 deg, 0), 1 cm) >= 0"
    )
    for top in (0.01, 0.06):
        places[:, 2] = top
        spec = check_text(text.format(top=top))
        turned = np.stack([-places[:, 1], places[:, 0]]), headings + math.pi / 2.0
        rows = [*np.repeat([[0.0], [0.0], [math.pi / 2.0]], count, axis=1), *turned[0], turned[1] % (2.0 * math.pi)]
        found = phi(spec.core, rows, NUMPY)
        np.testing.assert_allclose(found["task"], rooms(arm, places), atol=1e-9)
        known = np.minimum(rooms(arm, places, headings + math.pi / 6.0), 0.01)
        np.testing.assert_allclose(found["way"], known, atol=1e-9)
        assert (known[rooms(arm, places) >= 0.01] < 0.0).any()  # a heading that is worse than the best


@pytest.mark.parametrize("name", ["panda", "so101"])
def test_an_arm_of_a_file_travels_with_the_spec(tmp_path, name):
    (tmp_path / "mine.toml").write_bytes(grammar_file(f"arms/{name}.toml").read_bytes())
    text = 'robot a = arm("mine.toml") at (0.5, -0.25, NORTH)\nobject can\ntask: graspable(can, a)'
    spec = check_file(tmp_path / "one.spec", text.encode())
    again = check_text(spec.source)
    assert again.source == spec.source
    rows = list(scenes_of(spec, 5, 50))
    for one in (again, check_text(text.replace('arm("mine.toml")', name))):
        np.testing.assert_array_equal(phi(one.core, rows, NUMPY)["task"], phi(spec.core, rows, NUMPY)["task"])


def test_robot_is_a_name_elsewhere():
    assert check_text("leftOf(robot, plate)").objects == ("robot", "plate")
    assert check_text("object a, b\nrobot: leftOf(a, b)").labels == ("robot",)
    assert check_text("robot robot = panda\nobject b\ntask: reachable(b, robot)").objects == ("robot", "b")


WRONG = {
    "robot a = pandda\ntask: reachable(mug, a)": "unknown-arm",
    "robot a[2]\ntask: leftOf(mug, plate)": "unknown-arm",
    "robot a = mug\ntask: reachable(mug, a)": "unknown-arm",
    'robot a = arm("none.toml")\ntask: reachable(mug, a)': "spec-without-file",
    "robot a = panda\ntask: reachable(mug, plate)": "wrong-type",
    "robot a = panda\ntask: graspable((0.5, 0.5), a)": "wrong-type",
    "robot a[2] = panda\ntask: graspable(a[1], a[2])": "wrong-type",
    "robot a = panda\ntask: graspable(a, a)": "same-argument-twice",
    "robot a = panda\ntask: reachable(mug, a, -1 cm)": "size-out-of-range",
    "robot a = panda\ntask: reachable(mug, a, x(mug))": "not-constant",
    "robot a = panda\ntask: handRoom(mug, a, 90, 0) >= 0": "more-than-a-turn",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong(text):
    with pytest.raises(SpecError) as caught:
        check_text(text)
    (problem,) = caught.value.diagnostics
    assert problem.kind.code == WRONG[text] and problem.span is not None


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("robot a[2] = panda\nobject can\ntask: graspable(a[1], a[2])", "a robot"),
        ("robot a = panda\nobject can[2]\ntask: graspable(can, a)", "a list"),
        ("robot a = panda\nobject can\ntask: graspable(workspace, a)", "a region"),
        ("robot a[2] = panda\nobject can\ntask: armClear(a[1], a[2])", "a robot"),
    ],
)
def test_what_no_hand_grasps(text, found):
    with pytest.raises(SpecError, match=f"must be an object that a hand can grasp, not {found}"):
        check_text(text)


def test_all_that_a_file_lacks_is_one_diagnostic(tmp_path):
    (tmp_path / "empty.toml").write_text("")
    with pytest.raises(SpecError) as caught:
        check_file(tmp_path / "one.spec", b'robot a = arm("empty.toml")\nobject can\ntask: reachable(can, a)')
    (problem,) = caught.value.diagnostics
    assert "no table [base]; it has no table [hand]; " in problem.title


def test_files_of_arms():
    assert "panda" in shipped_arms()
    assert read_arm(grammar_file("arms/panda.toml").read_bytes()) == shipped_arm("panda")
    good = grammar_file("arms/panda.toml").read_text()
    for old, new, count in (
        ("[base]", "[bases]", 2),
        ("opening = ", "open = ", 2),
        ('name = "', 'name = 3 # "', 1),
        ("bearing = [", "bearing = [9, ", 1),
        ("nearest = [", "nearest = [0.1, ", 1),
        ("heights = [", "heights = [9, ", 1),
        ("width = ", "width = -", 1),
        ("width = ", 'width = "1" # ', 1),
        ("[hand]", "[[hand", 1),
    ):
        assert old in good
        with pytest.raises(ArmError) as caught:
            read_arm(good.replace(old, new, 1).encode())
        assert len(caught.value.reasons) == count, (new, caught.value.reasons)
    for name, unit in (("bearing", "rad"), ("farthest", "m")):  # as if they were degrees and millimetres
        with pytest.raises(ArmError) as caught:
            read_arm(re.sub(rf"(?m)^{name} = \[[^\]]*", f"{name} = [-166, 166", good).encode())
        assert f"to 10 {unit}" in str(caught.value.reasons)
    leaning = grammar_file("arms/so101.toml").read_text()
    head, _, behind = leaning.partition("[behind]")
    for broken, reason in (
        (head + "[behind]" + behind.replace("turn = ", "turns = "), "it has no field `behind.turns`"),
        (head + "[behind]" + behind.replace("bearing = [", "bearing = [9, "), "`behind.bearing` must be a list of 2"),
        (head + "[behind]" + behind.replace("nearest = [", "nearest = [0.1, "), "`behind.heights`, `nearest`"),
        (head + 'behind = "here"', "it has no field `hand.behind`"),
        (head.replace("offset = [", "offset = [1, "), "`offset` must be a list of 2 numbers"),
        (head.replace("turn = [", "turn = [3, -3] # ["), "`turn` must be the lower limit, then the upper one"),
    ):
        with pytest.raises(ArmError) as caught:
            read_arm(broken.encode())
        assert reason in caught.value.reasons[0], caught.value.reasons
