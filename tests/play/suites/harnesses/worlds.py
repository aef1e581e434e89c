"""A world that remembers what it should not: how often it was reset, what was drawn, where objects were left; and that
moves objects in the very array that the start came in. And a policy that stops at random moments."""

import numpy as np
from gymnasium.spaces import Box

begun = []  # of every episode in this process: the start's number, and the bytes of the poses that it began with


class Forgetful:
    """The seed of a reset draws what else is in the episode. Actions push the first object, to the middle is success;
    above 0.5 the third number ends the episode."""

    action_space = Box(-1.0, 1.0, (3,))

    def __init__(self, task):
        self.task, self.rng = task, np.random.default_rng(0)
        self.poses = np.zeros((len(task.spec.objects), 7))

    def reset(self, *, seed, options):
        self.rng = np.random.default_rng(seed)
        self.poses = options["start"].poses
        begun.append((options["start"].number, self.poses.tobytes()))
        return self.seen(), {"success": False}

    def seen(self):
        picture = np.full((8, 8, 3), self.rng.integers(256), dtype=np.uint8)
        return {
            "names": self.task.spec.objects,
            "objects": self.poses.copy(),
            "joints": self.rng.random(7),
            "eye": picture,
        }

    def step(self, action):
        self.poses[0, :2] += 0.01 * np.asarray(action)[:2]
        success = bool(np.hypot(*self.poses[0, :2]) < 0.03)
        return self.seen(), float(success), False, bool(action[2] > 0.5), {"success": success}

    def close(self):
        self.poses[:] = np.nan


def blind(task):
    """A world without an action space."""
    made = Forgetful(task)
    made.action_space = None
    return made


def broken(task):
    raise OSError("no display")


def stops(seed):
    """Actions that push, and stop at random moments."""
    rng = np.random.default_rng(seed)
    while True:
        yield np.array([*rng.uniform(-1.0, 1.0, 2), float(rng.random() < 0.2)], dtype=np.float32)


def still(observation, instruction):
    return np.zeros(3)
