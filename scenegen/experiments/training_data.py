"""The scenes that a model was trained on, made again from what its file says of its training."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.api.train import Model
from scenegen.data.table import dataset_maker
from scenegen.training.seeds import Stream, stream


def training_rows(model: Model) -> npt.NDArray[np.float64]:
    """(3N, M) in metres and radians."""
    facts = model.trained.card.training
    maker = dataset_maker(str(facts["data"]))
    data = maker(model.spec.checked, int(str(facts["scenes"])), stream(int(str(facts["seed"])), Stream.DATA))
    return data.rows.double().numpy()
