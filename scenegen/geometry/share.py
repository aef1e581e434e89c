"""The share of a body's silhouette, seen by a camera, that no nearer body covers.

Bodies are upright prisms over footprints, or stacks of such. Lengths are added up along SIGHT_LINES lines from left to
right, at equal distances from the lowest to the highest point of the silhouette: on each, a body is one interval, and
what is seen of it is what the union of the others leaves. A body covers another one only where its shadow reaches that
(scenegen.geometry.shadow; of a stack, the shadow of the prism around it), so those whose clearance is not negative take
no part.

So that there is a slope everywhere, the share goes on: beyond 1 by the clearance to the nearest shadow, where nothing
is covered, and below 0, to -1 at most, by how far the silhouette is inside of a body that covers all of it. It is -1
where the eye is inside of a body.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from functools import reduce
from typing import Any

from scenegen.geometry.footprint import Box, Circle, Footprint, Polygon, Stack, corners
from scenegen.geometry.namespace import Namespace

SIGHT_LINES = 32  # of a picture, from left to right, on which a silhouette is measured
CLEARANCE_OF_ALL = 0.1  # metres of clearance that count as much as a whole silhouette
LEAST = 1e-9  # of what is divided by: lengths in metres, and of directions
LEAST_INSIDE = 1e-12  # square metres: a tiny bit, whatever the rounding
LEAST_DEPTH = 1e-3  # metres ahead of the eye: what is nearer is taken to be so far away

BODY, CAMERA, OTHER = 5, 7, 6
"""How many numbers: of the body x, y, heading, lowest and highest point; of the camera x, y, z, the level direction in
which it looks (x and y), sine and cosine of the angle by which it looks down; of each other body those of a body, and
the clearance to its shadow."""


def visible_share(ns: Namespace, *given: Any) -> Any:
    """Of footprints, the first of which is that of the body, and numbers as BODY, CAMERA and OTHER say."""
    shapes, numbers = parts_of(given)
    gaps = numbers[BODY + CAMERA + OTHER - 1 :: OTHER]
    for number, shape in enumerate(shapes):
        if isinstance(shape, Circle):  # whose heading may be that of other scenes
            numbers[2 + (BODY + CAMERA + (number - 1) * OTHER if number else 0)] = 0.0
    least = reduce(ns.minimum, gaps)
    clear = 1.0 + ns.maximum(least, 0.0 * least) / CLEARANCE_OF_ALL

    # Sizes may be numbers, too: of many bodies that are alike but for them (scenegen.learn.robustness.deciding).
    sizes = [size for shape in shapes for size in _sizes(shape)]

    def share_of_some(inner: Namespace, *some: Any) -> Any:
        left = iter(some[len(numbers) :])
        bodies = [_with_sizes(shape, left) for shape in shapes]
        return (_share(inner, bodies, some),)

    (share,) = ns.only(least < 0.0, share_of_some, (clear,), *numbers, *sizes)
    return share


def _sizes(shape: Footprint) -> tuple[Any, ...]:
    match shape:
        case Circle(radius):
            return (radius,)
        case Box(length, width):
            return length, width
        case _:
            return ()


def _with_sizes(shape: Footprint, sizes: Iterator[Any]) -> Footprint:
    match shape:
        case Circle():
            return Circle(next(sizes))
        case Box():
            return Box(next(sizes), next(sizes))
        case _:
            return shape


def parts_of(given: Sequence[Any]) -> tuple[list[Footprint], list[Any]]:
    count = (len(given) - BODY - CAMERA + OTHER) // (OTHER + 1)
    return list(given[:count]), list(given[count:])


class _View:
    """A camera as bodies are seen by it: x to the right and y ahead on the table, z up, from its eye."""

    def __init__(self, ns: Namespace, camera: Sequence[Any]) -> None:
        self.ns = ns
        self.eye, (self.ahead_x, self.ahead_y, self.sin, self.cos) = camera[:3], camera[3:]

    def body(self, shape: Footprint, numbers: Sequence[Any]) -> _Body | _Several:
        ns = self.ns
        x, y, theta, low, top = numbers
        if isinstance(shape, Stack):
            pieces = [self.body(one, (x, y, theta, low + start, low + stop)) for one, start, stop in shape.pieces]
            return _Several(ns, pieces)
        dx, dy = x - self.eye[0], y - self.eye[1]
        right, ahead = dx * self.ahead_y - dy * self.ahead_x, dx * self.ahead_x + dy * self.ahead_y
        points: list[tuple[Any, Any]] = []
        if isinstance(shape, Box | Polygon):
            cos, sin = ns.turn(theta)
            across, along = cos * self.ahead_y - sin * self.ahead_x, cos * self.ahead_x + sin * self.ahead_y
            points = [(right + (across * u - along * v), ahead + (along * u + across * v)) for u, v in corners(shape)]
        return _Body(self, shape, right, ahead, points, (low - self.eye[2], top - self.eye[2]))


class _Several:
    """A stack: on a line of sight, all from the first piece to the last."""

    def __init__(self, ns: Namespace, bodies: Sequence[Any]) -> None:
        self.ns, self.bodies = ns, bodies

    def extent(self) -> tuple[Any, Any]:
        return self._hull([one.extent() for one in self.bodies])

    def slices(self, rows: Any) -> tuple[Any, Any]:
        return self._hull([one.slices(rows) for one in self.bodies])

    def _hull(self, intervals: Sequence[tuple[Any, Any]]) -> tuple[Any, Any]:
        lows, highs = zip(*intervals, strict=True)
        return reduce(self.ns.minimum, lows), reduce(self.ns.maximum, highs)


class _Body:
    def __init__(
        self,
        view: _View,
        shape: Footprint,
        right: Any,
        ahead: Any,
        points: list[tuple[Any, Any]],
        levels: Sequence[Any],
    ) -> None:
        self.view, self.shape, self.right, self.ahead, self.points = view, shape, right, ahead, points
        self.levels = levels

    def extent(self) -> tuple[Any, Any]:
        """The lowest and the highest line of sight that meets it, as heights in a picture one metre ahead."""
        view, ns = self.view, self.view.ns
        ends = [y for _, y in self.points]
        if isinstance(self.shape, Circle):
            ends = [self.ahead - self.shape.radius, self.ahead + self.shape.radius]
        heights = [
            (view.sin * y + view.cos * z) / ns.maximum(view.cos * y - view.sin * z, 0.0 * y + LEAST_DEPTH)
            for y in ends
            for z in self.levels
        ]
        return reduce(ns.minimum, heights), reduce(ns.maximum, heights)

    def slices(self, rows: Any) -> tuple[Any, Any]:
        """Where each line of sight enters and leaves the body, to the right in a picture one metre ahead; where it
        misses it, the first is larger than the second."""
        view, ns = self.view, self.view.ns
        rise = _away_from_zero(ns, rows * view.cos - view.sin)  # of a ray, for each metre ahead in the picture
        level = _away_from_zero(ns, rows * view.sin + view.cos)
        ends: list[tuple[Any, Any, Any]] = []  # whether it is one, and the ends of a piece of the body on the line
        for z in self.levels:  # where the line crosses the bottom and the top
            way = z / rise
            y = level * way
            scale = ns.maximum(way, 0.0 * way + LEAST)
            ends += [(hit & (way > LEAST), left / scale, right / scale) for hit, left, right in self._chords(y)]
        for x, y, real in self._sides():  # and where upright edges, or those of the outline of a cylinder, cross it
            way = y / level
            z = way * rise
            scale = ns.maximum(way, 0.0 * way + LEAST)
            ends.append(((z >= self.levels[0]) & (z <= self.levels[1]) & (way > LEAST) & real, x / scale, x / scale))
        lows = [ns.where(hit, left, 0.0 * left + BESIDE_ALL) for hit, left, _ in ends]
        highs = [ns.where(hit, right, 0.0 * right - BESIDE_ALL) for hit, _, right in ends]
        low, high = reduce(ns.minimum, lows), reduce(ns.maximum, highs)
        around = (low == low) & self._has_eye()
        return ns.where(around, 0.0 * low - BESIDE_ALL, low), ns.where(around, 0.0 * high + BESIDE_ALL, high)

    def _has_eye(self) -> Any:
        """Whether the eye is inside of it."""
        (low, high), points = self.levels, self.points
        around = (low < 0.0) & (high > 0.0)
        if isinstance(self.shape, Circle):
            square = self.view.ahead_x**2 + self.view.ahead_y**2  # 1 but for rounding
            room = self.shape.radius**2 * square - self.right**2 - self.ahead**2
            return around & (room > LEAST_INSIDE)
        for (x, y), (u, v) in zip(points, [*points[1:], points[0]], strict=True):
            around = around & (x * v - y * u > LEAST_INSIDE)
        return around

    def _chords(self, y: Any) -> list[tuple[Any, Any, Any]]:
        """Where lines at y, from left to right, cross the footprint's edges: whether they do, and the ends."""
        ns = self.view.ns
        if isinstance(self.shape, Circle):
            off = y - self.ahead
            square = self.shape.radius * self.shape.radius - off * off
            half = ns.sqrt(ns.maximum(square, 0.0 * square))
            return [(square >= 0.0, self.right - half, self.right + half)]
        found = []
        for (x, here), (u, there) in zip(self.points, [*self.points[1:], self.points[0]], strict=True):
            share = (y - here) / _away_from_zero(ns, there - here)
            place = x + ns.clip(share, 0.0, 1.0) * (u - x)
            found.append(((share >= 0.0) & (share <= 1.0), place, place))
        return found

    def _sides(self) -> list[tuple[Any, Any, Any]]:
        ns = self.view.ns
        if not isinstance(self.shape, Circle):
            return [(x, y, y == y) for x, y in self.points]
        square, radius = self.right * self.right + self.ahead * self.ahead, self.shape.radius
        beyond = square - radius * radius
        safe = ns.maximum(square, 0.0 * square + LEAST)
        along, across = beyond / safe, radius * ns.sqrt(ns.maximum(beyond, 0.0 * beyond)) / safe
        outside = beyond > 0.0  # seen from right above, a cylinder has no sides
        return [
            (self.right * along - sign * self.ahead * across, self.ahead * along + sign * self.right * across, outside)
            for sign in (1.0, -1.0)
        ]


BESIDE_ALL = 1e6  # to the right in a picture: beyond everything


def _away_from_zero(ns: Namespace, a: Any) -> Any:
    return ns.where(ns.absolute(a) < LEAST, 0.0 * a + LEAST, a)


def _share(ns: Namespace, shapes: Sequence[Footprint], numbers: Sequence[Any]) -> Any:
    """The share where something may be covered, of arrays."""
    view = _View(ns, numbers[BODY : BODY + CAMERA])
    body = view.body(shapes[0], numbers[:BODY])
    low, high = body.extent()
    rows = ns.spread(low, high, SIGHT_LINES)
    left, right = body.slices(rows)
    width = ns.maximum(right - left, 0.0 * left)
    right = left + width
    total = _sum_lines(width)
    size = ns.maximum(total, 0.0 * total + LEAST)
    starts, ends, depth, around = [], [], 0.0 * total, total < 0.0
    for number, shape in enumerate(shapes[1:]):
        at = BODY + CAMERA + number * OTHER
        sizes = _sizes(shape)

        def slices(inner: Namespace, *some: Any, shape: Footprint = shape) -> Any:
            here, there = BODY, BODY + CAMERA
            other = _View(inner, some[here:there]).body(_with_sizes(shape, iter(some[there + 1 :])), some[:here])
            return other.slices(some[there])

        numbers_of = (*numbers[at : at + BODY], *numbers[BODY : BODY + CAMERA], rows, *sizes)
        begin, end = ns.only(numbers[at + BODY] < 0.0, slices, (BESIDE_ALL, -BESIDE_ALL), *numbers_of)
        around = around | ((begin[0] <= -BESIDE_ALL) & (end[0] >= BESIDE_ALL))
        slack = ns.minimum(left - begin, end - right)
        inside = reduce(ns.minimum, list(slack)) * (SIGHT_LINES / size)
        inside = ns.maximum(inside, 0.0 * inside)
        depth = ns.maximum(depth, inside / (1.0 + inside))
        begin, end = ns.minimum(ns.maximum(begin, left), right), ns.minimum(ns.maximum(end, left), right)
        starts.append(begin)
        ends.append(ns.maximum(end, begin))
    share = 1.0 - _sum_lines(_union(ns, starts, ends)) / size - depth
    return ns.where(around, 0.0 * share - 1.0, share)


def _sum_lines(lengths: Any) -> Any:
    """The sum over lines of sight, one after the other: `sum` has another order, and other bits, for a single scene."""
    return reduce(operator.add, list(lengths))


def _union(ns: Namespace, starts: list[Any], ends: list[Any]) -> Any:
    """The length of the union of intervals."""
    for last in range(len(starts) - 1, 0, -1):  # in the order of their starts
        for k in range(last):
            later = starts[k] > starts[k + 1]
            before, after = ns.minimum(starts[k], starts[k + 1]), ns.maximum(starts[k], starts[k + 1])
            ends[k], ends[k + 1] = ns.where(later, ends[k + 1], ends[k]), ns.where(later, ends[k], ends[k + 1])
            starts[k], starts[k + 1] = before, after
    reached, length = ends[0], ends[0] - starts[0]
    for start, end in zip(starts[1:], ends[1:], strict=True):
        more = end - ns.maximum(start, reached)
        length = length + ns.maximum(more, 0.0 * more)
        reached = ns.maximum(reached, end)
    return length
