"""What carries and holds: trays, cartons, boards, teapots."""

from __future__ import annotations

import math

import numpy as np

from scenegen.assets.hollow import Crate
from scenegen.assets.mesh import Mesh, box, disc, joined, loft, revolve, tube
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import CREAM, DARK, STEEL, WHITE, Part
from scenegen.assets.solids import HOLLOWS


def crate_of(name: str) -> Crate:
    """The library's crate of that name."""
    found = HOLLOWS[name]
    assert isinstance(found, Crate)
    return found


def frame(crate: Crate, inset: float, low: float, high: float, thick: float) -> Mesh:
    """A rectangular ring of four bars inside the outline of a crate."""
    long, wide = crate.length - 2.0 * inset, crate.width - 2.0 * inset
    side, end = box(long, thick, high - low), box(thick, wide - 2.0 * thick, high - low)
    y, x = (wide - thick) / 2.0, (long - thick) / 2.0
    bars = [side.moved(y=s * y, z=low) for s in (-1.0, 1.0)] + [end.moved(x=s * x, z=low) for s in (-1.0, 1.0)]
    return joined(bars)


def tray(color: RGB) -> tuple[Part, ...]:
    crate = crate_of("tray")
    floor = box(crate.length - 0.004, crate.width - 0.004, crate.floor)
    inlay = box(crate.length - 0.05, crate.width - 0.05, 0.0006).moved(z=crate.floor)
    stripes = [
        box(wide, crate.width - 0.05, 0.0012).moved(x=x, z=crate.floor) for x, wide in ((0.135, 0.012), (0.150, 0.004))
    ]
    slots = [box(0.0125, 0.090, 0.012).moved(x=s * 0.19365, z=0.024) for s in (-1.0, 1.0)]
    return (
        Part(floor, mix(color, WHITE, 0.12)),
        Part(frame(crate, 0.0, 0.0, crate.height, crate.wall), color),
        Part(inlay, mix(color, WHITE, 0.30)),
        Part(joined(slots), mix(color, DARK, 0.65)),
        Part(joined(stripes), mix(color, WHITE, 0.75)),
    )


def carton(color: RGB) -> tuple[Part, ...]:
    crate = crate_of("carton")
    outside = frame(crate, 0.0, 0.0, crate.height, crate.wall)
    floor = box(crate.length - 0.002, crate.width - 0.002, crate.floor)
    lining = frame(crate, crate.wall, crate.floor, crate.height - 0.002, 0.0006)
    tape = box(0.0010, 0.050, 0.062).moved(x=crate.length / 2.0 - 0.0005, z=crate.height - 0.064)
    arrows = [_upright_arrow(y).moved(x=crate.length / 2.0 - 0.0011) for y in (-0.055, 0.055)]
    seam = box(crate.length - 0.02, 0.046, 0.0006).moved(z=crate.floor)
    return (
        Part(outside, color),
        Part(floor, mix(color, DARK, 0.10)),
        Part(lining, mix(color, DARK, 0.28)),
        Part(tape, mix(color, CREAM, 0.70)),
        Part(joined(arrows), mix(color, DARK, 0.60)),
        Part(seam, mix(color, CREAM, 0.45)),
    )


def _upright_arrow(y: float) -> Mesh:
    """ "This side up" on the front of a carton."""
    head = loft([[[x, y - 0.018, 0.075], [x, y + 0.018, 0.075], [x, y, 0.105]] for x in (0.0, 0.0011)])
    return joined([head, box(0.0011, 0.012, 0.040).moved(x=0.00055, y=y, z=0.036)])


def board(color: RGB) -> tuple[Part, ...]:
    slab = box(0.340, 0.220, 0.0176, 0.003)
    strips = [box(0.334, 0.026, 0.0004).moved(y=y, z=0.0174) for y in (-0.072, 0.0, 0.072)]
    hole = disc(0.014, 0.0172, 0.0180, 28).moved(x=0.140)
    ring = revolve([(0.014, 0.0172), (0.018, 0.0172), (0.018, 0.0178), (0.014, 0.0178)], 28).moved(x=0.140)
    return (
        Part(slab, color),
        Part(joined(strips), mix(color, CREAM, 0.22)),
        Part(ring, mix(color, DARK, 0.35)),
        Part(hole, mix(color, DARK, 0.80)),
    )


def teapot(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.0), (0.040, 0.0), (0.044, 0.004), (0.058, 0.022), (0.066, 0.048), (0.065, 0.070), (0.055, 0.094),
            (0.038, 0.110), (0.034, 0.114), (0.0, 0.114),
        ],
        56,
    ).moved(x=-0.002)  # fmt: skip
    lid = revolve(
        [(0.0, 0.112), (0.036, 0.112), (0.036, 0.117), (0.028, 0.124), (0.012, 0.130), (0.0, 0.131)], 40
    ).moved(x=-0.002)
    knob = revolve([(0.0, 0.128), (0.006, 0.130), (0.010, 0.139), (0.008, 0.147), (0.0, 0.150)], 24).moved(x=-0.002)
    turns = np.linspace(0.0, 1.0, 9)
    line = [(0.050 + 0.052 * s, 0.038 + 0.066 * s**1.4 + 0.006 * math.sin(math.pi * s)) for s in turns]
    spout = _tapered(line, 0.0165, 0.0075)
    bow = [0.5 * math.pi + math.pi * s for s in np.linspace(0.04, 0.96, 13)]
    grip = tube([(-0.058 + 0.047 * math.cos(a), 0.064 + 0.034 * math.sin(a)) for a in bow], 0.0075, 0.0050, 10)
    band = revolve([(0.0665, 0.050), (0.0672, 0.052), (0.0672, 0.058), (0.0662, 0.060)], 56).moved(x=-0.002)
    pale = mix(color, WHITE, 0.75)
    return (
        Part(body, color),
        Part(lid, mix(color, DARK, 0.12)),
        Part(knob, STEEL),
        Part(spout, color),
        Part(grip, mix(color, DARK, 0.12)),
        Part(band, pale),
    )


def _tapered(line: list[tuple[float, float]], first: float, last: float) -> Mesh:
    """A round spout along (x, z) points in the plane y = 0, its radius falling from `first` to `last`."""
    points = np.array(line)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    turn = np.linspace(0.0, math.tau, 14, endpoint=False)
    radii = np.linspace(first, last, len(points))
    return loft(
        [
            np.column_stack([x - tz * r * np.cos(turn), r * np.sin(turn), z + tx * r * np.cos(turn)])
            for (x, z), (tx, tz), r in zip(points, tangent, radii, strict=True)
        ]
    )
