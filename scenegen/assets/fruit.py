"""Bananas, oranges and lemons."""

from __future__ import annotations

import math

import numpy as np

from scenegen.assets.mesh import Mesh, loft, revolve, tube
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import DARK, Part

LEAF: RGB = (0.30, 0.55, 0.22)
STALK: RGB = (0.38, 0.30, 0.16)


def banana(color: RGB) -> tuple[Part, ...]:
    """Lying on its side, bent to the left; the stalk is at the front."""
    bend, middle = 0.110, 0.97 * 0.0176
    stations = [
        (-0.80, 0.0050), (-0.77, 0.0085), (-0.66, 0.0130), (-0.45, 0.0162), (-0.15, 0.0176), (0.15, 0.0176),
        (0.42, 0.0160), (0.58, 0.0125), (0.66, 0.0085), (0.72, 0.0060),
    ]  # fmt: skip
    body = _bow(stations, bend, middle)
    stalk = _bow([(0.70, 0.0062), (0.80, 0.0046), (0.855, 0.0050)], bend, middle)
    tip = _bow([(-0.835, 0.0030), (-0.79, 0.0056)], bend, middle)
    return Part(body, color), Part(stalk, mix(color, (0.50, 0.48, 0.16), 0.75)), Part(tip, mix(color, DARK, 0.75))


def _bow(stations: list[tuple[float, float]], bend: float, height: float) -> Mesh:
    """Sections (angle along the bow, radius) of something bent to the left, lying on the table."""
    turn = np.linspace(0.0, math.tau, 12, endpoint=False)
    rim = 1.0 + 0.045 * np.cos(3.0 * turn)  # bananas have edges
    sections = []
    for angle, radius in stations:
        x, y = bend * math.sin(angle), -bend * math.cos(angle) + 0.091
        u, v = math.sin(angle), -math.cos(angle)  # outwards
        far = radius * rim * np.cos(turn)
        sections.append(np.column_stack([x + u * far, y + v * far, height + 0.97 * radius * rim * np.sin(turn)]))
    return loft(np.stack(sections)).moved(-0.0015, 0.00705).scaled(1.05, 1.05, 1.04)


def orange(color: RGB) -> tuple[Part, ...]:
    rows = [(0.0395 * math.sin(a), 0.0375 - 0.0375 * math.cos(a)) for a in np.linspace(0.0, math.pi, 17)]
    body = revolve([(0.0, 0.0), *rows[1:-1], (0.0, 0.0735)])
    stalk = revolve([(0.0, 0.071), (0.0045, 0.072), (0.0035, 0.0765), (0.0, 0.0770)], 12)
    return Part(body, color), Part(stalk, STALK), Part(_leaf(0.0755, 0.004, 0.0355), LEAF)


def _leaf(height: float, start: float, length: float) -> Mesh:
    """A leaf that lies along the heading."""
    rows = (
        (0.0, 0.0010, 0.0),
        (0.25, 0.0075, 0.0030),
        (0.55, 0.0085, 0.0032),
        (0.85, 0.0045, 0.0010),
        (1.0, 0.0008, 0.0),
    )
    sections = []
    for share, half, lift in rows:
        x, z = start + share * length, height + lift
        sections.append([[x, -half, z], [x, half, z], [x, 0.6 * half, z + 0.0012], [x, -0.6 * half, z + 0.0012]])
    return loft(sections)


def lemon(color: RGB) -> tuple[Part, ...]:
    rows = [
        (0.0, -0.0415), (0.006, -0.0405), (0.0095, -0.0365), (0.018, -0.0310), (0.0255, -0.0180), (0.0288, 0.0),
        (0.0260, 0.0170), (0.0185, 0.0300), (0.0105, 0.0375), (0.0070, 0.0420), (0.0, 0.0435),
    ]  # fmt: skip
    body = revolve(rows).laid().moved(z=0.0288)
    stalk = revolve([(0.0, 0.0415), (0.0038, 0.0425), (0.0030, 0.0448), (0.0, 0.0450)], 12).laid().moved(z=0.0288)
    shine = tube([(-0.016, 0.0562), (0.0, 0.0575), (0.014, 0.0563)], 0.0035, 0.0005, 8)
    return Part(body, color), Part(stalk, STALK), Part(shine, mix(color, (1.0, 1.0, 0.9), 0.5))
