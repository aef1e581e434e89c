"""Robots and cameras in a view from above, as SVG: what an arm reaches, what a camera pictures, an open hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

from scenegen.geometry.footprint import Point, Rectangle
from scenegen.lang.spec import Pose, SpecCamera
from scenegen.looks.overlay import Ring, frame_of

REACH, SEES, SEES_FILL, HAND = "#2f6f9f", "#9a5b13", "#e0a13c", "#3a3f47"
EYE = 11.0  # pixels: how long the sign of a camera is
ARC_POINTS = 96  # of a ring, all round

ToPixel = Callable[[Point], Point]


@dataclass(frozen=True, slots=True)
class FigureSights:
    """Rings where their robots stand, cameras, and hands, each the corners of two fingers and a palm."""

    rings: Sequence[tuple[Pose, Ring]] = ()
    cameras: Sequence[SpecCamera] = ()
    hands: Sequence[tuple[Sequence[Point], ...]] = ()


def draw_below(sights: FigureSights, view: Rectangle, pixel: ToPixel) -> Iterator[str]:
    """What lies under the objects."""
    for pose, ring in sights.rings:
        outer, inner = (list(map(pixel, _arc(pose, radius, ring))) for radius in (ring.farthest, ring.nearest))
        ways = [_way(outer), _way(inner)] if ring.bearing is None else [_way(outer + inner[::-1])]
        style = f'fill="{REACH}" fill-opacity="0.07" fill-rule="evenodd" stroke="{REACH}" stroke-dasharray="5 3"'
        yield f'<path d="{"".join(ways)}" {style}/>'
    for frame in (frame_of(one, view) for one in sights.cameras):
        if frame.corners:
            style = f'fill="{SEES_FILL}" fill-opacity="0.06" stroke="{SEES}"'
            yield f'<path d="{_way(list(map(pixel, frame.corners)))}" {style}/>'


def draw_above(sights: FigureSights, view: Rectangle, pixel: ToPixel) -> Iterator[str]:
    """What lies over the objects."""
    for hand in sights.hands:
        for number, corners in enumerate(hand):
            style = 'fill-opacity="0.35"' if number < 2 else 'fill-opacity="0" stroke-dasharray="3 2"'
            yield f'<path d="{_way(list(map(pixel, corners)))}" fill="{HAND}" stroke="{HAND}" {style}/>'
    for frame in (frame_of(one, view) for one in sights.cameras):
        (x, y), theta = pixel(frame.eye[:2]), frame.eye[2]
        cone = [(x + EYE * math.cos(theta + turn), y - EYE * math.sin(theta + turn)) for turn in (-0.5, 0.5)]
        yield f'<path d="{_way([(x, y), *cone])}" fill="{SEES_FILL}" stroke="{SEES}"/>'
        name_x, name_y = x + 2.0 * EYE * math.cos(theta), y - 2.0 * EYE * math.sin(theta) + 3.5
        halo = 'stroke="#ffffff" stroke-opacity="0.85" stroke-width="3" paint-order="stroke"'
        words = f'text-anchor="middle" font-size="10" fill="{SEES}" {halo}'
        yield f'<text x="{name_x:.1f}" y="{name_y:.1f}" {words}>{escape(frame.name)}</text>'
        inside = "#ffffff" if frame.outside else SEES
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{inside}" stroke="{SEES}"/>'


def _arc(pose: Pose, radius: float, ring: Ring) -> list[Point]:
    first, last = ring.bearing or (0.0, math.tau)
    count = math.ceil(ARC_POINTS * (last - first) / math.tau)
    turns = [pose[2] + first + (last - first) * step / count for step in range(count + 1)]
    return [(pose[0] + radius * math.cos(turn), pose[1] + radius * math.sin(turn)) for turn in turns]


def _way(points: Sequence[Point]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + "Z"
