"""Settled scenes as blocks of arrays, the input of their file formats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from scenegen.errors import DataError
from scenegen.scenes.data import SettledHeader
from scenegen.scenes.formats.header import first_problem

Array = npt.NDArray[np.float64]

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
MM = 1000.0  # millimetres of a metre

Touch = tuple[str | None, str | None, float]


@dataclass(frozen=True, slots=True, eq=False)
class SettledBlock:
    """m scenes of N objects. `poses` (m, N, 7) are place (metres) and quaternion, w first; `shift` (m, N) in metres and
    `turn` (m, N) in degrees are against the plan; `moved` (m, N) says which objects moved too far; `phi` (L, m) is that
    of the settled scene; `contacts` are by scene the pairs that touched before, None for the table, and how deep in
    metres; `on` (m, M) is the surface that each object stood on in the plan, where the header has several, counted from
    1. NaN, from a simulation that diverged, is written as null. Objects that are not there are NaN and have not
    moved."""

    poses: Array
    shift: Array
    turn: Array
    moved: npt.NDArray[np.bool_]
    phi: Array
    contacts: tuple[tuple[Touch, ...], ...]
    on: Array | None = None

    @property
    def count(self) -> int:
        return len(self.poses)

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """(m, N): which objects are there."""
        return np.asarray(self.moved | ~np.isnan(self.poses).any(axis=2))

    @property
    def deepest(self) -> Array:
        """(m,): the depth of each scene's deepest contact, in metres."""
        return np.array([max((depth for *_, depth in touches), default=0.0) for touches in self.contacts])


def settled_header(text: str | bytes, path: Path) -> SettledHeader:
    """Raises DataError."""
    try:
        return SettledHeader.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(str(path), error)) from None
