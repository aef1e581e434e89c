"""A small behaviour-cloned policy: a network learns from demonstrations what is moved, and where to.

    python examples/policies/cloned.py SPEC OUT.npz      # records demonstrations and learns them, in some minutes
    scenegen suite run SUITE --policy examples/policies/cloned.py:Cloned --world ...

The demonstrations are episodes that the scripted policy won. What is learned is their one keyframe: the thing that was
moved, and its pose in the end, from the poses of all things at the start. The hand is the scripted one's. The network
does not know the spec, and of several good places it learns the middle. Learning needs robosuite and torch, acting only
numpy: `Cloned` reads FOLDER/TASK.npz; the environment variable CLONED names the folder, by default the current one.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from scripted import Moves, Scripted, flat

import scenegen

DEMONSTRATIONS, STEPS = 250, 100  # episodes, and actions of each
WIDTH, EPOCHS, DECAY = 64, 400, 1e-2


def features(poses: np.ndarray) -> np.ndarray:
    """(4 N,) of poses (N, 3): places, in 20 cm, and headings."""
    return np.column_stack([5.0 * poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])]).ravel()


class Cloned(Scripted):
    """One for each world: it reads the weights of the world's task."""

    def __init__(self, env: Any, see: float = 0.003, put: float = 0.003, path: Path | None = None) -> None:
        super().__init__(env, see, put)
        file = Path(os.environ.get("CLONED", ".")) / f"{env.task.name}.npz" if path is None else path
        with np.load(file) as arrays:
            self.layers = [(arrays[f"weight{k}"], arrays[f"bias{k}"]) for k in range(len(arrays.files) // 2)]

    def moves(self, poses: np.ndarray) -> Moves:
        value = features(poses)
        for number, (weight, bias) in enumerate(self.layers):
            value = weight @ value + bias
            if number + 1 < len(self.layers):
                value = np.tanh(value)
        x, y, cosine, sine = value[-4:]
        return [
            (int(np.argmax(value[:-4])), np.array([x / 5.0, y / 5.0, np.arctan2(sine, cosine), 0.0]))
        ]  # on the table


def record(world: Any, starts: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """The keyframes of the episodes that the scripted policy won with one move: features (n, 4 N) of the start, and
    (n, N + 4): what was moved, and the features of where it then was."""
    expert = Scripted(world, see=0.0, put=0.0)
    seen, done = [], []
    for start in starts:
        observation, _ = world.reset(seed=start.number, options={"start": start})
        expert.reset(start.number)
        before, success = flat(observation["objects"]), False
        for _ in range(STEPS):
            observation, _, success, _, _ = world.step(expert(observation, ""))
            if success:
                break
        after = flat(observation["objects"])
        moved = np.linalg.norm(after[:, :2] - before[:, :2], axis=1)
        if success:
            which = int(np.argmax(moved))
            seen.append(features(before))
            done.append(np.concatenate([np.arange(len(before)) == which, features(after[which : which + 1])]))
    print(f"{len(seen)} of {len(starts)} demonstrations succeeded")
    return np.array(seen), np.array(done)


def learn(seen: np.ndarray, done: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Weights and biases of a network with two hidden layers, by the mean squared error."""
    import torch

    torch.manual_seed(seed)
    torch.set_num_threads(1)
    x, y = torch.tensor(seen, dtype=torch.float32), torch.tensor(done, dtype=torch.float32)
    first, second, last = (torch.nn.Linear(a, b) for a, b in ((x.shape[1], WIDTH), (WIDTH, WIDTH), (WIDTH, y.shape[1])))
    network = torch.nn.Sequential(first, torch.nn.Tanh(), second, torch.nn.Tanh(), last)
    optimizer = torch.optim.AdamW(network.parameters(), lr=3e-3, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, EPOCHS)
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(x)).split(32):
            loss = torch.nn.functional.mse_loss(network(x[rows]), y[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        schedule.step()
    print(f"mean squared error {loss.item():.4f} of the last {len(rows)}")
    arrays = {}
    for number, layer in enumerate((first, second, last)):
        arrays[f"weight{number}"], arrays[f"bias{number}"] = (
            one.detach().numpy() for one in (layer.weight, layer.bias)
        )
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


def main(path: str, out: str) -> None:
    from scenegen.play.suites.adapters.table import make

    spec = scenegen.load(path)
    label = "goal" if "goal" in spec.labels else spec.labels[0]
    world = make(SimpleNamespace(name=Path(path).stem, spec=spec, instruction="", success=label))
    seen, done = record(world, starts_of(spec, label, DEMONSTRATIONS, seed=1_000_003))
    np.savez_compressed(out, **learn(seen, done))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
