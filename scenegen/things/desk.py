"""What lies on desks: laptops, phones, pens, scissors and the like."""

from __future__ import annotations

from itertools import pairwise

from scenegen.things.mesh import Mesh, box, disc, joined, loft, prism, revolve, ribbon
from scenegen.things.palette import RGB, mix
from scenegen.things.parts import DARK, STEEL, WHITE, Part

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
    deck = box(0.234, 0.330, 0.018, 0.002).moved(x=0.039)
    bed = box(0.108, 0.290, 0.0006).moved(x=0.000, z=0.0178)
    keys = [
        box(0.0150, 0.0165, 0.0016).moved(x=-0.042 + 0.0205 * row, y=-0.132 + 0.0203 * column, z=0.0180)
        for row in range(5)
        for column in range(14)
        if not (row == 4 and 3 < column < 9)
    ]
    space = box(0.0150, 0.098, 0.0016).moved(x=0.040, y=0.0, z=0.0180)
    pad = box(0.064, 0.100, 0.0005).moved(x=0.107, z=0.0178)
    page = _lid(0.0081, 0.0090, 0.090, 0.36, 0.86)
    lines = [_lid(0.0088, 0.0096, 0.070, low, low + 0.05) for low in (0.44, 0.56, 0.68)]
    return (
        Part(deck, color),
        Part(_lid(0.0, 0.0075, 0.165, 0.0, 1.0), color),
        Part(_lid(0.0070, 0.0080, 0.158, 0.07, 0.965), DARK),
        Part(_lid(0.0076, 0.0085, 0.150, 0.14, 0.93), SCREEN),
        Part(page, mix(SCREEN, WHITE, 0.85)),
        Part(joined(lines), mix(SCREEN, WHITE, 0.45)),
        Part(bed, mix(color, DARK, 0.45)),
        Part(joined([*keys, space]), DARK),
        Part(pad, mix(color, DARK, 0.22)),
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
            group.append(box(0.0155, 0.0168, 0.0039).moved(x=x, y=-0.1995 + 0.0210 * column, z=top - 0.0006))
    keys.append(box(0.0155, 0.1218, 0.0032).moved(x=-0.052, y=-0.0420, z=0.0133))
    return (
        Part(body, color),
        Part(joined(keys), mix(color, WHITE, 0.72)),
        Part(joined(marks), (0.85, 0.45, 0.20)),
    )


def mouse(color: RGB) -> tuple[Part, ...]:
    dome = revolve([(0.0, 0.0), (0.95, 0.0), (1.0, 0.18), (0.93, 0.52), (0.74, 0.80), (0.42, 0.96), (0.0, 1.0)], 44)
    body = dome.scaled(0.0575, 0.031, 0.0365)
    across = ((-0.0006, -0.004), (0.0006, -0.004), (0.0006, 0.0), (-0.0006, 0.0))
    slit = loft([[[x, y, z + down] for y, down in across] for x, z in _ridge(0.004, 0.050)])
    wheel = disc(0.0075, -0.0032, 0.0032, 24).tipped().moved(x=0.030, z=0.0290)
    return (
        Part(body, color),
        Part(slit, mix(color, DARK, 0.85)),
        Part(wheel, (0.80, 0.82, 0.85)),
        Part(disc(0.0035, 0.0360, 0.0380, 16).moved(x=-0.012), mix(color, WHITE, 0.55)),
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
    glass = box(0.144, 0.068, 0.0003).moved(z=0.0081)
    view = box(0.132, 0.064, 0.0003).moved(x=-0.001, z=0.0083)
    dots = [
        box(0.012, 0.012, 0.0004).moved(x=x, y=y, z=0.0085)
        for x in (-0.012, 0.010, 0.032)
        for y in (-0.021, -0.007, 0.007, 0.021)
    ]
    bar = box(0.012, 0.056, 0.0004).moved(x=-0.055, z=0.0085)
    eye = disc(0.0024, 0.0081, 0.0090, 14).moved(x=0.0685)
    return (
        Part(body, color),
        Part(glass, mix(color, DARK, 0.8)),
        Part(view, SCREEN),
        Part(joined(dots), mix(SCREEN, WHITE, 0.70)),
        Part(bar, mix(SCREEN, WHITE, 0.40)),
        Part(eye, STEEL),
    )


def remote(color: RGB) -> tuple[Part, ...]:
    body = box(0.190, 0.046, 0.0175, 0.003)
    buttons = [
        box(0.0095, 0.0085, 0.0020).moved(x=-0.062 + 0.0165 * row, y=0.0125 * column, z=0.0172)
        for row in range(5)
        for column in (-1, 0, 1)
    ]
    pad = disc(0.0155, 0.0172, 0.0188, 32).moved(x=0.040)
    power = disc(0.0048, 0.0172, 0.0200, 18).moved(x=0.079, y=0.0)
    return (
        Part(body, color),
        Part(joined(buttons), (0.62, 0.64, 0.67)),
        Part(pad, (0.62, 0.64, 0.67)),
        Part(disc(0.0065, 0.0186, 0.0194, 24).moved(x=0.040), DARK),
        Part(power, (0.85, 0.20, 0.18)),
    )


def stapler(color: RGB) -> tuple[Part, ...]:
    """Its jaws are at the front."""
    foot = box(0.150, 0.038, 0.009, 0.002)
    plate = box(0.034, 0.022, 0.0012).moved(x=0.052, z=0.0088)
    arm = ribbon(
        [
            (-0.075, -0.0130, 0.0130, 0.006, 0.040), (-0.062, -0.0165, 0.0165, 0.009, 0.052),
            (-0.020, -0.0165, 0.0165, 0.020, 0.058), (0.045, -0.0150, 0.0150, 0.026, 0.053),
            (0.072, -0.0125, 0.0125, 0.026, 0.043), (0.0745, -0.0080, 0.0080, 0.028, 0.038),
        ]
    )  # fmt: skip
    rail = ribbon([(-0.060, -0.0095, 0.0095, 0.011, 0.020), (0.0735, -0.0095, 0.0095, 0.020, 0.029)])
    return Part(foot, mix(color, DARK, 0.55)), Part(plate, STEEL), Part(rail, STEEL), Part(arm, color)


def pen(color: RGB) -> tuple[Part, ...]:
    barrel = revolve([(0.0, -0.058), (0.0060, -0.057), (0.0062, 0.040), (0.0058, 0.050), (0.0, 0.050)], 22)
    cone = revolve([(0.0, 0.0495), (0.0057, 0.0495), (0.0016, 0.0680), (0.0008, 0.0722), (0.0, 0.0725)], 22)
    knob = revolve([(0.0, -0.0725), (0.0028, -0.0720), (0.0030, -0.0570), (0.0, -0.0570)], 16)
    clip = joined(
        [box(0.042, 0.0030, 0.0010).moved(x=-0.034, z=0.0130), box(0.004, 0.0030, 0.003).moved(x=-0.053, z=0.0108)]
    )
    return (
        Part(barrel.laid().moved(z=0.0062), color),
        Part(cone.laid().moved(z=0.0062), STEEL),
        Part(knob.laid().moved(z=0.0062), STEEL),
        Part(clip, STEEL),
    )


def marker(color: RGB) -> tuple[Part, ...]:
    barrel = revolve([(0.0, -0.0675), (0.0080, -0.0675), (0.0092, -0.0655), (0.0092, 0.024), (0.0, 0.024)], 28)
    band = revolve([(0.0, -0.040), (0.0094, -0.040), (0.0094, 0.000), (0.0, 0.000)], 28)
    cap = revolve([(0.0, 0.023), (0.0098, 0.023), (0.0098, 0.058), (0.0080, 0.0660), (0.0, 0.0675)], 28)
    clip = box(0.034, 0.0040, 0.0012).moved(x=0.042, z=0.0188)
    return (
        Part(barrel.laid().moved(z=0.0098), mix(color, WHITE, 0.86)),
        Part(band.laid().moved(z=0.0098), color),
        Part(cap.laid().moved(z=0.0098), color),
        Part(clip, mix(color, DARK, 0.35)),
    )


def scissors(color: RGB) -> tuple[Part, ...]:
    """Slightly open, points to the front."""
    outline = [
        (0.000, -0.0075),
        (0.020, -0.0080),
        (0.070, -0.0055),
        (0.0895, -0.0008),
        (0.0880, 0.0008),
        (0.010, 0.0065),
        (0.000, 0.0060),
    ]
    blade = prism(outline, 0.0, 0.0022)
    mirrored = prism([(x, -y) for x, y in reversed(outline)], 0.0, 0.0022)
    shank = prism([(-0.030, -0.0050), (0.008, -0.0055), (0.008, 0.0055), (-0.030, 0.0050)], 0.0, 0.0040)
    eye = revolve([(0.66, 0.0), (1.0, 0.0), (1.0, 0.0105), (0.66, 0.0105)], 36).scaled(0.0320, 0.0200, 1.0)
    open_ = 0.10
    blades = joined([blade.turned(open_).moved(z=0.0048), mirrored.turned(-open_).moved(z=0.0072)])
    shanks = [shank.turned(s * 0.52).moved(x=-0.004, y=-s * 0.006, z=0.0035) for s in (1.0, -1.0)]
    eyes = [eye.turned(s * 0.10).moved(x=-0.0575, y=-s * 0.0215) for s in (1.0, -1.0)]
    pivot = disc(0.0042, 0.0045, 0.0125, 20).moved(x=0.004)
    return Part(blades, STEEL), Part(joined([*shanks, *eyes]), color), Part(pivot, DARK)
