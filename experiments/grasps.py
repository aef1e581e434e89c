"""`graspable` against two oracles: contacts in MuJoCo, and yaws one degree apart. `python -m experiments.grasps`.

The first counts, over random scenes without overlap, how often the sign of phi agrees with what MuJoCo's distances of
geoms say of the same 12 yaws, hand and objects in space: of the boxes of the arm's file and, where robosuite is
installed, of the collision shapes of its Panda gripper. The second counts how many scenes 12 yaws miss that 180 find.
"""

from __future__ import annotations

import importlib.util
import itertools
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

import scenegen
from experiments.measure import phi_of
from scenegen.arrays import Array
from scenegen.geometry.footprint import Box, Circle
from scenegen.lang.check.arms import YAWS
from scenegen.lang.spec import CheckedSpec
from scenegen.things.arms import shipped_arm

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
FINGER = 0.0524, 0.0538  # metres from the flange down to robosuite's fingers, and their length
PALMS = 1  # of the parts of a hand; the others are its fingers
FAR = 0.001  # metres: the largest distance asked for


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
    hands = [("the boxes of the file", box_hand())] + [("robosuite's shapes", mesh_hand())] * bool(_meshes())
    for (hand, parts), jaw in itertools.product(hands, (True, False)):
        verdicts = Oracle(made.poses, spec.checked, parts, jaw).verdicts()
        agree, wrong = (says == verdicts)[judged].mean(), (says & ~verdicts)[judged].sum() / (says & judged).sum()
        what = f"{hand}, {'a thing no wider than the hand opens' if jaw else 'whatever fits between the fingers'}"
        print(f"{what}: MuJoCo agrees with {agree:.2%}; of those called graspable {wrong:.2%} are not")
    finer = phi_of(scenegen.parse(HEAD + every), np.ascontiguousarray(made.poses.reshape(scenes, -1).T))
    found = finer >= 0.0
    for name, few, many in zip(NAMES, says, found, strict=True):
        missed = (many & ~few).mean()
        print(f"{name}: graspable at 12 yaws {few.mean():.1%}, at 180 {many.mean():.1%}, missed {missed:.1%}")


class Oracle:
    """The objects of scenes and an open hand as geoms of MuJoCo, whose distances decide. `parts` are the palm and both
    fingers, each a geom in the frame of the fingertips, whose x is the direction in which they close and whose z is up;
    with `jaw`, so wide jaws have to be clear of the thing too."""

    def __init__(self, poses: Array, spec: CheckedSpec, parts: Sequence[str], jaw: bool) -> None:
        self.poses, self.shapes = poses[:, 1:], spec.shapes[1:]
        self.base, self.arm = poses[0, 0], shipped_arm("panda")
        things = [_thing(one.footprint, one.height) for one in self.shapes]
        hand, count = self.arm.hand, len(things)
        jaws = _boxes(hand.opening, (hand.finger[0], JAW), hand.finger_length)
        self.model = mujoco.MjModel.from_xml_string(
            f"<mujoco><asset>{_meshes()}</asset><worldbody>{''.join([*things, *parts, *jaws])}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        self.parts = range(count, count + len(parts))
        self.own = [*self.parts[PALMS:], *range(count + len(parts), self.model.ngeom if jaw else 0)]

    def verdicts(self) -> npt.NDArray[np.bool_]:
        """(objects, scenes): whether each can be grasped."""
        return np.array([[self._can(scene, which) for scene in self.poses] for which in range(len(self.shapes))])

    def _can(self, scene: Array, which: int) -> bool:
        (x, y, theta), shape, count = scene[which], self.shapes[which], len(self.shapes)
        grip = max(0.0, shape.height - DEPTH)
        near, far = self.arm.ring.reach_at(grip)
        if not near <= math.hypot(x - self.base[0], y - self.base[1]) <= far:
            return False
        for k, (px, py, turn) in enumerate(scene):
            self._put(k, px, py, self.shapes[k].height / 2.0, turn)
        others = [k for k in range(count) if k != which]
        return any(self._is_clear(x, y, theta + step * math.pi / YAWS, grip, which, others) for step in range(YAWS))

    def _is_clear(self, x: float, y: float, yaw: float, grip: float, which: int, others: list[int]) -> bool:
        for geom in range(len(self.shapes), self.model.ngeom):
            self._put(geom, x, y, grip, yaw)
        pairs = itertools.chain(((one, which) for one in self.own), itertools.product(self.parts, others))
        return all(mujoco.mj_geomDistance(self.model, self.data, *pair, FAR, None) >= 0.0 for pair in pairs)

    def _put(self, geom: int, x: float, y: float, z: float, turn: float) -> None:
        """A geom where its own frame is, in a frame that stands there."""
        cos, sin = math.cos(turn), math.sin(turn)
        frame, own = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]), np.empty(9)
        mujoco.mju_quat2Mat(own, self.model.geom_quat[geom])
        self.data.geom_xpos[geom] = frame @ self.model.geom_pos[geom] + (x, y, z)
        self.data.geom_xmat[geom] = (frame @ own.reshape(3, 3)).ravel()


def box_hand() -> list[str]:
    """The boxes of the arm's file: palm, then fingers."""
    hand = shipped_arm("panda").hand
    palm = _box(*hand.palm, at=(0.0, 0.0, hand.finger_length + hand.palm[2] / 2.0))
    return [palm, *_boxes(hand.opening, hand.finger, hand.finger_length)]


def mesh_hand() -> list[str]:
    """The collision shapes of robosuite's Panda gripper where its file panda_gripper.xml has them, open: the hulls of
    the hand and of the fingers, and the pads. There z is down and the fingers close along y."""
    low, half = FINGER[0] + FINGER[1], math.sqrt(0.5)
    turns = f"0 {half} {half} 0", f"0 {half} {-half} 0"
    found = [f'<geom type="mesh" mesh="hand" pos="0 0 {low}" quat="{turns[0]}"/>']
    for way, turn in zip((1.0, -1.0), turns, strict=True):
        found.append(f'<geom type="mesh" mesh="finger" pos="{way * 0.04} 0 {FINGER[1]}" quat="{turn}"/>')
        found.append(_box(0.008, 0.016, 0.016, at=(way * 0.0435, 0.0, FINGER[1] - 0.041)))
    return found


def _meshes() -> str:
    """robosuite's meshes of the hand, as assets."""
    package = importlib.util.find_spec("robosuite")
    if package is None or package.origin is None:
        return ""
    folder = Path(package.origin).parent / "models" / "assets" / "grippers" / "meshes" / "panda_gripper"
    return "".join(f'<mesh name="{name}" file="{folder / name}.stl"/>' for name in ("hand", "finger"))


def _boxes(opening: float, finger: tuple[float, float], height: float) -> list[str]:
    """Two fingers from their tips upwards."""
    aside = (opening + finger[0]) / 2.0
    return [_box(*finger, height, at=(way * aside, 0.0, height / 2.0)) for way in (-1.0, 1.0)]


def _thing(footprint: object, height: float) -> str:
    if isinstance(footprint, Circle):
        return f'<geom type="cylinder" size="{footprint.radius} {height / 2.0}"/>'
    assert isinstance(footprint, Box)
    return _box(footprint.length, footprint.width, height)


def _box(length: float, width: float, height: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    size, place = (" ".join(map(str, each)) for each in ((length / 2.0, width / 2.0, height / 2.0), at))
    return f'<geom type="box" size="{size}" pos="{place}"/>'


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
