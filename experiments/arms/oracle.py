"""Shipped arms against inverse kinematics: is what `reachable` says of random poses true?

Poses of a hand that points down, uniform over a cylinder somewhat larger than the ring, with uniform headings. The
truth is a posture within all limits, found by inverse kinematics and checked by forward kinematics on the arm's URDF:
for this heading or the opposite one, which is the same grasp. Where the tip is beside the last axis, the heading
matters: there a place counts as reached where it is at one of 36 headings, and the poses are judged by themselves, too.
Of the Panda: frankik with 721 values of its last joint, then ssik for what is still without. Of the UR5e and the
SO-101: experiments/arms/closed_form.py.

    python -m experiments.arms.oracle so101 [--poses 10000] [--urdf panda.urdf]

The Panda needs `pip install frankik ssik`, and its URDF file, which the package pybullet_data has.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from experiments.arms import facts
from experiments.arms.closed_form import down, fits, forward, solve_planar, solve_ur
from scenegen.things.arms import Arm, ReachRing, shipped_arm
from scenegen.things.chain import JointChain, read_chain
from scenegen.things.outline import Floats

BORDER = 0.005  # metres: poses nearer than this to where the claim changes do not count
DIRECTIONS = 200  # in which a pose is moved to see whether it is near the border
HEADINGS = 18  # over half a turn, that are tried where the tip is beside the last axis
QUARTERS = 0.0, math.pi, math.pi / 2.0, -math.pi / 2.0  # directions from that away from the base
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
    ring = arm.ring
    radii = (max(ring.farthest) + 0.05) * np.sqrt(rng.uniform(size=count))
    bearings = rng.uniform(-math.pi, math.pi, count)
    heights = rng.uniform(ring.heights[0] - 0.03, ring.heights[-1] + 0.03, count)
    places = np.column_stack([radii * np.cos(bearings), radii * np.sin(bearings), heights])
    return places, rng.uniform(-math.pi, math.pi, count)


def rooms(arm: Arm, places: Floats, headings: Floats | None = None) -> Floats:
    """(N,) metres: how far inside of what the arm's file says places are, the hand turned as is best; with `headings`
    (N,) of the direction in which it closes, turned so, either way round. As scenegen/lang/check/arms.py has it."""
    found = [np.full(len(places), -np.inf)]
    for ring in arm.rings:
        if headings is None:
            ahead, back, left, right = (ring.tip_distance(arm.offset, away) for away in QUARTERS)
            found.append(_room_in_ring(ring, places, (back, ahead, min(left, right))))
            continue
        x, y = arm.offset
        for heading in (headings, headings + math.pi):
            cos, sin = np.cos(heading), np.sin(heading)
            axis = places - np.column_stack([x * cos - y * sin, x * sin + y * cos, np.zeros(len(places))])
            found.append(_room_in_ring(ring, axis, (0.0, 0.0, 0.0), heading if any(arm.offset) else None))
    most: Floats = np.max(found, axis=0)
    return most


def _room_in_ring(
    ring: ReachRing, places: Floats, slack: tuple[float, float, float], headings: Floats | None = None
) -> Floats:
    radii, bearings, heights = (
        np.hypot(places[:, 0], places[:, 1]),
        np.arctan2(places[:, 1], places[:, 0]),
        places[:, 2],
    )
    near, far = (np.interp(heights, ring.heights, curve) for curve in (ring.nearest, ring.farthest))
    over = np.minimum(heights - ring.heights[0], ring.heights[-1] - heights)
    parts = [radii - near + slack[0], far + slack[1] - radii, np.where(over < 0.0, over, np.inf)]
    limits = [] if ring.turns_freely else [(bearings, ring.bearing, slack[2])]
    for angles, (low, high), more in limits + ([] if headings is None else [(headings - bearings, ring.turn, 0.0)]):
        off = np.mod(angles - (low + high) / 2.0 + math.pi, math.tau) - math.pi
        parts.append(radii * ((high - low) / 2.0 - np.abs(off)) + more)
    least: Floats = np.min(parts, axis=0)
    return least


def measure(
    arm: Arm, is_reached: IsReached, axis: tuple[float, float], count: int, seed: int = SEED
) -> dict[str, float]:
    """Counts of the poses off the border, by claim and truth, and precision and recall: of places, the hand turned as
    is best, and, where that matters, of poses. `axis` is where the first axis stands in the base link's frame."""
    places, yaws = draw_poses(arm, count, seed)
    offset = np.array([*axis, 0.0])

    def is_held(place: Floats, yaw: float) -> bool:
        return is_reached(place + offset, yaw) or is_reached(place + offset, yaw + math.pi)

    found: dict[str, float] = {"poses": count}
    turned = [k * math.pi / HEADINGS for k in range(HEADINGS)] if any(arm.offset) else [0.0]
    for what, headings, tried in (("", None, turned), ("at a heading: ", yaws, [0.0]))[: 1 + any(arm.offset)]:
        claimed = rooms(arm, places, headings) >= 0.0
        counts = np.ones(count, dtype=bool)
        for way in _directions():
            counts &= (rooms(arm, places + BORDER * way, headings) >= 0.0) == claimed
        claimed, reached = (
            claimed[counts],
            np.array(
                [
                    any(is_held(place, yaw + more) for more in tried)
                    for place, yaw in zip(places[counts], yaws[counts].tolist(), strict=True)
                ]
            ),
        )
        right = int((claimed & reached).sum())
        numbers: dict[str, float] = {
            "off the border": len(claimed),
            "claimed": int(claimed.sum()),
            "reached": int(reached.sum()),
        }
        numbers |= {"precision": right / max(int(claimed.sum()), 1), "recall": right / max(int(reached.sum()), 1)}
        found |= {f"{what}{name}": number for name, number in numbers.items()}
    return found


def _directions() -> Floats:
    """(D, 3): unit vectors, evenly over all directions."""
    steps = np.arange(DIRECTIONS) + 0.5
    heights, turns = 1.0 - 2.0 * steps / DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * steps
    around = np.sqrt(1.0 - heights**2)
    return np.column_stack([around * np.cos(turns), around * np.sin(turns), heights])


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
