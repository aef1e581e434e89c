"""What objects look like: footprints, heights, colours and meshes of the things that stand on tables."""

from scenegen.assets.library import (
    ASSETS,
    UNKNOWN,
    Asset,
    Box,
    Circle,
    asset_of,
    colors_of,
    has_picture,
    shape_of,
    stem,
)
from scenegen.assets.parts import Part

__all__ = [
    "ASSETS",
    "UNKNOWN",
    "Asset",
    "Box",
    "Circle",
    "Part",
    "asset_of",
    "colors_of",
    "has_picture",
    "shape_of",
    "stem",
]
