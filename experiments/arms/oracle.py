"""Shipped arms against inverse kinematics: is what `reachable` says of random poses true?

Poses of a hand that points down, uniform over a cylinder somewhat larger than the ring, with uniform headings. The
truth is a posture within all limits, found by inverse kinematics and checked by forward kinematics on the arm's URDF:
for this heading or the opposite one, which is the same grasp. Of the Panda: frankik with 721 values of its last joint,
then ssik for what is still without. Of the UR5e and the SO-101: experiments/arms/closed_form.py.

    python -m experiments.arms.oracle so101 [--poses 10000] [--urdf panda.urdf]

The Panda needs `pip install frankik ssik`, and its URDF file, which the package pybullet_data has.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from experiments.arms import facts
from experiments.arms.closed_form import down, fits, forward, solve_planar, solve_ur
from scenegen.things.arms import Arm, shipped_arm
from scenegen.things.chain import JointChain, read_chain
from scenegen.things.outline import Floats

BORDER = 0.005  # metres: poses nearer than this to where the answer changes do not count
LAST_JOINTS = 721  # values of the Panda's last joint
UR5E_LENGTHS = 0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996
UR5E_TOOL = 0.163  # metres from the flange to between the fingertips
PANDA_SHOULDER, PANDA_WRIST = 0.333, 0.088  # metres: its height; the last axis from the joint before it
PANDA_HAND = 0.107 + 0.105  # metres from that joint's height down to between the fingertips
PANDA_ARM = math.hypot(0.316, 0.0825) + math.hypot(0.384, 0.0825)  # metres from the shoulder to that joint, at most
SEED = 0

IsReached = Callable[[Floats, float], bool]
"""A place (3,) in the frame of the base link, and a yaw -> whether a posture is known."""


def draw_poses(arm: Arm, count: int, seed: int) -> tuple[Floats, Floats]:
    """Places (N, 3) about the first axis, and yaws (N,)."""
    rng = np.random.default_rng(seed)
    radii = (max(arm.farthest) + 0.05) * np.sqrt(rng.uniform(size=count))
    bearings = rng.uniform(-math.pi, math.pi, count)
    heights = rng.uniform(arm.heights[0] - 0.03, arm.heights[-1] + 0.03, count)
    places = np.column_stack([radii * np.cos(bearings), radii * np.sin(bearings), heights])
    return places, rng.uniform(-math.pi, math.pi, count)


def claims(arm: Arm, places: Floats) -> npt.NDArray[np.bool_]:
    """(N,): what the arm's file says is reached."""
    radii, bearings = np.hypot(places[:, 0], places[:, 1]), np.arctan2(places[:, 1], places[:, 0])
    near, far = (np.interp(places[:, 2], arm.heights, curve) for curve in (arm.nearest, arm.farthest))
    found: npt.NDArray[np.bool_] = (
        (places[:, 2] >= arm.heights[0]) & (places[:, 2] <= arm.heights[-1]) & (radii >= near) & (radii <= far)
    )
    if not arm.turns_freely:
        found &= (bearings >= arm.bearing[0]) & (bearings <= arm.bearing[1])
    return found


def border_distances(arm: Arm, places: Floats) -> Floats:
    """(N,): metres to where the claim changes."""
    points = np.column_stack([np.hypot(places[:, 0], places[:, 1]), places[:, 2]])
    near, far = (list(zip(curve, arm.heights, strict=True)) for curve in (arm.nearest, arm.farthest))
    corners = np.array([*near, *far[::-1], near[0]])
    best = np.full(len(points), np.inf)
    for start, end in itertools.pairwise(corners):
        if start[0] == end[0] == 0.0:
            continue  # the axis itself is no border
        along = end - start
        share = np.clip((points - start) @ along / max(float(along @ along), 1e-18), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(points - start - share[:, None] * along).T))
    if not arm.turns_freely:
        bearings = np.arctan2(places[:, 1], places[:, 0])
        for limit in arm.bearing:
            off = np.abs(np.mod(bearings - limit + math.pi, math.tau) - math.pi)
            best = np.minimum(best, points[:, 0] * np.where(off < math.pi / 2.0, np.sin(off), 1.0))
    return best


def measure(
    arm: Arm, is_reached: IsReached, axis: tuple[float, float], count: int, seed: int = SEED
) -> dict[str, float]:
    """Counts of the poses off the border, by claim and truth; precision and recall, over all bearings and over those
    within the arm's `bearing`. `axis` is where the first axis stands in the base link's frame."""
    places, yaws = draw_poses(arm, count, seed)
    claimed, counts = claims(arm, places), border_distances(arm, places) > BORDER
    offset = np.array([*axis, 0.0])
    truth = np.array(
        [
            is_reached(place + offset, yaw) or is_reached(place + offset, yaw + math.pi) if one else False
            for place, yaw, one in zip(places, yaws.tolist(), counts.tolist(), strict=True)
        ]
    )
    bearings = np.arctan2(places[:, 1], places[:, 0])
    ahead = counts & ((bearings >= arm.bearing[0]) & (bearings <= arm.bearing[1]) | arm.turns_freely)
    right = int((claimed & truth & counts).sum())
    return {
        "poses": count,
        "off the border": int(counts.sum()),
        "claimed": int((claimed & counts).sum()),
        "reached": int((truth & counts).sum()),
        "precision": right / max(int((claimed & counts).sum()), 1),
        "recall": right / max(int((truth & counts).sum()), 1),
        "recall within bearing": right / max(int((truth & ahead).sum()), 1),
    }


def closed_form_oracle(name: str) -> tuple[IsReached, tuple[float, float]]:
    """Of `ur5e` or `so101`: whether a place is reached; where the first axis stands."""
    if name == "ur5e":
        ur = read_chain(facts.ur5e().encode(), "link7")

        def reaches(place: Floats, yaw: float) -> bool:
            flange, turn = place + np.array([0.0, 0.0, UR5E_TOOL]), down(yaw)
            return fits(ur, solve_ur(UR5E_LENGTHS, turn, flange), turn, flange)

        return reaches, (0.0, 0.0)
    so = read_chain(facts.so101().encode(), "link6")

    def reaches_planar(place: Floats, yaw: float) -> bool:
        return fits(so, solve_planar(so, yaw, place), down(yaw), place)

    return reaches_planar, (facts.SO101[0][1][0], facts.SO101[0][1][1])


def panda_oracle(chain: JointChain) -> IsReached:
    """`chain` leads to the point between the fingertips."""
    import frankik
    from ssik.prebuilt import franka_panda_ik

    hinges = chain.hinges
    low, high = (np.array(each) for each in zip(*((one.low, one.high) for one in hinges), strict=True))
    zero = np.array([[0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0]])
    turn, at = forward(chain, zero)
    tip = np.eye(4)
    tip[:3, :3], tip[:3, 3] = turn[0], at[0]
    to_frankik, to_ssik = (np.linalg.inv(tip) @ other(zero[0]) for other in (frankik.fk, franka_panda_ik.fk))
    last = np.linspace(low[6], high[6], LAST_JOINTS)

    def reaches(place: Floats, yaw: float) -> bool:
        goal = np.eye(4)
        goal[:3, :3], goal[:3, 3] = down(yaw), place
        wrist = place[2] + PANDA_HAND - PANDA_SHOULDER
        if math.hypot(max(math.hypot(place[0], place[1]) - PANDA_WRIST, 0.0), wrist) > PANDA_ARM:
            return False  # whatever the elbow does
        wanted = goal @ to_frankik
        for some in (last[::20], last):
            found = np.concatenate([frankik.ik_full(wanted, None, q7) for q7 in some.tolist()])
            if fits(chain, found, goal[:3, :3], place, 1e-4):
                return True
        others = [one.q for one in franka_panda_ik.solve(goal @ to_ssik, allow_rescue=False)]
        return bool(others) and fits(chain, np.array(others), goal[:3, :3], place, 1e-4)

    return reaches


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("arm")
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--urdf", type=Path)
    given = parser.parse_args()
    begun = time.monotonic()
    arm = shipped_arm(given.arm)
    if given.arm == "panda":
        is_reached, axis = panda_oracle(read_chain(given.urdf.read_bytes(), "panda_grasptarget")), (0.0, 0.0)
    else:
        is_reached, axis = closed_form_oracle(given.arm)
    found = measure(arm, is_reached, axis, given.poses, given.seed)
    print(json.dumps({"arm": given.arm, **found, "seconds": round(time.monotonic() - begun, 1)}))


if __name__ == "__main__":
    main()
