"""A scene seen from above, as SVG: footprints with names and headings, regions, and dimension lines.

Plain data in, text out; the same data gives the same bytes. Lengths of the data are metres, angles radians; x runs to
the right and y upwards, away from the viewer. The grid has decimetres if there are not too many in the workspace.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

from scenegen.geometry import Box, Circle, Footprint, Polygon
from scenegen.geometry.footprint import clip
from scenegen.looks.usual import CIRCLE_CORNERS, UsualPlace
from scenegen.pictures.figures.dimensions import Dimension, FigureObject, FigureScene, Guide, Mark, Point, Turn, outline
from scenegen.pictures.figures.sights import draw_above, draw_below

EM = 0.62  # width of a character in a sans-serif font such as DejaVu Sans, relative to the font size
# opacity of a part with share 0, and what is added at share 1; radius of a recorded place, in pixels
FAINT, DARKER, DOT = 0.05, 0.16, 1.4
LINE_POINT_GAP = 3.0  # pixels between the points that represent a line


@dataclass(frozen=True, slots=True)
class Rect:
    """Pixels; y runs downwards."""

    left: float
    top: float
    right: float
    bottom: float

    def shared_area(self, other: Rect) -> float:
        """The area that both cover."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.bottom, other.bottom) - max(self.top, other.top)
        return max(width, 0.0) * max(height, 0.0)

    @property
    def area(self) -> float:
        return (self.right - self.left) * (self.bottom - self.top)


def text_width(text: str, size: float) -> float:
    """About how many pixels wide a text is."""
    return EM * size * len(text)


@dataclass(slots=True)
class Labels:
    """The existing drawing as rectangles with a cost per square pixel, within a frame that no label may leave."""

    frame: Rect
    taken: list[tuple[Rect, float]] = field(default_factory=list)

    def avoid(self, rect: Rect, cost: float) -> None:
        self.taken.append((rect, cost))

    def line(self, a: tuple[float, float], b: tuple[float, float], cost: float = 4.0) -> None:
        """Keep labels away from the visible part of a line."""
        steps = max(1, round(max(abs(b[0] - a[0]), abs(b[1] - a[1])) / LINE_POINT_GAP))
        for step in range(steps + 1):
            x, y = a[0] + step / steps * (b[0] - a[0]), a[1] + step / steps * (b[1] - a[1])
            point = Rect(x - 1.5, y - 1.5, x + 1.5, y + 1.5)
            if point.shared_area(self.frame):
                self.avoid(point, cost)

    def place(self, candidates: Sequence[tuple[float, float]], width: float, size: float) -> tuple[float, float]:
        """The best centre for a text of that width and size, moved into the frame; its place is then taken."""
        best, least = (0.0, 0.0), float("inf")
        for order, (x, y) in enumerate(candidates):
            x = max(self.frame.left + width / 2, min(x, self.frame.right - width / 2))
            y = max(self.frame.top + size / 2, min(y, self.frame.bottom - size / 2))
            box = _box(x, y, width, size)
            cost = 1.5 * order + sum(weight * box.shared_area(rect) for rect, weight in self.taken)
            if cost < least:
                best, least = (x, y), cost
        self.avoid(_box(*best, width, size), 10.0)
        return best


def _box(x: float, y: float, width: float, size: float) -> Rect:
    return Rect(x - width / 2, y - size / 2, x + width / 2, y + size / 2)


INK, QUIET, GRID, FRAME, PAPER = "#26282c", "#7a7f87", "#ececea", "#b4b4b0", "#ffffff"
GOOD, BAD = "#0b7a5c", "#c2332b"
TINTS = ("#cfe0f3", "#f8dcc9", "#d3ead6", "#e5d8ee", "#f7eab8", "#cbe8ea")  # footprints, in the order of the objects
EDGES = ("#5b86b5", "#c98256", "#669c70", "#957bab", "#b59a3c", "#5ba0a6")
ZONE, ZONE_EDGE = "#f3f1e9", "#b9b199"
FONT = "DejaVu Sans, Verdana, Helvetica, Arial, sans-serif"
TYPE, SMALL = 11, 10  # pixels
MARGIN, LINE = 12, 15
MAX_PIXEL = 20_000.0  # pixels: maximum distance of anything drawn from the upper left corner
MAX_GRID_LINES = 30  # maximum number of grid lines in one direction


def topview(*views: FigureScene, width: int = 240) -> str:
    """An SVG document of one view, or of several side by side, each `width` pixels wide.

    Readable from 240 pixels up. Parts further outside of the workspace than a quarter of its size are cut off.
    """
    drawn = [_Panel(view, width) for view in views]
    floor = max(panel.bottom for panel in drawn)
    for panel in drawn:
        panel.floor = floor  # captions side by side are aligned
    height = math.ceil(floor + MARGIN + LINE * max(len(view.caption) for view in views))
    body = [part for place, panel in enumerate(drawn) for part in panel.svg(place * width)]
    total = width * len(views)
    opening = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="{_n(height)}" '
        f'viewBox="0 0 {total} {_n(height)}" font-family="{FONT}" font-size="{TYPE}">'
    )
    return "\n".join([opening, f'<rect width="{total}" height="{_n(height)}" fill="{PAPER}"/>', *body, "</svg>", ""])


def _n(value: float) -> str:
    """A number of pixels, to a tenth."""
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


class _Panel:
    """A view that is being converted to SVG."""

    def __init__(self, view: FigureScene, width: int) -> None:
        self.view, self.width = view, width
        self.left, self.right = _drawn_interval(view.x, [end for thing in view.things for end in _extent(thing, 0)])
        self.low, self.top = _drawn_interval(view.y, [end for thing in view.things for end in _extent(thing, 1)])
        self.scale = (width - 2 * MARGIN) / (self.right - self.left)
        self.bottom = MARGIN + (self.top - self.low) * self.scale
        self.floor = self.bottom
        self.labels = Labels(Rect(2.0, 2.0, width - 2.0, self.bottom + MARGIN - 2.0))

    def pixel(self, point: Point) -> Point:
        """Pixels of a place; very distant places are moved to a limit that drawing programs can handle."""
        x, y = MARGIN + (point[0] - self.left) * self.scale, MARGIN + (self.top - point[1]) * self.scale
        return max(-MAX_PIXEL, min(x, MAX_PIXEL)), max(-MAX_PIXEL, min(y, MAX_PIXEL))

    def svg(self, shift: int) -> list[str]:
        view = self.view
        objects = [thing for thing in view.things if not thing.zone]
        colors = {id(thing): place % len(TINTS) for place, thing in enumerate(objects)}
        opening = f'<g transform="translate({shift} 0)">' if shift else "<g>"
        out = self._table()
        for thing in view.things:
            if thing.zone:
                out += self._outline(thing, ZONE, ZONE_EDGE, 'stroke-dasharray="4 2"')
        for usual in view.usual:
            out += self._usual(usual)
        around = self.left, self.low, self.right, self.top
        if view.sights is not None:
            out += draw_below(view.sights, around, self.pixel)
        for thing in sorted(objects, key=lambda thing: -self._box(thing).area):  # objects on a tray stay visible
            edge = EDGES[colors[id(thing)]]
            out += self._outline(thing, thing.tint or TINTS[colors[id(thing)]], edge, "")
            for part in thing.inside:
                points = " ".join(f"{_n(x)},{_n(y)}" for x, y in map(self.pixel, outline(part, thing.pose)))
                out.append(f'<polygon points="{points}" fill="none" stroke="{edge}" stroke-width="0.6"/>')
            out += self._heading(thing, edge)
            self.labels.avoid(self._box(thing), 0.1)
        if view.sights is not None:
            out += draw_above(view.sights, around, self.pixel)
        for mark in view.marks:
            out += self._mark(mark)
        out = [opening, *self._clip(out, shift)]
        for mark in view.marks:
            out += self._measure(mark)
        for thing in (*objects, *(thing for thing in view.things if thing.zone)):
            out += self._name(thing)
        for place, line in enumerate(view.caption):
            last = place == len(view.caption) - 1
            out.append(self._caption(line, place, view.good if last else None))
        return [*out, "</g>"]

    def _clip(self, drawn: list[str], shift: int) -> list[str]:
        """The drawing, clipped at the frame if it extends over it: captions and other views are outside."""
        frame = self.labels.frame
        boxes = [self._box(thing) for thing in self.view.things]
        if self.view.sights is None and not any(frame.shared_area(box) < box.area * (1.0 - 1e-9) for box in boxes):
            return drawn
        size = f'width="{_n(frame.right - frame.left)}" height="{_n(frame.bottom - frame.top)}"'
        rect = f'<rect x="{_n(frame.left)}" y="{_n(frame.top)}" {size}/>'
        name = f"frame{shift // self.width + 1}"
        return [f'<clipPath id="{name}">{rect}</clipPath>', f'<g clip-path="url(#{name})">', *drawn, "</g>"]

    def _caption(self, line: str, place: int, good: bool | None) -> str:
        """A line below the picture, in a smaller font if it would not fit; coloured if it is good or bad."""
        style = f'fill="{INK}"' if good is None else f'fill="{GOOD if good else BAD}" font-weight="bold"'
        size = min(TYPE, TYPE * (self.width - 8) / text_width(line, TYPE)) if line else TYPE
        x, y = self.width / 2, self.floor + MARGIN + LINE * place + 8
        return (
            f'<text x="{_n(x)}" y="{_n(y)}" text-anchor="middle" font-size="{_n(size)}" {style}>{escape(line)}</text>'
        )

    def _table(self) -> list[str]:
        """The workspace with its grid."""
        (left, right), (bottom, top) = self.view.x, self.view.y
        step = 0.1
        while max(right - left, top - bottom) / step > MAX_GRID_LINES:
            step *= 10.0
        x, y = self.pixel((left, top))
        size = f'width="{_n((right - left) * self.scale)}" height="{_n((top - bottom) * self.scale)}"'
        path = []
        for number in range(math.floor(left / step) + 1, math.ceil(right / step - 1e-9)):
            path.append(f"M{_n(self.pixel((number * step, top))[0])} {_n(y)}V{_n(self.pixel((left, bottom))[1])}")
        for number in range(math.floor(bottom / step) + 1, math.ceil(top / step - 1e-9)):
            path.append(f"M{_n(x)} {_n(self.pixel((left, number * step))[1])}H{_n(self.pixel((right, bottom))[0])}")
        return [
            f'<path d="{"".join(path)}" stroke="{GRID}" fill="none"/>',
            f'<rect x="{_n(x)}" y="{_n(y)}" {size} fill="none" stroke="{FRAME}" stroke-width="1.5"/>',
        ]

    def _outline(self, thing: FigureObject, fill: str, edge: str, more: str) -> list[str]:
        style = f'fill="{fill}" stroke="{edge}"' + (f" {more}" if more else "")
        if not thing.zone:
            style += ' fill-opacity="0.75"'
        if isinstance(thing.footprint, Circle):
            x, y = self.pixel(thing.pose[:2])
            return [f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(thing.footprint.radius * self.scale)}" {style}/>']
        points = " ".join(f"{_n(x)},{_n(y)}" for x, y in map(self.pixel, outline(thing.footprint, thing.pose)))
        return [f'<polygon points="{points}" {style}/>']

    def _usual(self, place: UsualPlace) -> list[str]:
        """Where things usually are: circles, regions, dots, in the colour of the first of those that share it."""
        ink = EDGES[place.things[0] % len(EDGES)]
        parts = [(area.corners, area.share) for area in place.areas]
        for disc in place.discs:
            x, y = disc.middle
            for radius in (disc.outer, disc.inner):
                turns = (math.tau * step / CIRCLE_CORNERS for step in range(CIRCLE_CORNERS))
                circle = [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]
                parts.append((clip(circle, place.within), disc.share))
        out = []
        for corners, share in parts:
            points = " ".join(f"{_n(x)},{_n(y)}" for x, y in map(self.pixel, corners))
            style = (
                f'fill-opacity="{FAINT + DARKER * share:.3f}" stroke="{ink}" stroke-opacity="0.45" stroke-width="0.8"'
            )
            out.append(f'<polygon points="{points}" fill="{ink}" {style}/>')
        for x, y in map(self.pixel, place.dots):
            out.append(f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{DOT}" fill="{ink}" fill-opacity="0.5"/>')
        return out

    def _heading(self, thing: FigureObject, edge: str) -> list[str]:
        """A triangle at the front."""
        x, y = self.pixel(thing.pose[:2])
        front = _front(thing.footprint) * self.scale
        size = min(6.0, max(3.0, 0.35 * front))
        cos, sin = math.cos(thing.pose[2]), -math.sin(thing.pose[2])
        tip, back = front - 2.0, front - 2.0 - size
        corners = [(tip, 0.0), (back, size * 0.55), (back, -size * 0.55)]
        points = " ".join(f"{_n(x + cos * u - sin * v)},{_n(y + sin * u + cos * v)}" for u, v in corners)
        return [f'<polygon points="{points}" fill="{edge}"/>']

    def _box(self, thing: FigureObject) -> Rect:
        """Pixels that an object covers."""
        (left, right), (low, high) = _extent(thing, 0), _extent(thing, 1)
        return Rect(*self.pixel((left, high)), *self.pixel((right, low)))

    def _mark(self, mark: Mark) -> list[str]:
        """A mark without its text."""
        match mark:
            case Guide(start, end):
                (ax, ay), (bx, by) = self.pixel(start), self.pixel(end)
                self.labels.line((ax, ay), (bx, by), 0.5)
                line = f"M{_n(ax)} {_n(ay)}L{_n(bx)} {_n(by)}"
                return [f'<path d="{line}" stroke="{QUIET}" stroke-dasharray="3 3" fill="none"/>']
            case Dimension(start, end):
                a, b = self.pixel(start), self.pixel(end)
                self.labels.line(a, b)
                nx, ny = _normal(a, b)
                bars = "".join(
                    f"M{_n(x - 4 * nx)} {_n(y - 4 * ny)}L{_n(x + 4 * nx)} {_n(y + 4 * ny)}" for x, y in (a, b)
                )
                line = f"M{_n(a[0])} {_n(a[1])}L{_n(b[0])} {_n(b[1])}{bars}"
                return [f'<path d="{line}" stroke="{_color(mark)}" stroke-width="1.8" fill="none"/>']
            case Turn(center, start, stop):
                x, y = self.pixel(center)
                arm, arc = self._arms()
                rays = []
                for heading in (start, stop):
                    end = x + arm * math.cos(heading), y - arm * math.sin(heading)
                    self.labels.line((x, y), end)
                    rays.append(f"M{_n(x)} {_n(y)}L{_n(end[0])} {_n(end[1])}")
                ends = [(x + arc * math.cos(turn), y - arc * math.sin(turn)) for turn in (start, stop)]
                sweep = 0 if stop > start else 1  # SVG measures angles clockwise
                (ax, ay), (bx, by) = ends
                curve = f"M{_n(ax)} {_n(ay)}A{_n(arc)} {_n(arc)} 0 0 {sweep} {_n(bx)} {_n(by)}"
                return [
                    f'<path d="{rays[0]}" stroke="{QUIET}" stroke-dasharray="3 3" fill="none"/>',
                    f'<path d="{rays[1]}{curve}" stroke="{_color(mark)}" stroke-width="1.8" fill="none"/>',
                ]

    def _arms(self) -> tuple[float, float]:
        """Pixels: the length of the rays of an angle, and where its arc runs."""
        return 0.34 * self.width, 0.26 * self.width

    def _measure(self, mark: Mark) -> list[str]:
        """The text of a mark."""
        if isinstance(mark, Guide) or not mark.text:
            return []
        width = text_width(mark.text, SMALL)
        places = []
        if isinstance(mark, Dimension):
            a, b = self.pixel(mark.start), self.pixel(mark.end)
            nx, ny = _normal(a, b)
            away = 4.0 + abs(nx) * width / 2 + abs(ny) * SMALL / 2
            for share in (0.5, 0.3, 0.7, 0.1, 0.9):
                x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
                places += [(x + side * away * nx, y + side * away * ny) for side in (1.0, -1.0)]
            beyond = 6.0 + abs(ny) * width / 2 + abs(nx) * SMALL / 2
            places += [(b[0] - beyond * ny, b[1] + beyond * nx), (a[0] + beyond * ny, a[1] - beyond * nx)]
        else:
            x, y = self.pixel(mark.center)
            middle = (mark.start + mark.stop) / 2.0
            for heading in (middle, mark.start - 0.5 * (mark.stop - mark.start), 2 * mark.stop - middle):
                for far in (self._arms()[1] + 6.0, self._arms()[0] + 4.0):
                    away = far + abs(math.cos(heading)) * width / 2 + abs(math.sin(heading)) * SMALL / 2
                    places.append((x + away * math.cos(heading), y - away * math.sin(heading)))
        x, y = self.labels.place(places, width, SMALL)
        return [_text(mark.text, x, y, SMALL, _color(mark))]

    def _name(self, thing: FigureObject) -> list[str]:
        box, width = self._box(thing), text_width(thing.name, TYPE)
        x, y = self.pixel(thing.pose[:2])
        half = TYPE / 2 + 3
        around = [(x, box.bottom + half), (x, box.top - half)]
        around += [(box.right + width / 2 + 4, y), (box.left - width / 2 - 4, y)]
        if thing.zone:
            left, right = box.left + width / 2 + 4, box.right - width / 2 - 4
            within = [
                (left, box.top + half),
                (right, box.bottom - half),
                (right, box.top + half),
                (left, box.bottom - half),
            ]
        else:
            within = [(x, y), (x, y + 9), (x, y - 9)] if box.right - box.left > width else []
        x, y = self.labels.place([*within, *around], width, TYPE)
        return [_text(thing.name, x, y, TYPE, QUIET if thing.zone else INK)]


def _extent(thing: FigureObject, axis: int) -> tuple[float, float]:
    """The interval that an object covers along an axis, in metres."""
    if isinstance(thing.footprint, Circle):
        return thing.pose[axis] - thing.footprint.radius, thing.pose[axis] + thing.footprint.radius
    ends = [corner[axis] for corner in outline(thing.footprint, thing.pose)]
    return min(ends), max(ends)


def _drawn_interval(workspace: tuple[float, float], ends: Sequence[float]) -> tuple[float, float]:
    """The drawn interval along an axis: the workspace, and parts of objects that extend beyond the margin, up to a
    quarter of the workspace on either side."""
    low, high = workspace
    least, most = 0.04 * (high - low), 0.25 * (high - low)
    below, above = low - min([*ends, low]), max([*ends, high]) - high
    return low - (min(below, most) if below > least else 0.0), high + (min(above, most) if above > least else 0.0)


def _color(mark: Dimension | Turn) -> str:
    return GOOD if mark.good else BAD


def _front(footprint: Footprint) -> float:
    """How far a footprint reaches along its heading, in metres."""
    match footprint:
        case Circle(radius):
            return radius
        case Box(length, _):
            return length / 2.0
        case Polygon(vertices):
            return max(x for x, _ in vertices)


def _normal(a: Point, b: Point) -> Point:
    """The unit vector perpendicular to a line in pixels; upwards if it has no length."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = math.hypot(dx, dy)
    return (dy / length, -dx / length) if length > 0.05 else (0.0, -1.0)


def _text(text: str, x: float, y: float, size: int, color: str) -> str:
    """Centred on (x, y), with a halo that separates it from lines."""
    return (
        f'<text x="{_n(x)}" y="{_n(y + 0.36 * size)}" text-anchor="middle" font-size="{size}" fill="{color}" '
        f'stroke="{PAPER}" stroke-opacity="0.85" stroke-width="3" paint-order="stroke">{escape(text)}</text>'
    )
