"""Cutlery, boxes, books and blocks."""

from __future__ import annotations

from scenegen.assets.mesh import box, disc, prism, revolve, ribbon
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import CREAM, DARK, STEEL, WHITE, Part, pip


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
    rivets = [disc(0.0026, 0.0, 0.0100, 12).moved(x=x) for x in (-0.085, -0.035)]
    return Part(grip, DARK), Part(blade, color), *(Part(rivet, STEEL) for rivet in rivets)


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
        (0.0, 0.0029),
        (0.40, 0.0035),
        (0.70, 0.0066),
        (0.84, 0.0102),
        (0.70, 0.0050),
        (0.40, 0.0024),
        (0.0, 0.0020),
    ]
    bowl = revolve(dish).scaled(0.028, 0.019, 1.0).moved(x=0.062)
    shadow = revolve(hollow).scaled(0.028, 0.019, 1.0).moved(x=0.062)
    return Part(shaft, color), Part(bowl, color), Part(shadow, mix(color, DARK, 0.22))


def napkin(color: RGB) -> tuple[Part, ...]:
    sheet = box(0.150, 0.150, 0.0016)
    fold = prism([(-0.073, -0.073), (0.020, -0.073), (0.020, 0.073), (-0.073, 0.073)], 0.0, 0.0040)
    stripe = prism([(0.046, -0.0745), (0.056, -0.0745), (0.056, 0.0745), (0.046, 0.0745)], 0.0, 0.0028)
    thin = prism([(0.061, -0.0745), (0.064, -0.0745), (0.064, 0.0745), (0.061, 0.0745)], 0.0, 0.0028)
    pale = mix(color, WHITE, 0.75)
    return Part(sheet, mix(color, WHITE, 0.18)), Part(fold, color), Part(stripe, pale), Part(thin, pale)


def crackerbox(color: RGB) -> tuple[Part, ...]:
    body = box(0.158, 0.058, 0.2085)
    belt = box(0.1592, 0.0592, 0.070).moved(z=0.075)
    biscuits = [box(0.040, 0.0600, 0.040).moved(x=x, z=z) for x, z in ((-0.046, 0.090), (0.046, 0.090), (0.0, 0.090))]
    sun = revolve([(0.0, -0.0300), (0.021, -0.0300), (0.021, 0.0300), (0.0, 0.0300)], 32)
    emblem = sun.tipped().moved(z=0.176)
    cap = box(0.1585, 0.0300, 0.0012).moved(z=0.2080)
    seal = disc(0.0190, 0.2080, 0.2100, 32).moved(x=0.046)
    gold: RGB = (0.91, 0.69, 0.32)
    return (
        Part(body, color),
        Part(belt, CREAM),
        *(Part(biscuit, gold) for biscuit in biscuits),
        Part(emblem, (0.98, 0.80, 0.22)),
        Part(cap, mix(color, DARK, 0.18)),
        Part(seal, (0.98, 0.80, 0.22)),
    )


def book(color: RGB) -> tuple[Part, ...]:
    pages = box(0.204, 0.144, 0.019).moved(y=0.001, z=0.003)
    covers = [box(0.210, 0.150, 0.0030).moved(z=z) for z in (0.0, 0.0208)]
    spine = box(0.210, 0.004, 0.0238).moved(y=0.073)
    title = box(0.034, 0.096, 0.0012).moved(x=0.052, y=-0.004, z=0.0234)
    line = box(0.008, 0.060, 0.0012).moved(x=0.018, y=-0.004, z=0.0234)
    joint = box(0.210, 0.0035, 0.0012).moved(y=0.062, z=0.0231)
    gilt = mix(color, (0.95, 0.85, 0.60), 0.85)
    return (
        Part(pages, CREAM),
        *(Part(cover, color) for cover in covers),
        Part(spine, color),
        Part(title, gilt),
        Part(line, gilt),
        Part(joint, mix(color, DARK, 0.45)),
    )


def block(color: RGB) -> tuple[Part, ...]:
    light = sum(color) / 3 > 0.55
    mark = mix(color, DARK, 0.55) if light else mix(color, WHITE, 0.65)
    return Part(box(0.050, 0.050, 0.0490, 0.0025), color), Part(pip(0.026, 0.026, 0.0480, 0.0500), mark)
