"""Arms measured from their URDF files: rings worked out on paper, shipped ones against inverse kinematics in closed
form, and files that have no arm.
"""

import itertools
import math

import numpy as np
import pytest

from experiments.arms.oracle import closed_form_oracle, measure
from scenegen.things import reach
from scenegen.things.armfile import ArmSizes, arm_text, closing_direction, thin_ring
from scenegen.things.arms import read_arm, shipped_arm, shipped_arms
from scenegen.things.chain import ChainError, read_chain
from scenegen.things.outline import MeshError

DOWN = np.array([0.0, 0.0, 1.0])


def joint(name, number, at, rpy="0 0 0", axis="0 1 0", kind="revolute", limits=(-3.2, 3.2)):
    limit = f'<limit lower="{limits[0]}" upper="{limits[1]}"/>' if kind == "revolute" else ""
    ends = f'<parent link="l{number}"/><child link="l{number + 1}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>{ends}{limit}</joint>'
    )


def planar(
    *,
    tip="0 0 0.1",
    pan=(-2.0, 2.0),
    shoulder=(-3.2, 3.2),
    elbow=(-3.2, 3.2),
    first="0 0 1",
    roll=(-3.2, 3.2),
    slide=False,
    finger="",
):
    """Two links of 30 and 25 cm on a shoulder at 20 cm, a wrist, and a hand 10 cm long, with a finger that swings about
    an axis."""
    joints = [
        joint("pan", 0, "0 0 0.2", axis=first, limits=pan),
        joint("shoulder", 1, "0 0 0", limits=shoulder),
        joint("elbow", 2, "0 0 0.3", limits=elbow),
        joint("wrist", 3, "0 0 0.25"),
        joint("roll", 4, "0 0 0", axis="0 0 1", kind="prismatic" if slide else "revolute", limits=roll),
        joint("tip", 5, tip, kind="fixed"),
    ]
    joints += [joint("jaw", 5, "0 0 0.05", axis=finger).replace('child link="l6"', 'child link="l7"')] * bool(finger)
    links = "".join(f'<link name="l{number}"/>' for number in range(len(joints) + 1))
    return f'<robot name="r">{links}{"".join(joints)}</robot>'.encode()


@pytest.fixture
def coarse(monkeypatch):
    """A search of a second."""
    for name, value in {"LEVELS": 12, "RADII": 60, "RANDOM_POSTURES": 4_000, "BATCH": 2_000, "BISECTIONS": 1}.items():
        monkeypatch.setattr(reach, name, value)


def exact(height, elbow=math.pi):
    """Nearest and farthest of `planar` whose elbow bends by so much to either side."""
    rise = height + 0.1 - 0.2
    shortest = math.sqrt(0.3**2 + 0.25**2 + 2.0 * 0.3 * 0.25 * math.cos(elbow))
    return math.sqrt(max(0.0, shortest**2 - rise**2)), math.sqrt(0.55**2 - rise**2)


@pytest.mark.long
@pytest.mark.parametrize("elbow", [math.pi, 2.0])
def test_two_links_worked_on_paper(coarse, elbow):
    whole = reach.measure_reach(read_chain(planar(elbow=(-elbow, elbow)), "l6"), DOWN)
    found = whole.front
    assert found.bearing == (-math.pi, math.pi) and whole.axis == (0.0, 0.0)  # backwards it leans over its base
    assert whole.behind is None
    ring = list(zip(found.heights, found.nearest, found.farthest, strict=True))
    for height, near, far in ring:
        inner, outer = exact(height, elbow)
        assert inner - 1e-5 <= near and far <= outer + 1e-5
    ends = [exact(height, elbow) for height in found.heights]
    for number, (_, near, far) in list(enumerate(ring))[1:-1]:  # where ends jump, neighbours share the narrower radii
        inner, outer = zip(*ends[number - 1 : number + 2], strict=True)
        assert near <= max(inner) + whole.step and far >= min(outer) - whole.step
    assert found.heights[0] < -0.35 and found.heights[-1] > 0.55


@pytest.mark.long
def test_a_tip_beside_the_last_axis_narrows_the_ring(coarse):
    """2 cm beside it, all headings are sure between radii 2 cm further in, at bearings that the offset still allows."""
    found = reach.measure_reach(
        read_chain(planar(shoulder=(0.0, 1.6), elbow=(-2.0, 2.0), tip="0.02 0 0.1"), "l6"), DOWN
    ).front
    low, high = found.bearing
    assert -2.0 < low == -high < -1.5
    for height, near, far in zip(found.heights, found.nearest, found.farthest, strict=True):
        inner, outer = exact(height, 2.0)
        assert near >= inner + 0.02 - 1e-5 and far <= outer - 0.02 + 1e-5


@pytest.mark.long
def test_where_it_is_known_how_a_hand_closes_the_ring_is_that_of_the_last_axis(coarse):
    """The tip is 2 cm to where the hand closes; the arm also leans back over its base, and the hand turns clockwise as
    seen from above, as its axis points down: by 5 rad."""
    data = planar(shoulder=(-1.0, 1.6), elbow=(-2.0, 2.0), tip="0.02 0 0.1", finger="0 1 0", roll=(-3.0, 2.0))
    chain = read_chain(data, "l6")
    closing = closing_direction(data, chain, "l6", DOWN)
    np.testing.assert_allclose(np.abs(closing), [1.0, 0.0, 0.0], atol=1e-12)
    found = reach.measure_reach(chain, DOWN, 0.0, closing)
    assert np.abs(found.offset) == pytest.approx([0.02, 0.0], abs=1e-9)
    assert found.front.bearing == (-2.0, 2.0) and found.behind is not None
    for height, near, far in zip(found.front.heights, found.front.nearest, found.front.farthest, strict=True):
        inner, outer = exact(height, 2.0)
        assert inner - 1e-5 <= near and far <= outer + 1e-5
    assert max(found.front.farthest) > 0.54  # not 2 cm less
    # pointing down, its x axis points back to the base, and turns clockwise
    middle = (math.pi if closing[0] > 0 else 0.0) + 0.5
    for ring, turned in ((found.front, 0.0), (found.behind, math.pi)):
        assert ring.turn[1] - ring.turn[0] == pytest.approx(5.0, abs=1e-6)
        assert math.remainder(sum(ring.turn) / 2.0 - middle - turned, math.tau) == pytest.approx(0.0, abs=1e-6)
    text = arm_text("mine", found, ArmSizes({}, 0.0, ()), {}, "by hand")
    arm = read_arm(text.encode())
    assert np.abs(arm.offset) == pytest.approx([0.02, 0.0]) and arm.behind is not None
    assert sum(arm.behind.bearing) == pytest.approx(math.tau, abs=1e-3)


def test_fingers_that_slide_along_the_hand_close_nowhere():
    data = planar(finger="0 0 1")
    assert closing_direction(data, read_chain(data, "l6"), "l6", DOWN) is None


@pytest.mark.parametrize("name", [pytest.param("so101", marks=pytest.mark.long), "ur5e"])
def test_shipped_arms_against_closed_forms(name):
    """`python -m experiments.arms.oracle NAME` does the same with 10,000 poses."""
    is_reached, axis = closed_form_oracle(name)
    found = measure(shipped_arm(name), is_reached, axis, count=200, seed=1)
    assert found["claimed"] > 30 and found["precision"] >= 0.999 and found["recall"] >= 0.995
    if any(shipped_arm(name).offset):
        assert found["at a heading: precision"] >= 0.999 and found["at a heading: recall"] >= 0.98


def test_shipped_arms_are_small_and_say_how_they_were_measured():
    from scenegen.resources import grammar_file

    assert {"panda", "so101", "ur5e"} <= set(shipped_arms())
    for name in ("panda", "so101", "ur5e"):
        text = grammar_file(f"arms/{name}.toml").read_text()
        assert len(text) < 2_000 and text.startswith("# Measured by `scenegen arm`")


def distances(points, line):
    """Of points (P, 2) to a polyline (N, 2)."""
    best = np.full(len(points), np.inf)
    for start, end in itertools.pairwise(line):
        share = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(points - start - share[:, None] * (end - start)).T))
    return best


@pytest.mark.parametrize("seed", range(20))
def test_a_thinned_ring_lies_within_the_measured_one(seed):
    rng = np.random.default_rng(seed)
    heights = np.sort(rng.uniform(-0.3, 0.8, 60)).round(4)
    turn = np.linspace(0.0, math.pi, 60)
    near = np.maximum(0.0, 0.1 + 0.1 * np.cos(turn * rng.uniform(1, 4)) + 0.05 * (rng.uniform() < turn / 9))
    far = 0.5 + 0.3 * np.sin(turn)
    curves = (tuple(one.tolist()) for one in (heights, near, far))
    ring = reach.MeasuredRing(*curves, (-1.0, 1.0), (-math.pi, math.pi), ())
    at, inner, outer = thin_ring(ring)
    assert len(at) < 60 and at == sorted(at)
    for height, least, most in zip(heights, near, far, strict=True):
        low, high = np.interp(height, at, inner), np.interp(height, at, outer)
        assert least - 2e-4 <= low and high <= most + 2e-4
    assert distances(np.column_stack([near, heights]), np.column_stack([inner, at])).max() < 0.0025
    assert distances(np.column_stack([far, heights]), np.column_stack([outer, at])).max() < 0.0025


def test_what_is_written_is_read():
    ring = reach.MeasuredRing((0.0, 0.1, 0.3), (0.1, 0.1, 0.2), (0.5, 0.6, 0.4), (-2.0, 2.0), (-3.0, 3.0), (0.1,))
    whole = reach.Reach(ring, None, (0.0, 0.0), 0.02, 0.005, (0.0, 0.0))
    text = arm_text("mine", whole, ArmSizes({"base": (0.3, 0.2, 0.1)}, 0.05, ()), {"opening": (0.07,)}, "by hand")
    arm = read_arm(text.encode())
    assert (arm.name, arm.ring.bearing, arm.base.width, arm.hand.opening) == ("mine", (-2.0, 2.0), 0.3, 0.07)
    assert (
        arm.ring.heights[0] == -0.05
        and arm.ring.nearest[0] == pytest.approx(0.101)
        and arm.ring.farthest[0] == pytest.approx(0.499)
    )
    assert (arm.ring.turn, arm.offset, arm.behind) == ((-math.pi, math.pi), (0.0, 0.0), None)
    assert (
        "width = 0.3  # measured" in text
        and "opening = 0.07  # given" in text
        and "palm = [0.2, 0.08, 0.1]  # assumed" in text
    )


@pytest.mark.parametrize(
    ("data", "tip", "base", "reason"),
    [
        (planar(), "hand", "", "it has no link `hand`"),
        (planar(), "l6", "ground", "it has no link `ground`"),
        (planar(), "l2", "l4", "no joints lead from `l4` to `l2`"),
        (planar(slide=True), "l6", "", "`roll` between base and tip is prismatic"),
        (planar(first="1 0 0"), "l6", "", "its first joint, `pan`, does not turn about the vertical"),
        (planar(), "l6", "l1", "its first joint, `shoulder`, does not turn about the vertical"),
        (planar(), "l4", "", "its last joint, `wrist`, does not turn the hand about the direction it points in"),
        (planar(roll=(-1.0, 1.0)), "l6", "", "`roll`, turns by less than half a turn"),
        (planar(), "l3", "", "fewer than four joints"),
        (planar(elbow=(1.0, 0.5)), "l6", "", "leave it no angle"),
        (b"<robot", "l6", "", "not well-formed XML"),
    ],
)
def test_files_without_an_arm(data, tip, base, reason):
    with pytest.raises(MeshError, match=reason.replace("(", r"\(")):
        reach.measure_reach(read_chain(data, tip, base), DOWN)


@pytest.mark.long
def test_a_hand_that_cannot_point_down(coarse):
    """The shoulder and the wrist are held so that the hand stays above the level."""
    data = planar().replace(b'lower="-3.2" upper="3.2"', b'lower="-0.4" upper="0.4"', 3)
    data = data.replace(b'name="roll" type="revolute"', b'name="roll" type="continuous"')
    with pytest.raises(ChainError, match="cannot point straight down"):
        reach.measure_reach(read_chain(data, "l6"), DOWN)
