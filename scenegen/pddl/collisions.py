"""Which pairs of a spec's bodies could share space: only these need a requirement, and phi stays cheap."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

from scenegen.assets.surfaces import reach_of
from scenegen.pddl.setting import Setting, shape_from
from scenegen.pddl.things import Rectangle

_RECT = re.compile(r"rect\(([^,]+), ([^,]+), ([^,]+), ([^)]+)\)(?: at (.+) m)?$")


def collisions(setting: Setting, options: dict[str, list[str]]) -> list[str]:
    """`require` statements for all pairs of things, furniture and boards whose boxes, seen from above, can meet.

    `options` are the surfaces of each thing. What the one carries is not left out: it could be beside it.
    """
    boxes: dict[str, Rectangle] = {}
    fixed = set[str]()
    boards: dict[str, Rectangle] = {}
    for name, text in setting.used.items():
        found = _RECT.search(text)
        if " at " in text:
            fixed.add(name)
            boards[name] = _rectangle(found) if found else setting.space
    for name, made in setting.furniture.items():
        if made.body is not None:
            x, y, _ = setting.poses.get(name, (0.0, 0.0, 0.0))
            boxes[setting.ids[name]] = _grown((x, y, x, y), max(made.body[:2]) * 0.75)
            fixed.add(setting.ids[name])
    for name, shape in setting.shapes.items():
        reach = reach_of(shape_from(shape).footprint)
        places = [_box(setting, one, boxes) for one in options.get(name) or ["workspace"]]
        boxes[setting.ids[name]] = _grown(_around(places), reach)
    pairs = [
        (one, other)
        for (one, first), (other, second) in itertools.combinations({**boxes, **boards}.items(), 2)
        if not (one in fixed and other in fixed) and _meet(first, second)
    ]
    return _required(pairs)


def _required(pairs: Sequence[tuple[str, str]]) -> list[str]:
    return [f"require apart({one}, {other}) >= 0" for one, other in pairs]


def _box(
    setting: Setting,
    surface: str,
    boxes: dict[str, Rectangle],
) -> Rectangle:
    """Where the centre of what stands on a surface can be. What stands on things of which no box is known yet can be
    anywhere."""
    if surface in setting.used:
        found = _RECT.search(setting.used[surface])
        return _rectangle(found) if found else setting.space
    return boxes.get(surface, setting.space)


def _rectangle(found: re.Match[str]) -> Rectangle:
    left, bottom, right, top = (float(found[number]) for number in range(1, 5))
    return left, bottom, right, top


def _grown(box: Rectangle, by: float) -> Rectangle:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by


def _around(boxes: Sequence[Rectangle]) -> Rectangle:
    left, bottom, right, top = zip(*boxes, strict=True)
    return min(left), min(bottom), max(right), max(top)


def _meet(one: Rectangle, other: Rectangle) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
