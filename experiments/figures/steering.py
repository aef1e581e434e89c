"""Fig. 6: renders of experiment 1; phi of one label is varied while the other is satisfied."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch

from experiments.figures.strip import strips
from experiments.measure import Array, columns, phi_of
from experiments.pictures import pictures
from scenegen.api.spec import Spec
from scenegen.learn.model import Model

SAFE, TASK = 0.3, 0.02  # phi of the label that is held, so that both can be had together
STEPS: dict[str, tuple[tuple[float, float], ...]] = {  # the label that is varied -> (task, safe)
    "task": tuple((task, SAFE) for task in (-0.4, -0.2, 0.0, 0.2, 0.38)),
    "safe": tuple((TASK, safe) for safe in (-0.2, -0.1, 0.0, 0.15, 0.3)),
}


def steering(spec: Spec, models: Mapping[str, Model], pixels: int) -> tuple[bytes, list[dict[str, object]]]:
    """A PNG file, two rows per model, and what it shows as data: wanted and reached phi of every picture."""
    asked = [
        (name, label, [dict(zip(("task", "safe"), pair, strict=True)) for pair in steps])
        for name in models
        for label, steps in STEPS.items()
    ]
    scenes = [_ask(spec, models[name], wanted) for name, _, wanted in asked]
    drawn = iter(pictures(spec, np.concatenate(scenes, axis=1), "top", (pixels, pixels)))
    rows, facts = [], list[dict[str, object]]()
    for (name, label, wanted), part in zip(asked, scenes, strict=True):
        reached = phi_of(spec, part)
        other = "safe" if label == "task" else "task"
        heading = f"{name}: phi of `{label}` varied, `{other}` satisfied"
        rows.append((heading, [(next(drawn), _words(one, phi)) for one, phi in zip(wanted, reached.T, strict=True)]))
        facts += [
            {"model": name, "varied": label, "wanted": one, "reached": dict(zip(spec.labels, phi, strict=True))}
            for one, phi in zip(wanted, reached.T.tolist(), strict=True)
        ]
    return strips(rows), facts


def _words(wanted: Mapping[str, float], reached: Array) -> list[str]:
    """The lines below a picture."""
    return [
        f"wanted  task {wanted['task']:+.2f}  safe {wanted['safe']:+.2f}",
        f"reached  task {reached[0]:+.2f}  safe {reached[1]:+.2f}",
    ]


def _ask(spec: Spec, model: Model, wanted: list[dict[str, float]]) -> Array:
    """The first scene that the model draws for each phi, (3N, n): none is picked."""
    phi = torch.cat([columns(one, spec.labels, 1) for one in wanted], dim=1)
    drawn: Array = model.trained.propose(phi, torch.Generator().manual_seed(6)).double().numpy()
    return np.ascontiguousarray(drawn)
