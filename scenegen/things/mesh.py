"""Closed triangle meshes made from a few numbers: boxes, lofts, surfaces of revolution, tubes.

Vertices are shared between triangles and triangles wind counter-clockwise seen from outside, so that "every edge is
used once in each direction" says that a mesh is closed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

CREASE = math.radians(35.0)  # edges sharper than this are drawn as edges, flatter ones as a smooth surface


@dataclass(frozen=True, slots=True)
class Mesh:
    """`vertices` (V, 3) in metres, `faces` (F, 3) indices of vertices."""

    vertices: Floats
    faces: Indices

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        return Mesh(self.vertices + np.array([x, y, z]), self.faces)

    def tipped(self) -> Mesh:
        """Turned by a quarter about the x axis: what pointed up points along -y."""
        x, y, z = self.vertices.T
        return Mesh(np.column_stack([x, -z, y]), self.faces)

    def laid(self) -> Mesh:
        """Turned by a quarter about the y axis: what pointed up points along +x."""
        x, y, z = self.vertices.T
        return Mesh(np.column_stack([z, y, -x]), self.faces)

    def turned(self, angle: float) -> Mesh:
        """Turned about the z axis, counter-clockwise, by radians."""
        x, y, z = self.vertices.T
        cos, sin = math.cos(angle), math.sin(angle)
        return Mesh(np.column_stack([cos * x - sin * y, sin * x + cos * y, z]), self.faces)

    def scaled(self, x: float, y: float, z: float) -> Mesh:
        """Stretched along the axes by positive factors."""
        return Mesh(self.vertices * np.array([x, y, z]), self.faces)

    @property
    def volume(self) -> float:
        """Cubic metres enclosed (divergence theorem); positive where triangles face outwards."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)

    @property
    def closed(self) -> bool:
        """Whether every edge is used once in each direction."""
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        forward = {(int(a), int(b)) for a, b in edges}
        return len(forward) == len(edges) and all((b, a) in forward for a, b in forward)


def shaded(mesh: Mesh) -> tuple[Floats, Floats, Indices]:
    """Vertices, unit normals (both (3F, 3)) and indices (3F,) with one corner each: smooth but for creases."""
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    # Weighting by the angle at the corner makes the result independent of how a surface is cut into triangles.
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    lengths = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    angles = np.arccos(np.clip((ahead * behind).sum(axis=2) / np.maximum(lengths, 1e-30), -1.0, 1.0)).ravel()
    flat = mesh.faces.ravel()
    order = np.argsort(flat, kind="stable")
    starts = np.concatenate([[0], np.flatnonzero(np.diff(flat[order])) + 1])
    counts = np.diff(starts, append=flat.size)
    normals = np.empty((flat.size, 3))
    for count in np.unique(counts):  # all vertices with so many corners at a time
        group = order[starts[counts == count, None] + np.arange(count)]
        faces = unit[group // 3]
        near = faces @ faces.transpose(0, 2, 1) > math.cos(CREASE)
        normals[group] = near @ (faces * angles[group][..., None])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return corners.reshape(-1, 3), normals, np.arange(flat.size)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def _outwards(vertices: Floats, faces: Sequence[tuple[int, int, int]] | Indices) -> Mesh:
    mesh = Mesh(np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64))
    return mesh if mesh.volume >= 0.0 else Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def loft(sections: npt.ArrayLike) -> Mesh:
    """The solid through S convex sections of K points each, (S, K, 3), closed by a fan at either end."""
    points = np.asarray(sections, dtype=np.float64)
    count, ring = points.shape[:2]
    vertices = np.concatenate([points.reshape(-1, 3), points[[0, -1]].mean(axis=1)])
    first, last = count * ring, count * ring + 1
    faces = []
    for k in range(ring):
        nxt = (k + 1) % ring
        faces += [(first, nxt, k), (last, (count - 1) * ring + k, (count - 1) * ring + nxt)]
        for s in range(count - 1):
            a, b, c, d = s * ring + k, s * ring + nxt, (s + 1) * ring + nxt, (s + 1) * ring + k
            faces += [(a, b, c), (a, c, d)]
    return _outwards(vertices, faces)


def box(length: float, width: float, height: float, bevel: float = 0.0) -> Mesh:
    """A box on z = 0, centred in x and y; `bevel` takes off its upper and lower edges."""

    def section(z: float, inset: float) -> list[list[float]]:
        x, y = length / 2 - inset, width / 2 - inset
        return [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]

    if not bevel:
        return loft([section(0.0, 0.0), section(height, 0.0)])
    return loft([section(0.0, bevel), section(bevel, 0.0), section(height - bevel, 0.0), section(height, bevel)])


def prism(outline: Sequence[tuple[float, float]], bottom: float, top: float) -> Mesh:
    """A convex outline in the plane, extruded from z = bottom to z = top."""
    flat = np.array(outline, dtype=np.float64)
    return loft(np.stack([np.column_stack([flat, np.full(len(flat), z)]) for z in (bottom, top)]))


def disc(radius: float, bottom: float, top: float, sides: int = 40) -> Mesh:
    """An upright cylinder."""
    return revolve([(0.0, bottom), (radius, bottom), (radius, top), (0.0, top)], sides)


def revolve(profile: Sequence[tuple[float, float]], sides: int = 48, start: float = 0.0, sweep: float = 0.0) -> Mesh:
    """The solid that a profile of (radius, z) points sweeps round the z axis.

    A full turn by default: the profile then starts and ends on the axis (radius 0), or is a closed ring off the axis.
    With `sweep`, an arc of that many radians from the angle `start`, closed at both ends; the profile is convex then.
    """
    points = np.array(profile, dtype=np.float64)
    if sweep:
        arc = start + np.linspace(0.0, sweep, sides)
        radius, height = points.T
        return loft(np.stack([np.column_stack([radius * np.cos(a), radius * np.sin(a), height]) for a in arc]))
    angles = start + np.arange(sides) * (2.0 * math.pi / sides)
    on_axis = points[0, 0] == 0.0 and points[-1, 0] == 0.0
    rings = points[1:-1] if on_axis else points
    vertices = np.stack(
        [
            np.outer(np.cos(angles), rings[:, 0]),
            np.outer(np.sin(angles), rings[:, 0]),
            np.tile(rings[:, 1], (sides, 1)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    count = len(rings)
    faces = []
    for k in range(sides):
        here, there = k * count, ((k + 1) % sides) * count
        for r in range(count if not on_axis else count - 1):
            s = (r + 1) % count
            faces += [(here + r, there + r, there + s), (here + r, there + s, here + s)]
        if on_axis:
            bottom, top = sides * count, sides * count + 1
            faces += [(bottom, there, here), (top, here + count - 1, there + count - 1)]
    if on_axis:
        vertices = np.concatenate([vertices, [[0.0, 0.0, points[0, 1]], [0.0, 0.0, points[-1, 1]]]])
    return _outwards(vertices, faces)


def tube(path: Sequence[tuple[float, float]], half_width: float, half_thickness: float, sides: int = 10) -> Mesh:
    """A rod with an oval section along a path of (x, z) points in the plane y = 0; `half_width` is along y."""
    points = np.array(path, dtype=np.float64)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    turn = np.linspace(0.0, 2.0 * math.pi, sides, endpoint=False)
    across, along = half_width * np.sin(turn), half_thickness * np.cos(turn)
    sections = [
        np.column_stack([x - tz * along, across, z + tx * along])
        for (x, z), (tx, tz) in zip(points, tangent, strict=True)
    ]
    return loft(np.stack(sections))


def ribbon(stations: Sequence[tuple[float, float, float, float, float]]) -> Mesh:
    """A flat bar along x: stations (x, lowest y, highest y, lowest z, highest z) with a slightly rounded top."""
    sections = []
    for x, y0, y1, z0, z1 in stations:
        side = (y1 - y0) * 0.22
        shoulder = z0 + 0.55 * (z1 - z0)
        flat = [(y0, z0), (y1, z0), (y1, shoulder), (y1 - side, z1), (y0 + side, z1), (y0, shoulder)]
        sections.append([[x, y, z] for y, z in flat])
    return loft(sections)
