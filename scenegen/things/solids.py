"""The convex pieces that library objects collide with, where the prism over the footprint would be too coarse.

They follow the pictures' meshes to a few millimetres; what is thin or soft (cutlery, napkins) stays a prism. All stand
flat on the table, so that what rolls in life rests in a simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from scenegen.things.cabinet import Cabinet, Drawer, Rack
from scenegen.things.mesh import Mesh, box, loft
from scenegen.things.parts import UNITS, Crate, Hollow, Slab, Vessel

ROUND_SIDES = 20  # of solid round pieces
DOME = ((0.0, 0.95), (0.18, 1.0), (0.6, 0.85), (1.0, 0.35))  # a mouse, in half its length, width and height

HOLLOWS: dict[str, Hollow] = {
    "plate": Vessel(
        (
            (0.0, 0.070, 0.0),
            (0.007, 0.088, 0.0),
            (0.007, 0.088, 0.076),
            (0.0125, 0.105, 0.092),
            (0.022, 0.125, 0.120),
        )
    ),
    "bowl": Vessel(
        ((0.0, 0.034, 0.0), (0.010, 0.046, 0.0), (0.010, 0.046, 0.030), (0.021, 0.061, 0.052), (0.060, 0.080, 0.076))
    ),
    "mug": Vessel(((0.0, 0.036, 0.0), (0.010, 0.038, 0.0), (0.010, 0.038, 0.0305), (0.095, 0.038, 0.033))),
    "cup": Vessel(
        (
            (0.0, 0.022, 0.0),
            (0.010, 0.0245, 0.0),
            (0.010, 0.0245, 0.018),
            (0.035, 0.036, 0.030),
            (0.075, 0.0425, 0.038),
        )
    ),
    "tray": Crate(0.400, 0.300, 0.045, 0.011, 0.010),
    "carton": Crate(0.300, 0.220, 0.160, 0.005, 0.005),
    "bin": Crate(0.240, 0.200, 0.130, 0.008, 0.008),
    "basket": Vessel(((0.0, 0.150, 0.0), (0.012, 0.150, 0.0), (0.012, 0.150, 0.144), (0.080, 0.150, 0.144))),
    "pot": Vessel(((0.0, 0.110, 0.0), (0.008, 0.110, 0.0), (0.008, 0.110, 0.104), (0.110, 0.110, 0.104))),
    "glass": Vessel(((0.0, 0.0275, 0.0), (0.008, 0.029, 0.0), (0.008, 0.029, 0.026), (0.125, 0.035, 0.032))),
}


Rows = tuple[tuple[float, float], ...]

ROUNDS: dict[
    str, Rows
] = {  # (z, radius) of what is solid and round, from the bottom up; a height that occurs twice is a step
    "stand": (
        (0.0, 0.075),
        (0.012, 0.070),
        (0.012, 0.022),
        (0.122, 0.022),
        (0.122, 0.085),
        (0.130, 0.115),
        (0.140, 0.115),
    ),
    "lid": ((0.0, 0.112), (0.008, 0.112), (0.022, 0.060), (0.048, 0.018)),
    "bottle": ((0.0, 0.032), (0.004, 0.036), (0.130, 0.036), (0.168, 0.0155), (0.230, 0.0145)),
    "can": ((0.0, 0.027), (0.006, 0.033), (0.107, 0.033), (0.115, 0.0275)),
    "jar": ((0.0, 0.036), (0.004, 0.040), (0.088, 0.040), (0.098, 0.0365), (0.120, 0.0365)),
    "apple": ((0.0, 0.016), (0.012, 0.030), (0.036, 0.037), (0.052, 0.033), (0.072, 0.016)),
    "orange": ((0.0, 0.016), (0.014, 0.033), (0.037, 0.040), (0.060, 0.033), (0.080, 0.014)),
}
HANDLES: dict[str, tuple[float, float, float, float]] = {  # from x, to x; lowest z, highest z
    "mug": (0.037, 0.0615, 0.020, 0.078),
    "cup": (0.036, 0.0595, 0.026, 0.064),
}
GRIP = 0.013  # how wide a handle is


def _round(*rows: tuple[float, float]) -> tuple[Mesh, ...]:
    """Frusta through (z, radius), from the bottom up."""
    turns = [math.tau * k / ROUND_SIDES for k in range(ROUND_SIDES)]
    rings = [[[radius * math.cos(turn), radius * math.sin(turn), z] for turn in turns] for z, radius in rows]
    pairs = zip(pairwise(rows), pairwise(rings), strict=True)
    return tuple(loft([below, above]) for ((low, _), (high, _)), (below, above) in pairs if low < high)


def _handle(inner: float, outer: float, low: float, high: float) -> tuple[Mesh, ...]:
    """The ear of a mug: three bars from the wall at x = `inner` to x = `outer`."""
    thick, wide = 0.008, GRIP
    bar = box(outer - inner, wide, thick).moved(x=(inner + outer) / 2.0)
    upright = box(thick, wide, high - low).moved(x=outer - thick / 2.0, z=low)
    return upright, bar.moved(z=low), bar.moved(z=high - thick)


def _teapot() -> tuple[Mesh, ...]:
    body = _round((0.0, 0.042), (0.022, 0.060), (0.048, 0.066), (0.094, 0.056), (0.114, 0.036), (0.150, 0.010))
    spout, grip = box(0.050, 0.020, 0.052).moved(x=0.085, z=0.052), box(0.046, 0.014, 0.068).moved(x=-0.087, z=0.030)
    return *(piece.moved(x=-0.002) for piece in body), spout, grip


def _laptop() -> tuple[Mesh, ...]:
    """The deck, and the lid that leans back."""
    lid = [
        [[x, -0.165, z], [x + 0.0085, -0.165, z], [x + 0.0085, 0.165, z], [x, 0.165, z]]
        for x, z in ((-0.078, 0.0), (-0.156, 0.224))
    ]
    return box(0.234, 0.330, 0.0195).moved(x=0.039), loft(lid)


def slab_mesh(one: Slab) -> Mesh:
    """An upright piece as a box."""
    x0, y0, x1, y1 = one.box
    middle = {"x": (x0 + x1) / 2.0, "y": (y0 + y1) / 2.0, "z": one.low}
    return box(x1 - x0, y1 - y0, one.high - one.low).moved(**middle)


SOLIDS: dict[str, Callable[[], tuple[Mesh, ...]]] = {
    "plate": HOLLOWS["plate"].pieces,
    "bowl": HOLLOWS["bowl"].pieces,
    "mug": lambda: (*HOLLOWS["mug"].pieces(), *_handle(*HANDLES["mug"])),
    "cup": lambda: (*HOLLOWS["cup"].pieces(), *_handle(*HANDLES["cup"])),
    "glass": HOLLOWS["glass"].pieces,
    "basket": HOLLOWS["basket"].pieces,
    "pot": HOLLOWS["pot"].pieces,
    "cabinet": lambda: tuple(map(slab_mesh, Cabinet().slabs())),
    "drawer": lambda: tuple(map(slab_mesh, Drawer().slabs())),
    "rack": lambda: tuple(map(slab_mesh, Rack().slabs())),
    "bin": HOLLOWS["bin"].pieces,
    "stand": lambda: _round(*ROUNDS["stand"]),
    "lid": lambda: _round(*ROUNDS["lid"]),
    "shelfunit": lambda: tuple(map(slab_mesh, UNITS["shelfunit"].slabs())),
    "tray": HOLLOWS["tray"].pieces,
    "carton": HOLLOWS["carton"].pieces,
    "bottle": lambda: _round(*ROUNDS["bottle"]),
    "can": lambda: _round(*ROUNDS["can"]),
    "jar": lambda: _round(*ROUNDS["jar"]),
    "apple": lambda: _round(*ROUNDS["apple"]),
    "orange": lambda: _round(*ROUNDS["orange"]),
    "teapot": _teapot,
    "laptop": _laptop,
    "mouse": lambda: tuple(part.scaled(0.0575, 0.031, 0.038) for part in _round(*DOME)),
    "stapler": lambda: (box(0.150, 0.038, 0.010), box(0.149, 0.033, 0.048).moved(z=0.010)),
}
