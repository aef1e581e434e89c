"""Files of init states: as torch saves them, which is LIBERO's form, and as numpy does, with the fixtures."""

from __future__ import annotations

import contextlib
import io
import pickle
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.files import CANNOT_READ
from scenegen.needs import need
from scenegen.scenes.files import read_bytes, whole_file

STATES_FILE = "a file of init states"
FIXTURE_PREFIX = "fixture "  # before the names of fixtures


def write_states(path: Path, states: Array, fixtures: Mapping[str, Array], task: str) -> Path:
    """Write TASK.pruned_init, and TASK.pruned_init.npz, which has the poses (7,) of the fixtures and the name of the
    task, too. Raises OutputError, and RequestError without torch."""
    need("torch", "to write init states")
    import torch

    with whole_file(path) as file:
        torch.save(states, file)
    poses: dict[str, Any] = {f"{FIXTURE_PREFIX}{name}": pose for name, pose in fixtures.items()}
    with whole_file(Path(f"{path}.npz")) as file:
        np.savez_compressed(file, states=states, task=np.array(task), **poses)
    return path


def read_states(path: Path) -> Array:
    """(n, D): the rows of TASK.pruned_init.npz, or of TASK.pruned_init, of which only numbers and arrays of them are
    unpickled, by numpy's old names and by its new. Raises DataError, and RequestError without torch."""
    packed = Path(f"{path}.npz")
    if packed.exists():
        return read_packed(packed)["states"]
    need("torch", "to read init states")
    import torch

    makers: list[Any] = [np.zeros(0).__reduce__()[0], np.float64(0.0).__reduce__()[0]]
    names = [(one, f"numpy.{core}.multiarray.{one.__name__}") for one in makers for core in ("core", "_core")]
    kinds = {type(np.dtype(one)) for one in "?bBhHiIlLqQefd"}
    file = io.BytesIO(read_bytes(path, STATES_FILE))
    with _no_other(path), torch.serialization.safe_globals([np.ndarray, np.dtype, *kinds, *names]):
        return _rows(torch.load(file, map_location="cpu", weights_only=True))


def read_packed(path: Path) -> dict[str, Array]:
    """The arrays of TASK.pruned_init.npz: `states` (n, D), which are the first where none has the name, and others by
    name. Raises DataError."""
    file = io.BytesIO(read_bytes(path, STATES_FILE))
    with _no_other(path), np.load(file) as arrays:
        found = dict(arrays)
        return {**found, "states": _rows(found.get("states", next(iter(found.values()), None)))}


def _rows(found: Any) -> Array:
    """(n, D), float64."""
    states = np.asarray(found).astype(np.float64, casting="same_kind")
    if states.ndim != 2:
        raise ValueError(states.shape)
    return states


@contextlib.contextmanager
def _no_other(path: Path) -> Iterator[None]:
    """Raises DataError for what numpy and torch raise where a file is something else."""
    other = ValueError, TypeError, RuntimeError, LookupError, EOFError, pickle.UnpicklingError, zipfile.BadZipFile
    try:
        yield
    except other as error:
        reason, remedy = "it has no rows of numbers, one for each state", f"{STATES_FILE} was expected there"
        raise DataError(CANNOT_READ(path=path, reason=reason, remedy=remedy)) from error
