"""Scenes as rendered pictures in memory."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.scenes.data import RequestData

Array = npt.NDArray[np.float64]


def scene_set(spec: Spec, rows: Array) -> SceneSet:
    """Scenes stored as (3N, n), with their phi."""
    from scenegen.api.scenes import evaluate

    poses = np.ascontiguousarray(rows.T, dtype=np.float64).reshape(rows.shape[1], len(spec.objects), 3)
    header = make_header(spec.checked, {}, RequestData(phi={}, n=rows.shape[1], spread="base"))
    found = SceneSet(poses, {}, header)
    return dataclasses.replace(found, phi=evaluate(spec.checked, found))


def pictures(spec: Spec, rows: Array, view: str, size: tuple[int, int], workers: int = 1) -> list[Image.Image]:
    """One picture (width, height in pixels) per scene of (3N, n), by the renderer. `view` is "top" or "perspective"."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "pictures"
        drawn = scene_set(spec, rows).render(out, views=(view,), size=size, workers=workers)
        found = []
        for path in drawn.pictures:
            with Image.open(path) as picture:
                found.append(picture.convert("RGB"))
    return found
