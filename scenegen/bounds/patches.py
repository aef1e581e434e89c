"""Patches of surfaces, each in the frame of what carries it: where the centre of an object can be on them, for each
slice of its headings, and drawing a place on one of many."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from scenegen.lang.spec import Support
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI, X, Y, row_of
from scenegen.primitives.footprint import Circle, Footprint, Polygon
from scenegen.primitives.outline import corners, measures

Array = npt.NDArray[np.float64]

SLICES = 128  # of the circle of headings


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """How one object is drawn: from K patches, the k-th with the probability `odds[k] - odds[k - 1]`. (K,) each: the
    middle and half the size of a patch in the frame of what carries it (a `radius` above 0: a disc), the interval of
    the switch and that of the heading against the carrier's; `number` says which of `frames` carries the patch: the row
    of its x, or the pose of a region. `turned`: the heading is drawn, too."""

    thing: int
    switch: int | None
    turned: bool
    odds: Array
    middle: Array  # (2, K)
    half: Array  # (2, K)
    radius: Array
    begin: Array
    width: Array
    heading: Array
    slice: float
    number: npt.NDArray[np.intp]
    frames: tuple[int | tuple[float, float, float], ...]
    log_volume: float

    @property
    def rows(self) -> tuple[int, ...]:
        place = tuple(row_of(self.thing, axis) for axis in (FLAT if self.turned else PLACE))
        return place if self.switch is None else (*place, self.switch)

    def draw(self, out: Array, rng: np.random.Generator) -> None:
        """Fill the object's rows of `out` (3N, m), in which what carries it is drawn."""
        for row, value in self.poses(out, (out.shape[1],), rng).items():
            out[row] = value

    def poses(self, scenes: Array, shape: tuple[int, ...], rng: np.random.Generator) -> dict[int, Array]:
        """Values of the object's rows, of a shape (..., P), where what carries it stands as in `scenes` (3N, P)."""
        patch = np.minimum(np.searchsorted(self.odds, rng.random(shape), side="right"), len(self.odds) - 1)
        one, other = rng.random((2, *shape))
        u = self.middle[0].take(patch) + (2.0 * one - 1.0) * self.half[0].take(patch)
        v = self.middle[1].take(patch) + (2.0 * other - 1.0) * self.half[1].take(patch)
        if self.radius.any():
            radius = self.radius.take(patch)
            far, round_ = radius * np.sqrt(one), TWO_PI * other
            u, v = np.where(radius > 0.0, far * np.cos(round_), u), np.where(radius > 0.0, far * np.sin(round_), v)
        x, y, theta = self._frame(scenes, self.number.take(patch))
        cos, sin = np.cos(theta), np.sin(theta)
        found = {row_of(self.thing, X): x + (cos * u - sin * v), row_of(self.thing, Y): y + (sin * u + cos * v)}
        if self.turned:
            turn = theta + self.heading.take(patch) + self.slice * rng.random(shape)
            found[row_of(self.thing, THETA)] = np.mod(turn, TWO_PI)
        if self.switch is not None:
            found[self.switch] = self.begin.take(patch) + self.width.take(patch) * rng.random(shape)
        return found

    def _frame(self, scenes: Array, number: npt.NDArray[np.intp]) -> list[Array]:
        poses = [
            [np.float64(value) for value in frame]
            if isinstance(frame, tuple)
            else [scenes[frame + axis] for axis in FLAT]
            for frame in self.frames
        ]
        found = [np.asarray(value) for value in poses[-1]]
        for which in range(len(poses) - 1):
            here = number == which
            found = [np.where(here, value, rest) for value, rest in zip(poses[which], found, strict=True)]
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """The patches of one surface, (K,) or (2, K) each as in `Step`: what carries it, the interval of the switch, and
    the headings at which slices begin. With a `radius` above 0 the one patch is a disc."""

    frame: int | tuple[float, float, float]
    begin: float
    width: float
    middle: Array  # (2, K)
    half: Array
    radius: float
    heading: Array  # (K,)

    @property
    def areas(self) -> Array:
        """Of its patches, square metres: (K,)."""
        if self.radius > 0.0:
            return np.full(len(self.heading), math.pi * self.radius**2)
        out: Array = 4.0 * self.half[0] * self.half[1]
        return out


def disc(upper: Footprint, under: Support) -> float:
    """The radius of the disc of centres on a round surface, 0 where it is no disc."""
    if not isinstance(under.outline, Circle):
        return 0.0
    if not under.walled:
        return under.outline.radius
    return max(0.0, under.outline.radius - upper.radius) if isinstance(upper, Circle) else 0.0


@cache
def patches(upper: Footprint | None, outline: Footprint, turned: bool) -> tuple[Array, Array]:
    """The boxes of centres on a surface, for each slice of headings where they are `turned`: middle and half the size,
    (2, K) each. `upper` is what must lie inside, None where only the centre must."""
    points = np.array(_corners(outline))
    low, high = points.min(axis=0)[:, None], points.max(axis=0)[:, None]
    count = SLICES if turned else 1
    if upper is None:
        low, high = np.repeat(low, count, axis=1), np.repeat(high, count, axis=1)
    elif isinstance(upper, Circle) or not turned:
        inner = max(0.0, measures(upper).inner)
        low, high = np.repeat(low + inner, count, axis=1), np.repeat(high - inner, count, axis=1)
    else:
        angle = (np.arange(SLICES) + 0.5) * (TWO_PI / SLICES)
        slack = measures(upper).turn * (TWO_PI / SLICES / 2.0)
        x, y = np.array(corners(upper)).T[:, :, None]
        turned_points = np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])
        low = low + np.maximum(-turned_points.min(axis=1) - slack, 0.0)
        high = high - np.maximum(turned_points.max(axis=1) - slack, 0.0)
    return (low + high) / 2.0, (high - low) / 2.0


def _corners(outline: Footprint) -> tuple[tuple[float, float], ...]:
    if isinstance(outline, Circle):
        return ((-outline.radius, -outline.radius), (outline.radius, outline.radius))
    return outline.vertices if isinstance(outline, Polygon) else corners(outline)


def facing(begin: Array, ends: tuple[float, float]) -> npt.NDArray[np.bool_]:
    """Which slices of headings, (K,) begins, meet an interval of headings."""
    low, high = ends
    if high - low >= TWO_PI - 1e-6:
        return np.ones(len(begin), dtype=bool)
    out: npt.NDArray[np.bool_] = np.mod(begin - low, TWO_PI) <= high - low
    out |= np.mod(begin + TWO_PI / SLICES - low, TWO_PI) <= high - low
    out |= np.mod(low - begin, TWO_PI) <= TWO_PI / SLICES
    return out


def cut(
    middle: Array, half: Array, frame: tuple[float, float, float], ends: list[tuple[float, float]]
) -> tuple[Array, Array]:
    """Patches in a frame that stays where it is, as far as they lie in a box of the table."""
    x, y, theta = frame
    cos, sin = math.cos(theta), math.sin(theta)
    centre = [(low + high) / 2.0 for low, high in ends]
    size = [(high - low) / 2.0 for low, high in ends]
    dx, dy = centre[0] - x, centre[1] - y
    about = np.array([cos * dx + sin * dy, cos * dy - sin * dx])[:, None]
    reach = np.array([abs(cos) * size[0] + abs(sin) * size[1], abs(sin) * size[0] + abs(cos) * size[1]])[:, None]
    low, high = np.maximum(middle - half, about - reach), np.minimum(middle + half, about + reach)
    return (low + high) / 2.0, (high - low) / 2.0


def step_of(thing: int, switch: int | None, pieces: list[Piece], turned: bool) -> Step:
    """How an object is drawn on pieces with some area together; `turned` as in `Step`."""
    frames = tuple(dict.fromkeys(one.frame for one in pieces))
    size = [len(one.heading) for one in pieces]
    weights = np.concatenate([one.width * one.areas for one in pieces])
    slice_ = TWO_PI / SLICES
    total = float(weights.sum()) * (slice_ if turned else 1.0)
    odds = np.cumsum(weights)
    return Step(
        thing,
        switch,
        turned,
        odds / odds[-1],
        np.concatenate([one.middle for one in pieces], axis=1),
        np.concatenate([one.half for one in pieces], axis=1),
        np.repeat([one.radius for one in pieces], size),
        np.repeat([one.begin for one in pieces], size),
        np.repeat([one.width for one in pieces], size),
        np.concatenate([one.heading for one in pieces]),
        slice_,
        np.repeat(np.array([frames.index(one.frame) for one in pieces], dtype=np.intp), size),
        frames,
        math.log(total),
    )
