"""Inverse kinematics in closed form for hands that point straight down: of the UR5e, and of the SO-101. What they find
is checked by forward kinematics and the limits of the joints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np

from scenegen.things.chain import JointChain, rotations
from scenegen.things.outline import Floats

MAX_ERROR = 1e-6  # metres and radians that forward kinematics may be off


def forward(chain: JointChain, angles: Floats) -> tuple[Floats, Floats]:
    """The tip's axes (N, 3, 3) and place (N, 3) in the base link's frame, of angles (N, J)."""
    turn, at = np.broadcast_to(np.eye(3), (len(angles), 3, 3)), np.zeros((len(angles), 3))
    for number, hinge in enumerate(chain.hinges):
        at = at + turn @ hinge.frame.at
        turn = turn @ hinge.frame.turn @ rotations(hinge.axis, angles[:, number])
    return turn @ chain.tip.turn, at + turn @ chain.tip.at


def down(yaw: float) -> Floats:
    """The axes (3, 3) of a tip whose z points down, turned by a yaw about the vertical."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])


def fits(chain: JointChain, angles: Floats, turn: Floats, at: Floats, error: float = MAX_ERROR) -> bool:
    """Whether one of these angles (N, J), whole turns added or taken away, is within all limits and leads there."""
    low, high = (np.array(each) for each in zip(*((one.low, one.high) for one in chain.hinges), strict=True))
    angles = angles[np.isfinite(angles).all(axis=1)]
    wrapped = low + np.mod(angles - low + 1e-9, math.tau) - 1e-9
    wrapped = wrapped[(wrapped <= high + 1e-9).all(axis=1)]
    if not len(wrapped):
        return False
    found_turn, found_at = forward(chain, wrapped)
    return bool(
        ((np.abs(found_turn - turn).max(axis=(1, 2)) <= error) & (np.abs(found_at - at).max(axis=1) <= error)).any()
    )


def two_links(first: float, second: float, x: float, y: float) -> Iterator[tuple[float, float]]:
    """The directions of two links of these lengths that lead from the origin to a point."""
    square = x * x + y * y
    cosine = (square - first * first - second * second) / (2.0 * first * second)
    if abs(cosine) <= 1.0:
        for bend in (math.acos(cosine), -math.acos(cosine)):
            start = math.atan2(y, x) - math.atan2(second * math.sin(bend), first + second * math.cos(bend))
            yield start, start + bend


def solve_ur(lengths: tuple[float, float, float, float, float, float], turn: Floats, at: Floats) -> Floats:
    """Angles (N, 6) of an arm of Universal Robots' kind for a flange that points down; `lengths` are d1, a2, a3, d4, d5
    and d6. The second to fourth joint move in a plane that stands upright; the fifth is then at a quarter turn."""
    d1, a2, a3, d4, d5, d6 = lengths
    wrist = at - d6 * turn[:, 2]
    aside = d4 / max(math.hypot(wrist[0], wrist[1]), 1e-12)
    found: list[list[float]] = []
    if abs(aside) > 1.0:
        return np.empty((0, 6))
    for side in (math.asin(aside), math.pi - math.asin(aside)):
        q1 = math.atan2(wrist[1], wrist[0]) + side
        normal = np.array([math.sin(q1), -math.cos(q1), 0.0])  # of the plane: the axes of the second to fourth joint
        ahead = np.array([math.cos(q1), math.sin(q1), 0.0])
        for q5 in (math.pi / 2.0, -math.pi / 2.0):
            s5 = math.sin(q5)
            q6 = math.atan2(-float(turn[:, 1] @ normal) / s5, float(turn[:, 0] @ normal) / s5)
            # the fifth joint's axis is the third column of the frame before it: the hand's y and x tell where it points
            axis5 = turn[:, 0] * math.sin(q6) + turn[:, 1] * math.cos(q6)
            for sign in (1.0, -1.0):
                elbow_end = wrist - sign * d5 * axis5 - d4 * normal
                x, y = float(elbow_end @ ahead), float(elbow_end[2]) - d1
                for first, second in two_links(a2, a3, x, y):
                    down_axis = sign * axis5
                    total = math.atan2(float(down_axis @ ahead), -float(down_axis[2]))
                    found.append([q1, first, second - first, total - second, q5, q6])
    return np.array(found).reshape(-1, 6)


def solve_planar(chain: JointChain, yaw: float, at: Floats) -> Floats:
    """Angles (N, 5) of an arm whose second to fourth joint are parallel and level, and whose last turns about the
    direction of the hand, for a tip that points down with this yaw."""
    count = len(chain.hinges)
    places, axes, tip_turn, tip = _zero(chain)
    lateral = axes[1]  # the common axis
    radial = np.array([lateral[1], -lateral[0], 0.0])
    roll = axes[4]
    foot = places[4] + roll * float(roll @ (tip - places[4]))  # of the tip on the last axis
    plane = [
        np.array([float(one @ radial), one[2]])
        for one in (*(place - places[0] for place in places[1:4]), foot - places[0])
    ]
    aside = float((foot - places[0]) @ lateral)
    offset = tip_turn.T @ (tip - foot)
    wanted = at - down(yaw) @ offset - places[0]
    distance = math.hypot(wanted[0], wanted[1])
    if distance < abs(aside):
        return np.empty((0, count))
    found = []
    pointing = np.array([float(tip_turn[:, 2] @ radial), tip_turn[2, 2]])
    turned = -math.pi / 2.0 - math.atan2(pointing[1], pointing[0])  # in the plane, from radial to up
    for front in (1.0, -1.0):
        reach = front * math.sqrt(distance**2 - aside**2)
        bearing = math.atan2(wanted[1], wanted[0]) - math.atan2(
            reach * radial[1] + aside * lateral[1], reach * radial[0] + aside * lateral[0]
        )
        target = np.array([reach, wanted[2]])
        links = [plane[1] - plane[0], plane[2] - plane[1], plane[3] - plane[2]]
        c, s = math.cos(turned), math.sin(turned)
        wrist = target - np.array([c * links[2][0] - s * links[2][1], s * links[2][0] + c * links[2][1]]) - plane[0]
        lengths = [float(np.hypot(*link)) for link in links[:2]]
        for first, second in two_links(*lengths, *wrist.tolist()):
            one, two = (angle - math.atan2(link[1], link[0]) for angle, link in ((first, links[0]), (second, links[1])))
            # about the lateral axis a turn leads from up to radial, the other way round than in the plane
            sense = float(np.cross(radial, [0.0, 0.0, 1.0]) @ lateral)
            inner = [sense * one, sense * (two - one), sense * (turned - two)]
            pan = bearing * float(axes[0][2])
            for last in _last(chain, [pan, *inner], yaw):
                found.append([pan, *inner, last])
    return np.array(found).reshape(-1, count)


def _last(chain: JointChain, angles: list[float], yaw: float) -> list[float]:
    """The angle of the last joint that gives a hand that points down this yaw."""
    turn, _ = forward(chain, np.array([[*angles, 0.0]]))
    now = math.atan2(turn[0, 1, 0], turn[0, 0, 0])
    return [now - yaw, yaw - now]


@cache
def _zero(chain: JointChain) -> tuple[list[Floats], list[Floats], Floats, Floats]:
    """Where the joints are, and their axes, at angles of 0; the tip's axes and place."""
    turn, at = np.eye(3), np.zeros(3)
    places, axes = [], []
    for hinge in chain.hinges:
        at, turn = at + turn @ hinge.frame.at, turn @ hinge.frame.turn
        places.append(at)
        axes.append(turn @ hinge.axis)
    tip_turn, tip = forward(chain, np.zeros((1, len(chain.hinges))))
    return places, axes, tip_turn[0], tip[0]
