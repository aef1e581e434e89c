"""Colours: the library's, one for a name that it does not know, and shades that tell equal objects apart."""

from __future__ import annotations

import colorsys
import hashlib
import re
from collections import Counter
from collections.abc import Sequence

from scenegen.things.library import ASSETS, PLAIN, RGB, UNKNOWN, known_as


def parse_rgb(color: str) -> RGB:
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


def name_color(name: str, taken: Sequence[RGB] = ()) -> RGB:
    """The colour of a name: the same on every machine; the next free one of the palette where it is already taken."""
    start = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")
    colors = [PALETTE[(start + step) % len(PALETTE)] for step in range(len(PALETTE))]
    free = [color for color in colors if color not in taken]
    if free:
        return free[0]
    turns = 1 + len(taken) // len(PALETTE)
    return shade(colors[len(taken) % len(PALETTE)], turns, turns + 1 + len(taken))


def region_colors(names: Sequence[str]) -> list[RGB]:
    """A pale colour for each region of a table, no two alike, none that of the wood."""
    used: list[RGB] = [CHOCOLATE]
    for name in names:
        used.append(name_color(name, used))
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


def _family(name: str, asset: str) -> str | None:
    """What an object gets a shade of its colour with: the array of a plain shape, the library's objects of one name.
    None where its colour is its own."""
    if asset in PLAIN:
        return f"{_array(name)}[]"
    return asset if known_as(name) == asset else None


def _array(name: str) -> str:
    return re.sub(r"\[\d+\]$", "", name)


def _family_color(name: str, asset: str, used: Sequence[RGB]) -> RGB:
    known = known_as(_array(name)) if asset in PLAIN else asset
    if known is None or (asset in PLAIN and ASSETS[known].color in used):
        return name_color(_array(name), used)
    return ASSETS[known].color


def object_colors(objects: Sequence[tuple[str, str]], *, distinct: bool = False) -> tuple[RGB, ...]:
    """The main colour of every object of a scene, given as (name, asset), in the order given.

    What the library knows has the library's colour, and the elements of an array look the same. Blocks and plain shapes
    that have names of their own get colours that can be told apart: the library's where it knows the name, else one
    that belongs to the name. `distinct` tells apart all objects that would look the same.
    """
    if distinct:
        return _all_different(objects)
    alike = [(asset if _has_own_color(asset) else _array(name), asset) for name, asset in objects]
    kinds = list(dict.fromkeys(alike))
    color = dict(zip(kinds, _all_different(kinds), strict=True))
    return tuple(color[kind] for kind in alike)


def _has_own_color(asset: str) -> bool:
    """Whether a colour belongs to what the asset is: apples are red, whereas blocks and bins come in all colours."""
    return asset not in (*PLAIN, UNKNOWN, "bin")


def _all_different(objects: Sequence[tuple[str, str]]) -> tuple[RGB, ...]:
    """Colours of which no two objects of an asset share one: the asset's own or one that belongs to the name, and
    shades of it for further objects of that asset, or of that array of plain shapes."""
    families = [_family(name, asset) for name, asset in objects]
    counts = Counter(families)
    seen: Counter[str] = Counter()
    first: dict[str, RGB] = {}
    taken: dict[str, list[RGB]] = {}
    colors: list[RGB] = []
    for (name, asset), family in zip(objects, families, strict=True):
        used = taken.setdefault("" if asset in PLAIN else asset, [])
        if family is None:
            color = name_color(name, used)
        else:
            if family not in first:
                first[family] = _family_color(name, asset, used)
            color = shade(first[family], seen[family], counts[family])
            seen[family] += 1
        used.append(color)
        colors.append(color)
    return tuple(colors)
