"""The scenes that a model was trained on, made again from what its file says of its training."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from experiments.errors import OTHER_TRAINING_DATA
from scenegen.errors import DataError
from scenegen.learn.model import Model
from scenegen.learn.training.config import dataset_maker
from scenegen.learn.training.dataset import split
from scenegen.learn.training.state import Stream, stream


def data_source(model: Model) -> str:
    """What tells training sets apart: models with the same were trained on the same scenes."""
    data = model.trained.card.data
    return "" if data is None else data.sha256


def training_rows(model: Model) -> npt.NDArray[np.float64]:
    """(3N, M) in metres and radians, without those that were held out. Raises DataError where they cannot be made as
    they were."""
    card = model.trained.card
    if card.data is not None:
        seed = int(str(card.training["seed"]))
        total = card.data.scenes + card.data.held_out
        made = dataset_maker(str(card.training["data"]))(model.spec.checked, total, stream(seed, Stream.DATA))
        if made.sha256 == card.data.sha256:
            return split(made, card.data.held_out)[0].rows.double().numpy()
    raise DataError(OTHER_TRAINING_DATA(model=card.model))
