"""What objects look like: footprints, heights, colours and meshes of the things that stand on tables."""

from scenegen.geometry.footprint import Box, Circle
from scenegen.things.library import (
    ASSETS,
    PLAIN,
    UNKNOWN,
    Asset,
    Shape,
    asset_of,
    has_picture,
    meant_by,
    shape_of,
    stem,
)

__all__ = [
    "ASSETS",
    "PLAIN",
    "UNKNOWN",
    "Asset",
    "Box",
    "Circle",
    "Shape",
    "asset_of",
    "has_picture",
    "meant_by",
    "shape_of",
    "stem",
]
