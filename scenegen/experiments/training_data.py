"""The scenes that a model was trained on, made again from what its file says of its training."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.api.train import Model
from scenegen.data.table import dataset_maker
from scenegen.training.seeds import Stream, stream

FACTS = ("data", "scenes", "seed")


def data_source(model: Model) -> str:
    """What decides the training scenes, but for the spec: models that agree on it were trained on the same ones."""
    facts = model.trained.card.training
    return " ".join(str(facts[name]) for name in FACTS)


def training_rows(model: Model) -> npt.NDArray[np.float64]:
    """(3N, M) in metres and radians."""
    data, scenes, seed = data_source(model).split(" ")
    made = dataset_maker(data)(model.spec.checked, int(scenes), stream(int(seed), Stream.DATA))
    return made.rows.double().numpy()
