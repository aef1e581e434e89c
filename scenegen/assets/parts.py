"""What a part is, and the few details that several objects share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.assets.mesh import Mesh, loft, prism, revolve, tube
from scenegen.assets.palette import RGB

CREAM: RGB = (0.96, 0.93, 0.84)
WHITE: RGB = (0.97, 0.97, 0.96)
STEEL: RGB = (0.70, 0.72, 0.75)
DARK: RGB = (0.20, 0.18, 0.18)
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
