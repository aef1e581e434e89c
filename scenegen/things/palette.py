"""Colours: one for a name that the library does not know, and shades that tell equal objects apart."""

from __future__ import annotations

import colorsys
import hashlib
import re
from collections.abc import Sequence

RGB = tuple[float, float, float]

NAMED = ("red", "orange", "yellow", "green", "blue", "purple", "pink", "brown", "white", "grey", "black")  # some names


def hex_of(written: str) -> str | None:
    """A colour as people write it, `red` or `#ffdd33`, as "#rrggbb"; None where it is none."""
    from PIL import ImageColor

    if not re.fullmatch(r"#[0-9a-fA-F]{3}([0-9a-fA-F]{3})?|[A-Za-z]+", written):
        return None
    try:
        red, green, blue = ImageColor.getrgb(written.lower())[:3]
    except ValueError:
        return None
    return f"#{red:02x}{green:02x}{blue:02x}"


def rgb_of(color: str) -> RGB:
    """The channels, 0 to 1, of "#rrggbb"."""
    red, green, blue = (int(color[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
    return red, green, blue


CHOCOLATE: RGB = (0.47, 0.30, 0.20)
LINEN: RGB = (0.97, 0.95, 0.90)

# Far apart in hue or lightness, none close to the table's wood.
PALETTE: tuple[RGB, ...] = (
    (0.13, 0.45, 0.71),  # blue
    (0.84, 0.33, 0.13),  # vermilion
    (0.18, 0.58, 0.36),  # green
    (0.56, 0.31, 0.65),  # purple
    (0.93, 0.69, 0.13),  # yellow
    (0.09, 0.62, 0.67),  # teal
    (0.78, 0.16, 0.34),  # crimson
    (0.45, 0.62, 0.16),  # moss
    (0.90, 0.48, 0.65),  # pink
    (0.22, 0.26, 0.42),  # navy
    CHOCOLATE,
    (0.45, 0.72, 0.92),  # sky
)


def stable(name: str, taken: Sequence[RGB] = ()) -> RGB:
    """The colour of a name: the same on every machine; the next free one of the palette where it is already taken."""
    start = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")
    colors = [PALETTE[(start + step) % len(PALETTE)] for step in range(len(PALETTE))]
    free = [color for color in colors if color not in taken]
    if free:
        return free[0]
    turns = 1 + len(taken) // len(PALETTE)
    return shade(colors[len(taken) % len(PALETTE)], turns, turns + 1 + len(taken))


def of_regions(names: Sequence[str]) -> list[RGB]:
    """A pale colour for each region of a table, no two alike, none that of the wood."""
    used: list[RGB] = [CHOCOLATE]
    for name in names:
        used.append(stable(name, used))
    return [mix(color, LINEN, 0.35) for color in used[1:]]


def shade(color: RGB, index: int, count: int) -> RGB:
    """Shade `index` of `count` that can be told apart: the colour itself, then its hue turned by equal steps."""
    if index == 0:
        return color
    hue, lightness, saturation = colorsys.rgb_to_hls(*color)
    # A grey has no hue to turn: it starts from a cool one. The last step stays clear of the first colour.
    start = hue if saturation > 0.12 else 0.58
    red, green, blue = colorsys.hls_to_rgb(
        (start + index / max(count, 4) * 0.92) % 1.0,
        min(max(lightness + (0.06 if index % 2 else -0.06), 0.28), 0.72),
        min(max(saturation, 0.45), 0.65),
    )
    return red, green, blue


def mix(color: RGB, other: RGB, share: float) -> RGB:
    """`share` of the other colour in the first."""
    red, green, blue = ((1.0 - share) * a + share * b for a, b in zip(color, other, strict=True))
    return red, green, blue
