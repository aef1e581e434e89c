"""Objects, samplers and simulations with the interface of robosuite's, as far as a placement uses them."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np


@dataclass(eq=False)
class Thing:
    name: str
    half: float = 0.02
    horizontal_radius: float = 0.03

    @property
    def root_body(self):
        return f"{self.name}_main"

    @property
    def bottom_offset(self):
        return np.array([0.0, 0.0, -self.half])

    @property
    def top_offset(self):
        return np.array([0.0, 0.0, self.half])


@dataclass(eq=False)
class Turned(Thing):
    """An object whose model is laid on its side when it is placed."""

    init_quat: tuple = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


@dataclass(eq=False)
class Corner:
    """A sampler that puts its objects at one place."""

    mujoco_objects: list = field(default_factory=list)
    at: tuple = (0.5, 0.5, 0.8)

    def sample(self, fixtures=None, reference=None, on_top=True):
        own = {one.name: (self.at, np.array([1.0, 0.0, 0.0, 0.0]), one) for one in self.mujoco_objects}
        return {**(fixtures or {}), **own}


def simulation(placed):
    """The state right after the placed objects were put into a simulation."""
    bodies = [model.root_body for _, _, model in placed.values()]
    return SimpleNamespace(
        model=SimpleNamespace(body_name2id=bodies.index),
        data=SimpleNamespace(
            body_xpos=np.array([at for at, _, _ in placed.values()]),
            body_xquat=np.array([quaternion for _, quaternion, _ in placed.values()]),
        ),
    )
