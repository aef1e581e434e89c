"""A start on paper: the outlines of its objects on the grid of the mat, or a card that says where each stands."""

from __future__ import annotations

import math
from collections.abc import Iterator

from scenegen.geometry.footprint import measures
from scenegen.play.stage.mat import draw_grid
from scenegen.play.stage.pdf import PaperDrawing, Stroke, Words, fitting_scale
from scenegen.play.stage.stage import TableStage, outline_at
from scenegen.play.suites.suite import GradedStart

LETTER_HEIGHT = 0.0035  # metres on paper
ARROW_HEAD = 0.003  # metres on paper


def draw_start(stage: TableStage, start: GradedStart, paper: str) -> PaperDrawing:
    """A page: as large as the paper allows, 1:1 at best."""
    room = stage.margin + 0.01
    low, high = (stage.x[0] - room, stage.y[0] - room), (stage.x[1] + room, stage.y[1] + room)
    scale = fitting_scale(low, high, paper)
    parts = [*draw_grid(stage), *_outlines(stage, start, scale)]
    title = f"episode {start.number}: {start.task.name}, {start.band}, 1:{1.0 / scale:.2g}. {start.task.instruction}"
    return PaperDrawing(low, high, parts, paper, title, scale)


def _outlines(stage: TableStage, start: GradedStart, scale: float) -> Iterator[Stroke | Words]:
    spec, letter = start.task.spec.checked, LETTER_HEIGHT / scale
    for which, pose in enumerate(start.task.scenes.poses[start.row]):
        thing = stage.thing(spec, which)
        corners = [(float(x), float(y)) for x, y in outline_at(thing.shape, pose)]
        yield Stroke([*corners, corners[0]], 0.0004 / scale)
        x, y, theta = map(float, pose)
        if thing.is_round:
            yield Stroke([(x - letter / 2.0, y), (x + letter / 2.0, y)])
            yield Stroke([(x, y - letter / 2.0), (x, y + letter / 2.0)])
        else:
            yield _arrow(x, y, theta, measures(thing.shape.footprint).outer, ARROW_HEAD / scale)
        below = min(corner[1] for corner in corners) - letter
        yield Words(x, below, f"{spec.objects[which]}: {stage.name_place(x, y)}{_height(start, which)}", letter)


def _arrow(x: float, y: float, theta: float, length: float, head: float) -> Stroke:
    tip = x + length * math.cos(theta), y + length * math.sin(theta)
    sides = [(tip[0] - head * math.cos(theta + turn), tip[1] - head * math.sin(theta + turn)) for turn in (0.4, -0.4)]
    return Stroke([(x, y), tip, sides[0], tip, sides[1]], 0.2 * head)


def write_card(stage: TableStage, start: GradedStart) -> str:
    """A line for each object: its place on the grid, and its heading where it has one, counter-clockwise from the right
    hand side of the mat."""
    spec = start.task.spec.checked
    lines = [f"episode {start.number}: {start.task.name}, {start.band}. {start.task.instruction}"]
    for which, (x, y, theta) in enumerate(start.task.scenes.poses[start.row].tolist()):
        thing = stage.thing(spec, which)
        heading = "" if thing.is_round else f", heading {math.degrees(theta):.0f} deg"
        lines.append(f"  {spec.objects[which]}: {stage.name_place(x, y)}{_height(start, which)}{heading}")
    return "\n".join(lines) + "\n"


def _height(start: GradedStart, which: int) -> str:
    """How far above the mat an object stands on something."""
    base = 100.0 * float(start.poses[which, 2])
    return f", {base:.1f} cm above the mat" if base >= 0.05 else ""
