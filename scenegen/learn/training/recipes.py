"""What each model is trained with unless told otherwise."""

from __future__ import annotations

from collections.abc import Mapping

# The paper's: 50 epochs of Adam at 1e-3 in batches of 32 over 20,000 uniform scenes, at a constant rate.
PAPER: Mapping[str, object] = {"epochs": 50, "batch_size": 32, "lr": 1e-3, "scenes": 20_000, "data": "uniform"}
# Ours: exact scenes, balanced in phi; the rate warms up, then falls along a cosine.
OURS: Mapping[str, object] = {"epochs": 16, "batch_size": 512, "lr": 1e-3, "scenes": 200_000, "data": "balanced"}
FLOW: Mapping[str, object] = {**OURS, "epochs": 36, "scenes": 100_000}
# Games want many steps more than large batches.
GAMES: Mapping[str, object] = {**OURS, "batch_size": 256, "epochs": 8}

DEFAULTS: Mapping[tuple[str, str], Mapping[str, object]] = {
    ("paper", "gan"): PAPER,
    ("paper", "aae"): PAPER,
    ("default", "gan"): GAMES,
    ("default", "aae"): {**GAMES, "epochs": 6},
    ("default", "flow"): FLOW,
    ("default", "energy"): OURS,
}
CONSTANT = frozenset({"paper"})
"""Recipes whose learning rate does not change."""

GATHERING = "gathering exact scenes"
"""What a run says that it does for SECONDS of CPU time at most. It cannot tell how long it will take: it draws scenes
that are ever rarer, and only a batch that has begun has an estimate."""
SECONDS = 110.0
