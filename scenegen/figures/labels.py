"""Placement of text in a drawing: each label takes the candidate that covers least of the existing drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

EM = 0.62  # width of a character in a sans-serif font such as DejaVu Sans, relative to the font size
STEP = 3.0  # pixels between the points that represent a line


@dataclass(frozen=True, slots=True)
class Rect:
    """Pixels; y runs downwards."""

    left: float
    top: float
    right: float
    bottom: float

    def shared(self, other: Rect) -> float:
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
        steps = max(1, round(max(abs(b[0] - a[0]), abs(b[1] - a[1])) / STEP))
        for step in range(steps + 1):
            x, y = a[0] + step / steps * (b[0] - a[0]), a[1] + step / steps * (b[1] - a[1])
            point = Rect(x - 1.5, y - 1.5, x + 1.5, y + 1.5)
            if point.shared(self.frame):
                self.avoid(point, cost)

    def place(self, candidates: Sequence[tuple[float, float]], width: float, size: float) -> tuple[float, float]:
        """The best centre for a text of that width and size, moved into the frame; its place is then taken."""
        best, least = (0.0, 0.0), float("inf")
        for order, (x, y) in enumerate(candidates):
            x = max(self.frame.left + width / 2, min(x, self.frame.right - width / 2))
            y = max(self.frame.top + size / 2, min(y, self.frame.bottom - size / 2))
            box = _box(x, y, width, size)
            cost = 1.5 * order + sum(weight * box.shared(rect) for rect, weight in self.taken)
            if cost < least:
                best, least = (x, y), cost
        self.avoid(_box(*best, width, size), 10.0)
        return best


def _box(x: float, y: float, width: float, size: float) -> Rect:
    return Rect(x - width / 2, y - size / 2, x + width / 2, y + size / 2)
