"""Meshes as binary STL files: a header of 80 bytes, the number of triangles, 50 bytes for each."""

from __future__ import annotations

import struct

import numpy as np

from scenegen.things.mesh import Mesh

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def binary(mesh: Mesh) -> bytes:
    """One mesh, in metres and single precision; its header cannot be mistaken for that of a text file."""
    triangles = np.zeros(len(mesh.faces), dtype=_TRIANGLE)
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles["normal"] = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    triangles["corners"] = corners
    return b"scenegen, metres, z upwards".ljust(80) + struct.pack("<I", len(triangles)) + triangles.tobytes()
