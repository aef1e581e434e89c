"""Pictures on objects from files of one's own, as simulators take them: PNG, and places from the lower edge."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from scenegen.assets.surface import Surface
from scenegen.export.world import Paint


def paints_of(skins: Sequence[Surface]) -> dict[int, Paint]:
    """By the number of the surface, from 1; for those with a texture."""
    found: dict[int, Paint] = {}
    files: dict[bytes, bytes] = {}
    for number, skin in enumerate(skins, start=1):
        if skin.texture and skin.uv is not None:
            if skin.texture not in files:
                files[skin.texture] = _png(skin.texture)
            found[number] = Paint(files[skin.texture], np.column_stack([skin.uv[:, 0], 1.0 - skin.uv[:, 1]]))
    return found


def _png(data: bytes) -> bytes:
    """MuJoCo reads no JPEG. Transparency is left out."""
    from PIL import Image  # only objects with textures need it

    out = io.BytesIO()
    with Image.open(io.BytesIO(data)) as picture:
        picture.convert("RGB").save(out, "PNG")
    return out.getvalue()
