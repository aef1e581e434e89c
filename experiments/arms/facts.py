"""Published kinematics of arms, as URDF files without shapes for `scenegen arm`.

UR5e: Denavit-Hartenberg parameters of Universal Robots' page "Parameters for calculations of kinematics and dynamics";
limits of its joints from the manual, the elbow's as its ROS description has them (half a turn to either side). SO-101:
frames and limits of its joints as its makers publish them, rounded to 0.1 mm (calibration of 2025).

    python -m experiments.arms.facts DIR
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

TURN, HALF = math.tau, math.pi
# theta is the angle of the joint; a, d in metres, alpha in radians; the limit to either side
UR5E = (
    ("shoulder_pan", 0.0, 0.1625, HALF / 2, TURN),
    ("shoulder_lift", -0.425, 0.0, 0.0, TURN),
    ("elbow", -0.3922, 0.0, 0.0, HALF),
    ("wrist_1", 0.0, 0.1333, HALF / 2, TURN),
    ("wrist_2", 0.0, 0.0997, -HALF / 2, TURN),
    ("wrist_3", 0.0, 0.0996, 0.0, TURN),
)
# place (m) and turn (rad, fixed x, y and z axes) in the frame of the joint before; limits (rad); all turn about z
SO101 = (
    ("shoulder_pan", (0.0388, 0.0, 0.0624), (HALF, 0.0, -HALF), (-1.9199, 1.9199)),
    ("shoulder_lift", (-0.0304, -0.0183, -0.0542), (-HALF / 2, -HALF / 2, 0.0), (-1.7453, 1.7453)),
    ("elbow_flex", (-0.1126, -0.028, 0.0), (0.0, 0.0, HALF / 2), (-1.69, 1.69)),
    ("wrist_flex", (-0.1349, 0.0052, 0.0), (0.0, 0.0, -HALF / 2), (-1.6581, 1.6581)),
    ("wrist_roll", (0.0, -0.0611, 0.0181), (HALF / 2, 0.0487, HALF), (-2.7439, 2.8412)),
)
SO101_TIP = (-0.0079, -0.0002, -0.0981), (0.0, HALF, 0.0)


def _joint(
    name: str, at: tuple[float, ...], turn: tuple[float, ...], number: int, limits: tuple[float, float] | None
) -> str:
    xyz, rpy = (" ".join(f"{one:.12g}" for one in values) for values in (at, turn))
    kind = "fixed" if limits is None else "revolute"
    limit = "" if limits is None else f'<axis xyz="0 0 1"/><limit lower="{limits[0]:.12g}" upper="{limits[1]:.12g}"/>'
    ends = f'<parent link="link{number}"/><child link="link{number + 1}"/>'
    return f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>{ends}{limit}</joint>\n'


def _robot(name: str, joints: list[str]) -> str:
    links = "".join(f'<link name="link{number}"/>' for number in range(len(joints) + 1))
    return f'<robot name="{name}">\n{links}\n{"".join(joints)}</robot>\n'


def ur5e() -> str:
    """The UR5e; its flange is link7."""
    joints, at, turn = [], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for number, (name, a, d, alpha, limit) in enumerate(UR5E):
        joints.append(_joint(name, at, turn, number, (-limit, limit)))
        at, turn = (a, 0.0, d), (alpha, 0.0, 0.0)  # of the next joint's frame in that of this one, after its turn
    joints.append(_joint("flange", at, turn, len(UR5E), None))
    return _robot("ur5e", joints)


def so101() -> str:
    """The SO-101; between its fingertips is link6."""
    joints = [_joint(name, at, turn, number, limits) for number, (name, at, turn, limits) in enumerate(SO101)]
    return _robot("so101", [*joints, _joint("tip", *SO101_TIP, len(SO101), None)])


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for made in (ur5e, so101):
        (folder / f"{made.__name__}.urdf").write_text(made())
