"""Room for the hand at the start and at the goal of a task: `experiments/success/grasp.py`."""

import numpy as np
import pytest

from experiments.success.grasp import BASE, scores
from scenegen.api.spec import parse
from scenegen.play.suites.adapters.table import TABLE_HEIGHT, table_of
from scenegen.play.suites.suite import SuiteTask

SPEC = """
workspace [-0.2, 0.2] x [-0.2, 0.2]
object cube = box(4 cm, 4 cm, 4 cm), post[2] = cylinder(4 cm, 9 cm)
require noOverlap()
goal: x(cube) >= 9 cm & x(cube) <= 11 cm & y(cube) >= -1 cm & y(cube) <= 1 cm
require !goal
"""
ROBOSUITE = [-0.56, 0.0, 0.912]  # metres: the body robot0_base of robosuite 1.5.2 beside a table of 0.8 m


def test_the_arm_stands_where_robosuite_has_it():
    frame, _ = table_of(parse(SPEC))
    x, y, theta = frame.pose(ROBOSUITE, [1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose((x, y, theta), BASE, atol=1e-12)
    assert ROBOSUITE[2] - TABLE_HEIGHT == pytest.approx(0.112)


@pytest.mark.long
def test_posts_cost_room_at_the_end_at_which_they_stand():
    spec = parse(SPEC)
    cube = [-0.1, 0.0, 0.0]
    poses = np.array([
        [cube, [-0.15, 0.15, 0.0], [0.0, 0.15, 0.0]],
        [cube, [-0.1, -0.065, 0.0], [-0.1, 0.065, 0.0]],  # 1 cm further apart than the cube is wide, and tall
        [cube, [0.1, -0.065, 0.0], [0.1, 0.065, 0.0]],
    ])  # fmt: skip
    scenes = spec.scenes(poses)
    found = scores(SuiteTask("between", spec, "", "goal", (), scenes, scenes.poses7()), [0, 1, 2])
    here, there, both = (
        found[name] for name in ("grasp at the start", "grasp at the goal, mean", "grasp at both ends, mean")
    )
    assert np.sign(here).tolist() == [1, -1, 1]
    assert np.sign(there).tolist() == [1, 1, -1]
    assert np.sign(both).tolist() == [1, -1, -1]
    np.testing.assert_array_equal(found["phi of the goal at the start"], scenes.phi["goal"])
    assert found["least of all three"].max() < 0.0  # no start has reached the goal
