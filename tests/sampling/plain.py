"""Truth by plain rejection, without scenegen: uniform numpy draws, phi and requirements by hand, keep what is in.

Each case is a spec, what is asked of it, the same phi in numpy (held against the scalar interpreter by a test), and,
where there is one, the analytic answer: numbers that are uniform on [0, 1] if scenes are right.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from scenegen.resources import shipped_specs

TURN = 2 * math.pi
CHUNK = 1 << 18

Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """`phi` maps rows (3N, B) to (L, B); `required` to (B,) booleans. `answers` gives name -> (B,) uniform numbers.

    `box` (3N rows of lowest, highest) holds all that is wanted where that is too rare for draws from the whole table.
    """

    text: str
    ranges: Mapping[str, tuple[float, float]]
    phi: Callable[[Array], Array]
    objects: int = 2
    size: tuple[float, float] = (1.0, 1.0)
    required: Callable[[Array], Array] | None = None
    answers: Callable[[Array], Mapping[str, Array]] | None = None
    box: tuple[tuple[float, float], ...] | None = None


def shipped(name):
    return shipped_specs()[name].read_text(encoding="utf-8")


def around(*values):
    """The paper's bands: 0.0125 on either side."""
    return [(value - 0.0125, value + 0.0125) for value in values]


def uniform(case, count, rng):
    """Scenes of the base draw, (3N, count), requirements not yet looked at."""
    rows = rng.random((3 * case.objects, count))
    rows[0::3] *= case.size[0]
    rows[1::3] *= case.size[1]
    rows[2::3] *= TURN
    return rows


def proposed(case, count, rng):
    """What plain rejection draws from: the base draw, or as much of it as lies in the case's box."""
    if case.box is None:
        return uniform(case, count, rng)
    low, high = np.array(case.box).T[:, :, None]
    return low + (high - low) * rng.random((len(case.box), count))


def fits(case, rows):
    """Whether scenes are in every range and meet what is required, (B,)."""
    good = np.ones(rows.shape[1], dtype=bool)
    for value, (low, high) in zip(case.phi(rows), case.ranges.values(), strict=True):
        good &= (value >= low) & (value <= high)
    return good if case.required is None else good & case.required(rows)


def truth(case, count, rng):
    """The first `count` scenes of plain rejection, (3N, count)."""
    kept, found = [], 0
    while found < count:
        rows = proposed(case, CHUNK, rng)
        kept.append(rows[:, fits(case, rows)])
        found += kept[-1].shape[1]
    return np.concatenate(kept, axis=1)[:, :count]


# ---- the paper's


def exp1(rows):
    mx, my, _, px, py, _ = rows
    return np.stack([np.minimum(px - mx, my - py), np.hypot(mx - px, my - py) - 0.25])


def sorting(rows):
    """(4, B): the margin of each direction, left to right, right to left, upwards, downwards."""
    dx, dy = np.diff(rows[0::3], axis=0), np.diff(rows[1::3], axis=0)
    return np.stack([dx.min(axis=0), (-dx).min(axis=0), dy.min(axis=0), (-dy).min(axis=0)])


def sort(rows):
    return sorting(rows).max(axis=0)[None]


def setting(rows, right=0.1, by=0):
    """Experiment 2. `right` is the y of the placemat's right point, `by` the object that the cracker box stands beside:
    the plate, or in the published code the mug. Right for phi > 0 alone, where the code's distance to the mat is a min.
    """
    (px, py, _), (mx, my, _), (kx, ky, kt), (cx, cy, _) = rows[0:3], rows[3:6], rows[6:9], rows[9:12]
    bx, by = rows[3 * by], rows[3 * by + 1]
    margins = (
        px - 0.3, 0.7 - px, py, 0.2 - py,
        0.25 - np.hypot(mx - 0.5, my - 0.2), mx - 0.3, 0.7 - mx, my - 0.2,
        0.25 - np.hypot(kx - 0.7, ky - right), kx - 0.7, ky, 0.2 - ky, 0.2 - np.abs(turned(kt - math.pi / 2)),
        cy - by, bx - cx,
    )  # fmt: skip
    return np.min(margins, axis=0)[None]


def published(rows):
    return setting(rows, right=0.15, by=1)


_FREE, _NORTH = (0.0, TURN), (math.pi / 2 - 0.2, math.pi / 2 + 0.2)
SETTING = (
    (0.3, 0.7), (0, 0.2), _FREE,
    (0.3, 0.7), (0.2, 0.45), _FREE,
    (0.7, 0.95), (0, 0.2), _NORTH,
    (0, 0.7), (0, 1), _FREE,
)  # fmt: skip


def setting_probability(low, high, published=False):
    """P(low <= phi <= high) of experiment 2 for 0 < low < high, to all digits.

    phi >= t holds object by object, but for the cracker box, whose share (1 - y - t)(x - t) depends on where the object
    stands that it is held against: areas, and integrals of that share, by Gauss and Legendre's rule.
    """
    return _setting_above(low, published) - _setting_above(high, published)


def _setting_above(t, published):
    radius, sides = 0.25 - t, (0.3 + t, 0.7 - t)

    def share(x, y):
        return (1 - y - t) * (x - t)

    def top(x):
        return 0.2 + np.sqrt(radius**2 - (x - 0.5) ** 2)

    def area(weight):
        """Of where the mug may be: above the mat, within a circle about the middle of its upper side."""
        return integral(lambda x: integral(lambda y: weight(x, y), 0.2 + t, top(x)), *sides)

    right = 0.15 if published else 0.1
    knife = integral(lambda y: np.sqrt(radius**2 - (y - right) ** 2) - t, t, 0.2 - t)
    mat = (0.4 - 2 * t) * (0.2 - 2 * t)
    beside = integral(lambda x: integral(lambda y: share(x, y), t + 0 * x, 0.2 - t + 0 * x), *sides)
    two = mat * area(share) if published else beside * area(lambda x, y: 1.0 + 0 * y)
    return two * knife * (0.4 - 2 * t) / TURN


def integral(f, a, b):
    """Of f over [a, b], where both are (K,) or numbers: f takes (60,) + (K,) points."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    shape = (-1,) + (1,) * np.ndim(b)
    nodes, weights = nodes.reshape(shape), weights.reshape(shape)
    return (b - a) / 2 * (weights * f((a + b) / 2 + (b - a) / 2 * nodes)).sum(axis=0)


# ---- known answers


def disc(rows):
    return 0.25 - np.hypot(rows[0] - 0.4, rows[1] - 0.55)[None]


def disc_answers(rows):
    dx, dy = rows[0] - 0.4, rows[1] - 0.55
    return {
        "area": (dx**2 + dy**2) / 0.25**2,
        "direction": np.arctan2(dy, dx) / TURN + 0.5,
        "heading": rows[2] / TURN,
    }


def left(rows):
    return (rows[3] - rows[0])[None]


def left_answers(rows):
    """The difference of two uniform places has density 1 - d; the left one is uniform in what d leaves."""
    apart = rows[3] - rows[0]
    return {
        "difference": (0.8**2 - (1 - apart) ** 2) / (0.8**2 - 0.5**2),
        "left one": rows[0] / (1 - apart),
        "y(1)": rows[1],
        "y(2)": rows[4],
        "heading": rows[5] / TURN,
    }


def circles(rows):
    return 0.5 - np.hypot(rows[0] - rows[3], rows[1] - rows[4])[None]


def circles_apart(rows):
    centres = rows[[0, 1, 3, 4]]
    inside = ((centres >= 0.1) & (centres <= 0.9)).all(axis=0)
    return inside & (np.hypot(rows[0] - rows[3], rows[1] - rows[4]) >= 0.2)


def square_line(s):
    """P(two uniform points of the unit square are at most s <= 1 apart)."""
    return math.pi * s**2 - 8 / 3 * s**3 + s**4 / 2


def circles_answers(rows):
    """Centres are uniform in a square of 0.8, given a distance from 0.2 to 0.4."""
    distance = np.hypot(rows[0] - rows[3], rows[1] - rows[4])
    least, most = square_line(0.2 / 0.8), square_line(0.4 / 0.8)
    return {
        "distance": (square_line(distance / 0.8) - least) / (most - least),
        "heading(1)": rows[2] / TURN,
        "heading(2)": rows[5] / TURN,
    }


def turned(theta):
    """Into (-pi, pi]."""
    return np.pi - np.mod(np.pi - theta, TURN)


def heading(rows):
    return 0.4 - np.abs(turned(rows[2]))[None]


def heading_answers(rows):
    """Two arcs, 0.25 to 0.3 rad on either side of east, laid end to end."""
    off = turned(rows[2])
    return {"heading": np.where(off > 0, off - 0.2, off + 0.3) / 0.1, "x": rows[0], "y": rows[1]}


# ---- oriented boxes: by the separating axes of two rectangles, and the nearest point of a rectangle to a disc

BOXES = """\
workspace [0, 0.6] x [0, 0.5]
object tray = box(0.24, 0.12, 0.02), book = box(0.2, 0.14, 0.03), mug = cylinder(0.05, 0.1)
require noOverlap()
require insideWorkspace()
task: leftOf(tray, book) & farFrom(mug, tray, 0.15)
"""
TRAY, BOOK, MUG = (0.12, 0.06), (0.1, 0.07), 0.05


def boxes(rows):
    return np.minimum(rows[3] - rows[0], np.hypot(rows[6] - rows[0], rows[7] - rows[1]) - 0.15)[None]


def _apart(place, half, other, other_half):
    """Whether an axis of the first rectangle separates the second from it."""
    dx, dy = other[0] - place[0], other[1] - place[1]
    cos, sin = np.cos(place[2]), np.sin(place[2])
    c, s = np.abs(np.cos(other[2] - place[2])), np.abs(np.sin(other[2] - place[2]))
    along = np.abs(cos * dx + sin * dy) >= half[0] + other_half[0] * c + other_half[1] * s
    return along | (np.abs(cos * dy - sin * dx) >= half[1] + other_half[0] * s + other_half[1] * c)


def _off(place, half, disc, radius):
    dx, dy = disc[0] - place[0], disc[1] - place[1]
    cos, sin = np.cos(place[2]), np.sin(place[2])
    beyond = np.maximum(np.abs(cos * dx + sin * dy) - half[0], 0), np.maximum(np.abs(cos * dy - sin * dx) - half[1], 0)
    return np.hypot(*beyond) >= radius


def boxes_apart(rows):
    tray, book, mug = rows[0:3], rows[3:6], rows[6:9]
    good = _apart(tray, TRAY, book, BOOK) | _apart(book, BOOK, tray, TRAY)
    good &= _off(tray, TRAY, mug, MUG) & _off(book, BOOK, mug, MUG)
    for place, half in ((tray, TRAY), (book, BOOK), (mug, (MUG, MUG))):
        cos, sin = (np.abs(np.cos(place[2])), np.abs(np.sin(place[2]))) if place is not mug else (1.0, 0.0)
        for middle, reach, size in (
            (place[0], cos * half[0] + sin * half[1], 0.6),
            (place[1], sin * half[0] + cos * half[1], 0.5),
        ):
            good &= (middle >= reach) & (middle <= size - reach)
    return good


CASES = {
    "exp1": Case(shipped("mug_left_of_plate"), dict(zip(("task", "safe"), around(0.19, 0.08), strict=True)), exp1),
    "sort_3": Case(shipped("sort_3"), {"sorted": around(0.05)[0]}, sort, objects=3),
    "setting": Case(shipped("table_setting"), {"task": around(0.03)[0]}, setting, objects=4, box=SETTING),
    "setting, published": Case(
        shipped("table_setting_published"), {"task": around(0.03)[0]}, published, objects=4, box=SETTING
    ),
    "disc": Case("closeTo(mug, (0.4, 0.55), 0.25)", {"task": (0.0, 0.25)}, disc, objects=1, answers=disc_answers),
    "left": Case("leftOf(mug, plate)", {"task": (0.2, 0.5)}, left, answers=left_answers),
    "circles": Case(
        "object mug = cylinder(0.1, 0.1), bowl = cylinder(0.1, 0.1)\n"
        "require noOverlap()\nrequire insideWorkspace()\ntask: closeTo(mug, bowl, 0.5)",
        {"task": (0.1, 0.4)},
        circles,
        required=circles_apart,
        answers=circles_answers,
    ),
    "heading": Case("angle(knife, EAST, 0.4)", {"task": (0.1, 0.15)}, heading, objects=1, answers=heading_answers),
    "boxes": Case(BOXES, {"task": (0.03, 0.055)}, boxes, objects=3, size=(0.6, 0.5), required=boxes_apart),
}
