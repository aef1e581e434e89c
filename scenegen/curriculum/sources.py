"""Where scenes come from: the exact sampler, a trained model, or a scene file. All of them are verified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.family import is_family, load_model
from scenegen.api.model import Model
from scenegen.api.reading import read_scenes
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import Part, parts_of
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.curriculum.errors import refused
from scenegen.curriculum.goal import Goal, Scorer
from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import DRAW_TOO_SLOW, SOURCE_OF_ANOTHER_SPEC
from scenegen.errors.requests import NO_SCENES, OUT_OF_TIME, WRONG_VALUE
from scenegen.lang.members import rows_among
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import row_count
from scenegen.sampling.request import Range, SampleRequest
from scenegen.training.datasets.arrange import check_scenes
from scenegen.validation import as_path

Array = npt.NDArray[np.float64]

SECONDS = 20.0  # after this time a request counts as unreachable; scenes that are found earlier do not depend on it
SHORTLY = 2.0  # the same, if the nearest scenes may be used instead


@dataclass(frozen=True, eq=False)
class Scenes:
    """`poses` (n, 3N) in metres and radians, and `phi` (n, D) of a goal's labels."""

    poses: Array
    phi: Array

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def columns(self) -> list[list[float]]:
        """phi by label as lists, which Python reads fastest; computed once for many streams."""
        found: list[list[float]] = self.phi.T.tolist()
        return found


class Sampler:
    """Draws from a spec, exactly, or from a model trained on it."""

    def __init__(self, target: Goal, model: Model | None = None) -> None:
        self._from: Spec | Model = target.spec if model is None else model.with_spec(target.spec)

    def draw(
        self, phi: Mapping[str, Range], n: int, seed: int, spread: str = "flat", patience: float = SECONDS
    ) -> Scenes:
        """Up to n scenes with phi in the ranges, at least one: as many as are found in `patience` seconds. Raises
        RequestError."""
        request = SampleRequest(
            phi, n, seed=seed, spread=spread, timeout=patience, keep_partial=True, workers=1, strict=True
        )
        try:
            found = draw_scenes(self._from, request)
        except RequestError as problem:
            first = problem.diagnostics[0]
            if first.kind not in OUT_OF_TIME:
                raise
            slow = DRAW_TOO_SLOW(first.span, problem=first.title, note=first.note, seconds=patience)
            raise RequestError(slow) from problem
        spec = (self._from.spec if isinstance(self._from, Model) else self._from).drawn
        rows = _stored(spec, found)[0] if spec.choices else found.poses.reshape(len(found), -1).T
        return Scenes(rows.T, np.stack(list(found.phi.values()), axis=1))


def stock(target: Goal, scenes: SceneSet) -> Scenes:
    """The scenes of a file, scored by the spec. Raises DataError for scenes that are not of it."""
    if not len(scenes):
        raise DataError(NO_SCENES())
    rows, parts = _stored(target.spec.drawn, scenes)
    for part in parts:
        check_scenes(part.spec, part.rows)
    return Scenes(np.ascontiguousarray(rows.T), Scorer(target)(rows)[: len(target.names)].T.copy())


def _stored(spec: CheckedSpec, scenes: SceneSet) -> tuple[Array, list[Part]]:
    """Scenes as the core of the spec has them, (3N, n), NaN for objects that are not there; and by the ordinary specs
    that they are of. Raises DataError for other objects."""
    rows = np.full((row_count(len(spec.core.objects)), len(scenes)), np.nan)
    parts = list(parts_of(spec, scenes))
    for part in parts:
        rows[rows_among(spec, part.spec)[:, None], part.which] = part.rows
    return rows, parts


def check_source(source: object) -> None:
    """Raises gymnasium.error.Error for an invalid source."""
    if source is not None and not isinstance(source, str | Path | SceneSet | Model):
        wanted = "a model, scenes, or the path of either"
        raise refused(WRONG_VALUE(argument="source", value=f"of type {type(source).__name__}", wanted=wanted))


def open_source(target: Goal, spec: Spec, source: Any) -> Sampler | Scenes:
    """`source` as users give it: None for the exact sampler, a Model or a SceneSet, or the path of a model file
    (.safetensors), of a folder of models, or of a scene file. Raises DataError, RequestError, gymnasium.error.Error."""
    if source is None:
        return Sampler(target)
    if isinstance(source, str | Path):
        path = as_path("source", source)
        source = (
            load_model(path, spec) if path.suffix.lower() == ".safetensors" or is_family(path) else read_scenes(path)
        )
    if isinstance(source, SceneSet):
        return stock(target, source)
    if isinstance(source, Model):
        if source.spec.drawn.sha256 != spec.drawn.sha256:
            raise refused(SOURCE_OF_ANOTHER_SPEC(model=source.name))
        return Sampler(target, source)
    raise AssertionError(source)  # see check_source
