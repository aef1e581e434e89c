"""Closed triangle meshes made from a few numbers: boxes, lofts, surfaces of revolution, tubes; and parts of objects.

Vertices are shared between triangles and triangles wind counter-clockwise seen from outside, so that "every edge is
used once in each direction" says that a mesh is closed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.geometry.footprint import Box, Circle, Footprint, Point, Polygon, centroid
from scenegen.things.library import RGB
from scenegen.things.outline import MAX_DRAWN_CORNERS, Floats, Indices, simplify
from scenegen.things.palette import mix

CREASE = math.radians(35.0)  # edges sharper than this are drawn as edges, flatter ones as a smooth surface


@dataclass(frozen=True, slots=True)
class Mesh:
    """`vertices` (V, 3) in metres, `faces` (F, 3) indices of vertices."""

    vertices: Floats
    faces: Indices

    def shift(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        return Mesh(self.vertices + np.array([x, y, z]), self.faces)

    def tip(self) -> Mesh:
        """Turned by a quarter about the x axis: what pointed up points along -y."""
        x, y, z = self.vertices.T
        return Mesh(np.column_stack([x, -z, y]), self.faces)

    def lay(self) -> Mesh:
        """Turned by a quarter about the y axis: what pointed up points along +x."""
        x, y, z = self.vertices.T
        return Mesh(np.column_stack([z, y, -x]), self.faces)

    def turn(self, angle: float) -> Mesh:
        """Turned about the z axis, counter-clockwise, by radians."""
        x, y, z = self.vertices.T
        cos, sin = math.cos(angle), math.sin(angle)
        return Mesh(np.column_stack([cos * x - sin * y, sin * x + cos * y, z]), self.faces)

    def scale(self, x: float, y: float, z: float) -> Mesh:
        """Stretched along the axes by positive factors."""
        return Mesh(self.vertices * np.array([x, y, z]), self.faces)

    @property
    def volume(self) -> float:
        """Cubic metres enclosed (divergence theorem); positive where triangles face outwards."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)

    @property
    def is_closed(self) -> bool:
        """Whether every edge is used once in each direction."""
        edges = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        forward = {(int(a), int(b)) for a, b in edges}
        return len(forward) == len(edges) and all((b, a) in forward for a, b in forward)


def shade_mesh(mesh: Mesh) -> tuple[Floats, Floats, Indices]:
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


def join(meshes: Sequence[Mesh]) -> Mesh:
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


CREAM: RGB = (0.96, 0.93, 0.84)
CHINA: RGB = (0.97, 0.97, 0.96)
STEEL: RGB = (0.70, 0.72, 0.75)
SOOT: RGB = (0.20, 0.18, 0.18)
COFFEE: RGB = (0.28, 0.17, 0.11)


@dataclass(frozen=True, slots=True)
class Part:
    """A closed mesh in the object's frame (metres; z = 0 the table, heading along +x) and its colour."""

    mesh: Mesh
    color: RGB


def handle(inner: float, reach: float, low: float, high: float) -> Mesh:
    """The ear of a mug: from the wall at x = `inner` out to x = `reach`, between two heights."""
    thick = 0.0042
    middle, half = (low + high) / 2, (high - low) / 2
    bow = [0.5 * math.pi - math.pi * step / 14 for step in range(15)]
    path = [(inner + (reach - thick - inner) * math.cos(a) ** 0.7, middle + half * math.sin(a)) for a in bow[1:-1]]
    return tube([(inner - 0.003, middle + half), *path, (inner - 0.003, middle - half)], 0.0065, thick)


def patch(radius: float, depth: float, low: float, high: float, sweep: float) -> Mesh:
    """A label on a round wall: `sweep` radians of it, centred on the heading, its outside at `radius`."""
    inner = radius - depth
    ring = [(inner, low), (radius, low), (radius, high), (inner, high)]
    return revolve(ring, max(4, round(sweep / 0.13)), start=-sweep / 2, sweep=sweep)


def lining(inside: list[tuple[float, float]], thickness: float = 0.0008) -> Mesh:
    """A thin coat on the inside of a vessel; `inside` runs from the axis to the rim as (radius, z)."""
    coat = [(max(r - thickness, 0.0), z + thickness) for r, z in inside[:-1]]
    rim, height = inside[-1]
    coat.append((rim - thickness, height))
    below = [(r + thickness / 2 if r else 0.0, z - thickness / 2) for r, z in inside]
    return revolve([*coat, *reversed(below)])


def crescent(profile: Sequence[tuple[float, float]], sweep: float, thickness: float = 0.0006) -> Mesh:
    """A brush stroke of glaze on the inside of a vessel: it shows the heading of what is round.

    `profile` runs as (radius, z) from the rim inwards. The stroke covers all of it at the heading, and ever less of it
    to either side, over `sweep` radians in all.
    """
    points = np.array(profile)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    sections = []
    for angle in np.linspace(-sweep / 2, sweep / 2, max(8, round(sweep / 0.1))):
        share = max(math.cos(math.pi * angle / sweep), 0.02)
        places = np.linspace(0.0, share * along[-1], 6)
        line = np.column_stack([np.interp(places, along, points[:, 0]), np.interp(places, along, points[:, 1])])
        tangent = np.gradient(line, axis=0)
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])  # towards the axis and up
        normal *= thickness / np.linalg.norm(normal, axis=1, keepdims=True)
        radius, z = np.concatenate([line - normal, (line + normal)[::-1]]).T
        sections.append(np.column_stack([radius * math.cos(angle), radius * math.sin(angle), z]))
    return loft(sections)


def pip(length: float, width: float, bottom: float, top: float) -> Mesh:
    """An arrow head in the plane that points along the heading: the mark of blocks and plain shapes."""
    x, y, tip = length / 2, width / 2, width * 0.06
    return prism([(-x, -y), (x, -tip), (x, tip), (-x, y)], bottom, top)


BEVEL = 0.05  # of the smallest size: what edges lose
MARK_HEIGHT = 0.02  # of the smallest size: how far the mark stands out
MAX_MARK = 0.06  # metres


def plain(footprint: Footprint, height: float, color: RGB) -> tuple[Part, ...]:
    """Footprint x height as closed meshes: the body in its colour, and the mark. Sizes in metres."""
    light = sum(color) / 3 > 0.55
    ink = mix(color, SOOT, 0.55) if light else mix(color, CHINA, 0.65)
    match footprint:
        case Circle(radius):
            smallest = min(2.0 * radius, height)
            body = _round(radius, height - MARK_HEIGHT * smallest, BEVEL * smallest)
            long = wide = min(radius, MAX_MARK)
            x, y = 0.0, 0.0
        case Box(length, width):
            smallest = min(length, width, height)
            corners = [(-length, -width), (length, -width), (length, width), (-length, width)]
            half = np.array(corners) / 2.0
            body = _upright(half, 1.0 - 2.0 * BEVEL * smallest / np.array([length, width]), height, smallest)
            # In the middle of a cube, at the front of what is longer or larger.
            long = wide = min(0.5 * min(length, width), MAX_MARK)
            x, y = length / 2.0 - 0.25 * min(length, width) - long / 2.0, 0.0
        case Polygon(vertices):
            outline = simplify(vertices, MAX_DRAWN_CORNERS)
            x, y, room = _middle(outline)
            smallest = min(2.0 * room, height)
            centred = np.array(outline) - (x, y)
            body = _upright(centred, np.full(2, 1.0 - BEVEL * smallest / room), height, smallest).shift(x, y)
            long = wide = min(room, MAX_MARK)
    raised = MARK_HEIGHT * smallest
    mark = pip(long, wide, height - 2.0 * raised, height).shift(x, y)
    return Part(body, color), Part(mark, ink)


def _round(radius: float, height: float, bevel: float) -> Mesh:
    inner, top = radius - bevel, height - bevel
    return revolve([(0.0, 0.0), (inner, 0.0), (radius, bevel), (radius, top), (inner, height), (0.0, height)])


def _upright(outline: Floats, inset: Floats, height: float, smallest: float) -> Mesh:
    """A convex outline (K, 2) round the origin, extruded; `inset` scales it at its bevelled ends."""
    bevel, top = BEVEL * smallest, height - MARK_HEIGHT * smallest
    levels = [(0.0, inset), (bevel, np.ones(2)), (top - bevel, np.ones(2)), (top, inset)]
    return loft(np.stack([np.column_stack([outline * scale, np.full(len(outline), z)]) for z, scale in levels]))


def _middle(outline: Sequence[Point]) -> tuple[float, float, float]:
    """The centroid of a convex polygon, counter-clockwise, and its distance from the nearest edge."""
    x, y = centroid(Polygon(tuple(outline)))
    edges = zip(outline, (*outline[1:], outline[0]), strict=True)
    room = min(
        ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in edges
    )
    return x, y, room
