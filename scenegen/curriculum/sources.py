"""Where scenes come from: the exact sampler, a trained model, or a scene file. All of them are verified."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen import given
from scenegen.api.model import Model, load_model
from scenegen.api.sample import sample
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet, read_scenes
from scenegen.api.spec import Spec
from scenegen.curriculum.aim import Aim, Scorer
from scenegen.data.arrange import check_scenes
from scenegen.errors import DataError, Diagnostic, RequestError

Array = npt.NDArray[np.float64]
Ends = tuple[float | None, float | None]

SECONDS = 20.0  # after which a request counts as out of reach; what is found in time does not depend on it
SHORTLY = 2.0  # the same, where the nearest that there is will do


@dataclass(frozen=True, eq=False)
class Scenes:
    """`poses` (n, 3N) in metres and radians, and `phi` (n, D) of an aim's labels."""

    poses: Array
    phi: Array

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def columns(self) -> list[list[float]]:
        """phi by label, as Python reads it fastest; made once, for many feeds."""
        found: list[list[float]] = self.phi.T.tolist()
        return found


class Sampler:
    """Draws from a spec, exactly, or from a model trained on it."""

    def __init__(self, aim: Aim, model: Model | None = None) -> None:
        self._from: Spec | Model = aim.spec if model is None else _aimed(aim, model)

    def draw(
        self, ranges: Mapping[str, Ends], n: int, seed: int, spread: str = "flat", patience: float = SECONDS
    ) -> Scenes:
        """Up to n scenes with phi in the ranges, at least one, as many as are found in `patience` seconds. Raises
        RequestError."""
        try:
            found = sample(
                self._from, ranges, n, seed=seed, spread=spread, timeout=patience, keep_partial=True, workers=1
            )
        except RequestError as problem:
            first = problem.diagnostics[0]
            if "--timeout" not in first.help:
                raise
            help_ = (
                f"a draw has {patience:g} s here; draw scenes with `scenegen sample` first, and give them as `source`"
            )
            raise RequestError(replace(first, help=help_)) from problem
        return Scenes(found.poses.reshape(len(found), -1), np.stack(list(found.phi.values()), axis=1))


def stock(aim: Aim, scenes: SceneSet) -> Scenes:
    """The scenes of a file, scored by the spec. Raises DataError for scenes that are not of it."""
    if not len(scenes):
        raise DataError(Diagnostic("there are no scenes in the file", help="sample some first"))
    rows = np.array(rows_of(aim.spec.checked, scenes))
    check_scenes(aim.spec.checked, rows)
    return Scenes(np.ascontiguousarray(rows.T), Scorer(aim)(rows)[: len(aim.names)].T.copy())


def check_source(source: object) -> None:
    """Raises gymnasium.error.Error for what scenes cannot come from."""
    if source is not None and not isinstance(source, str | Path | SceneSet | Model):
        raise error.Error(f"`source` is a model, scenes, or the path of either, not {type(source).__name__}")


def open_source(aim: Aim, spec: Spec, source: Any) -> Sampler | Scenes:
    """`source` as people give it: None for the exact sampler, a Model or a SceneSet, or the path of a model file
    (.safetensors) or of a scene file. Raises DataError, RequestError, gymnasium.error.Error."""
    if source is None:
        return Sampler(aim)
    if isinstance(source, str | Path):
        path = given.path("source", source)
        source = load_model(path, spec) if path.suffix == ".safetensors" else read_scenes(path)
    if isinstance(source, SceneSet):
        return stock(aim, source)
    if isinstance(source, Model):
        if source.spec.checked.sha256 != spec.checked.sha256:
            raise error.Error(
                f"the model {source.name} was trained on another spec; make the environment from that one"
            )
        return Sampler(aim, source)
    raise AssertionError(source)  # check_source was asked


class _Narrowed:
    """A trained model that is told of its own labels alone."""

    def __init__(self, trained: Any, labels: int) -> None:
        self._trained, self._labels = trained, labels
        self.name, self.steps = trained.name, trained.steps

    def propose(self, phi: Any, generator: Any) -> Any:
        return self._trained.propose(phi[: self._labels], generator)


def _aimed(aim: Aim, model: Model) -> Model:
    """A model whose spec has the aim's labels."""
    if aim.labels == len(aim.names):
        return model
    aimed = copy.copy(model)
    aimed.spec, aimed.trained = aim.spec, cast(Any, _Narrowed(model.trained, aim.labels))
    return aimed
