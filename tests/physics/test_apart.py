"""`apart` against MuJoCo's distances between geoms: random pairs of boxes, cylinders and prisms at random heights.

MuJoCo gives the nearest points of two bodies. Where they are apart, the one lies to the side of the other by the
clearance in the plane and above it by that of the heights; `apart` is the larger. Where they share space both give the
depth.
"""

import math

import numpy as np
import pytest

from scenegen.geometry import NUMPY, Box, Circle
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi
from scenegen.things.mesh import prism

mujoco = pytest.importorskip("mujoco", reason="mujoco, the oracle, is not installed (pip install 'scenegen[mujoco]')")

POSES = 20  # of each pair of shapes
NEAR = 1e-6  # metres
MODEL = """<mujoco><option ccd_tolerance="1e-12" ccd_iterations="400"/><asset>{meshes}</asset>
<worldbody>{geoms}</worldbody></mujoco>"""


def shape_of(draw, kind):
    """A shape as a spec has it."""
    height = draw.uniform(0.01, 0.2)
    if kind == "box":
        return f"box({draw.uniform(0.02, 0.3)!r}, {draw.uniform(0.02, 0.3)!r}, {height!r})"
    if kind == "cylinder":
        return f"cylinder({draw.uniform(0.01, 0.15)!r}, {height!r})"
    turns = np.sort(draw.uniform(0.0, math.tau, int(draw.integers(3, 9)))).tolist()
    wide, long = draw.uniform(0.03, 0.15, 2).tolist()
    corners = ", ".join(f"({long * math.cos(turn)!r}, {wide * math.sin(turn)!r})" for turn in turns)
    return f"prism([{corners}], {height!r})"


def geom_of(shape, name):
    """The same shape as a geom of MuJoCo and the mesh that it may need; its frame is in the middle of its height."""
    half = shape.height / 2.0
    match shape.footprint:
        case Box(length, width):
            return f'<geom type="box" size="{length / 2.0!r} {width / 2.0!r} {half!r}"/>', ""
        case Circle(radius):
            return f'<geom type="cylinder" size="{radius!r} {half!r}"/>', ""
        case outline:
            corners = " ".join(map(repr, prism(outline.vertices, -half, half).vertices.ravel().tolist()))
            return f'<geom type="mesh" mesh="{name}"/>', f'<mesh name="{name}" vertex="{corners}"/>'


def compared(seed, pairs):
    """(pairs * POSES, 2): `apart` and what MuJoCo says, and how many of the pairs were beside, above, in each other."""
    draw = np.random.default_rng(seed)
    found, kinds = [], np.zeros(3, dtype=int)
    for _ in range(pairs):
        one, other = (shape_of(draw, str(draw.choice(["box", "cylinder", "prism"]))) for _ in range(2))
        stands = [f"box(1, 1, {draw.uniform(0.01, 0.25)!r})" for _ in range(2)]
        spec = check_text(
            f"object low = {stands[0]}, high = {stands[1]}, a = {one} on low, b = {other} on high\n"
            "task: apart(a, b) >= 0"
        )
        poses = draw.uniform((-0.15, -0.15, 0.0), (0.15, 0.15, math.tau), (POSES, 4, 3))
        ours = phi(spec.core, list(poses.reshape(POSES, 12).T), NUMPY)["task"]
        parts = [geom_of(shape, name) for shape, name in zip(spec.shapes[2:], "ab", strict=True)]
        geoms, meshes = ("".join(some) for some in zip(*parts, strict=True))
        model = mujoco.MjModel.from_xml_string(MODEL.format(geoms=geoms, meshes=meshes))
        data = mujoco.MjData(model)
        local = [(model.geom_pos[k].copy(), model.geom_quat[k].copy()) for k in range(2)]
        for pose, apart in zip(poses[:, 2:], ours.tolist(), strict=True):
            place(data, local, pose, [spec.heights[k] + spec.shapes[k].height / 2.0 for k in (2, 3)])
            ends = np.zeros(6)
            distance = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, ends)
            x, y, z = np.abs(ends[3:] - ends[:3])
            beside, above = math.hypot(x, y), float(z)
            found.append((apart, distance if distance < 0.0 else max(beside, above)))
            kinds[2 if distance < 0.0 else int(above > beside)] += 1
    return np.array(found), kinds


def place(data, local, poses, heights):
    """Put both geoms where their objects are; meshes have a frame of their own, which MuJoCo chose."""
    for k, ((x, y, theta), z) in enumerate(zip(poses, heights, strict=True)):
        turn = np.array([math.cos(theta / 2.0), 0.0, 0.0, math.sin(theta / 2.0)])
        offset, quat = np.zeros(3), np.zeros(4)
        mujoco.mju_rotVecQuat(offset, local[k][0], turn)
        mujoco.mju_mulQuat(quat, turn, local[k][1])
        data.geom_xpos[k] = offset + np.array([x, y, z])
        mujoco.mju_quat2Mat(data.geom_xmat[k], quat)


def check(seed, pairs):
    found, kinds = compared(seed, pairs)
    assert kinds.min() > 0.03 * len(found), kinds
    worst = np.abs(found[:, 0] - found[:, 1]).argmax()
    np.testing.assert_allclose(found[:, 0], found[:, 1], atol=NEAR, err_msg=f"pair {worst // POSES} of seed {seed}")


def test_two_hundred_pairs():
    check(1, 10)


@pytest.mark.slow
def test_ten_thousand_pairs():
    check(2, 500)
