"""A scripted pick-and-place policy: it finds by scenegen where a thing has to go, and takes it there.

    scenegen suite run SUITE --policy examples/policies/scripted.py:Scripted --world ...

It sees the poses of all objects and knows the spec. What it does not know: its eye is off by `see` metres when it
grasps, and its hand by `put` metres when it lets go (standard deviations, drawn anew for each thing). Where the start
comes with a goal and a grasp (`scenegen suite new --grasp`), it takes these, unless `follow` is false. It gives up
getting above a place after `steps` actions, and goes on from where it is.
"""

import math
from collections.abc import Callable, Iterator
from itertools import combinations, product
from typing import Any

import numpy as np

import scenegen
from scenegen.geometry import NUMPY, Box, Circle
from scenegen.geometry.clearance import gap

Moves = list[tuple[int, np.ndarray]]  # numbers of objects, and where each goes: x, y, theta, z
Script = Iterator[np.ndarray]  # actions
CANDIDATES = 128  # places that are looked at for each thing
WIDEST = 0.075  # metres that go between the fingers
REACH = 0.05, 0.5  # metres and radians of an action of 1
OPEN, CLOSED = -1.0, 1.0
ABOVE = 0.12  # metres that the hand keeps above what stands on the table
DEEP = 0.025  # metres between the finger tips and the top of what they hold
HAND = ((0.132, 0.022, -0.012), (0.208, 0.064, 0.024))  # open fingers, palm: length, width, and height above the grip
ROOM = 0.01  # metres around the hand that are enough
ASIDE = 0.03  # metres beside its place from which the hand goes down, the nearer the faster


class Scripted:
    """One for each world, which has `task` (spec and success label); made anew for each task."""

    def __init__(self, env: Any, see: float = 0.003, put: float = 0.003, follow: bool = True, steps: int = 25) -> None:
        self.label, self.see, self.put, self.follow, self.steps = env.task.success, see, put, follow, steps
        self.spec = without_start(env.task.spec, self.label)
        self.shapes, self.yaws = self.spec.checked.shapes, None  # of the grasps that came with the start
        self.half = False  # whether what is moved may be half turned at the goal that came with it

    def reset(self, seed: int) -> None:
        self.random = np.random.default_rng([seed, 1])
        self.script, self.level, self.yaws = None, ABOVE, None

    def __call__(self, observation: Any, instruction: str) -> np.ndarray:
        self.seen = observation
        if self.script is None:
            self.rest = yaw(observation["hand"])
            self.middle = self.rest + observation["joints"][-1]  # of what the wrist can turn
            self.script = self.play(self.moves(flat(self.things())))
        return next(self.script)

    def things(self) -> np.ndarray:
        """(N, 7): where the objects of the spec are."""
        return self.seen["objects"]

    def moves(self, poses: np.ndarray) -> Moves:
        if not self.follow or "goal" not in self.seen:
            return plan(self.spec, self.label, poses)
        goal, self.yaws = self.seen["goal"], self.seen["yaws"]
        (which,) = np.flatnonzero(np.isfinite(self.yaws))
        self.half = self.may_turn(which, flat(goal))
        return [(which, np.append(flat(goal)[which], goal[which, 2]))]

    def may_turn(self, which: int, poses: np.ndarray) -> bool:
        """Whether the label holds as well with a box or a cylinder half turned."""
        if self.spec.checked.choices or not isinstance(self.shapes[which].footprint, Box | Circle):
            return False
        both = np.stack([poses, poses])
        both[1, which, 2] += math.pi
        given, turned = self.spec.scenes(both).phi[self.label]
        return turned > given - 1e-6

    def play(self, moves: Moves) -> Script:
        """The actions: each yield is one, and the next thing that is seen."""
        for which, goal in moves:
            yield from self.carry(which, goal)
        while True:  # out of the way
            yield self.towards([0.0, self.seen["hand"][1], self.level], self.rest, OPEN)

    def carry(self, which: int, goal: Any) -> Script:
        height = self.shapes[which].height
        x, y, _ = flat(self.things())[which]
        tallest = max(
            shape.height + pose[2]
            for shape, pose in zip(self.shapes, self.things(), strict=True)
            if shape.arm is None  # over its own base it does not come
        )
        self.level = tallest + max(ABOVE, height)
        low = self.things()[which][2]
        grip = low + max(height - DEEP, 0.012)
        off = self.random.normal(0.0, self.see, 2)
        turn, after = self.grasp(which, goal, grip)
        at = np.array([x + off[0], y + off[1]])
        yield from self.move([*at, self.level], turn, OPEN, near=0.03, steps=self.steps)
        yield from self.move([*at, grip], turn, OPEN)
        yield from self.hold([*at, grip], turn, CLOSED, lambda before, now, _: now > before - 5e-4)
        yield from self.move([*at, self.level], turn, CLOSED, near=0.03)
        at = goal[:2] + self.random.normal(0.0, self.put, 2)
        yield from self.move([*at, self.level], after, CLOSED, near=0.01, steps=self.steps)
        drop = grip + goal[3] - low + 0.003
        yield from self.move([*at, drop], after, CLOSED)
        yield from self.hold([*at, drop], after, OPEN, lambda _, now, first: now > first + 0.01)
        yield from self.move([*at, self.level], after, OPEN, near=0.05)

    def grasp(self, which: int, goal: Any, grip: float) -> tuple[float, float]:
        """The directions in which the fingers close on a thing, and in which they let it go: of those that go across
        it, the ones with most room around the hand, and of several the ones that turn it least; or those of the grasp
        that came with the start, by the one of two sides that keeps the wrist farthest from its ends."""
        poses, low = flat(self.things()), self.things()[which][2]
        if self.yaws is not None:
            turnings = [nearest(goal[2] - poses[which, 2] + k * math.pi, 0.0, math.tau) for k in range(1 + self.half)]
            sides = [self.rest - math.pi / 2.0, self.rest + math.pi / 2.0]
            befores = [nearest(poses[which, 2] + self.yaws[which], side, math.pi) for side in sides]
            found = [(before, before + turning) for before in befores for turning in turnings]
            return min(found, key=lambda way: max(abs(turn - self.middle) for turn in way))
        ways = list(across(self.shapes[which], poses[which, 2], goal[2], self.rest))
        before, after = np.array(ways).T
        room = np.minimum(
            self.clearance(which, poses[which], grip, before), self.clearance(which, goal, grip + goal[3] - low, after)
        )
        turned = np.abs(before - self.rest) + np.abs(after - self.rest)
        return ways[int(np.argmax(room - 1e-3 * turned))]

    def clearance(self, which: int, at: Any, grip: float, turns: np.ndarray) -> np.ndarray:
        """(k,): metres around the open hand at a thing, at most ROOM: to what is as high as its fingers or its palm."""
        found = np.full(len(turns), ROOM)
        for other, (shape, pose) in enumerate(zip(self.shapes, self.things(), strict=True)):
            for length, width, above in HAND:
                if other != which and shape.height + pose[2] > grip + above:
                    x, y, theta = flat(pose[None])[0]
                    hand = Box(length, width)
                    found = np.minimum(found, gap(NUMPY, hand, shape.footprint, at[0], at[1], turns, x, y, theta))
        return found

    def move(self, goal: Any, turn: float, fingers: float, near: float = 0.004, steps: int = 25) -> Script:
        """Towards a place until the hand is near."""
        for _ in range(steps):
            off = np.linalg.norm(np.subtract(goal, self.seen["hand"][:3]))
            if off < near and abs(nearest(turn, yaw(self.seen["hand"]), math.tau) - yaw(self.seen["hand"])) < 0.1:
                return
            yield self.towards(goal, turn, fingers)

    def hold(
        self, goal: Any, turn: float, fingers: float, done: Callable[[float, float, float], bool], steps: int = 12
    ) -> Script:
        """At a place, until the fingers have done: how wide they were before, are now, and were at first."""
        first = now = np.ptp(self.seen["fingers"])
        for step in range(steps):
            yield self.towards(goal, turn, fingers)
            before, now = now, np.ptp(self.seen["fingers"])
            if step and done(before, now, first):
                return

    def towards(self, goal: Any, turn: float, fingers: float) -> np.ndarray:
        """The action that moves the hand towards a place, pointing down, with the fingers closing along `turn`. It goes
        down where it is above the place, not on a slant: on its way down it drifts, most near the base and far out."""
        hand = self.seen["hand"]
        shift = np.subtract(goal, hand[:3]) / REACH[0]
        aside = np.linalg.norm(shift[:2]) * REACH[0]
        shift[:2] /= max(1.0, np.abs(shift[:2]).max())
        shift[2] = np.clip(shift[2], -max(0.0, 1.0 - aside / ASIDE), 1.0)
        rotation = rotation_vector(pointing_down(turn) @ matrix(hand[3:]).T) / REACH[1]
        cosine, sine = math.cos(self.seen["turn"]), math.sin(self.seen["turn"])
        to_robot = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return np.clip([*(to_robot @ shift), *(to_robot @ rotation), fingers], -1.0, 1.0)


def without_start(spec: scenegen.Spec, label: str) -> scenegen.Spec:
    """The spec of a suite's task without what the suite adds to it: that the goal does not hold at the start."""
    before, _, last = spec.checked.source.rpartition("require ")
    return scenegen.parse(before) if last.startswith(f"!{label}") else spec


def plan(spec: scenegen.Spec, label: str, poses: np.ndarray) -> Moves:
    """The fewest moves (object, (x, y, theta, z)) after which the label holds: one, or two; none if there are none."""
    able = [which for which, shape in enumerate(spec.checked.shapes) if graspable(shape)]
    able = [which for which in able if which not in spec.checked.fixed]
    for count in (1, 2):
        found = [best for group in combinations(able, count) if (best := places(spec, label, poses, group)) is not None]
        if found:
            return max(found, key=lambda one: one[0])[1]
    return []


def places(spec: scenegen.Spec, label: str, poses: np.ndarray, group: tuple[int, ...]) -> tuple[float, Moves] | None:
    """The best of the places for a group of things, the others as they are: its margin, and the moves."""
    kept = set(range(len(poses))) - set(group) - set(spec.checked.fixed)
    fix = {spec.objects[which]: tuple(poses[which]) for which in kept}
    try:
        scenes = scenegen.sample(
            spec, {label: (0.0, None)}, CANDIDATES, fix=fix, spread="base", timeout=60.0, workers=1
        )
    except scenegen.RequestError:
        return None  # proved to be impossible, or not found
    given = np.concatenate([scenes.poses, scenes.poses])
    given[CANDIDATES:, group, 2] = poses[list(group), 2]  # the same places, turned as they are now
    after = spec.scenes(given, on=None if scenes.on is None else np.concatenate([scenes.on, scenes.on]))
    phi = after.phi[label]
    margin = np.where(phi >= 0.0, np.minimum(phi, room(spec, after.poses7(), group)), -1.0)
    margin[CANDIDATES:] += 0.01  # which is easier to do
    best = int(np.argmax(margin))
    return margin[best], [(which, np.append(given[best, which], after.poses7()[best, which, 2])) for which in group]


def room(spec: scenegen.Spec, poses: np.ndarray, group: tuple[int, ...]) -> np.ndarray:
    """(n,): metres between the things of a group and their nearest neighbours, as discs; not what they stand over."""
    shapes = spec.checked.shapes
    found = np.full(len(poses), np.inf)
    for which in group:
        for other in set(range(len(shapes))) - {which}:
            apart = np.linalg.norm(poses[:, which, :2] - poses[:, other, :2], axis=1)
            apart -= sum(max(shapes[one].footprint.extent) / 2.0 for one in (which, other))
            over = poses[:, which, 2] >= poses[:, other, 2] + shapes[other].height - 0.001
            found = np.where(over, found, np.minimum(found, apart))
    return found


def graspable(shape: Any) -> bool:
    return min(shape.footprint.extent) <= WIDEST


def across(shape: Any, theta: float, goal: float, now: float) -> Iterator[tuple[float, float]]:
    """The directions in which fingers can close on a thing with the heading `theta`, and open again when it has the
    heading `goal`, each as near as can be to how the hand is turned now."""
    if shape.asset == "cylinder":
        for before, after in product(np.arange(8) * math.pi / 8.0, repeat=2):
            yield nearest(before, now, math.pi), nearest(after, now, math.pi)
        return
    length, width = shape.footprint.extent
    turning = nearest(goal - theta, 0.0, math.tau)
    for turn in (0.0, math.pi / 2.0) if max(length, width) <= WIDEST else (0.0,):
        way = theta + turn + (math.pi / 2.0 if width <= length else 0.0)
        before = nearest(way, now - turning / 2.0, math.pi)
        yield before, before + turning


def nearest(angle: float, to: float, period: float) -> float:
    """The angle nearest to another, of those that differ from the first by a period."""
    return to + math.remainder(angle - to, period)


def flat(poses: np.ndarray) -> np.ndarray:
    """(N, 3): x, y and heading of poses (N, 7)."""
    return np.column_stack([poses[:, :2], np.remainder(2.0 * np.arctan2(poses[:, 6], poses[:, 3]), math.tau)])


def matrix(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def yaw(hand: np.ndarray) -> float:
    """The direction in which the fingers close."""
    return math.atan2(*matrix(hand[3:])[1::-1, 0])


def pointing_down(turn: float) -> np.ndarray:
    """The attitude of a hand that points down, with its x axis, along which the fingers close, turned by an angle."""
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.array([[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]])


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Axis times angle."""
    off = rotation - rotation.T
    axis = np.array([off[2, 1], off[0, 2], off[1, 0]])
    sine = np.linalg.norm(axis) / 2.0
    return axis / 2.0 * (math.atan2(sine, (np.trace(rotation) - 1.0) / 2.0) / sine if sine > 1e-9 else 1.0)
