"""A toy world: actions move the first object in the plane, and success is the spec's; and policies for it."""

import os
import time

import numpy as np


class Toy:
    def __init__(self, task):
        self.task, self.resets = task, 0

    def reset(self, *, seed, options):
        self.start = options["start"]
        assert seed == self.start.seed and self.start.task.name == self.task.name
        self.poses = self.task.scenes.poses[self.start.row].copy()
        return self.seen(), {"success": False}

    def seen(self):
        return {"a": self.poses[0].astype(np.float32), "number": self.start.number}

    def step(self, action):
        self.poses[0, :2] += action
        phi = self.task.spec.scenes(self.poses).phi[self.task.success][0]
        return self.seen(), float(phi), False, False, {"success": bool(phi >= 0.0)}

    def close(self):
        pass


def make(task):
    return Toy(task)


class Unjudged(Toy):
    """A world that does not say whether the task is done."""

    def step(self, action):
        return *super().step(action)[:4], {}


def unjudged(task):
    return Unjudged(task)


class Judging(Toy):
    """A world whose judgement, of steps and of resets, is what a test puts there."""

    said = True, False

    def reset(self, **given):
        return super().reset(**given)[0], {"success": self.said[1]}

    def step(self, action):
        return *super().step(action)[:4], {"success": self.said[0]}


def judging(task):
    return Judging(task)


def broken(task):
    raise OSError("no display")


def towards(observation, instruction):
    """To the middle, by 1 cm a step: level by level it takes longer."""
    place = observation["a"][:2]
    return -0.01 * place / np.linalg.norm(place)


def away(observation, instruction):
    return -towards(observation, instruction)


def obedient(observation, instruction):
    return towards(observation, instruction) if instruction else np.zeros(2)


class Noisy:
    """As good as its seed: half of the episodes go away."""

    def reset(self, seed):
        self.sign = 1 if seed % 2 else -1

    def __call__(self, observation, instruction):
        return self.sign * towards(observation, instruction)


def seeing(env):
    return lambda observation, instruction: -0.1 * env.poses[0, :2]


def dying(observation, instruction):
    number = observation["number"]
    if number == 1:
        raise ValueError("no plan")
    if number == 2:
        os._exit(3)
    if number == 4:
        time.sleep(60)
    return towards(observation, instruction)
