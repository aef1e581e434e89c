"""The paper's first data set: scenes drawn from the base distribution, each labelled with its phi."""

from __future__ import annotations

import torch

from scenegen.data.dataset import Dataset, base_draw, labelled
from scenegen.lang.spec import CheckedSpec


def uniform(spec: CheckedSpec, scenes: int, generator: torch.Generator) -> Dataset:
    """`scenes` scenes, uniform over the workspace and the circle."""
    return labelled(spec, base_draw(spec, scenes, generator))
