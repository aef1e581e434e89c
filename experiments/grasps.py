"""`graspable` against two oracles: boxes in MuJoCo, and yaws one degree apart. `python -m experiments.grasps`.

The first counts, over random scenes without overlap, how often the sign of phi agrees with what MuJoCo's distances of
geoms say of the same 12 yaws, hand and objects in space; the second how many scenes 12 yaws miss that 180 find.
"""

from __future__ import annotations

import math
import sys

import mujoco
import numpy as np
import numpy.typing as npt

import scenegen
from experiments.measure import phi_of
from scenegen.arrays import Array
from scenegen.geometry.footprint import Box, Circle
from scenegen.lang.check.arms import YAWS
from scenegen.lang.spec import CheckedSpec
from scenegen.things.arms import Arm, shipped_arm

HEAD = """
robot arm = panda at (0.5, -0.25, NORTH)
workspace [0.3, 0.7] x [0.2, 0.6]
object a = cylinder(0.03, 0.1), b = box(0.05, 0.05, 0.05), c = box(0.16, 0.06, 0.21), d = cylinder(0.036, 0.23),
    e = box(0.09, 0.058, 0.058), f = box(0.04, 0.2, 0.12)
require noOverlap()
"""
NAMES = "abcdef"
DEPTH = 0.02  # metres: GRASP_DEPTH
BORDER = 0.003  # metres: nearer to 0 than this, phi is not judged
JAW = 1.0  # metres: how wide jaws are between which a thing fits only if it is no wider than the hand opens
FAR = 1.0  # metres: the largest distance asked for


def main(scenes: int = 2000, seed: int = 0) -> None:
    """Print both comparisons."""
    labels = "".join(f"of_{name}: graspable({name}, arm)\n" for name in NAMES)
    every = "".join(
        f"all_{name}: reachable({name}, arm) & (exists k in 0..179: handRoom({name}, arm, k * 1 deg, 2 cm) >= 0)\n"
        for name in NAMES
    )
    spec = scenegen.parse(HEAD + labels)
    made = scenegen.sample(spec, {}, n=scenes, seed=seed)
    phi = np.stack([made.phi[f"of_{name}"] for name in NAMES])
    judged, says = np.abs(phi) >= BORDER, phi >= 0.0
    print(f"{scenes} scenes, {judged.sum()} of {phi.size} grasps at least {1e3 * BORDER:g} mm from the border")
    for jaw, what in ((JAW, "jaws as wide as the thing"), (0.0, "fingers alone")):
        verdicts = Oracle(made.poses, spec.checked, jaw).verdicts()
        agree, wrong = (says == verdicts)[judged].mean(), (says & ~verdicts)[judged].sum() / (says & judged).sum()
        print(f"{what}: MuJoCo agrees with {agree:.2%}; of those called graspable {wrong:.2%} are not")
    finer = phi_of(scenegen.parse(HEAD + every), np.ascontiguousarray(made.poses.reshape(scenes, -1).T))
    found = finer >= 0.0
    for name, few, many in zip(NAMES, says, found, strict=True):
        missed = (many & ~few).mean()
        print(f"{name}: graspable at 12 yaws {few.mean():.1%}, at 180 {many.mean():.1%}, missed {missed:.1%}")


class Oracle:
    """The objects of scenes and an open hand as geoms of MuJoCo, whose distances decide."""

    def __init__(self, poses: Array, spec: CheckedSpec, jaw: float) -> None:
        self.poses, self.shapes = poses[:, 1:], spec.shapes[1:]
        self.base, self.arm = poses[0, 0], shipped_arm("panda")
        things = [_thing(one.footprint, one.height) for one in self.shapes]
        hand = self.arm.hand
        parts = [_box(*hand.finger, hand.finger_length)] * 2 + [_box(*hand.palm)]
        parts += [_box(hand.finger[0], max(jaw, hand.finger[1]), hand.finger_length)] * 2
        self.model = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{''.join(things + parts)}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)

    def verdicts(self) -> npt.NDArray[np.bool_]:
        """(objects, scenes): whether each can be grasped."""
        return np.array([[self._can(scene, which) for scene in self.poses] for which in range(len(self.shapes))])

    def _can(self, scene: Array, which: int) -> bool:
        (x, y, theta), shape, count = scene[which], self.shapes[which], len(self.shapes)
        grip = max(0.0, shape.height - DEPTH)
        near, far = self.arm.reach_at(grip)
        if not near <= math.hypot(x - self.base[0], y - self.base[1]) <= far:
            return False
        for k, (px, py, turn) in enumerate(scene):
            self._put(k, px, py, self.shapes[k].height / 2.0, turn)
        others = [k for k in range(count) if k != which]
        return any(
            self._is_clear(x, y, theta + step * math.pi / YAWS, grip, which, others, self.arm) for step in range(YAWS)
        )

    def _is_clear(self, x: float, y: float, yaw: float, grip: float, which: int, others: list[int], arm: Arm) -> bool:
        hand, count = arm.hand, len(self.shapes)
        aside = (hand.opening + hand.finger[0]) / 2.0
        for geom, way in ((count, -aside), (count + 1, aside), (count + 3, -aside), (count + 4, aside)):
            middle = grip + hand.finger_length / 2.0
            self._put(geom, x + way * math.cos(yaw), y + way * math.sin(yaw), middle, yaw)
        self._put(count + 2, x, y, grip + hand.finger_length + hand.palm[2] / 2.0, yaw)
        pairs = [(count + part, k) for part in range(3) for k in others] + [(count + 3, which), (count + 4, which)]
        return all(mujoco.mj_geomDistance(self.model, self.data, *pair, FAR, None) >= 0.0 for pair in pairs)

    def _put(self, geom: int, x: float, y: float, z: float, turn: float) -> None:
        cos, sin = math.cos(turn), math.sin(turn)
        self.data.geom_xpos[geom] = x, y, z
        self.data.geom_xmat[geom] = cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0


def _thing(footprint: object, height: float) -> str:
    if isinstance(footprint, Circle):
        return f'<geom type="cylinder" size="{footprint.radius} {height / 2.0}"/>'
    assert isinstance(footprint, Box)
    return _box(footprint.length, footprint.width, height)


def _box(length: float, width: float, height: float) -> str:
    return f'<geom type="box" size="{length / 2.0} {width / 2.0} {height / 2.0}"/>'


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
