"""What holds other things in the pictures: shelf units, baskets, pots and their lids, stands."""

from __future__ import annotations

from scenegen.assets.boards import UNITS, Slab
from scenegen.assets.mesh import box, disc, joined, revolve
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import DARK, STEEL, WHITE, Part, crescent, lining, patch

GROWN = 0.0004  # metres by which boards reach into the sides, so that no line of the table shows


def _slab(one: Slab) -> tuple[float, float, float, float, float, float]:
    x0, y0, x1, y1 = one.box
    return x1 - x0, y1 - y0, one.high - one.low, (x0 + x1) / 2.0, (y0 + y1) / 2.0, one.low


def shelfunit(color: RGB) -> tuple[Part, ...]:
    left, right, back, *boards = UNITS["shelfunit"].slabs()
    made = []
    for group, shade in (
        ((left, right), color),
        ((back,), mix(color, DARK, 0.18)),
        (boards, mix(color, WHITE, 0.16)),
    ):
        grown = GROWN if group is boards else 0.0
        meshes = []
        for length, width, height, x, y, z in map(_slab, group):
            meshes.append(box(length, width + grown, height).moved(x=x, y=y, z=z))
        made.append(Part(joined(meshes), shade))
    return tuple(made)


def basket(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.012), (0.144, 0.012), (0.144, 0.079)]
    body = revolve([(0.0, 0.0), (0.149, 0.0), (0.150, 0.004), (0.150, 0.080), (0.145, 0.080), *reversed(inside)], 64)
    bands = [revolve([(0.1495, z), (0.1500, z), (0.1500, z + 0.010), (0.1495, z + 0.010)], 64) for z in (0.018, 0.048)]
    return (
        Part(body, color),
        Part(lining(inside), mix(color, WHITE, 0.35)),
        Part(joined(bands), mix(color, DARK, 0.30)),
        Part(crescent([(0.1435, 0.0745), (0.1435, 0.0300)], 1.8), mix(color, DARK, 0.35)),
    )


def pot(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.008), (0.104, 0.008), (0.104, 0.109)]
    body = revolve([(0.0, 0.0), (0.106, 0.0), (0.110, 0.005), (0.110, 0.110), (0.105, 0.110), *reversed(inside)], 64)
    mark = crescent([(0.1035, 0.1040), (0.1035, 0.0500)], 1.8)
    return Part(body, color), Part(lining(inside), mix(color, WHITE, 0.45)), Part(mark, color)


def lid(color: RGB) -> tuple[Part, ...]:
    dome = revolve(
        [
            (0.0, 0.0), (0.111, 0.0), (0.112, 0.002), (0.112, 0.005), (0.109, 0.008), (0.085, 0.014), (0.050, 0.020),
            (0.018, 0.0235), (0.0, 0.0235),
        ],
        64,
    )  # fmt: skip
    knob = revolve([(0.0, 0.020), (0.008, 0.022), (0.008, 0.033), (0.017, 0.039), (0.016, 0.046), (0.0, 0.048)], 32)
    ring = revolve([(0.104, 0.0070), (0.1085, 0.0062), (0.1085, 0.0085), (0.104, 0.0098)], 64)
    vent = disc(0.0055, 0.0140, 0.0178, 18).moved(x=0.070)
    return Part(dome, color), Part(knob, DARK), Part(ring, mix(color, STEEL, 0.55)), Part(vent, mix(color, DARK, 0.85))


def stand(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.0), (0.074, 0.0), (0.075, 0.004), (0.071, 0.010), (0.046, 0.017), (0.026, 0.030), (0.0175, 0.052),
            (0.0165, 0.080), (0.021, 0.102), (0.036, 0.116), (0.070, 0.1225), (0.112, 0.126), (0.115, 0.129),
            (0.115, 0.1375), (0.113, 0.1394), (0.0, 0.1394),
        ],
        64,
    )  # fmt: skip
    ring = revolve([(0.092, 0.1380), (0.1005, 0.1380), (0.1005, 0.1400), (0.092, 0.1400)], 64)
    mark = patch(0.1005, 0.0160, 0.1385, 0.1399, 0.34)
    ink = mix(color, DARK, 0.40)
    return Part(body, color), Part(ring, mix(color, DARK, 0.28)), Part(mark, ink)
