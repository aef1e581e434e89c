"""A small behaviour-cloned policy: a network that learns one task from the scripted policy's demonstrations.

    python examples/policies/cloned.py SPEC OUT.npz      # records demonstrations and learns them, in some minutes
    scenegen suite run SUITE --policy examples/policies/cloned.py:Cloned --world ...

It needs robosuite and torch to learn, and only numpy to act: `Cloned` reads FOLDER/TASK.npz, with FOLDER from the
environment variable CLONED, by default the current folder. It does not know the spec. It sees where things are, seen
from the hand, and what it last told the fingers.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from scripted import Scripted, yaw

import scenegen

DEMONSTRATIONS, SHAKE = 200, 0.1  # episodes, and noise of the actions that are done, not of those that are learned
WIDTH, EPOCHS, BATCH = 256, 60, 512


def features(observation: Any, told: float) -> np.ndarray:
    """What the network sees: (8 + 8 N,)."""
    hand, objects, turned = observation["hand"], observation["objects"], yaw(observation["hand"])
    own = [*hand[:3] * 5.0, np.cos(turned), np.sin(turned), np.ptp(observation["fingers"]) * 20.0, told, 1.0]
    heading = 2.0 * np.arctan2(objects[:, 6], objects[:, 3])
    place, seen = objects[:, :3] * 5.0, (objects[:, :3] - hand[:3]) * 10.0
    return np.concatenate([own, place.ravel(), np.tanh(seen).ravel(), np.cos(heading), np.sin(heading)])


class Cloned:
    """One for each world: it reads the weights of the world's task."""

    def __init__(self, env: Any, path: Path | None = None) -> None:
        file = Path(os.environ.get("CLONED", ".")) / f"{env.task.name}.npz" if path is None else path
        with np.load(file) as arrays:
            self.layers = [(arrays[f"weight{k}"], arrays[f"bias{k}"]) for k in range(len(arrays.files) // 2)]

    def reset(self, seed: int) -> None:
        self.told = -1.0

    def __call__(self, observation: Any, instruction: str) -> np.ndarray:
        value = features(observation, self.told)
        for number, (weight, bias) in enumerate(self.layers):
            value = weight @ value + bias
            if number + 1 < len(self.layers):
                value = np.maximum(value, 0.0)
        self.told = 1.0 if value[6] > 0.0 else -1.0
        return np.append(np.clip(value[:6], -1.0, 1.0), self.told)


def record(world: Any, starts: Sequence[Any], seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """What the scripted policy saw and did in the episodes that it won: features (n, F) and actions (n, 7)."""
    random, expert = np.random.default_rng(seed), Scripted(world, see=0.0, put=0.0)
    seen, done, won = [], [], 0
    for start in starts:
        observation, _ = world.reset(seed=start.number, options={"start": start})
        expert.reset(start.number)
        told, over, episode = -1.0, False, []
        while not over:
            action = expert(observation, "")
            episode.append((features(observation, told), action))
            told = action[6]
            shaken = np.append(action[:6] + random.normal(0.0, SHAKE, 6) * (np.abs(action[:6]).max() > 0.3), told)
            observation, _, success, late, _ = world.step(shaken)
            over = success or late
        if success:
            won += 1
            seen += [one for one, _ in episode]
            done += [one for _, one in episode]
    print(f"{won} of {len(starts)} demonstrations succeeded: {len(seen)} steps")
    return np.array(seen), np.array(done)


def learn(seen: np.ndarray, done: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Weights and biases of a network of three layers, by the mean squared error."""
    import torch

    torch.manual_seed(seed)
    torch.set_num_threads(1)
    middle, spread = seen.mean(axis=0), seen.std(axis=0) + 1e-3
    x, y = torch.tensor((seen - middle) / spread, dtype=torch.float32), torch.tensor(done, dtype=torch.float32)
    sizes = [x.shape[1], WIDTH, WIDTH, 7]
    layers = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
    network = torch.nn.Sequential(layers[0], torch.nn.ReLU(), layers[1], torch.nn.ReLU(), layers[2])
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, EPOCHS)
    for _ in range(EPOCHS):
        total = 0.0
        for rows in torch.randperm(len(x)).split(BATCH):
            loss = torch.nn.functional.mse_loss(network(x[rows]), y[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += float(loss.detach()) * len(rows)
        schedule.step()
    print(f"mean squared error {total / len(x):.4f}")
    arrays = {}
    for number, layer in enumerate(layers):
        weight, bias = layer.weight.detach().double().numpy(), layer.bias.detach().double().numpy()
        if number == 0:  # what was done to the features becomes a part of the first layer
            weight, bias = weight / spread, bias - weight @ (middle / spread)
        arrays |= {f"weight{number}": weight.astype(np.float32), f"bias{number}": bias.astype(np.float32)}
    return arrays


@dataclass
class Start:
    """A start that is in no suite."""

    number: int
    poses: np.ndarray
    objects: tuple
    phi: dict
    on: np.ndarray | None = None


def starts_of(spec: scenegen.Spec, label: str, n: int, seed: int) -> list[Start]:
    """Starts from the base distribution that miss the goal."""
    scenes = scenegen.sample(spec, {label: (None, 0.0)}, n, seed=seed, spread="base", workers=1)
    phi = [{name: float(values[k]) for name, values in scenes.phi.items()} for k in range(n)]
    return [Start(k, poses, spec.objects, phi[k]) for k, poses in enumerate(scenes.poses7())]


def main(path: str | Path, out: str) -> None:
    from scenegen.worlds.suites.adapters.table import make

    spec = scenegen.load(path)
    label = "goal" if "goal" in spec.labels else spec.labels[0]
    world = make(SimpleNamespace(name=Path(path).stem, spec=spec, instruction="", success=label))
    seen, done = record(world, starts_of(spec, label, DEMONSTRATIONS, seed=1_000_003))
    np.savez_compressed(out, **learn(seen, done))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
