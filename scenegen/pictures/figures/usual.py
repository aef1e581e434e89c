"""Where things usually are in a view from above, as SVG: circles of normal distributions, regions, recorded places."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from scenegen.geometry.footprint import Point, clip
from scenegen.looks.usual import CIRCLE_CORNERS, NormalCircles, UsualPlace

FAINT, DARKER = 0.05, 0.16  # how opaque a part is of which hardly a thing is; and how much more, if all are in it
DOT = 1.4  # pixels

ToPixel = Callable[[Point], Point]


def draw_usual(places: Sequence[UsualPlace], color: Callable[[int], str], pixel: ToPixel) -> Iterator[str]:
    """What lies under everything else. `color` is that of an object; things that share a place have that of the first
    one."""
    for place in places:
        ink = color(place.things[0])
        for disc in place.discs:
            for radius in (disc.outer, disc.inner):
                yield _part(clip(_circle(disc, radius), place.within), disc.share, ink, pixel)
        for area in place.areas:
            yield _part(area.corners, area.share, ink, pixel)
        for x, y in map(pixel, place.dots):
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{DOT}" fill="{ink}" fill-opacity="0.5"/>'


def _circle(disc: NormalCircles, radius: float) -> list[Point]:
    x, y = disc.middle
    turns = [math.tau * step / CIRCLE_CORNERS for step in range(CIRCLE_CORNERS)]
    return [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]


def _part(corners: Sequence[Point], share: float, ink: str, pixel: ToPixel) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(pixel, corners))
    style = f'fill-opacity="{FAINT + DARKER * share:.3f}" stroke="{ink}" stroke-opacity="0.45" stroke-width="0.8"'
    return f'<polygon points="{points}" fill="{ink}" {style}/>'
