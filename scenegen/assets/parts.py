"""What a part is, and the few details that several objects share."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenegen.assets.mesh import Mesh, prism, revolve, tube
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


def pip(length: float, width: float, bottom: float, top: float) -> Mesh:
    """An arrow head in the plane that points along the heading: the mark of objects that look alike all round."""
    x, y, tip = length / 2, width / 2, width * 0.06
    return prism([(-x, -y), (x, -tip), (x, tip), (-x, y)], bottom, top)
