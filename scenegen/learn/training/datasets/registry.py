"""The table of data sets. A new one is one file and one line here."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE

if TYPE_CHECKING:
    import torch

    from scenegen.lang.spec import CheckedSpec
    from scenegen.learn.training.datasets.dataset import Dataset
    from scenegen.learn.training.datasets.gathering import Gathering


class DatasetMaker(Protocol):
    """Makes `scenes` labelled scenes for a spec; the generator (a CPU one) alone determines the outcome. `gathering` is
    told how far it is, and may end it with RequestError."""

    def __call__(
        self, spec: CheckedSpec, scenes: int, generator: torch.Generator, gathering: Gathering | None = None
    ) -> Dataset: ...


# Text, not functions: `scenegen train --help` lists them without importing torch.
DATASETS: dict[str, str] = {
    "balanced": "scenegen.learn.training.datasets.balanced:balanced",
    "uniform": "scenegen.learn.training.datasets.uniform:uniform",
    "boosted": "scenegen.learn.training.datasets.boosted:boosted",
}


def is_file(data: str) -> bool:
    """Whether `--data` names a scene file rather than an entry of DATASETS."""
    return data not in DATASETS and (bool(Path(data).suffix) or os.sep in data)


def dataset_maker(name: str) -> DatasetMaker:
    """The function of a data set by name. Raises RequestError, with the nearest name, for one not in DATASETS."""
    if name not in DATASETS:
        raise RequestError(UNKNOWN_CHOICE(what="data set", name=name, known=DATASETS))
    module, _, attribute = DATASETS[name].partition(":")
    maker: DatasetMaker = getattr(importlib.import_module(module), attribute)
    return maker
