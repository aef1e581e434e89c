"""How small things are drawn: tableware, cutlery, boxes, fruit, and what lies on desks."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from scenegen.things.library import RGB
from scenegen.things.mesh import (
    CHINA,
    COFFEE,
    CREAM,
    SOOT,
    STEEL,
    Mesh,
    Part,
    box,
    crescent,
    disc,
    handle,
    join,
    lining,
    loft,
    patch,
    pip,
    prism,
    revolve,
    ribbon,
    tube,
)
from scenegen.things.palette import mix


def plate(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.0), (0.070, 0.0), (0.080, 0.004), (0.125, 0.0185), (0.1245, 0.0208), (0.122, 0.0215),
            (0.119, 0.0210), (0.090, 0.0125), (0.083, 0.0085), (0.076, 0.0070), (0.0, 0.0070),
        ],
        72,
    )  # fmt: skip
    ink = mix(color, (0.20, 0.36, 0.62), 0.70)
    well = revolve([(0.0, 0.006), (0.0755, 0.006), (0.0758, 0.0069), (0.0735, 0.0074), (0.0, 0.0074)], 72)
    line = revolve([(0.1085, 0.016), (0.1130, 0.016), (0.1130, 0.0198), (0.1085, 0.0185)], 72)
    mark = crescent([(0.1130, 0.0194), (0.0930, 0.0135)], 2.6)
    return Part(body, color), Part(well, mix(color, (0.84, 0.86, 0.88), 0.45)), Part(line, ink), Part(mark, ink)


def bowl(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.009), (0.030, 0.010), (0.052, 0.021), (0.068, 0.040), (0.076, 0.0585)]
    body = revolve(
        [
            (0.0, 0.0), (0.034, 0.0), (0.038, 0.005), (0.058, 0.018), (0.073, 0.040), (0.080, 0.0585),
            (0.0785, 0.060), (0.0765, 0.060), *reversed(inside),
        ]
    )  # fmt: skip
    inner = mix(color, CHINA, 0.72)
    mark = crescent([(0.0755, 0.0585), (0.067, 0.0400), (0.058, 0.0290)], 3.6, 0.0012)
    return Part(body, color), Part(lining(inside), inner), Part(mark, color)


def mug(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.010), (0.0305, 0.011), (0.0325, 0.093)]
    body = revolve(
        [(0.0, 0.0), (0.034, 0.0), (0.038, 0.005), (0.038, 0.093), (0.0372, 0.095), (0.0333, 0.095), *reversed(inside)]
    )
    return (
        Part(body, color),
        Part(handle(0.037, 0.062, 0.022, 0.076), color),
        Part(lining(inside), mix(color, CHINA, 0.80)),
        Part(disc(0.0318, 0.060, 0.074), COFFEE),
    )


def cup(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.009), (0.018, 0.010), (0.030, 0.035), (0.0375, 0.0735)]
    body = revolve(
        [
            (0.0, 0.0), (0.022, 0.0), (0.023, 0.006), (0.034, 0.030), (0.040, 0.055), (0.0425, 0.0735),
            (0.0418, 0.075), (0.0382, 0.075), *reversed(inside),
        ]
    )  # fmt: skip
    tea = revolve([(0.0, 0.045), (0.0318, 0.045), (0.0349, 0.062), (0.0, 0.062)])
    return (
        Part(body, color),
        Part(handle(0.038, 0.060, 0.028, 0.062), color),
        Part(lining(inside), mix(color, CHINA, 0.80)),
        Part(tea, (0.66, 0.38, 0.14)),
    )


def glass(color: RGB) -> tuple[Part, ...]:
    water = revolve([(0.0, 0.0), (0.0275, 0.0), (0.029, 0.003), (0.0338, 0.100), (0.0, 0.100)])
    rim = revolve([(0.0338, 0.099), (0.0350, 0.124), (0.0344, 0.125), (0.0330, 0.124), (0.0320, 0.099)])
    rind, lemon = (disc(radius, 0.098, top, 24).shift(x=0.014) for radius, top in ((0.0155, 0.1025), (0.0128, 0.1030)))
    return (
        Part(water, mix(color, (0.25, 0.52, 0.72), 0.60)),
        Part(rim, mix(color, CHINA, 0.35)),
        Part(rind, (0.95, 0.78, 0.16)),
        Part(lemon, (0.98, 0.93, 0.58)),
    )


def bottle(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.0), (0.032, 0.0), (0.0352, 0.004), (0.0352, 0.125), (0.033, 0.140), (0.024, 0.156),
            (0.0155, 0.168), (0.013, 0.182), (0.013, 0.212), (0.0, 0.212),
        ]
    )  # fmt: skip
    return (
        Part(body, color),
        Part(patch(0.0357, 0.003, 0.035, 0.105, 3.6), CREAM),
        Part(patch(0.0360, 0.0045, 0.058, 0.082, 1.4), mix(color, SOOT, 0.15)),
        Part(
            revolve([(0.0, 0.205), (0.0145, 0.205), (0.0145, 0.229), (0.0135, 0.230), (0.0, 0.230)]), (0.80, 0.62, 0.24)
        ),
    )


def can(color: RGB) -> tuple[Part, ...]:
    body = revolve([(0.0, 0.006), (0.0328, 0.006), (0.0328, 0.106), (0.0, 0.106)])
    ends = revolve(
        [
            (0.0, 0.0), (0.026, 0.0), (0.0328, 0.0065), (0.0326, 0.106), (0.0285, 0.1145), (0.027, 0.115),
            (0.026, 0.112), (0.0, 0.112),
        ]
    )  # fmt: skip
    tab = box(0.024, 0.011, 0.0014, 0.0004).shift(x=0.004, z=0.1125)
    mouth = disc(0.0085, 0.1115, 0.1128, 16).scale(0.85, 1.0, 1.0).shift(x=0.016)
    return (
        Part(body, color),
        Part(ends, STEEL),
        Part(patch(0.0330, 0.003, 0.045, 0.075, 2.4), CHINA),
        Part(mouth, SOOT),
        Part(tab, mix(STEEL, SOOT, 0.35)),
    )


def jar(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [(0.0, 0.0), (0.036, 0.0), (0.0395, 0.004), (0.0395, 0.086), (0.036, 0.094), (0.033, 0.098), (0.0, 0.098)]
    )
    lid = revolve([(0.0, 0.096), (0.0365, 0.096), (0.0365, 0.117), (0.035, 0.1188), (0.0, 0.1188)])
    ink = mix(color, SOOT, 0.15)
    seal = join(
        [box(0.050, 0.014, 0.0012).shift(x=0.0125, z=0.1185), box(0.0015, 0.014, 0.030).shift(x=0.037, z=0.0897)]
    )
    return (
        Part(body, color),
        Part(lid, CREAM),
        Part(patch(0.0397, 0.003, 0.025, 0.072, 2.6), CREAM),
        Part(patch(0.0400, 0.0025, 0.040, 0.058, 1.2), mix(color, SOOT, 0.30)),
        Part(seal, ink),
    )


def apple(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.004), (0.010, 0.0), (0.020, 0.002), (0.030, 0.013), (0.0355, 0.026), (0.0368, 0.038),
            (0.034, 0.050), (0.026, 0.059), (0.016, 0.0615), (0.007, 0.058), (0.0, 0.053),
        ]
    )  # fmt: skip
    stalk = tube([(0.0, 0.050), (-0.0005, 0.058), (-0.002, 0.065), (-0.0045, 0.0705)], 0.0018, 0.0018, 7)
    leaf = loft(
        [
            [[x, -w, 0.064 + lift], [x, w, 0.064 + lift], [x, 0.6 * w, 0.0652 + lift], [x, -0.6 * w, 0.0652 + lift]]
            for x, w, lift in (
                (-0.002, 0.001, 0.0),
                (0.006, 0.0060, 0.004),
                (0.014, 0.0070, 0.005),
                (0.027, 0.0008, 0.001),
            )
        ]
    )
    return Part(body, color), Part(stalk, (0.36, 0.24, 0.15)), Part(leaf, (0.30, 0.55, 0.22))


def fork(color: RGB) -> tuple[Part, ...]:
    shaft = ribbon(
        [
            (-0.095, -0.0055, 0.0055, 0.0, 0.0030), (-0.088, -0.0080, 0.0080, 0.0, 0.0034),
            (-0.040, -0.0050, 0.0050, 0.0010, 0.0045), (0.015, -0.0034, 0.0034, 0.0030, 0.0070),
            (0.026, -0.0060, 0.0060, 0.0028, 0.0066), (0.036, -0.0125, 0.0125, 0.0014, 0.0048),
            (0.052, -0.0140, 0.0140, 0.0006, 0.0038), (0.056, -0.0140, 0.0140, 0.0006, 0.0036),
        ]
    )  # fmt: skip
    tines = [
        ribbon(
            [
                (0.052, y - 0.0028, y + 0.0028, 0.0006, 0.0036), (0.070, y - 0.0026, y + 0.0026, 0.0018, 0.0046),
                (0.088, y - 0.0021, y + 0.0021, 0.0054, 0.0080), (0.095, y - 0.0008, y + 0.0008, 0.0080, 0.0100),
            ]
        )
        for y in (-0.0112, 0.0, 0.0112)
    ]  # fmt: skip
    return Part(shaft, color), *(Part(tine, color) for tine in tines)


def knife(color: RGB) -> tuple[Part, ...]:
    grip = ribbon(
        [
            (-0.110, -0.0070, 0.0070, 0.0005, 0.0085), (-0.104, -0.0095, 0.0095, 0.0, 0.0096),
            (-0.050, -0.0080, 0.0080, 0.0, 0.0096), (-0.012, -0.0090, 0.0090, 0.0, 0.0096),
        ]
    )  # fmt: skip
    blade = ribbon(
        [
            (-0.014, -0.0085, 0.0090, 0.0025, 0.0055), (0.010, -0.0110, 0.0095, 0.0025, 0.0055),
            (0.070, -0.0110, 0.0095, 0.0025, 0.0055), (0.092, -0.0080, 0.0095, 0.0025, 0.0055),
            (0.104, -0.0020, 0.0092, 0.0025, 0.0055), (0.110, 0.0065, 0.0085, 0.0025, 0.0050),
        ]
    )  # fmt: skip
    rivets = [disc(0.0026, 0.0, 0.0100, 12).shift(x=x) for x in (-0.085, -0.035)]
    return Part(grip, SOOT), Part(blade, color), *(Part(rivet, STEEL) for rivet in rivets)


def spoon(color: RGB) -> tuple[Part, ...]:
    shaft = ribbon(
        [
            (-0.090, -0.0055, 0.0055, 0.0, 0.0030), (-0.083, -0.0080, 0.0080, 0.0, 0.0034),
            (-0.035, -0.0050, 0.0050, 0.0020, 0.0055), (0.020, -0.0034, 0.0034, 0.0060, 0.0100),
            (0.042, -0.0048, 0.0048, 0.0072, 0.0110),
        ]
    )  # fmt: skip
    dish = [
        (0.0, 0.0), (0.45, 0.0008), (0.80, 0.0045), (1.0, 0.0105), (0.97, 0.0120),
        (0.88, 0.0112), (0.70, 0.0062), (0.40, 0.0032), (0.0, 0.0026),
    ]  # fmt: skip
    hollow = [
        (0.0, 0.0029), (0.40, 0.0035), (0.70, 0.0066), (0.84, 0.0102), (0.70, 0.0050), (0.40, 0.0024),
        (0.0, 0.0020),
    ]  # fmt: skip
    bowl = revolve(dish).scale(0.028, 0.019, 1.0).shift(x=0.062)
    shadow = revolve(hollow).scale(0.028, 0.019, 1.0).shift(x=0.062)
    return Part(shaft, color), Part(bowl, color), Part(shadow, mix(color, SOOT, 0.22))


def napkin(color: RGB) -> tuple[Part, ...]:
    sheet = box(0.150, 0.150, 0.0016)
    fold = prism([(-0.073, -0.073), (0.020, -0.073), (0.020, 0.073), (-0.073, 0.073)], 0.0, 0.0040)
    stripe = prism([(0.046, -0.0745), (0.056, -0.0745), (0.056, 0.0745), (0.046, 0.0745)], 0.0, 0.0028)
    thin = prism([(0.061, -0.0745), (0.064, -0.0745), (0.064, 0.0745), (0.061, 0.0745)], 0.0, 0.0028)
    pale = mix(color, CHINA, 0.75)
    return Part(sheet, mix(color, CHINA, 0.18)), Part(fold, color), Part(stripe, pale), Part(thin, pale)


def crackerbox(color: RGB) -> tuple[Part, ...]:
    body = box(0.158, 0.058, 0.2085)
    belt = box(0.1592, 0.0592, 0.070).shift(z=0.075)
    biscuits = [box(0.040, 0.0600, 0.040).shift(x=x, z=z) for x, z in ((-0.046, 0.090), (0.046, 0.090), (0.0, 0.090))]
    sun = revolve([(0.0, -0.0300), (0.021, -0.0300), (0.021, 0.0300), (0.0, 0.0300)], 32)
    emblem = sun.tip().shift(z=0.176)
    cap = box(0.1585, 0.0300, 0.0012).shift(z=0.2080)
    seal = disc(0.0190, 0.2080, 0.2100, 32).shift(x=0.046)
    gold: RGB = (0.91, 0.69, 0.32)
    return (
        Part(body, color),
        Part(belt, CREAM),
        *(Part(biscuit, gold) for biscuit in biscuits),
        Part(emblem, (0.98, 0.80, 0.22)),
        Part(cap, mix(color, SOOT, 0.18)),
        Part(seal, (0.98, 0.80, 0.22)),
    )


def book(color: RGB) -> tuple[Part, ...]:
    pages = box(0.204, 0.144, 0.019).shift(y=0.001, z=0.003)
    covers = [box(0.210, 0.150, 0.0030).shift(z=z) for z in (0.0, 0.0208)]
    spine = box(0.210, 0.004, 0.0238).shift(y=0.073)
    title = box(0.034, 0.096, 0.0012).shift(x=0.052, y=-0.004, z=0.0234)
    line = box(0.008, 0.060, 0.0012).shift(x=0.018, y=-0.004, z=0.0234)
    joint = box(0.210, 0.0035, 0.0012).shift(y=0.062, z=0.0231)
    gilt = mix(color, (0.95, 0.85, 0.60), 0.85)
    return (
        Part(pages, CREAM),
        *(Part(cover, color) for cover in covers),
        Part(spine, color),
        Part(title, gilt),
        Part(line, gilt),
        Part(joint, mix(color, SOOT, 0.45)),
    )


def block(color: RGB) -> tuple[Part, ...]:
    light = sum(color) / 3 > 0.55
    mark = mix(color, SOOT, 0.55) if light else mix(color, CHINA, 0.65)
    return Part(box(0.050, 0.050, 0.0490, 0.0025), color), Part(pip(0.026, 0.026, 0.0480, 0.0500), mark)


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
    return Part(body, color), Part(stalk, mix(color, (0.50, 0.48, 0.16), 0.75)), Part(tip, mix(color, SOOT, 0.75))


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
    return loft(np.stack(sections)).shift(-0.0015, 0.00705).scale(1.05, 1.05, 1.04)


def orange(color: RGB) -> tuple[Part, ...]:
    rows = [(0.0395 * math.sin(a), 0.0375 - 0.0375 * math.cos(a)) for a in np.linspace(0.0, math.pi, 17)]
    body = revolve([(0.0, 0.0), *rows[1:-1], (0.0, 0.0735)])
    stalk = revolve([(0.0, 0.071), (0.0045, 0.072), (0.0035, 0.0765), (0.0, 0.0770)], 12)
    return Part(body, color), Part(stalk, STALK), Part(_leaf(0.0755, 0.004, 0.0355), LEAF)


def _leaf(height: float, start: float, length: float) -> Mesh:
    """A leaf that lies along the heading."""
    rows = (
        (0.0, 0.0010, 0.0), (0.25, 0.0075, 0.0030), (0.55, 0.0085, 0.0032), (0.85, 0.0045, 0.0010),
        (1.0, 0.0008, 0.0),
    )  # fmt: skip
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
    body = revolve(rows).lay().shift(z=0.0288)
    stalk = revolve([(0.0, 0.0415), (0.0038, 0.0425), (0.0030, 0.0448), (0.0, 0.0450)], 12).lay().shift(z=0.0288)
    shine = tube([(-0.016, 0.0562), (0.0, 0.0575), (0.014, 0.0563)], 0.0035, 0.0005, 8)
    return Part(body, color), Part(stalk, STALK), Part(shine, mix(color, (1.0, 1.0, 0.9), 0.5))


SCREEN: RGB = (0.20, 0.40, 0.62)
HINGE, LEAN, TOP = -0.078, -0.156, 0.224  # of a laptop's lid: x at its foot and at its head, height


def _lid(near: float, far: float, half: float, low: float, high: float) -> Mesh:
    """A slab in the plane of a laptop's lid, `near` to `far` metres in front of its back, from share `low` to `high`
    of its height."""
    sections = []
    for share in (low, high):
        x, z = HINGE + share * (LEAN - HINGE), 0.010 + share * (TOP - 0.010)
        sections.append([[x + near, -half, z], [x + far, -half, z], [x + far, half, z], [x + near, half, z]])
    return loft(sections)


def laptop(color: RGB) -> tuple[Part, ...]:
    """Open; it looks along its heading."""
    deck = box(0.234, 0.330, 0.018, 0.002).shift(x=0.039)
    bed = box(0.108, 0.290, 0.0006).shift(x=0.000, z=0.0178)
    keys = [
        box(0.0150, 0.0165, 0.0016).shift(x=-0.042 + 0.0205 * row, y=-0.132 + 0.0203 * column, z=0.0180)
        for row in range(5)
        for column in range(14)
        if not (row == 4 and 3 < column < 9)
    ]
    space = box(0.0150, 0.098, 0.0016).shift(x=0.040, y=0.0, z=0.0180)
    pad = box(0.064, 0.100, 0.0005).shift(x=0.107, z=0.0178)
    page = _lid(0.0081, 0.0090, 0.090, 0.36, 0.86)
    lines = [_lid(0.0088, 0.0096, 0.070, low, low + 0.05) for low in (0.44, 0.56, 0.68)]
    return (
        Part(deck, color),
        Part(_lid(0.0, 0.0075, 0.165, 0.0, 1.0), color),
        Part(_lid(0.0070, 0.0080, 0.158, 0.07, 0.965), SOOT),
        Part(_lid(0.0076, 0.0085, 0.150, 0.14, 0.93), SCREEN),
        Part(page, mix(SCREEN, CHINA, 0.85)),
        Part(join(lines), mix(SCREEN, CHINA, 0.45)),
        Part(bed, mix(color, SOOT, 0.45)),
        Part(join([*keys, space]), SOOT),
        Part(pad, mix(color, SOOT, 0.22)),
    )


def keyboard(color: RGB) -> tuple[Part, ...]:
    """The row of function keys is at the front, away from who types."""
    body = loft(
        [
            [[x, -0.215, 0.0], [x, 0.215, 0.0], [x, 0.215, top], [x, -0.215, top]]
            for x, top in ((-0.0675, 0.013), (0.0675, 0.0205))
        ]
    )
    keys: list[Mesh] = []
    marks: list[Mesh] = []
    for row in range(6):
        x = -0.052 + 0.0195 * row + (0.006 if row == 5 else 0.0)
        top = 0.013 + 0.0075 * (x + 0.0675) / 0.135
        for column in range(20):
            if row == 0 and 4 < column < 11:
                continue
            group = marks if (row == 5 and column % 5 == 0) or (row == 2 and column == 14) else keys
            group.append(box(0.0155, 0.0168, 0.0039).shift(x=x, y=-0.1995 + 0.0210 * column, z=top - 0.0006))
    keys.append(box(0.0155, 0.1218, 0.0032).shift(x=-0.052, y=-0.0420, z=0.0133))
    return (Part(body, color), Part(join(keys), mix(color, CHINA, 0.72)), Part(join(marks), (0.85, 0.45, 0.20)))


def mouse(color: RGB) -> tuple[Part, ...]:
    dome = revolve([(0.0, 0.0), (0.95, 0.0), (1.0, 0.18), (0.93, 0.52), (0.74, 0.80), (0.42, 0.96), (0.0, 1.0)], 44)
    body = dome.scale(0.0575, 0.031, 0.0365)
    across = ((-0.0006, -0.004), (0.0006, -0.004), (0.0006, 0.0), (-0.0006, 0.0))
    slit = loft([[[x, y, z + down] for y, down in across] for x, z in _ridge(0.004, 0.050)])
    wheel = disc(0.0075, -0.0032, 0.0032, 24).tip().shift(x=0.030, z=0.0290)
    return (
        Part(body, color),
        Part(slit, mix(color, SOOT, 0.85)),
        Part(wheel, (0.80, 0.82, 0.85)),
        Part(disc(0.0035, 0.0360, 0.0380, 16).shift(x=-0.012), mix(color, CHINA, 0.55)),
    )


def _ridge(start: float, stop: float) -> list[tuple[float, float]]:
    """(x, z) along the back of a mouse."""
    rows = [(0.0, 1.0), (0.42, 0.96), (0.74, 0.80), (0.93, 0.52), (1.0, 0.18)]
    out = []
    for step in range(11):
        x = start + (stop - start) * step / 10
        share = x / 0.0575
        (a, low), (b, high) = next(pair for pair in pairwise(rows) if pair[0][0] <= share <= pair[1][0])
        out.append((x, 0.0365 * (low + (high - low) * (share - a) / (b - a)) + 0.0006))
    return out


def phone(color: RGB) -> tuple[Part, ...]:
    body = box(0.150, 0.073, 0.0082, 0.0015)
    glass = box(0.144, 0.068, 0.0003).shift(z=0.0081)
    view = box(0.132, 0.064, 0.0003).shift(x=-0.001, z=0.0083)
    dots = [
        box(0.012, 0.012, 0.0004).shift(x=x, y=y, z=0.0085)
        for x in (-0.012, 0.010, 0.032)
        for y in (-0.021, -0.007, 0.007, 0.021)
    ]
    bar = box(0.012, 0.056, 0.0004).shift(x=-0.055, z=0.0085)
    eye = disc(0.0024, 0.0081, 0.0090, 14).shift(x=0.0685)
    return (
        Part(body, color),
        Part(glass, mix(color, SOOT, 0.8)),
        Part(view, SCREEN),
        Part(join(dots), mix(SCREEN, CHINA, 0.70)),
        Part(bar, mix(SCREEN, CHINA, 0.40)),
        Part(eye, STEEL),
    )


def remote(color: RGB) -> tuple[Part, ...]:
    body = box(0.190, 0.046, 0.0175, 0.003)
    buttons = [
        box(0.0095, 0.0085, 0.0020).shift(x=-0.062 + 0.0165 * row, y=0.0125 * column, z=0.0172)
        for row in range(5)
        for column in (-1, 0, 1)
    ]
    pad = disc(0.0155, 0.0172, 0.0188, 32).shift(x=0.040)
    power = disc(0.0048, 0.0172, 0.0200, 18).shift(x=0.079, y=0.0)
    return (
        Part(body, color),
        Part(join(buttons), (0.62, 0.64, 0.67)),
        Part(pad, (0.62, 0.64, 0.67)),
        Part(disc(0.0065, 0.0186, 0.0194, 24).shift(x=0.040), SOOT),
        Part(power, (0.85, 0.20, 0.18)),
    )


def stapler(color: RGB) -> tuple[Part, ...]:
    """Its jaws are at the front."""
    foot = box(0.150, 0.038, 0.009, 0.002)
    plate = box(0.034, 0.022, 0.0012).shift(x=0.052, z=0.0088)
    arm = ribbon(
        [
            (-0.075, -0.0130, 0.0130, 0.006, 0.040), (-0.062, -0.0165, 0.0165, 0.009, 0.052),
            (-0.020, -0.0165, 0.0165, 0.020, 0.058), (0.045, -0.0150, 0.0150, 0.026, 0.053),
            (0.072, -0.0125, 0.0125, 0.026, 0.043), (0.0745, -0.0080, 0.0080, 0.028, 0.038),
        ]
    )  # fmt: skip
    rail = ribbon([(-0.060, -0.0095, 0.0095, 0.011, 0.020), (0.0735, -0.0095, 0.0095, 0.020, 0.029)])
    return Part(foot, mix(color, SOOT, 0.55)), Part(plate, STEEL), Part(rail, STEEL), Part(arm, color)


def pen(color: RGB) -> tuple[Part, ...]:
    barrel = revolve([(0.0, -0.058), (0.0060, -0.057), (0.0062, 0.040), (0.0058, 0.050), (0.0, 0.050)], 22)
    cone = revolve([(0.0, 0.0495), (0.0057, 0.0495), (0.0016, 0.0680), (0.0008, 0.0722), (0.0, 0.0725)], 22)
    knob = revolve([(0.0, -0.0725), (0.0028, -0.0720), (0.0030, -0.0570), (0.0, -0.0570)], 16)
    clip = join(
        [box(0.042, 0.0030, 0.0010).shift(x=-0.034, z=0.0130), box(0.004, 0.0030, 0.003).shift(x=-0.053, z=0.0108)]
    )
    return (
        Part(barrel.lay().shift(z=0.0062), color),
        Part(cone.lay().shift(z=0.0062), STEEL),
        Part(knob.lay().shift(z=0.0062), STEEL),
        Part(clip, STEEL),
    )


def marker(color: RGB) -> tuple[Part, ...]:
    barrel = revolve([(0.0, -0.0675), (0.0080, -0.0675), (0.0092, -0.0655), (0.0092, 0.024), (0.0, 0.024)], 28)
    band = revolve([(0.0, -0.040), (0.0094, -0.040), (0.0094, 0.000), (0.0, 0.000)], 28)
    cap = revolve([(0.0, 0.023), (0.0098, 0.023), (0.0098, 0.058), (0.0080, 0.0660), (0.0, 0.0675)], 28)
    clip = box(0.034, 0.0040, 0.0012).shift(x=0.042, z=0.0188)
    return (
        Part(barrel.lay().shift(z=0.0098), mix(color, CHINA, 0.86)),
        Part(band.lay().shift(z=0.0098), color),
        Part(cap.lay().shift(z=0.0098), color),
        Part(clip, mix(color, SOOT, 0.35)),
    )


def scissors(color: RGB) -> tuple[Part, ...]:
    """Slightly open, points to the front."""
    outline = [
        (0.000, -0.0075), (0.020, -0.0080), (0.070, -0.0055), (0.0895, -0.0008), (0.0880, 0.0008),
        (0.010, 0.0065), (0.000, 0.0060),
    ]  # fmt: skip
    blade = prism(outline, 0.0, 0.0022)
    mirrored = prism([(x, -y) for x, y in reversed(outline)], 0.0, 0.0022)
    shank = prism([(-0.030, -0.0050), (0.008, -0.0055), (0.008, 0.0055), (-0.030, 0.0050)], 0.0, 0.0040)
    eye = revolve([(0.66, 0.0), (1.0, 0.0), (1.0, 0.0105), (0.66, 0.0105)], 36).scale(0.0320, 0.0200, 1.0)
    open_ = 0.10
    blades = join([blade.turn(open_).shift(z=0.0048), mirrored.turn(-open_).shift(z=0.0072)])
    shanks = [shank.turn(s * 0.52).shift(x=-0.004, y=-s * 0.006, z=0.0035) for s in (1.0, -1.0)]
    eyes = [eye.turn(s * 0.10).shift(x=-0.0575, y=-s * 0.0215) for s in (1.0, -1.0)]
    pivot = disc(0.0042, 0.0045, 0.0125, 20).shift(x=0.004)
    return Part(blades, STEEL), Part(join([*shanks, *eyes]), color), Part(pivot, SOOT)
