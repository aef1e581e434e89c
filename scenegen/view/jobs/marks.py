"""What decides phi, as lines that the page draws into a scene."""

from __future__ import annotations

from typing import Any

from scenegen.figures.drawing import Dimension, Guide, Mark, Turn


def mark_data(mark: Mark) -> dict[str, Any]:
    """A dimension line, an angle or a guide, as plain data."""
    match mark:
        case Dimension(start, end, text, good):
            return {"kind": "line", "start": start, "end": end, "text": text, "good": good}
        case Turn(center, start_angle, stop_angle, text, good):
            return {
                "kind": "turn", "center": center, "from": start_angle, "to": stop_angle, "text": text, "good": good,
            }  # fmt: skip
        case Guide(start, end):
            return {"kind": "guide", "start": start, "end": end}
