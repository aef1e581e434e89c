"""The networks of the IROS 2023 paper as they were published, as models of scenegen, with their settings and data."""

from __future__ import annotations

from collections.abc import Mapping

from scenegen.learn.models.registry import MODELS
from scenegen.learn.training.config import DATASETS, DEFAULTS

# 50 epochs of Adam at 1e-3 in batches of 32 over 20,000 uniform scenes, at a constant rate.
PAPER: Mapping[str, object] = {"epochs": 50, "batch_size": 32, "lr": 1e-3, "scenes": 20_000, "data": "uniform"}


def register() -> None:
    """Put `paper-gan`, `paper-aae` and the data set `boosted` into scenegen's tables, in this process."""
    MODELS["paper-gan"] = "experiments.published.networks:PublishedGAN"
    MODELS["paper-aae"] = "experiments.published.networks:PublishedAAE"
    DEFAULTS.update({"paper-gan": PAPER, "paper-aae": PAPER})
    DATASETS["boosted"] = "experiments.published.data:boosted"
