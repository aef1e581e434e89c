"""Problems written by hand: numpy functions of poses (N, 3, T + 1, B), in metres and radians."""

from dataclasses import replace

import numpy as np

from scenegen.pose import TWO_PI
from scenegen.sampling.motions.problem import MotionProblem
from scenegen.sampling.request import Range, SampleRequest


def distance(poses, a, b):  # at every moment, (T + 1, B)
    return np.hypot(poses[a, 0] - poses[b, 0], poses[a, 1] - poses[b, 1])


def meets(poses):  # eventually the first two objects are near
    return (0.15 - distance(poses, 0, 1)).max(axis=0)[None]


def parts(poses):  # near at first, apart in the end
    far = distance(poses, 0, 1)
    return np.minimum(0.2 - far[0], far[-1] - 0.35)[None]


def ends_right(poses):  # the first object left of 0 at first, right of 0.1 in the end
    return np.minimum(-poses[0, 0, 0], poses[0, 0, -1] - 0.1)[None]


def turns(poses):  # the first object faces along x in the end
    return (np.cos(poses[0, 2, -1]) - 0.9)[None]


def two(poses):
    return np.concatenate([meets(poses), ends_right(poses)])


def apart(poses):
    return (distance(poses, 0, 1) - 0.08).min(axis=0)


def travels(poses):  # all objects start left and end right
    left, right = -0.15 - poses[:, 0, 0], poses[:, 0, -1] - 0.1
    return np.minimum(left.min(axis=0), right.min(axis=0))[None]


class Score:
    """phi of the labels, then the requirement's margin."""

    def __init__(self, phi, required):
        self.phi, self.required = phi, required

    def __call__(self, poses):
        margin = np.full(poses.shape[-1], np.inf) if self.required is None else self.required(poses)
        return np.concatenate([self.phi(poses), margin[None]])


def problem(
    phi, wanted, *, objects=2, steps=4, n=1000, seed=0, spread="base", radius=0.15, turn=0.5, required=None, **more
):
    labels = tuple(wanted)
    corner = np.tile([0.4, 0.4, TWO_PI], (objects, 1))
    lowest = corner * [-1.0, -1.0, 0.0]
    request = SampleRequest({k: Range(*v) for k, v in wanted.items()}, n=n, seed=seed, spread=spread)
    reach = np.full(objects, radius), np.full(objects, turn)
    names = tuple(f"o{k}" for k in range(objects))
    score = Score(phi, required)
    return MotionProblem(names, labels, steps, lowest, corner, *reach, score, request, **more)


def held(made, thing):
    """The same problem, in which an object stays at the origin."""
    lowest, highest, radius, turn = (part.copy() for part in (made.lowest, made.highest, made.radius, made.turn))
    lowest[thing] = highest[thing] = radius[thing] = turn[thing] = 0.0
    return replace(made, lowest=lowest, highest=highest, radius=radius, turn=turn)


def all_problems(n):
    return {
        "meets": problem(meets, {"a": (0.05, None)}, n=n),
        "parts, all move": problem(parts, {"a": (0.0, None)}, steps=3, moves="all", n=n),
        "require": problem(ends_right, {"a": (0.0, 0.1)}, steps=5, required=apart, n=n),
        "two labels": problem(two, {"a": (0.0, None), "b": (-0.1, 0.2)}, steps=6, n=n),
        "held": held(problem(meets, {"a": (0.0, None)}, steps=3, n=n), 1),
        "turns, all move": problem(turns, {"a": (0.0, 0.05)}, objects=3, steps=2, moves="all", n=n, required=apart),
    }
