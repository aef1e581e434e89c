"""Round things: plates, bowls, mugs, glasses, bottles, cans, jars, apples."""

from __future__ import annotations

from scenegen.assets.mesh import box, disc, joined, loft, revolve, tube
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import COFFEE, CREAM, DARK, STEEL, WHITE, Part, crescent, handle, lining, patch


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
    inner = mix(color, WHITE, 0.72)
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
        Part(lining(inside), mix(color, WHITE, 0.80)),
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
        Part(lining(inside), mix(color, WHITE, 0.80)),
        Part(tea, (0.66, 0.38, 0.14)),
    )


def glass(color: RGB) -> tuple[Part, ...]:
    water = revolve([(0.0, 0.0), (0.0275, 0.0), (0.029, 0.003), (0.0338, 0.100), (0.0, 0.100)])
    rim = revolve([(0.0338, 0.099), (0.0350, 0.124), (0.0344, 0.125), (0.0330, 0.124), (0.0320, 0.099)])
    rind, lemon = (disc(radius, 0.098, top, 24).moved(x=0.014) for radius, top in ((0.0155, 0.1025), (0.0128, 0.1030)))
    return (
        Part(water, mix(color, (0.25, 0.52, 0.72), 0.60)),
        Part(rim, mix(color, WHITE, 0.35)),
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
        Part(patch(0.0360, 0.0045, 0.058, 0.082, 1.4), mix(color, DARK, 0.15)),
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
    tab = box(0.024, 0.011, 0.0014, 0.0004).moved(x=0.004, z=0.1125)
    mouth = disc(0.0085, 0.1115, 0.1128, 16).scaled(0.85, 1.0, 1.0).moved(x=0.016)
    return (
        Part(body, color),
        Part(ends, STEEL),
        Part(patch(0.0330, 0.003, 0.045, 0.075, 2.4), WHITE),
        Part(mouth, DARK),
        Part(tab, mix(STEEL, DARK, 0.35)),
    )


def jar(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [(0.0, 0.0), (0.036, 0.0), (0.0395, 0.004), (0.0395, 0.086), (0.036, 0.094), (0.033, 0.098), (0.0, 0.098)]
    )
    lid = revolve([(0.0, 0.096), (0.0365, 0.096), (0.0365, 0.117), (0.035, 0.1188), (0.0, 0.1188)])
    ink = mix(color, DARK, 0.15)
    seal = joined(
        [box(0.050, 0.014, 0.0012).moved(x=0.0125, z=0.1185), box(0.0015, 0.014, 0.030).moved(x=0.037, z=0.0897)]
    )
    return (
        Part(body, color),
        Part(lid, CREAM),
        Part(patch(0.0397, 0.003, 0.025, 0.072, 2.6), CREAM),
        Part(patch(0.0400, 0.0025, 0.040, 0.058, 1.2), mix(color, DARK, 0.30)),
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
