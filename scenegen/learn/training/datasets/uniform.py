"""The paper's first data set: scenes drawn from the base distribution, each labelled with its phi."""

from __future__ import annotations

import torch

from scenegen.lang.spec import CheckedSpec
from scenegen.learn.training.datasets.dataset import Dataset, base_draw, labelled
from scenegen.learn.training.datasets.gathering import Gathering


def uniform(spec: CheckedSpec, scenes: int, generator: torch.Generator, gathering: Gathering | None = None) -> Dataset:
    """`scenes` scenes, uniform over the workspace and the circle."""
    gathering = gathering or Gathering()
    gathering.begin("gathering scenes", scenes)
    return labelled(spec, base_draw(spec, scenes, generator, gathering.reach))
