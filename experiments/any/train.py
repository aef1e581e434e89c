"""Train the model of any spec: `python -m experiments.any.train OUT --hours 1.5`. Goes on where it was, if it was cut.

Scenes are drawn as training goes: a new spec every few steps, and each step learns from some scenes of some specs. The
weights that count are means over the last steps (exponential). Everything follows from the seeds and from how far the
budget of CPU time reaches.
"""

from __future__ import annotations

import argparse
import math
import random
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from experiments.any.specs import training_text
from experiments.any.stream import KNOWN, Stream
from scenegen.learn.models.graph_flow import GraphHyper, Networks
from scenegen.processes.pool import one_thread

SPECS, SCENES = 12, 40  # of a step
FIRST, EVERY = 256, 4  # lessons before the first step, and steps from one further lesson to the next
RATE, WARM, DECAY = 2e-3, 200, 1e-4
BRANCHES = 0.3  # weight of the surprise at branches beside the error of the velocity
SMOOTH = 0.999  # of the mean of the weights
LONGEST = 2.0  # a gradient
SAVE, TELL = 300.0, 100  # CPU seconds between states, steps between lines


@dataclass(slots=True)
class Training:
    """Mutable: where a training is."""

    networks: Networks
    mean: dict[str, Tensor]
    optimiser: torch.optim.Optimizer
    stream: Stream
    generator: torch.Generator
    choice: random.Random
    hyper: GraphHyper
    seed: int
    device: torch.device
    noise: torch.Generator | None  # of another device than the CPU
    step: int = 0
    seconds: float = 0.0

    def state(self) -> dict[str, Any]:
        return {
            "weights": self.networks.state_dict(),
            "mean": self.mean,
            "optimiser": self.optimiser.state_dict(),
            "generator": self.generator.get_state(),
            "next": self.stream.next,
            "hyper": self.hyper.model_dump(),
            "seed": self.seed,
            "step": self.step,
            "seconds": self.seconds,
        }


def begin(hyper: GraphHyper, seed: int, device: torch.device, saved: dict[str, Any] | None) -> Training:
    """A new training, or one that goes on from its state, with specs that it has not seen."""
    generator = torch.Generator().manual_seed(seed)
    noise = None if device.type == "cpu" else torch.Generator(device).manual_seed(seed)
    networks = Networks(hyper)
    networks.initialise(generator)
    networks.to(device)
    optimiser = torch.optim.AdamW(networks.parameters(), lr=RATE, betas=(0.9, 0.99), weight_decay=DECAY)
    mean = {name: value.clone() for name, value in networks.state_dict().items()}
    stream = Stream(training_text)
    found = Training(networks, mean, optimiser, stream, generator, random.Random(seed), hyper, seed, device, noise)
    if saved is not None:
        networks.load_state_dict(saved["weights"])
        optimiser.load_state_dict(saved["optimiser"])
        generator.set_state(saved["generator"])
        found.mean, found.step, found.seconds, stream.next = (saved[k] for k in ("mean", "step", "seconds", "next"))
    return found


def train(run: Training, budget: float) -> Iterator[dict[str, float]]:
    """Train for so many seconds of CPU in all; yields the mean losses of every TELL steps."""
    before, began = run.seconds, time.process_time()
    run.stream.grow(FIRST - len(run.stream.lessons))
    sums: dict[str, float] = {}
    while run.seconds < budget:
        if run.step % EVERY == 0:
            run.stream.grow(1)
        share = run.seconds / budget
        rate = RATE * min(1.0, (run.step + 1) / WARM) * 0.5 * (1.0 + math.cos(math.pi * share))
        for group in run.optimiser.param_groups:
            group["lr"] = rate
        graph, *batch = run.stream.batch(SPECS, SCENES, run.choice, run.generator)
        rows, wanted, deciders = (one.to(run.device) for one in batch)
        noise = run.generator if run.noise is None else run.noise
        losses = run.networks.losses(graph.to(run.device), rows, wanted, deciders, noise)
        run.optimiser.zero_grad()
        torch.autograd.backward(losses["velocity"] + BRANCHES * losses["branch"])
        nn.utils.clip_grad_norm_(run.networks.parameters(), LONGEST)
        run.optimiser.step()
        run.step += 1
        keep = min(SMOOTH, (1 + run.step) / (10 + run.step))
        with torch.no_grad():
            for name, value in run.networks.state_dict().items():
                run.mean[name].mul_(keep).add_(value, alpha=1.0 - keep)
        for name, loss in losses.items():
            sums[name] = sums.get(name, 0.0) + float(loss.detach()) / TELL
        run.seconds = before + time.process_time() - began
        if run.step % TELL == 0:
            yield sums
            sums = {}


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path)
    words.add_argument("--hours", type=float, default=1.5, help="of CPU time")
    words.add_argument("--seed", type=int, default=0)
    words.add_argument("--width", type=int, default=GraphHyper().width)
    words.add_argument("--rounds", type=int, default=GraphHyper().rounds)
    words.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    told = words.parse_args()
    saved = torch.load(told.out, map_location="cpu", weights_only=True) if told.out.exists() else None
    with one_thread():
        run = begin(
            GraphHyper(width=told.width, rounds=told.rounds, primitives=KNOWN),
            told.seed,
            torch.device(told.device),
            saved,
        )
        written = run.seconds
        for losses in train(run, 3600.0 * told.hours):
            shown = ", ".join(f"{name} {value:.4f}" for name, value in losses.items())
            print(f"step {run.step:,}, {run.seconds:.0f} s, {len(run.stream.lessons):,} specs: {shown}", flush=True)
            if run.seconds - written > SAVE:
                save(run, told.out)
                written = run.seconds
        save(run, told.out)


def save(run: Training, out: Path) -> None:
    """Write the state, whole or not at all."""
    part = out.with_name(f"{out.name}.part")
    torch.save(run.state(), part)
    part.replace(out)


if __name__ == "__main__":
    main()
