"""Settling: what rests is kept, what stands in something else is not; blame, determinism, processes, blocks, pieces."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

from scenegen.errors import RequestError, ScenegenError
from scenegen.geometry import NUMPY, PRIMITIVES, Box, Circle, Polygon
from scenegen.processes import process
from scenegen.things import Shape, shape_of
from scenegen.things.surfaces import base_heights
from scenegen.worlds.physics.bodies import within
from scenegen.worlds.physics.settling import Displacements, Refusals, Settler
from tests.physics.drops import settle_scenes

NAMES = ("plate", "mug", "knife", "crackerbox", "bottle")
SHAPES = tuple(map(shape_of, NAMES))


def _box(length, width, height):
    return Shape("box", Box(length, width), height)


def _rod(radius, height):
    return Shape("cylinder", Circle(radius), height)


def _one(shapes, poses, fixed=()):
    """What becomes of one scene."""
    return settle_scenes(shapes, np.array([poses], dtype=np.float64), fixed=fixed, workers=1)


def _gap(shapes, poses):
    """(scenes,): the smallest clearance of two objects of a scene."""
    gap = PRIMITIVES["gap"].evaluate
    rows = poses.transpose(1, 2, 0)
    pairs = [(a, b) for a in range(len(shapes)) for b in range(a)]
    found = [gap(NUMPY, shapes[a].footprint, shapes[b].footprint, *rows[a], *rows[b]) for a, b in pairs]
    return np.min(found, axis=0)


@pytest.fixture(scope="module")
def random():
    """Scenes of five objects from the base distribution, and what becomes of them."""
    poses = np.random.default_rng(11).uniform((0, 0, 0), (1, 1, 2 * np.pi), size=(160, len(NAMES), 3))
    return poses, settle_scenes(SHAPES, poses, workers=2)


@pytest.mark.long
def test_scenes_without_overlap_settle_and_hardly_stir(random):
    poses, found = random
    apart = _gap(SHAPES, poses) >= 0.0
    assert apart.sum() > 20
    assert found.kept[apart].all()
    assert found.shift[apart].max() < 0.001 and found.turn[apart].max() < 1.0


@pytest.mark.long
def test_scenes_with_deep_overlap_of_tall_things_do_not(random):
    """Two bodies that are 3 cm deep in each other part by that much together, so that one moves 1.5 cm or more: up, if
    the other is low, so only tall ones are looked at, where none carries another."""
    poses, found = random
    tall = [NAMES.index(name) for name in ("mug", "crackerbox", "bottle")]
    shapes = [SHAPES[k] for k in tall]
    deep = (_gap(shapes, poses[:, tall]) < -0.03) & ~base_heights(shapes, poses[:, tall]).any(axis=1)
    assert deep.sum() > 3
    assert not found.kept[deep].any()


@pytest.mark.long
def test_things_alone_rest_whatever_their_form():
    """Thin posts and sheets stand upright: nothing tips them."""
    shapes = [
        _box(0.01, 0.01, 0.3),
        _box(0.001, 0.3, 0.4),
        _rod(0.002, 0.3),
        _box(0.001, 0.001, 0.001),
        _box(0.3, 0.3, 0.0005),
        _box(5.0, 5.0, 5.0),
        _rod(0.037, 0.072),
        Shape("prism", Polygon(((0.0, 0.0), (0.3, 0.0), (0.05, 0.02))), 0.1),  # its origin is a corner
    ]
    found = _one(shapes, [(10.0 * k, 0.0, 1.0) for k in range(len(shapes))])
    assert not found.moved.any()


def test_a_block_on_the_edge_of_a_sheet_leans_as_trigonometry_says_and_a_post_falls():
    """A block 20 cm long whose middle is over the edge rests on that edge, 10 cm from its other end, unless that turns
    it by more than 5 degrees: asin(8 mm / 10 cm) is 4.6, asin(9.5 mm / 10 cm) is 5.5."""
    block, post = _box(0.2, 0.2, 0.05), _box(0.02, 0.02, 0.4)
    for height, settles in ((0.004, True), (0.008, True), (0.0095, False)):
        sheet = _box(0.2, 0.2, height)
        found = _one([sheet, block], [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)], fixed={0})
        assert found.kept[0] == settles
        if settles:
            assert found.turn[0, 1] == pytest.approx(np.degrees(np.arcsin(height / 0.1)), abs=0.2)
    found = _one([_box(0.2, 0.2, 0.004), post], [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)], fixed={0})
    assert found.moved.tolist() == [[False, True]]


def test_fixed_objects_stay_and_push():
    shapes = [_box(0.1, 0.1, 0.1), _box(0.1, 0.1, 0.1)]
    poses = [(0.0, 0.0, 0.0), (0.06, 0.0, 0.0)]
    one = _one(shapes, poses, fixed={0})
    assert one.moved.tolist() == [[False, True]] and one.shift[0, 0] == one.turn[0, 0] == 0.0
    both = _one(shapes, poses, fixed={0, 1})
    assert both.kept[0] and not both.shift.any()


def test_what_lies_wholly_on_a_tray_rests_on_it_and_what_overhangs_is_thrown_off():
    shapes = [_rod(0.03, 0.1), _box(0.4, 0.3, 0.05), *(_box(0.1 - 0.01 * k, 0.1, 0.1 - 0.01 * k) for k in range(3))]
    tower = [(-0.1, 0.0, 0.3)] * 3
    on = [(0.1, 0.0, 0.0), (0.0, 0.0, 0.0), *tower]
    over = [(0.2, 0.0, 0.0), (0.0, 0.0, 0.0), *tower]
    found = settle_scenes(shapes, np.array([on, over]), fixed={1}, workers=1)
    assert found.kept.tolist() == [True, False]
    assert found.moved[1].tolist() == [True, False, False, False, False]


def test_neighbours_that_touch_rest():
    shapes = [*[_box(0.1, 0.1, 0.1)] * 5, *[_rod(0.05, 0.1)] * 5]
    assert _one(shapes, [(0.1 * (k % 5), float(k // 5), 0.0) for k in range(10)]).kept[0]


def test_where_the_table_lies_does_not_matter():
    poses = np.array([[(0.0, 0.0, 0.0), (0.055, 0.0, 1.0)]])
    near = settle_scenes([_rod(0.05, 0.1), _box(0.1, 0.05, 0.1)], poses, workers=1)
    far = settle_scenes([_rod(0.05, 0.1), _box(0.1, 0.05, 0.1)], poses + np.array([1000.0, -500.0, 0.0]), workers=1)
    assert not near.kept.any() and not far.kept.any()
    assert (near.moved == far.moved).all()


@pytest.mark.long
def test_one_worker_or_more_alone_or_together_in_any_order_the_same_bits(random):
    poses, found = random
    some = slice(0, 70)
    backwards = settle_scenes(SHAPES, poses[some][::-1], workers=3)
    assert (backwards.shift[::-1] == found.shift[some]).all() and (backwards.turn[::-1] == found.turn[some]).all()
    with Settler(SHAPES, workers=1) as settler:
        for k in (7, 3, 90):
            alone = settler.settle(poses[k : k + 1])
            assert (alone.shift[0] == found.shift[k]).all() and (alone.turn[0] == found.turn[k]).all()


def test_limits_hold_at_their_ends_and_never_for_nan():
    shift = np.array([0.01, 0.0100001, 0.0, np.nan, 0.0])
    turn = np.array([5.0, 0.0, 5.0001, 0.0, np.nan])
    assert within(shift, turn).tolist() == [True, False, False, False, False]


def test_no_scenes_are_no_work():
    found = settle_scenes(SHAPES, np.empty((0, 5, 3)))
    assert found.kept.shape == (0,) and found.moved.shape == (0, 5)


def test_refusals_are_counted_by_object():
    shift = np.zeros((6, 3))
    shift[0, 1] = shift[1, 1] = shift[1, 2] = 0.02
    turn = np.zeros((6, 3))
    turn[2, 1] = 6.0
    names = ("plate", "mug", "fork")
    assert Refusals(names, 2, 0, (0, 0, 0)).diagnostic() is None
    found = Displacements(shift, turn)
    assert found.moved.sum(axis=0).tolist() == [0, 3, 1] and found.kept.tolist() == [False] * 3 + [True] * 3
    refusals = Refusals(names, 8, 3, (0, 3, 1))
    assert refusals.summary() == "3 of 8 scenes did not settle: `mug` moved in 3, `fork` in 1"
    warning = refusals.diagnostic()
    assert warning.severity == "warning" and not warning.help
    assert "noOverlap" in Refusals(names, 8, 5, (1, 3, 2)).diagnostic().help


def test_fewer_workers_than_one_are_refused():
    with pytest.raises(RequestError, match="`workers` is 0"):
        Settler(SHAPES, workers=0)


def test_a_process_that_dies_is_a_diagnostic(monkeypatch):
    program = [sys.executable, "-c", "import sys; sys.exit('out of gravity')"]
    monkeypatch.setattr(process, "command", lambda module, load=(): program)
    with pytest.raises(ScenegenError, match="out of gravity"):
        settle_scenes(SHAPES, np.zeros((40, 5, 3)), workers=2)


@pytest.mark.long
def test_standard_output_stays_clean_and_the_caller_free_of_pybullet():
    script = textwrap.dedent(
        """
        import sys
        import numpy as np
        from scenegen.things import shape_of
        from scenegen.worlds.physics.settling import Settler
        with Settler([shape_of("mug")], workers=1) as settler:
            found = settler.settle(np.zeros((1, 1, 3)))
        print(found.kept.tolist(), "pybullet" in sys.modules)
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("[True] False\n", "")
