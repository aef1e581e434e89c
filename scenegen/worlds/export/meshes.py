"""Meshes as files: Wavefront OBJ, which every simulator reads, and binary STL."""

from __future__ import annotations

import struct

import numpy as np

from scenegen.things.mesh import Mesh, shade_mesh
from scenegen.things.outline import Floats
from scenegen.worlds.export.xml import short

OBJ_HEADER = "# scenegen, metres, z upwards"
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def drawn_obj(mesh: Mesh, places: Floats | None = None) -> bytes:
    """One mesh with a normal at every corner: round objects look round, edges stay sharp. With `places` (V, 2), those
    of its vertices in a picture."""
    vertices, normals, _ = shade_mesh(mesh)
    columns = {"v": vertices, "vt": None if places is None else places[mesh.faces.ravel()], "vn": normals.round(6)}
    lines, numbers = [OBJ_HEADER], []
    for name, rows in columns.items():
        known: dict[str, int] = {}
        words = [] if rows is None else [known.setdefault(short(row), len(known) + 1) for row in rows.tolist()]
        numbers.append([str(word) for word in words] or [""] * len(vertices))
        lines += [f"{name} {row}" for row in known]
    corners = ["/".join(corner) for corner in zip(*numbers, strict=True)]
    lines += [f"f {' '.join(corners[k : k + 3])}" for k in range(0, len(corners), 3)]
    return ("\n".join(lines) + "\n").encode()


def plain_obj(mesh: Mesh) -> bytes:
    """One mesh without normals, for collisions."""
    places = [f"v {short(vertex)}" for vertex in mesh.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join([OBJ_HEADER, *places, *faces]) + "\n").encode()


def stl(mesh: Mesh) -> bytes:
    """One mesh, in metres and single precision; its header cannot be mistaken for that of a text file."""
    triangles = np.zeros(len(mesh.faces), dtype=_TRIANGLE)
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles["normal"] = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    triangles["corners"] = corners
    return b"scenegen, metres, z upwards".ljust(80) + struct.pack("<I", len(triangles)) + triangles.tobytes()
