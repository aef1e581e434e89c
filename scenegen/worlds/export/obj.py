"""Meshes as Wavefront OBJ files, which every simulator reads."""

from __future__ import annotations

from scenegen.things.mesh import Floats, Mesh, shaded
from scenegen.worlds.export.xml import short

HEAD = "# scenegen, metres, z upwards"


def smooth(mesh: Mesh) -> bytes:
    """One mesh with a normal at every corner: round objects look round, edges stay sharp."""
    vertices, normals, _ = shaded(mesh)
    places: dict[str, int] = {}
    turns: dict[str, int] = {}
    corners = []
    for vertex, normal in zip(vertices.tolist(), normals.round(6).tolist(), strict=True):
        place = places.setdefault(short(vertex), len(places) + 1)
        corners.append(f"{place}//{turns.setdefault(short(normal), len(turns) + 1)}")
    faces = [f"f {' '.join(corners[k : k + 3])}" for k in range(0, len(corners), 3)]
    lines = [HEAD, *(f"v {place}" for place in places), *(f"vn {turn}" for turn in turns), *faces]
    return ("\n".join(lines) + "\n").encode()


def painted(mesh: Mesh, places: Floats) -> bytes:
    """One mesh with a normal at every corner and, of each vertex, its place in a picture, (V, 2)."""
    vertices, normals, _ = shaded(mesh)
    columns = (("v", vertices), ("vt", places[mesh.faces.ravel()]), ("vn", normals.round(6)))
    known: list[dict[str, int]] = [{}, {}, {}]
    corners = [
        "/".join(str(one.setdefault(short(row), len(one) + 1)) for one, row in zip(known, rows, strict=True))
        for rows in zip(*(values.tolist() for _, values in columns), strict=True)
    ]
    lines = [f"{name} {row}" for (name, _), one in zip(columns, known, strict=True) for row in one]
    faces = [f"f {' '.join(corners[k : k + 3])}" for k in range(0, len(corners), 3)]
    return ("\n".join([HEAD, *lines, *faces]) + "\n").encode()


def plain(mesh: Mesh) -> bytes:
    """One mesh without normals, for collisions."""
    places = [f"v {short(vertex)}" for vertex in mesh.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join([HEAD, *places, *faces]) + "\n").encode()
