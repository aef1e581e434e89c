"""What objects look like: the library's own meshes, with normals, packed small."""

from __future__ import annotations

import base64
from collections.abc import Collection
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import Spec
from scenegen.show.view.jobs.describe import mesh_key, stage_of_spec
from scenegen.things import Shape, parts_of
from scenegen.things.mesh import shaded

STEPS = 32767  # of the largest coordinate: positions are 16-bit numbers


def meshes_of(spec: Spec, have: Collection[str]) -> dict[str, Any]:
    """The meshes of the spec's objects by key, without those that a page has already."""
    things = {mesh_key(thing): thing for thing in stage_of_spec(spec).things}
    return {key: packed_mesh(one.shape, tuple(one.color)) for key, one in things.items() if key not in have}


@lru_cache(maxsize=256)
def packed_mesh(shape: Shape, color: tuple[float, float, float]) -> dict[str, Any]:
    """Vertices of all parts: `position` in 16-bit steps of `scale` metres, `normal` in 8-bit steps, `color` in bytes,
    `index` in 16 or 32 bits; each as base64 of little-endian numbers."""
    positions, normals, colors = [], [], []
    for part in parts_of(shape, color):
        vertices, normal, _ = shaded(part.mesh)
        positions.append(vertices)
        normals.append(normal)
        colors.append(np.tile(np.array(part.color), (len(vertices), 1)))
    position = np.concatenate(positions)
    scale = max(float(np.abs(position).max()), 1e-9) / STEPS
    table = np.concatenate(
        [
            np.round(position / scale),
            np.round(np.concatenate(normals) * 127.0),
            np.round(np.clip(np.concatenate(colors), 0.0, 1.0) * 255.0),
        ],
        axis=1,
    ).astype(np.int64)
    unique, index = _unique(table)
    wide = len(unique) > 65535
    return {
        "scale": scale,
        "position": _text(unique[:, :3].astype("<i2")),
        "normal": _text(unique[:, 3:6].astype("i1")),
        "color": _text(unique[:, 6:].astype("u1")),
        "index": _text(index.reshape(-1).astype("<u4" if wide else "<u2")),
        "wide": wide,
    }


def _unique(table: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The different rows of a (V, 9) table of vertices in order, and where each row is among them. Two numbers hold a
    row, which sorts faster than nine."""
    place = (table[:, :3] + (1 << 15)) @ np.array([1 << 32, 1 << 16, 1])
    rest = (table[:, 3:] + (1 << 7)) @ (1 << np.arange(50, -1, -10))
    order = np.lexsort((rest, place))
    new = np.ones(len(table), dtype=np.int64)
    new[1:] = (np.diff(place[order]) != 0) | (np.diff(rest[order]) != 0)
    index = np.empty(len(table), dtype=np.int64)
    index[order] = np.cumsum(new) - 1
    return table[order[new == 1]], index


def _text(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
